#include "throng/trajectory/writer.hpp"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <sqlite3.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <unordered_map>

#include "support.hpp"

namespace throng::trajectory {
namespace {

using detail::fault;
using detail::number_text;

template <typename Number>
void append(std::string& text, Number value) {
  char digits[40];
  // The shortest digits that read back as the same number.
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  text.append(digits, end);
}

absl::Status check_columns(const std::string& path, const WriteSpec& spec, const Frame& frame,
                           const std::vector<std::string>& names) {
  const std::size_t agents = frame.ids.size();
  const auto fits = [&](std::size_t size, bool may_be_empty) {
    return size == agents || (may_be_empty && size == 0);
  };
  bool good = fits(frame.x_m.size(), false) && fits(frame.y_m.size(), false) &&
              fits(frame.z_m.size(), true) && fits(frame.heading_rad.size(), true) &&
              fits(names.size(), true) && frame.channels.size() == spec.channel_names.size();
  for (const auto& channel : frame.channels) good = good && fits(channel.size(), false);
  if (good) return absl::OkStatus();
  return fault(path, absl::StrCat("write: a column of the frame at ", frame.time_us,
                                  " us has not one entry for each of its ", agents, " agents"));
}

/// Frame number of a time, or an error when none is near.
absl::StatusOr<std::int64_t> frame_number(const std::string& path, double fps, std::int64_t time_us,
                                          std::int64_t last) {
  const double exact = static_cast<double>(time_us) * 1e-6 * fps;
  const double nearest = std::round(exact);
  if (std::abs(exact - nearest) > 0.1 || !(std::abs(nearest) < detail::kMaxInteger) ||
      static_cast<std::int64_t>(nearest) <= last) {
    return fault(path,
                 absl::StrCat("write: time ", number_text(1e-6 * static_cast<double>(time_us)),
                              " s is no frame at ", number_text(fps),
                              " frames per second; write CSV, or give a rate that fits"));
  }
  return static_cast<std::int64_t>(nearest);
}

/// A text file under a temporary name.
class TextFile {
 public:
  ~TextFile() {
    if (file_ != nullptr) {
      std::fclose(file_);
      std::remove(temporary_.c_str());
    }
  }
  absl::Status open(const std::string& path) {
    path_ = path;
    temporary_ = path + ".tmp";
    file_ = std::fopen(temporary_.c_str(), "wb");
    return file_ != nullptr ? absl::OkStatus() : failed();
  }
  absl::Status put(const std::string& text) {
    return std::fwrite(text.data(), 1, text.size(), file_) == text.size() ? absl::OkStatus()
                                                                          : failed();
  }
  absl::Status close() {
    const bool closed = std::fclose(file_) == 0;
    file_ = nullptr;
    if (closed && std::rename(temporary_.c_str(), path_.c_str()) == 0) return absl::OkStatus();
    const absl::Status status = failed();
    std::remove(temporary_.c_str());
    return status;
  }

 private:
  absl::Status failed() const {
    const std::string message = absl::StrCat(path_, ": cannot be written: ", std::strerror(errno));
    return errno == ENOSPC ? absl::ResourceExhaustedError(message)
                           : absl::UnavailableError(message);
  }
  std::string path_, temporary_;
  std::FILE* file_ = nullptr;
};

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",;\t \"#\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) {
    if (c == '"') field += '"';
    field += c == '\n' || c == '\r' ? ' ' : c;
  }
  return field + '"';
}

class CsvWriter final : public Writer {
 public:
  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    if (absl::Status s = file_.open(path); !s.ok()) return s;
    std::string header = "time_s,id,x_m,y_m";
    if (spec.has_z) header += ",z_m";
    if (spec.has_heading) header += ",heading_rad";
    if (!spec.motion_names.empty()) header += ",motion";
    if (spec.has_characters) header += ",character";
    for (const std::string& name : spec.channel_names)
      absl::StrAppend(&header, ",", csv_field(name));
    return file_.put(header + "\n");
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>& characters) override {
    if (absl::Status s = check_columns(path_, spec_, frame, names); !s.ok()) return s;
    if (!characters.empty() && characters.size() != frame.ids.size()) {
      return fault(path_, absl::StrCat("write: ", characters.size(), " characters of ",
                                       frame.ids.size(), " agents"));
    }
    char time[48];
    const std::int64_t us = frame.time_us;
    const auto size = std::snprintf(time, sizeof time, "%s%lld.%06lld", us < 0 ? "-" : "",
                                    static_cast<long long>(std::abs(us / 1000000)),
                                    static_cast<long long>(std::abs(us % 1000000)));
    text_.clear();
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      text_.append(time, static_cast<std::size_t>(size));
      text_ += ',';
      text_ +=
          names.empty() || names[i].empty() ? std::to_string(frame.ids[i]) : csv_field(names[i]);
      for (const double value : {frame.x_m[i], frame.y_m[i]}) {
        text_ += ',';
        append(text_, value);
      }
      if (spec_.has_z) {
        text_ += ',';
        append(text_, frame.z_m.empty() ? 0.0 : frame.z_m[i]);
      }
      if (spec_.has_heading) {
        text_ += ',';
        if (!frame.heading_rad.empty() && std::isfinite(frame.heading_rad[i])) {
          append(text_, frame.heading_rad[i]);
        }
      }
      if (!spec_.motion_names.empty()) {
        text_ += ',';
        const std::size_t code = frame.motion.empty() ? 0 : frame.motion[i];
        if (code > 0 && code <= spec_.motion_names.size()) {
          text_ += csv_field(spec_.motion_names[code - 1]);
        }
      }
      if (spec_.has_characters) {
        text_ += ',';
        if (!characters.empty() && characters[i] >= 0) append(text_, characters[i]);
      }
      for (const auto& channel : frame.channels) {
        text_ += ',';
        if (std::isfinite(channel[i])) append(text_, channel[i]);
      }
      text_ += '\n';
    }
    return file_.put(text_);
  }

  absl::Status close() override { return file_.close(); }

 private:
  std::string path_;
  WriteSpec spec_;
  TextFile file_;
  std::string text_;
};

absl::Status check_plain_ids(const std::string& path, const Frame& frame) {
  for (const std::uint64_t id : frame.ids) {
    if (static_cast<double>(id) > detail::kMaxInteger) {
      return fault(path, absl::StrCat("write: id is ", id, ", at most 2^53 fits this format"));
    }
  }
  return absl::OkStatus();
}

/// Frame number of a frame whose columns and ids fit a format of plain numbers.
absl::StatusOr<std::int64_t> numbered_frame(const std::string& path, const WriteSpec& spec,
                                            const Frame& frame,
                                            const std::vector<std::string>& names,
                                            std::int64_t last) {
  if (absl::Status s = check_columns(path, spec, frame, names); !s.ok()) return s;
  if (absl::Status s = check_plain_ids(path, frame); !s.ok()) return s;
  return frame_number(path, spec.fps, frame.time_us, last);
}

/// Columns as of PeTrack; x and y in metres. Further columns follow the ones that others read.
class ArchiveWriter final : public Writer {
 public:
  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    if (absl::Status s = file_.open(path); !s.ok()) return s;
    std::string header = "# framerate: ";
    append(header, spec.fps);
    header += " fps\n# id frame x/m y/m z/m";
    if (spec.has_heading) header += " viewDirX viewDirY";
    for (std::string name : spec.channel_names) {
      for (char& c : name) {
        if (c == ' ' || c == '\t' || c == '/' || c == '\n' || c == '\r') c = '_';
      }
      absl::StrAppend(&header, " ", name);
    }
    return file_.put(header + "\n");
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>&) override {
    const auto number = numbered_frame(path_, spec_, frame, names, last_);
    if (!number.ok()) return number.status();
    last_ = *number;
    text_.clear();
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      text_ += std::to_string(frame.ids[i]) + " " + std::to_string(last_);
      for (const double value :
           {frame.x_m[i], frame.y_m[i], frame.z_m.empty() ? 0.0 : frame.z_m[i]}) {
        text_ += ' ';
        append(text_, value);
      }
      if (spec_.has_heading) {
        const bool known = !frame.heading_rad.empty() && std::isfinite(frame.heading_rad[i]);
        for (const float value : {known ? std::cos(frame.heading_rad[i]) : 0.0f,
                                  known ? std::sin(frame.heading_rad[i]) : 0.0f}) {
          text_ += ' ';
          append(text_, value);
        }
      }
      for (const auto& channel : frame.channels) {
        text_ += ' ';
        if (std::isfinite(channel[i])) {
          append(text_, channel[i]);
        } else {
          text_ += "nan";
        }
      }
      text_ += '\n';
    }
    return file_.put(text_);
  }

  absl::Status close() override { return file_.close(); }

 private:
  std::string path_;
  WriteSpec spec_;
  TextFile file_;
  std::string text_;
  std::int64_t last_ = -1;
};

/// JuPedSim's schema version 2: the one that its tools and PedPy read with orientations.
class SqliteWriter final : public Writer {
 public:
  ~SqliteWriter() override {
    const bool open = database_ != nullptr;
    release();
    if (open) std::remove(temporary_.c_str());
  }

  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    temporary_ = path + ".tmp";
    std::remove(temporary_.c_str());
    const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
    // A plain path, also when it looks like a URI.
    const std::string plain = absl::StrCat(temporary_.front() == '/' ? "" : "./", temporary_);
    if (sqlite3_open_v2(plain.c_str(), &database_, flags, nullptr) != SQLITE_OK) return failed();
    std::string sql =
        "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF; BEGIN;"
        "CREATE TABLE trajectory_data(frame INTEGER NOT NULL, id INTEGER NOT NULL,"
        " pos_x REAL NOT NULL, pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL);"
        "CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);"
        "CREATE TABLE geometry(hash INTEGER NOT NULL, wkt TEXT NOT NULL);"
        "CREATE UNIQUE INDEX geometry_hash ON geometry(hash);"
        "CREATE TABLE frame_data(frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL);";
    if (absl::Status s = run(sql); !s.ok()) return s;
    for (const auto& [key, value] :
         {std::pair("version", 2.0), std::pair("fps", spec.fps), std::pair("xmin", spec.min_x_m),
          std::pair("xmax", spec.max_x_m), std::pair("ymin", spec.min_y_m),
          std::pair("ymax", spec.max_y_m)}) {
      std::string text;
      append(text, value);
      if (absl::Status s =
              run(absl::StrCat("INSERT INTO metadata VALUES('", key, "','", text, "')"));
          !s.ok()) {
        return s;
      }
    }
    if (!spec.walkable_area_wkt.empty()) {
      sqlite3_stmt* statement = nullptr;
      if (sqlite3_prepare_v2(database_, "INSERT INTO geometry VALUES(0, ?)", -1, &statement,
                             nullptr) != SQLITE_OK) {
        return failed();
      }
      sqlite3_bind_text(statement, 1, spec.walkable_area_wkt.data(),
                        static_cast<int>(spec.walkable_area_wkt.size()), SQLITE_TRANSIENT);
      const int result = sqlite3_step(statement);
      sqlite3_finalize(statement);
      if (result != SQLITE_DONE) return failed();
    }
    if (sqlite3_prepare_v2(database_, "INSERT INTO trajectory_data VALUES(?, ?, ?, ?, ?, ?)", -1,
                           &row_, nullptr) != SQLITE_OK ||
        sqlite3_prepare_v2(database_, "INSERT INTO frame_data VALUES(?, 0)", -1, &frame_,
                           nullptr) != SQLITE_OK) {
      return failed();
    }
    return absl::OkStatus();
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>&) override {
    const auto number = numbered_frame(path_, spec_, frame, names, last_);
    if (!number.ok()) return number.status();
    // JuPedSim writes every frame number; moments that nobody saw repeat nothing but the number.
    if (last_ >= 0 && *number - last_ > 1 && agents_before_ == 0 && *number - last_ < 1000000) {
      for (std::int64_t empty = last_ + 1; empty < *number; ++empty) {
        if (absl::Status s = put_frame(empty); !s.ok()) return s;
      }
    }
    last_ = *number;
    agents_before_ = frame.ids.size();
    if (absl::Status s = put_frame(last_); !s.ok()) return s;
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      const bool known = !frame.heading_rad.empty() && std::isfinite(frame.heading_rad[i]);
      const double heading = known ? static_cast<double>(frame.heading_rad[i]) : 0.0;
      sqlite3_bind_int64(row_, 1, last_);
      sqlite3_bind_int64(row_, 2, static_cast<sqlite3_int64>(frame.ids[i]));
      sqlite3_bind_double(row_, 3, frame.x_m[i]);
      sqlite3_bind_double(row_, 4, frame.y_m[i]);
      // A zero vector is JuPedSim's word for no orientation.
      sqlite3_bind_double(row_, 5, known ? std::cos(heading) : 0.0);
      sqlite3_bind_double(row_, 6, known ? std::sin(heading) : 0.0);
      if (sqlite3_step(row_) != SQLITE_DONE) return failed();
      sqlite3_reset(row_);
    }
    return absl::OkStatus();
  }

  absl::Status close() override {
    absl::Status status = run("CREATE INDEX frame_id_idx ON trajectory_data(frame, id); COMMIT");
    release();
    if (status.ok() && std::rename(temporary_.c_str(), path_.c_str()) != 0) {
      status = absl::UnavailableError(
          absl::StrCat(path_, ": cannot be written: ", std::strerror(errno)));
    }
    if (!status.ok()) std::remove(temporary_.c_str());
    return status;
  }

 private:
  absl::Status put_frame(std::int64_t number) {
    sqlite3_bind_int64(frame_, 1, number);
    if (sqlite3_step(frame_) != SQLITE_DONE) return failed();
    sqlite3_reset(frame_);
    return absl::OkStatus();
  }

  absl::Status run(const std::string& sql) {
    return sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK
               ? absl::OkStatus()
               : failed();
  }

  absl::Status failed() const {
    const std::string message =
        absl::StrCat(path_, ": cannot be written: ", sqlite3_errmsg(database_));
    return sqlite3_errcode(database_) == SQLITE_FULL ? absl::ResourceExhaustedError(message)
                                                     : absl::UnavailableError(message);
  }

  void release() {
    sqlite3_finalize(row_);
    sqlite3_finalize(frame_);
    row_ = frame_ = nullptr;
    sqlite3_close(database_);
    database_ = nullptr;
  }

  std::string path_, temporary_;
  WriteSpec spec_;
  sqlite3* database_ = nullptr;
  sqlite3_stmt *row_ = nullptr, *frame_ = nullptr;
  std::int64_t last_ = -1;
  std::size_t agents_before_ = 0;
};

absl::StatusOr<std::string> write_format(const std::string& path, const std::string& format) {
  std::string name = format;
  if (name.empty() && absl::EndsWithIgnoreCase(path, ".csv")) name = "csv";
  if (name.empty() && absl::EndsWithIgnoreCase(path, ".txt")) name = "archive-text";
  if (name.empty() &&
      (absl::EndsWithIgnoreCase(path, ".sqlite") || absl::EndsWithIgnoreCase(path, ".db"))) {
    name = "jupedsim-sqlite";
  }
  for (const std::string& known : write_format_names()) {
    if (name == known) return name;
  }
  return fault(path,
               name.empty()
                   ? absl::StrCat("the ending tells no format to write; end it with .csv, "
                                  ".sqlite or .txt, or name one of ",
                                  absl::StrJoin(write_format_names(), ", "))
                   : absl::StrCat("format to write is ", detail::quoted(name), ", must be one of ",
                                  absl::StrJoin(write_format_names(), ", ")));
}

template <typename Kind>
absl::StatusOr<std::unique_ptr<Writer>> opened(const std::string& path, const WriteSpec& spec) {
  auto writer = std::make_unique<Kind>();
  if (absl::Status s = writer->open(path, spec); !s.ok()) return s;
  return std::unique_ptr<Writer>(std::move(writer));
}

}  // namespace

std::vector<std::string> write_format_names() { return {"csv", "jupedsim-sqlite", "archive-text"}; }

absl::StatusOr<std::unique_ptr<Writer>> make_writer(const std::string& path,
                                                    const WriteSpec& spec) {
  absl::StatusOr<std::string> format = write_format(path, spec.format);
  if (!format.ok()) return format.status();
  if (*format == "csv") return opened<CsvWriter>(path, spec);
  if (!detail::valid_fps(spec.fps)) {
    return fault(path, absl::StrCat("frame rate to write is ", number_text(spec.fps),
                                    ", must be between 0.0001 and 100000; times may be irregular: "
                                    "write CSV or give a rate"));
  }
  return *format == "archive-text" ? opened<ArchiveWriter>(path, spec)
                                   : opened<SqliteWriter>(path, spec);
}

absl::StatusOr<Summary> convert(const std::string& input, const std::string& output,
                                const ReadOptions& options, const std::string& format, double fps,
                                const std::function<bool(std::uint64_t, std::uint64_t)>& goes_on) {
  absl::StatusOr<std::string> written = write_format(output, format);
  if (!written.ok()) return written.status();
  absl::StatusOr<Summary> summary = summarize(input, options);
  if (!summary.ok()) return summary;
  WriteSpec spec;
  spec.format = *written;
  spec.fps = fps > 0.0 ? fps : summary->info.fps;
  spec.has_z = summary->has_z;
  spec.has_heading = summary->has_heading;
  spec.channel_names = summary->info.channel_names;
  // others read WKT only: the surfaces that may follow stay out
  spec.walkable_area_wkt =
      summary->info.walkable_area_wkt.substr(0, summary->info.walkable_area_wkt.find("\n;"));
  spec.min_x_m = summary->min_x_m;
  spec.max_x_m = summary->max_x_m;
  spec.min_y_m = summary->min_y_m;
  spec.max_y_m = summary->max_y_m;
  const bool sqlite = *written == "jupedsim-sqlite", csv = *written == "csv";
  if (csv && summary->has_motion) spec.motion_names = summary->info.motion_names;
  spec.has_characters = csv && summary->has_characters;
  std::vector<std::string>& notes = summary->info.notes;
  for (std::string& name : spec.channel_names) {
    if (!csv || (name != "motion" && name != "character")) continue;
    // such a column would be read as what agents do, or who they are
    notes.push_back(absl::StrCat("the channel '", name, "' is written as '", name, "_value'"));
    name += "_value";
  }
  if (sqlite && (spec.has_z || !spec.channel_names.empty())) {
    notes.push_back("JuPedSim's SQLite holds neither heights nor channels; they are not written");
  }
  if (!csv && (summary->has_motion || summary->has_characters)) {
    notes.push_back(
        "what agents do and who they were chosen to be is not written; only CSV holds it");
  }
  if (!sqlite && !spec.walkable_area_wkt.empty()) {
    notes.push_back("the walkable area is not written; only SQLite holds it");
  }
  const bool renumber =
      *written != "csv" && static_cast<double>(summary->largest_id) > detail::kMaxInteger;
  if (renumber)
    notes.push_back("ids become 1, 2, ... in order of appearance: the format has no names");

  absl::StatusOr<std::unique_ptr<Reader>> reader = open(input, options);
  if (!reader.ok()) return reader.status();
  absl::StatusOr<std::unique_ptr<Writer>> writer = make_writer(output, spec);
  if (!writer.ok()) return writer.status();
  std::unordered_map<std::uint64_t, std::uint64_t> numbers;
  std::vector<std::string> names;
  std::vector<std::int32_t> characters;
  std::uint64_t frames = 0;
  Frame frame;
  while (true) {
    absl::StatusOr<bool> more = (*reader)->next(frame);
    if (!more.ok()) return more.status();
    if (!*more) break;
    names.clear();
    characters.clear();
    for (std::uint64_t& id : frame.ids) {
      if (spec.has_characters) characters.push_back((*reader)->agent_character(id));
      if (renumber) {
        id = numbers.try_emplace(id, numbers.size() + 1).first->second;
      } else {
        names.push_back((*reader)->agent_name(id));
      }
    }
    if (absl::Status s = (*writer)->write(frame, names, characters); !s.ok()) return s;
    if (goes_on && !goes_on(++frames, summary->frames)) {
      return absl::CancelledError(absl::StrCat(output, ": stopped after ", frames, " frames"));
    }
  }
  if (absl::Status s = (*writer)->close(); !s.ok()) return s;
  return summary;
}

}  // namespace throng::trajectory
