#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <unordered_map>

#include "csv_split.hpp"
#include "readers.hpp"
#include "sorted_reader.hpp"
#include "text_source.hpp"

/// Tables with a line of column names: any simulator's CSV, Pathfinder, crowd:it, SUMO's FCD table.
namespace throng::trajectory::detail {

bool split_csv(std::string_view line, char delimiter, std::vector<std::string_view>& fields,
               std::vector<std::string>& unquoted) {
  fields.clear();
  unquoted.clear();
  // Views into `unquoted` must survive its growth.
  unquoted.reserve(static_cast<std::size_t>(std::count(line.begin(), line.end(), '"')));
  if (delimiter == ' ') {
    split_blanks(line, fields);
    return true;
  }
  std::size_t at = 0;
  while (true) {
    while (at < line.size() && line[at] == ' ') ++at;
    if (at < line.size() && line[at] == '"') {
      const std::size_t begin = ++at;
      bool doubled = false;
      while (true) {
        const std::size_t quote = line.find('"', at);
        if (quote == std::string_view::npos) return false;
        at = quote + 1;
        if (at < line.size() && line[at] == '"') {
          doubled = true;
          ++at;
          continue;
        }
        break;
      }
      std::string_view field = line.substr(begin, at - 1 - begin);
      if (doubled) {
        std::string plain;
        for (std::size_t i = 0; i < field.size(); ++i) {
          plain += field[i];
          if (field[i] == '"') ++i;
        }
        unquoted.push_back(std::move(plain));
        field = unquoted.back();
      }
      fields.push_back(field);
      while (at < line.size() && line[at] == ' ') ++at;
      if (at < line.size() && line[at] != delimiter) return false;
    } else {
      const std::size_t end = std::min(line.find(delimiter, at), line.size());
      fields.push_back(trimmed(line.substr(at, end - at)));
      at = end;
    }
    if (at >= line.size() || fields.size() > kMaxColumns) return true;
    ++at;  // the delimiter
  }
}

char csv_delimiter(std::string_view header) {
  for (const char delimiter : {';', '\t', ','}) {
    if (header.find(delimiter) != std::string_view::npos) return delimiter;
  }
  return ' ';
}

namespace {

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
/// Nobody walks or runs at this mean speed: positions in centimetres give it away.
constexpr double kImplausibleSpeed = 12.0;
constexpr std::size_t kMaxSpeedAgents = 100000;
// What the wire takes.
constexpr std::size_t kMostMotions = 64;
constexpr std::size_t kLongestMotion = 64;
constexpr std::int64_t kLastCharacter = 65'535;

/// A column's name and the unit written with it: "x_cm", "x/cm", "x [cm]", "x (cm)".
struct ColumnName {
  std::string name;
  std::string unit;
};

ColumnName column_name(std::string_view text) {
  ColumnName column;
  std::string word = lower(trimmed(text));
  const std::size_t bracket = word.find_first_of("[(/");
  if (bracket != std::string::npos && bracket > 0) {
    std::string_view unit = std::string_view(word).substr(bracket + 1);
    if (!unit.empty() && (unit.back() == ']' || unit.back() == ')')) unit.remove_suffix(1);
    column.unit = std::string(trimmed(unit));
    column.name = std::string(trimmed(std::string_view(word).substr(0, bracket)));
    return column;
  }
  for (const char* unit : {"m", "cm", "mm", "s", "ms", "us", "rad", "deg"}) {
    const std::string ending = absl::StrCat("_", unit);
    if (word.size() > ending.size() && absl::EndsWith(word, ending)) {
      column.unit = unit;
      word.resize(word.size() - ending.size());
      break;
    }
  }
  column.name = std::move(word);
  return column;
}

bool one_of(std::string_view name, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

class Ingest final : public RowFeed {
 public:
  Ingest(const std::string& path, const ReadOptions& options) : path_(path), options_(options) {
    info_.format = "csv";
  }

  /// Reads the whole table, or as much of it as shows that it is in order of time.
  static ReaderOr run(std::unique_ptr<Ingest> ingest) {
    absl::StatusOr<std::unique_ptr<LineSource>> lines = LineSource::open(ingest->path_);
    if (!lines.ok()) return lines.status();
    ingest->lines_ = *std::move(lines);
    bool streams = false;
    while (!streams) {
      absl::StatusOr<bool> more = ingest->read_line(ingest->rows_.get());
      if (!more.ok()) return more.status();
      if (!*more) break;
      if (absl::Status s = ingest->lines_->tell(ingest->options_); !s.ok()) return s;
      streams = ingest->can_stream();
    }
    if (ingest->names_.empty()) {
      return fault(ingest->path_, "the file has no line with column names");
    }
    if (ingest->rows_ == nullptr) {
      return fault(ingest->path_,
                   "there are no rows of agents in the file; it may have been cut short");
    }
    Ingest& own = *ingest;
    return own.finish(streams ? std::move(ingest) : nullptr);
  }

  absl::StatusOr<bool> read_on(RowSorter& rows) override {
    absl::StatusOr<bool> more = read_line(&rows);
    if (!absl::IsOutOfRange(more.status())) return more;
    return absl::OutOfRangeError(
        absl::StrCat(path_, ", line ", lines_->number(),
                     ": the row belongs to a moment that was given already: the file is not in "
                     "order of time"));
  }
  const IdTable& ids() const override { return ids_; }
  const std::vector<std::string>& motion_names() const override { return info_.motion_names; }

 private:
  /// In order of time as far as some thousand rows and a few moments show; an agent that is not
  /// active is added later than its time.
  bool can_stream() const {
    constexpr std::uint64_t kLookAheadRows = 1u << 17;
    constexpr std::size_t kLookAheadKeys = 8;
    return options_.streams && rows_ != nullptr && active_ == kNone && rows_->keys_rise() &&
           !rows_->spilled() && rows_->row_count() >= kLookAheadRows &&
           rows_->key_count() >= kLookAheadKeys;
  }

  /// Takes the next line; its row goes to `rows`, where there is one (the first row makes it).
  absl::StatusOr<bool> read_line(RowSorter* rows) {
    std::string_view line;
    std::vector<std::string_view>& fields = fields_;
    absl::StatusOr<bool> more = lines_->next(line);
    if (!more.ok() || !*more) return more;
    const std::uint64_t number = lines_->number();
    if (trimmed(line).empty()) return true;
    if (trimmed(line).front() == '#') {
      if (absl::Status s = read_comment(number, trimmed(line).substr(1)); !s.ok()) return s;
      return true;
    }
    if (names_.empty()) {
      delimiter_ = csv_delimiter(line);
      if (!split_csv(line, delimiter_, fields, unquoted_)) return bad_quotes(number);
      if (absl::Status s = read_names(number, fields); !s.ok()) return s;
      return true;
    }
    if (!split_csv(line, delimiter_, fields, unquoted_)) return bad_quotes(number);
    if (fields.size() != names_.size()) {
      // A delimiter at the end of each line makes one empty field more.
      const bool trailing = fields.size() == names_.size() + 1 && fields.back().empty();
      if (!trailing) {
        return fault(
            path_, number,
            absl::StrCat("the row has ", fields.size(), " fields, the header names ", names_.size(),
                         lines_->unterminated() ? "; the file is cut short: remove its last line"
                                                : "; correct or remove the row"));
      }
    }
    if (first_row_) {
      first_row_ = false;
      if (is_units_row(fields)) {
        if (absl::Status s = read_units(number, fields); !s.ok()) return s;
        if (absl::Status s = settle({}); !s.ok()) return s;
        return true;
      }
    }
    if (!channels_settled_) {
      if (absl::Status s = settle(fields); !s.ok()) return s;
      rows = rows_.get();
    }
    if (absl::Status s = add(number, fields, *rows); !s.ok()) return s;
    return true;
  }

  absl::Status bad_quotes(std::uint64_t number) const {
    return fault(path_, number, "a quote is not closed, or text follows a closing quote");
  }

  /// "# framerate: 25" above the names, as throng and others write it.
  absl::Status read_comment(std::uint64_t number, std::string_view text) {
    const std::string line = lower(trimmed(text));
    if (!absl::StartsWith(line, "framerate") && !absl::StartsWith(line, "fps") &&
        !absl::StartsWith(line, "frame rate")) {
      return absl::OkStatus();
    }
    comment_fps_ = first_number(line);
    if (!comment_fps_ || !valid_fps(*comment_fps_)) {
      return fault(path_, number,
                   absl::StrCat("the frame rate ", quoted(text),
                                " must be a number between 0.0001 and 100000"));
    }
    return absl::OkStatus();
  }

  absl::Status read_names(std::uint64_t number, const std::vector<std::string_view>& fields) {
    if (fields.size() > kMaxColumns) {
      return fault(path_, number, absl::StrCat("more than ", kMaxColumns, " columns"));
    }
    bool numbers = true;
    for (const std::string_view field : fields) {
      double value = 0.0;
      numbers = numbers && parse_number(field, value);
      names_.emplace_back(field);
      columns_of_.push_back(column_name(field));
    }
    if (numbers) {
      return fault(path_, number,
                   "there is no line with column names; add one above the rows, e.g. "
                   "time_s,id,x_m,y_m");
    }
    if (absl::Status s = find_dialect(number); !s.ok()) return s;
    for (std::size_t i = 0; i < columns_of_.size(); ++i) {
      if (absl::Status s = take_role(number, i); !s.ok()) return s;
    }
    if (direction_x_ == kNone || direction_y_ == kNone) {
      for (std::size_t* column : {&direction_x_, &direction_y_}) {
        if (*column != kNone) extra_.push_back(*column);
        *column = kNone;
      }
      std::sort(extra_.begin(), extra_.end());
    }
    std::string missing;
    if (time_ == kNone && frame_ == kNone) missing = "time_s or frame";
    if (id_ == kNone) missing += missing.empty() ? "id" : ", id";
    if (x_ == kNone) missing += missing.empty() ? "x_m" : ", x_m";
    if (y_ == kNone) missing += missing.empty() ? "y_m" : ", y_m";
    if (!missing.empty()) {
      std::string found;
      for (const std::string& name : names_) {
        if (found.size() > 200) break;
        if (!found.empty()) found += ", ";
        found += name;
      }
      return fault(path_, number,
                   absl::StrCat("no column named ", missing, " among ", quoted_list(found),
                                "; rename the columns in the first line"));
    }
    return absl::OkStatus();
  }

  static std::string quoted_list(const std::string& found) {
    std::string text = found;
    for (char& c : text) {
      if (static_cast<unsigned char>(c) < 0x20) c = '?';
    }
    return text;
  }

  /// Programs whose tables are known say more than the column names do.
  absl::Status find_dialect(std::uint64_t number) {
    std::vector<std::string> bare;
    for (const std::string& name : names_) bare.push_back(lower(trimmed(name)));
    const auto has = [&](std::string_view name) {
      return std::find(bare.begin(), bare.end(), name) != bare.end();
    };
    if (has("timestep_time") || has("person_id") || has("vehicle_id")) {
      info_.format = "sumo-fcd-csv";
      sumo_ = true;
      known_unit_m_ = 1.0;
      if (!has("person_id")) {
        return fault(path_, number,
                     "SUMO's table has no column person_id: it lists no pedestrians");
      }
    } else if (has("pedid") && has("posx") && has("posy")) {
      info_.format = "crowdit-csv";
      known_unit_m_ = 1.0;
    } else if (has("terrain type") || (has("active") && has("name") && has("t"))) {
      info_.format = "pathfinder-csv";
    }
    return absl::OkStatus();
  }

  absl::Status take(std::uint64_t number, std::size_t column, std::size_t& role) {
    if (role != kNone) {
      return fault(path_, number,
                   absl::StrCat("columns ", quoted(names_[role]), " and ", quoted(names_[column]),
                                " mean the same; rename one of them"));
    }
    role = column;
    return absl::OkStatus();
  }

  absl::Status take_role(std::uint64_t number, std::size_t i) {
    std::string name = columns_of_[i].name;
    const std::string& unit = columns_of_[i].unit;
    if (sumo_) {
      if (absl::StartsWith(name, "vehicle_") || absl::StartsWith(name, "container_")) {
        return absl::OkStatus();
      }
      if (name == "timestep_time") name = "time";
      if (absl::StartsWith(name, "person_")) name = name.substr(7);
      // Clockwise from north.
      if (name == "angle") return take(number, i, compass_);
    }
    if (one_of(name, {"t", "time", "simtime", "sim_time", "seconds", "timestamp", "simsec"})) {
      if (!unit.empty() && !one_of(unit, {"s", "ms", "us", "sec", "seconds"})) {
        return fault(path_, number,
                     absl::StrCat("the unit of column ", quoted(names_[i]), " is ", quoted(unit),
                                  ", must be s, ms or us"));
      }
      seconds_per_unit_ = unit == "ms" ? 1e-3 : unit == "us" ? 1e-6 : 1.0;
      return take(number, i, time_);
    }
    if (one_of(name, {"frame", "fr", "frame_number", "frame_id", "framenumber"})) {
      return take(number, i, frame_);
    }
    if (one_of(name, {"id", "pedid", "ped_id", "agent", "agent_id", "agentid", "person_id",
                      "pedestrianid", "pedestrian_id", "track_id", "trackid"})) {
      return take(number, i, id_);
    }
    for (const auto& [axis, role] :
         {std::pair("x", &x_), std::pair("y", &y_), std::pair("z", &z_)}) {
      if (name != axis && name != absl::StrCat("pos", axis) && name != absl::StrCat("pos_", axis) &&
          name != absl::StrCat("position_", axis) && name != absl::StrCat("coordcent", axis)) {
        continue;
      }
      if (!unit.empty()) {
        if (absl::Status s = take_unit(number, i, unit); !s.ok()) return s;
      }
      return take(number, i, *role);
    }
    if (one_of(name, {"heading", "yaw", "orientation", "heading_angle"})) {
      if (unit == "deg" || unit == "degrees" || unit == "degree") degrees_ = true;
      return take(number, i, heading_);
    }
    if (name == "angle" && one_of(unit, {"rad", "deg"})) {
      degrees_ = unit == "deg";
      return take(number, i, heading_);
    }
    if (one_of(name, {"ori_x", "viewdirx", "heading_x", "dir_x", "dirx"})) {
      return take(number, i, direction_x_);
    }
    if (one_of(name, {"ori_y", "viewdiry", "heading_y", "dir_y", "diry"})) {
      return take(number, i, direction_y_);
    }
    if (name == "motion") return take(number, i, motion_);
    if (name == "character") return take(number, i, character_);
    if (name == "active" && info_.format == "pathfinder-csv") return take(number, i, active_);
    extra_.push_back(i);
    return absl::OkStatus();
  }

  absl::Status take_unit(std::uint64_t number, std::size_t column, std::string_view unit) {
    const std::optional<double> metres = unit_metres(unit);
    if (!metres) {
      return fault(path_, number,
                   absl::StrCat("the unit of column ", quoted(names_[column]), " is ", quoted(unit),
                                ", must be m, cm or mm"));
    }
    if (known_unit_m_ && *known_unit_m_ != *metres) {
      return fault(path_, number,
                   absl::StrCat("column ", quoted(names_[column]), " is in ", quoted(unit),
                                " but others are in units of ", number_text(*known_unit_m_),
                                " m; use one unit"));
    }
    known_unit_m_ = metres;
    return absl::OkStatus();
  }

  bool is_units_row(const std::vector<std::string_view>& fields) const {
    double value = 0.0;
    return !parse_number(fields[x_], value) && !parse_number(fields[y_], value) &&
           unit_metres(fields[x_]).has_value() && unit_metres(fields[y_]).has_value();
  }

  absl::Status read_units(std::uint64_t number, const std::vector<std::string_view>& fields) {
    for (const std::size_t column : {x_, y_, z_}) {
      if (column == kNone || fields[column].empty()) continue;
      if (absl::Status s = take_unit(number, column, fields[column]); !s.ok()) return s;
    }
    if (time_ != kNone && fields[time_] == "ms") seconds_per_unit_ = 1e-3;
    return absl::OkStatus();
  }

  /// Unit, rate and columns, at the first row. `fields` may be empty when a row of units came
  /// first.
  absl::Status settle(const std::vector<std::string_view>& fields) {
    if (rows_ == nullptr && !unit_settled_) {
      unit_settled_ = true;
      if (!known_unit_m_ && !options_.source_unit_m) {
        unit_assumed_ = true;
        unit_m_ = 1.0;
      } else {
        absl::StatusOr<double> unit = resolve_unit(path_, known_unit_m_, options_);
        if (!unit.ok()) return unit.status();
        unit_m_ = *unit;
      }
      if (time_ != kNone) {
        base_ = {TimeBase::Kind::kMicroseconds, 0.0};
      } else {
        absl::StatusOr<double> fps = resolve_fps(path_, comment_fps_, options_,
                                                 "the file has frame numbers but no frame rate");
        if (!fps.ok()) return fps.status();
        base_ = {TimeBase::Kind::kFrames, *fps};
      }
    }
    if (fields.empty()) return absl::OkStatus();
    channels_settled_ = true;
    columns_.z = z_ != kNone;
    columns_.heading = heading_ != kNone || compass_ != kNone || direction_x_ != kNone;
    std::string ignored;
    for (const std::size_t column : extra_) {
      double value = 0.0;
      const bool number = fields[column].empty() || parse_number(fields[column], value);
      if (number && info_.channel_names.size() < kMaxColumns) {
        channels_.push_back(column);
        info_.channel_names.push_back(names_[column]);
      } else if (ignored.size() < 200) {
        ignored += absl::StrCat(ignored.empty() ? "" : ", ", quoted(names_[column]));
      }
    }
    if (!ignored.empty()) {
      info_.notes.push_back(absl::StrCat("columns that are not numbers are ignored: ", ignored));
    }
    columns_.motion = motion_ != kNone;
    columns_.channels = channels_.size();
    rows_ = std::make_unique<RowSorter>(columns_.count(), options_.memory_bytes);
    return absl::OkStatus();
  }

  absl::Status number_at(std::uint64_t line, const std::vector<std::string_view>& fields,
                         std::size_t column, double& value) const {
    if (parse_number(fields[column], value)) return absl::OkStatus();
    const bool comma = fields[column].find(',') != std::string_view::npos;
    return fault(
        path_, line,
        absl::StrCat("column ", quoted(names_[column]), " is ", quoted(fields[column]),
                     ", must be a number",
                     comma ? "; write a point, not a comma" : "; correct or remove the row"));
  }

  absl::Status add(std::uint64_t line, const std::vector<std::string_view>& fields,
                   RowSorter& rows) {
    if (sumo_ && fields[id_].empty()) {
      ++vehicles_;
      return absl::OkStatus();
    }
    std::int64_t key = 0;
    if (time_ != kNone) {
      double time = 0.0;
      if (absl::Status s = number_at(line, fields, time_, time); !s.ok()) return s;
      time *= seconds_per_unit_;
      if (!(std::abs(time) <= kMaxTimeS)) {
        return fault(
            path_, line,
            absl::StrCat("time is ", number_text(time), " s, must be between -1e12 and 1e12 s"));
      }
      key = std::llround(time * 1e6);
    } else if (!parse_integer(fields[frame_], key) ||
               std::abs(static_cast<double>(key)) > kMaxInteger) {
      return fault(path_, line,
                   absl::StrCat("frame is ", quoted(fields[frame_]),
                                ", must be an integer of at most 2^53; correct or remove the row"));
    }
    absl::StatusOr<std::uint64_t> id = ids_.id(fields[id_]);
    if (!id.ok()) {
      return fault(path_, line,
                   std::string_view(id.status().message().data(), id.status().message().size()));
    }
    if (character_ != kNone && !fields[character_].empty()) {
      std::int64_t character = 0;
      if (parse_integer(fields[character_], character) && character >= 0 &&
          character <= kLastCharacter) {
        ids_.choose(*id, static_cast<std::int32_t>(character));
      } else {
        ++odd_characters_;
      }
    }
    values_.clear();
    double value = 0.0;
    for (const auto& [column, axis] :
         {std::pair(x_, 'x'), std::pair(y_, 'y'), std::pair(z_, 'z')}) {
      if (column == kNone) continue;
      if (absl::Status s = number_at(line, fields, column, value); !s.ok()) return s;
      value *= unit_m_;
      if (absl::Status s = check_position(path_, line, axis, value); !s.ok()) return s;
      values_.push_back(value);
    }
    if (unit_assumed_) watch_speed(*id, key);
    if (columns_.heading) {
      double heading = std::numeric_limits<double>::quiet_NaN();
      if (absl::Status s = heading_at(line, fields, heading); !s.ok()) return s;
      values_.push_back(heading);
    }
    if (columns_.motion) values_.push_back(motion_at(fields[motion_]));
    for (const std::size_t column : channels_) {
      if (!parse_number(fields[column], value) || !(std::abs(value) <= 3e38)) {
        if (!fields[column].empty()) ++odd_channels_;
        value = std::numeric_limits<double>::quiet_NaN();
      }
      values_.push_back(value);
    }
    return active_ == kNone ? rows.add(key, *id, line, values_)
                            : add_if_active(fields[active_] != "0", key, *id, line);
  }

  /// An agent that is not active is not there, but for the moments right before it enters and
  /// right after it leaves: they are where its way begins and ends.
  absl::Status add_if_active(bool active, std::int64_t key, std::uint64_t id, std::uint64_t line) {
    Activity& known = activity_[id];
    const bool was_active = known.active;
    known.active = active;
    if (active) {
      if (known.line != 0) {
        --inactive_;
        if (auto s = rows_->add(known.key, id, known.line, known.values); !s.ok()) return s;
        known.line = 0;
      }
      return rows_->add(key, id, line, values_);
    }
    if (was_active) return rows_->add(key, id, line, values_);
    ++inactive_;
    known.key = key;
    known.line = line;
    known.values = values_;
    return rows_->add_moment(key);
  }

  absl::Status heading_at(std::uint64_t line, const std::vector<std::string_view>& fields,
                          double& heading) const {
    if (direction_x_ != kNone && heading_ == kNone && compass_ == kNone) {
      double dx = 0.0, dy = 0.0;
      if (fields[direction_x_].empty() || fields[direction_y_].empty()) return absl::OkStatus();
      if (absl::Status s = number_at(line, fields, direction_x_, dx); !s.ok()) return s;
      if (absl::Status s = number_at(line, fields, direction_y_, dy); !s.ok()) return s;
      if (std::isfinite(dx) && std::isfinite(dy) && (dx != 0.0 || dy != 0.0)) {
        heading = std::atan2(dy, dx);
      }
      return absl::OkStatus();
    }
    const std::size_t column = compass_ != kNone ? compass_ : heading_;
    if (fields[column].empty()) return absl::OkStatus();
    double value = 0.0;
    if (absl::Status s = number_at(line, fields, column, value); !s.ok()) return s;
    if (!std::isfinite(value)) return absl::OkStatus();
    if (compass_ != kNone) {
      heading = std::remainder(90.0 - value, 360.0) * kPi / 180.0;
    } else {
      heading =
          degrees_ ? std::remainder(value, 360.0) * kPi / 180.0 : std::remainder(value, 2.0 * kPi);
    }
    return absl::OkStatus();
  }

  /// Code of what an agent does; 0 for nothing and beyond the names there may be.
  double motion_at(std::string_view name) {
    if (name.empty() || name == "0") return 0.0;
    const auto known = std::find(info_.motion_names.begin(), info_.motion_names.end(), name);
    if (known == info_.motion_names.end()) {
      if (info_.motion_names.size() == kMostMotions || name.size() > kLongestMotion) {
        ++odd_motions_;
        return 0.0;
      }
      info_.motion_names.emplace_back(name);
      return static_cast<double>(info_.motion_names.size());
    }
    return static_cast<double>(known - info_.motion_names.begin() + 1);
  }

  void watch_speed(std::uint64_t id, std::int64_t key) {
    if (last_.size() >= kMaxSpeedAgents && !last_.contains(id)) return;
    const auto [entry, fresh] = last_.try_emplace(id, std::array<double, 3>{});
    const double time_s = static_cast<double>(key) / (time_ != kNone ? 1e6 : base_.rate);
    if (!fresh) {
      distance_m_ += std::hypot(values_[0] - entry->second[1], values_[1] - entry->second[2]);
      walked_s_ += std::abs(time_s - entry->second[0]);
    }
    entry->second = {time_s, values_[0], values_[1]};
  }

  ReaderOr finish(std::unique_ptr<Ingest> feed) {
    if (unit_assumed_ && walked_s_ > 0.0 && distance_m_ / walked_s_ > kImplausibleSpeed) {
      return fault(path_, absl::StrCat("the columns name no unit, and in metres agents would move ",
                                       number_text(std::round(distance_m_ / walked_s_)),
                                       " m/s; give --source-unit cm or --source-unit m"));
    }
    if (unit_assumed_) info_.notes.push_back("positions taken as metres: the columns name no unit");
    if (time_ != kNone && columns_of_[time_].unit.empty() && info_.format == "csv") {
      info_.notes.push_back("times taken as seconds: the column names no unit");
    }
    if (inactive_ > 0) {
      info_.notes.push_back(absl::StrCat(counted(inactive_, "row", "rows"),
                                         " of agents that are not active skipped"));
    }
    if (vehicles_ > 0) {
      info_.notes.push_back(
          absl::StrCat(counted(vehicles_, "row", "rows"), " of vehicles skipped"));
    }
    if (odd_channels_ > 0) {
      info_.notes.push_back(absl::StrCat(counted(odd_channels_, "value", "values"),
                                         " of further columns not a number"));
    }
    if (odd_motions_ > 0) {
      info_.notes.push_back(
          absl::StrCat(counted(odd_motions_, "motion", "motions"), " left out: over ", kMostMotions,
                       " different ones, or a name of over ", kLongestMotion, " bytes"));
    }
    if (odd_characters_ > 0) {
      info_.notes.push_back(absl::StrCat(counted(odd_characters_, "character", "characters"),
                                         " left out: not a number of 0 to ", kLastCharacter));
    }
    IdTable ids(false);
    if (feed == nullptr) std::swap(ids, ids_);
    return make_sorted_reader(path_, info_, columns_, base_, options_, std::move(rows_),
                              std::move(ids), std::move(feed));
  }

  const std::string path_;
  const ReadOptions options_;
  std::unique_ptr<LineSource> lines_;
  std::vector<std::string_view> fields_;
  std::vector<std::string> unquoted_;
  bool first_row_ = true;
  Info info_;
  char delimiter_ = ',';
  std::vector<std::string> names_;
  std::vector<ColumnName> columns_of_;
  std::size_t time_ = kNone, frame_ = kNone, id_ = kNone, x_ = kNone, y_ = kNone, z_ = kNone;
  std::size_t heading_ = kNone, compass_ = kNone, direction_x_ = kNone, direction_y_ = kNone;
  std::size_t active_ = kNone, motion_ = kNone, character_ = kNone;
  std::vector<std::size_t> extra_, channels_;
  bool sumo_ = false, degrees_ = false;
  bool unit_settled_ = false, channels_settled_ = false, unit_assumed_ = false;
  double seconds_per_unit_ = 1.0;
  std::optional<double> comment_fps_, known_unit_m_;
  double unit_m_ = 1.0;
  Columns columns_;
  TimeBase base_;
  IdTable ids_{false};
  std::vector<double> values_;
  struct Activity {
    bool active = false;
    std::int64_t key = 0;
    std::uint64_t line = 0;  // of a row not given yet; 0: none
    std::vector<double> values;
  };
  std::unordered_map<std::uint64_t, Activity> activity_;
  std::uint64_t inactive_ = 0, vehicles_ = 0, odd_channels_ = 0, odd_motions_ = 0,
                odd_characters_ = 0;
  std::unordered_map<std::uint64_t, std::array<double, 3>> last_;  // time, x, y
  double distance_m_ = 0.0, walked_s_ = 0.0;
  std::unique_ptr<RowSorter> rows_;
};

}  // namespace

ReaderOr open_csv(const std::string& path, const ReadOptions& options) {
  return Ingest::run(std::make_unique<Ingest>(path, options));
}

}  // namespace throng::trajectory::detail
