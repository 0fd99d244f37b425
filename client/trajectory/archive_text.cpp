#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <array>
#include <cmath>
#include <limits>

#include "readers.hpp"
#include "sorted_reader.hpp"
#include "text_source.hpp"

/// Text with one agent of one frame in each line: archive and PeTrack ("id frame x y z"), jpscore
/// ("ID FR X Y Z A B ANGLE COLOR") and the obsmat of ETH and UCY ("frame id x z y vx vz vy").
namespace throng::trajectory::detail {
namespace {

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

/// Which column holds what.
struct Roles {
  std::size_t id = 0, frame = 1, x = 2, y = 3, z = kNone;
  std::size_t direction_x = kNone, direction_y = kNone;  // heading as a vector
  std::size_t angle_deg = kNone;                         // heading in degrees
  std::vector<std::size_t> channels;
  std::vector<std::string> channel_names;
  std::size_t needed = 4;  // columns that a row must have
};

/// What the comment lines say.
struct Header {
  std::optional<double> fps;
  std::uint64_t fps_line = 0;
  std::optional<double> unit_m;
  std::uint64_t unit_line = 0;
  std::optional<Roles> roles;
  bool jpscore = false;
  double part = 1.0;
};

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

/// The unit after a word "in", as of "coordinates (in metres)".
std::optional<double> unit_after_in(const std::string& line) {
  for (std::size_t at = line.find("in "); at != std::string::npos; at = line.find("in ", at + 1)) {
    if (at > 0 && is_letter(line[at - 1])) continue;
    std::size_t begin = at + 3;
    while (begin < line.size() && is_blank(line[begin])) ++begin;
    std::size_t end = begin;
    while (end < line.size() && is_letter(line[end])) ++end;
    if (const auto unit = unit_metres(line.substr(begin, end - begin))) return unit;
  }
  return std::nullopt;
}

/// Reads "id frame x/m y/m z/m viewDirX viewDirY" or "ID FR X Y Z A B ANGLE COLOR".
std::optional<Roles> roles_of(const std::vector<std::string_view>& words, bool& jpscore,
                              std::array<std::optional<double>, 2>& units) {
  Roles roles;
  roles.id = roles.frame = roles.x = roles.y = kNone;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string word = lower(words[i]);
    const std::size_t slash = word.find('/');
    const std::string name = word.substr(0, slash);
    const std::string unit = slash == std::string::npos ? "" : word.substr(slash + 1);
    if (name == "id" && roles.id == kNone) {
      roles.id = i;
    } else if ((name == "frame" || name == "fr") && roles.frame == kNone) {
      roles.frame = i;
      if (name == "fr") jpscore = true;
    } else if (name == "x" && roles.x == kNone) {
      roles.x = i;
      units[0] = unit_metres(unit);
    } else if (name == "y" && roles.y == kNone) {
      roles.y = i;
      units[1] = unit_metres(unit);
    } else if (name == "z" && roles.z == kNone) {
      roles.z = i;
    } else if (name == "viewdirx") {
      roles.direction_x = i;
    } else if (name == "viewdiry") {
      roles.direction_y = i;
    } else if (name == "angle") {
      roles.angle_deg = i;
    } else if (name != "viewdirz" && name != "markerid" && name != "router" && name != "spot") {
      roles.channels.push_back(i);
      roles.channel_names.push_back(name);
    }
  }
  if (roles.id == kNone || roles.frame == kNone || roles.x == kNone || roles.y == kNone) {
    return std::nullopt;
  }
  if (roles.direction_x == kNone || roles.direction_y == kNone) {
    roles.direction_x = roles.direction_y = kNone;
  }
  // The first row tells whether the columns after these are there and are numbers.
  roles.needed = std::max({roles.id, roles.frame, roles.x, roles.y}) + 1;
  return roles;
}

absl::Status note_unit(const std::string& path, std::uint64_t line, double unit_m, Header& header) {
  if (header.unit_m && *header.unit_m != unit_m) {
    return fault(path, line,
                 absl::StrCat("the unit is ", number_text(unit_m), " m here and ",
                              number_text(*header.unit_m), " m in line ", header.unit_line,
                              "; correct the header"));
  }
  header.unit_m = unit_m;
  header.unit_line = line;
  return absl::OkStatus();
}

absl::Status read_comment(const std::string& path, std::uint64_t number, std::string_view text,
                          Header& header) {
  const std::string line = lower(text);
  // "framerate: 25 fps", "frame rate = 25", "fps: 25"
  const bool rate = absl::StrContains(line, "framerate") || absl::StrContains(line, "frame rate") ||
                    absl::StartsWith(line, "fps");
  if (rate) {
    const std::size_t colon = line.find_first_of(":=");
    const std::optional<double> fps =
        first_number(colon == std::string::npos ? std::string_view(line)
                                                : std::string_view(line).substr(colon + 1));
    if (!fps) {
      return fault(path, number,
                   absl::StrCat("the frame rate ", quoted(text),
                                " has no number; write e.g. '# framerate: 25 fps'"));
    }
    if (!valid_fps(*fps)) {
      return fault(path, number,
                   absl::StrCat("the frame rate is ", number_text(*fps),
                                ", must be between 0.0001 and 100000; correct the header"));
    }
    if (header.fps && !same_rate(*header.fps, *fps)) {
      return fault(path, number,
                   absl::StrCat("the frame rate is ", number_text(*fps), " here and ",
                                number_text(*header.fps), " in line ", header.fps_line,
                                "; correct the header"));
    }
    header.fps = fps;
    header.fps_line = number;
    return absl::OkStatus();
  }
  if (absl::StartsWith(line, "count:")) header.part = first_number(line).value_or(1.0);

  std::vector<std::string_view> words;
  split_blanks(text, words);
  if (words.size() > kMaxColumns) {
    return fault(path, number, absl::StrCat("more than ", kMaxColumns, " columns"));
  }
  std::array<std::optional<double>, 2> units;
  bool jpscore = false;
  if (std::optional<Roles> roles = roles_of(words, jpscore, units)) {
    header.roles = std::move(roles);
    header.jpscore = header.jpscore || jpscore;
    for (const std::optional<double>& unit : units) {
      if (!unit) continue;
      if (absl::Status status = note_unit(path, number, *unit, header); !status.ok()) return status;
    }
    return absl::OkStatus();
  }
  // The height's line ("z: can be 3d position or height") says nothing about x and y.
  if (absl::StartsWith(line, "z:")) return absl::OkStatus();
  if (const auto unit = unit_after_in(line)) return note_unit(path, number, *unit, header);
  return absl::OkStatus();
}

class Ingest {
 public:
  Ingest(const std::string& path, const ReadOptions& options, const std::string& format)
      : path_(path), options_(options), obsmat_(format == "obsmat") {
    info_.format = format;
  }

  ReaderOr run() {
    absl::StatusOr<std::unique_ptr<LineSource>> lines = LineSource::open(path_);
    if (!lines.ok()) return lines.status();
    std::string_view line;
    std::vector<std::string_view> fields;
    while (true) {
      absl::StatusOr<bool> more = (*lines)->next(line);
      if (!more.ok()) return more.status();
      if (!*more) break;
      if (absl::Status s = (*lines)->tell(options_); !s.ok()) return s;
      const std::uint64_t number = (*lines)->number();
      line = trimmed(line);
      if (line.empty()) continue;
      if (line.front() == '#') {
        line = trimmed(line.substr(1));
        // Header lines after the first row would change the meaning of rows already read.
        if (rows_ == nullptr) {
          if (absl::Status s = read_comment(path_, number, line, header_); !s.ok()) return s;
        }
        continue;
      }
      split_blanks(line, fields);
      if (rows_ == nullptr) {
        if (absl::Status s = begin(number, fields); !s.ok()) return s;
      }
      if (absl::Status s = add(number, fields, (*lines)->unterminated()); !s.ok()) return s;
    }
    if (rows_ == nullptr) {
      return fault(path_, "there are no rows of agents in the file; it may have been cut short");
    }
    if (z_seen_ && !options_.ground_z && roles_.z != kNone) {
      info_.notes.push_back(
          "z is taken as the height of heads and ignored; use --z ground if it "
          "is the ground");
    }
    if (unknown_headings_ > 0) {
      info_.notes.push_back(
          absl::StrCat(counted(unknown_headings_, "row", "rows"), " without a direction"));
    }
    return make_sorted_reader(path_, std::move(info_), columns_, base_, options_, std::move(rows_),
                              IdTable(false));
  }

 private:
  /// At the first row the header is complete.
  absl::Status begin(std::uint64_t number, const std::vector<std::string_view>& fields) {
    if (obsmat_) {
      roles_.frame = 0;
      roles_.id = 1;
      roles_.x = 2;
      roles_.z = 3;
      roles_.y = 4;
      roles_.needed = 8;
      // Metres by definition; numbers follow the video, rows come 2.5 times a second.
      if (absl::Status s = require_metres(path_, options_, "obsmat"); !s.ok()) return s;
      unit_m_ = 1.0;
      base_ = {TimeBase::Kind::kSamples, 2.5};
      if (options_.source_fps) {
        absl::StatusOr<double> fps = resolve_fps(path_, std::nullopt, options_, "");
        if (!fps.ok()) return fps.status();
        base_ = {TimeBase::Kind::kFrames, *fps};
      } else {
        info_.notes.push_back(
            "2.5 samples a second, as all files of this kind; --source-fps "
            "gives another rate of the frame numbers");
      }
    } else {
      if (header_.roles) roles_ = *header_.roles;
      if (header_.jpscore) {
        info_.format = "jpscore-text";
        if (!header_.unit_m) header_.unit_m = 1.0;  // its manual knows no other
        if (header_.part > 1.0) {
          info_.notes.push_back(
              absl::StrCat("this is part ", number_text(header_.part),
                           " of an output in several files; join them to see all"));
        }
      }
      absl::StatusOr<double> fps =
          resolve_fps(path_, header_.fps, options_, "the file does not say its frame rate");
      if (!fps.ok()) return fps.status();
      base_ = {TimeBase::Kind::kFrames, *fps};
      absl::StatusOr<double> unit = resolve_unit(path_, header_.unit_m, options_);
      if (!unit.ok()) return unit.status();
      unit_m_ = *unit;
      if (!header_.roles && fields.size() > 4) roles_.z = 4;
    }

    // Of the columns beyond the needed ones those are used that the first row has as numbers.
    const auto usable = [&](std::size_t column) {
      double value = 0.0;
      return column < fields.size() && parse_number(fields[column], value);
    };
    if (!usable(roles_.z)) roles_.z = kNone;
    if (!usable(roles_.direction_x) || !usable(roles_.direction_y)) {
      roles_.direction_x = roles_.direction_y = kNone;
    }
    if (!usable(roles_.angle_deg)) roles_.angle_deg = kNone;
    std::vector<std::size_t> channels;
    for (std::size_t i = 0; i < roles_.channels.size(); ++i) {
      if (!usable(roles_.channels[i])) {
        info_.notes.push_back(absl::StrCat("column ", quoted(roles_.channel_names[i]),
                                           " is not a number and is ignored"));
        continue;
      }
      channels.push_back(roles_.channels[i]);
      info_.channel_names.push_back(roles_.channel_names[i]);
    }
    roles_.channels = std::move(channels);
    columns_.z = options_.ground_z && roles_.z != kNone;
    columns_.heading = roles_.direction_x != kNone || roles_.angle_deg != kNone;
    columns_.channels = roles_.channels.size();
    for (const std::size_t column :
         {roles_.z, roles_.direction_x, roles_.direction_y, roles_.angle_deg}) {
      if (column != kNone) roles_.needed = std::max(roles_.needed, column + 1);
    }
    for (const std::size_t column : roles_.channels) {
      roles_.needed = std::max(roles_.needed, column + 1);
    }
    rows_ = std::make_unique<RowSorter>(columns_.count(), options_.memory_bytes);
    return absl::OkStatus();
  }

  absl::Status number_at(std::uint64_t line, const std::vector<std::string_view>& fields,
                         std::size_t column, std::string_view name, double& value) const {
    if (parse_number(fields[column], value)) return absl::OkStatus();
    const bool comma = fields[column].find(',') != std::string_view::npos;
    return fault(
        path_, line,
        absl::StrCat(std::string(name), " is ", quoted(fields[column]), ", must be a number",
                     comma ? "; write a point, not a comma" : "; correct or remove the row"));
  }

  absl::Status add(std::uint64_t line, const std::vector<std::string_view>& fields,
                   bool unterminated) {
    if (fields.size() < roles_.needed) {
      return fault(
          path_, line,
          absl::StrCat("the row has ", fields.size(), " columns, must have ", roles_.needed,
                       unterminated ? "; the file is cut short: remove its last line"
                                    : "; correct or remove the row"));
    }
    if (fields.size() > kMaxColumns) {
      return fault(path_, line, absl::StrCat("the row has more than ", kMaxColumns, " columns"));
    }
    std::int64_t id = 0, frame = 0;
    if (!parse_integer(fields[roles_.id], id) || id < 0) {
      return fault(path_, line,
                   absl::StrCat("id is ", quoted(fields[roles_.id]),
                                ", must be an integer from 0; correct or remove the row"));
    }
    if (!parse_integer(fields[roles_.frame], frame) ||
        std::abs(static_cast<double>(frame)) > kMaxInteger) {
      return fault(path_, line,
                   absl::StrCat("frame is ", quoted(fields[roles_.frame]),
                                ", must be an integer of at most 2^53; correct or remove the row"));
    }
    values_.clear();
    double value = 0.0;
    for (const auto& [column, axis] :
         {std::pair(roles_.x, 'x'), std::pair(roles_.y, 'y'), std::pair(roles_.z, 'z')}) {
      if (column == kNone) continue;
      const std::string_view name(&axis, 1);
      if (absl::Status s = number_at(line, fields, column, name, value); !s.ok()) return s;
      value *= unit_m_;
      if (axis == 'z') {
        z_seen_ = z_seen_ || value != 0.0;
        if (!columns_.z) continue;
      }
      if (absl::Status s = check_position(path_, line, axis, value); !s.ok()) return s;
      values_.push_back(value);
    }
    if (columns_.heading) {
      double heading = std::numeric_limits<double>::quiet_NaN();
      if (roles_.direction_x != kNone) {
        double dx = 0.0, dy = 0.0;
        if (auto s = number_at(line, fields, roles_.direction_x, "viewDirX", dx); !s.ok()) return s;
        if (auto s = number_at(line, fields, roles_.direction_y, "viewDirY", dy); !s.ok()) return s;
        // A zero vector means that the direction was not seen.
        if (std::isfinite(dx) && std::isfinite(dy) && (dx != 0.0 || dy != 0.0)) {
          heading = std::atan2(dy, dx);
        }
      } else {
        double angle_deg = 0.0;
        if (auto s = number_at(line, fields, roles_.angle_deg, "ANGLE", angle_deg); !s.ok())
          return s;
        if (std::isfinite(angle_deg)) heading = std::remainder(angle_deg, 360.0) * kPi / 180.0;
      }
      if (std::isnan(heading)) ++unknown_headings_;
      values_.push_back(heading);
    }
    for (std::size_t i = 0; i < roles_.channels.size(); ++i) {
      if (auto s = number_at(line, fields, roles_.channels[i], info_.channel_names[i], value);
          !s.ok()) {
        return s;
      }
      values_.push_back(std::abs(value) <= 3e38 ? value : std::numeric_limits<double>::quiet_NaN());
    }
    return rows_->add(frame, static_cast<std::uint64_t>(id), line, values_);
  }

  const std::string& path_;
  const ReadOptions& options_;
  bool obsmat_;
  Info info_;
  Header header_;
  Roles roles_;
  Columns columns_;
  TimeBase base_;
  double unit_m_ = 1.0;
  bool z_seen_ = false;
  std::uint64_t unknown_headings_ = 0;
  std::vector<double> values_;
  std::unique_ptr<RowSorter> rows_;
};

}  // namespace

ReaderOr open_archive_text(const std::string& path, const ReadOptions& options,
                           const std::string& format) {
  return Ingest(path, options, format).run();
}

}  // namespace throng::trajectory::detail
