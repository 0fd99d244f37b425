#include <absl/strings/str_cat.h>
#include <absl/strings/string_view.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "readers.hpp"
#include "sorted_reader.hpp"

/// JuPedSim's SQLite output, versions 1 to 3, straight from the file in order of frames.
namespace throng::trajectory::detail {
namespace {

constexpr std::int64_t kMaxWktBytes = 64 << 20;

struct CloseDatabase {
  void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
};
struct Finalize {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Database = std::unique_ptr<sqlite3, CloseDatabase>;
using Statement = std::unique_ptr<sqlite3_stmt, Finalize>;

/// "file:" URI of a path: everything but plain characters as %XX, so that '?' and '#' are no
/// syntax.
std::string file_uri(const std::string& path) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  std::string uri = "file:";
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '/' || c == '.' || c == '-' || c == '_';
    if (plain) {
      uri += c;
    } else {
      uri += {'%', kHex[byte >> 4], kHex[byte & 15]};
    }
  }
  // immutable: no locks, no journal, and nothing is ever written beside the file.
  return uri + "?mode=ro&immutable=1";
}

class SqliteReader final : public Reader {
 public:
  explicit SqliteReader(std::string path) : path_(std::move(path)) {
    info_.format = "jupedsim-sqlite";
  }

  absl::Status open(const ReadOptions& options) {
    if (absl::Status s = require_metres(path_, options, "JuPedSim"); !s.ok()) return s;
    sqlite3* raw = nullptr;
    const int result = sqlite3_open_v2(file_uri(path_).c_str(), &raw,
                                       SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    database_.reset(raw);
    if (result != SQLITE_OK) return broken("open");
    // The file may come from anywhere: no code in its schema, damaged pages are found early.
    sqlite3_db_config(raw, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(raw, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_db_config(raw, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
    sqlite3_db_config(raw, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
    sqlite3_limit(raw, SQLITE_LIMIT_LENGTH, static_cast<int>(kMaxWktBytes));
    sqlite3_exec(raw, "PRAGMA cell_size_check=ON", nullptr, nullptr, nullptr);

    if (absl::Status s = read_columns(); !s.ok()) return s;
    if (absl::Status s = read_metadata(options); !s.ok()) return s;
    if (absl::Status s = read_geometry(); !s.ok()) return s;
    for (const char* ending : {"-wal", "-journal"}) {
      struct stat status {};
      if (::stat((path_ + ending).c_str(), &status) == 0 && status.st_size > 0) {
        info_.notes.push_back(absl::StrCat("there is a ", ending,
                                           " file beside it: it may still be written, and what is "
                                           "not in the main file yet is not read"));
      }
    }

    std::string sql = "SELECT rowid, frame, id, pos_x, pos_y";
    if (columns_.heading) sql += ", ori_x, ori_y";
    for (const std::string& channel : info_.channel_names) {
      sql += ", \"";
      for (const char c : channel) sql += c == '"' ? std::string("\"\"") : std::string(1, c);
      sql += '"';
    }
    if (absl::Status s = prepare(sql + " FROM trajectory_data ORDER BY frame, id", rows_);
        !s.ok()) {
      return s;
    }
    if (has_frame_data_) {
      if (auto s = prepare("SELECT DISTINCT frame FROM frame_data ORDER BY frame", frames_);
          !s.ok()) {
        return s;
      }
      if (absl::Status s = step_frames(); !s.ok()) return s;
    }
    if (absl::Status s = step_rows(); !s.ok()) return s;
    if (rows_end_ && frames_end_) {
      return fault(path_, "table trajectory_data has no rows; the simulation wrote nothing");
    }
    first_frame_ = rows_end_     ? frames_frame_
                   : frames_end_ ? row_frame_
                                 : std::min(row_frame_, frames_frame_);
    return absl::OkStatus();
  }

  const Info& info() const override { return info_; }
  std::int64_t frames_inserted() const override { return inserted_; }

  absl::StatusOr<bool> next(Frame& frame) override {
    if (rows_end_ && frames_end_) return false;
    std::int64_t current = rows_end_     ? frames_frame_
                           : frames_end_ ? row_frame_
                                         : std::min(row_frame_, frames_frame_);
    // JuPedSim writes every frame, so without frame_data (version 1) a gap is a time with nobody:
    // one empty frame says that all have left.
    if (!has_frame_data_ && last_had_agents_ && current > last_frame_ + 1) {
      current = last_frame_ + 1;
      ++inserted_;
    }
    const double time_s =
        (static_cast<double>(current) - static_cast<double>(first_frame_)) / info_.fps;
    if (!(std::abs(time_s) <= kMaxTimeS)) {
      return fault(path_, absl::StrCat("table trajectory_data: frame is ", current, ", ",
                                       number_text(time_s), " s after the first; at most ",
                                       number_text(kMaxTimeS), " s are allowed"));
    }
    clear_frame(columns_, std::llround(time_s * 1e6), frame);
    while (!rows_end_ && row_frame_ == current) {
      if (!frame.ids.empty() && frame.ids.back() == row_id_) {
        return row_fault(absl::StrCat("agent ", row_id_, " is there twice in frame ", current));
      }
      if (frame.ids.size() >= kMaxAgentsPerFrame) {
        return row_fault(absl::StrCat("more than ", kMaxAgentsPerFrame, " agents in one frame"));
      }
      append_row(columns_, row_id_, values_, frame);
      if (absl::Status s = step_rows(); !s.ok()) return s;
    }
    while (!frames_end_ && frames_frame_ <= current) {
      if (absl::Status s = step_frames(); !s.ok()) return s;
    }
    last_frame_ = current;
    last_had_agents_ = !frame.ids.empty();
    return true;
  }

 private:
  absl::Status broken(std::string_view what) const {
    const char* text = database_ ? sqlite3_errmsg(database_.get()) : "not enough memory";
    return absl::InvalidArgumentError(
        absl::StrCat(path_, ": ", absl::string_view(what.data(), what.size()), ": ", text,
                     "; the file is damaged, cut short, or not JuPedSim's"));
  }

  absl::Status row_fault(std::string_view message) const {
    return absl::InvalidArgumentError(
        absl::StrCat(path_, ", table trajectory_data, row ", sqlite3_column_int64(rows_.get(), 0),
                     ": ", absl::string_view(message.data(), message.size())));
  }

  absl::Status prepare(const std::string& sql, Statement& statement) {
    sqlite3_stmt* raw = nullptr;
    const int result = sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &raw, nullptr);
    statement.reset(raw);
    if (result != SQLITE_OK) return broken(sql);
    return absl::OkStatus();
  }

  /// Whether a table (not a view) of that name is there, and its columns.
  absl::StatusOr<std::vector<std::string>> table_columns(const std::string& table) {
    Statement statement;
    if (absl::Status s = prepare(
            "SELECT 1 FROM sqlite_master WHERE type='table' AND name='" + table + "'", statement);
        !s.ok()) {
      return s;
    }
    std::vector<std::string> names;
    int result = sqlite3_step(statement.get());
    if (result == SQLITE_DONE) return names;
    if (result != SQLITE_ROW) return broken("list of tables");
    if (absl::Status s = prepare("PRAGMA table_info(" + table + ")", statement); !s.ok()) return s;
    while ((result = sqlite3_step(statement.get())) == SQLITE_ROW) {
      const auto* name = reinterpret_cast<const char*>(sqlite3_column_text(statement.get(), 1));
      if (name != nullptr) names.emplace_back(name);
      if (names.size() > kMaxColumns) break;
    }
    if (result != SQLITE_DONE && result != SQLITE_ROW) return broken("columns of " + table);
    return names;
  }

  absl::Status read_columns() {
    absl::StatusOr<std::vector<std::string>> names = table_columns("trajectory_data");
    if (!names.ok()) return names.status();
    if (names->empty()) {
      return fault(path_, "there is no table trajectory_data; this is not a JuPedSim trajectory");
    }
    bool ori_x = false, ori_y = false;
    std::vector<std::string> missing = {"frame", "id", "pos_x", "pos_y"};
    for (const std::string& name : *names) {
      const auto known = std::find(missing.begin(), missing.end(), name);
      if (known != missing.end()) {
        missing.erase(known);
      } else if (name == "ori_x") {
        ori_x = true;
      } else if (name == "ori_y") {
        ori_y = true;
      } else if (info_.channel_names.size() < kMaxColumns) {
        info_.channel_names.push_back(name);
      }
    }
    if (!missing.empty()) {
      return fault(path_, absl::StrCat("table trajectory_data has no column ", missing.front(),
                                       "; needed are frame, id, pos_x and pos_y"));
    }
    // Version 3 dropped them, files upgraded from version 2 still have them: the table decides.
    columns_.heading = ori_x && ori_y;
    columns_.channels = info_.channel_names.size();
    absl::StatusOr<std::vector<std::string>> frame_data = table_columns("frame_data");
    if (!frame_data.ok()) return frame_data.status();
    has_frame_data_ =
        std::find(frame_data->begin(), frame_data->end(), "frame") != frame_data->end();
    return absl::OkStatus();
  }

  absl::Status read_metadata(const ReadOptions& options) {
    absl::StatusOr<std::vector<std::string>> names = table_columns("metadata");
    if (!names.ok()) return names.status();
    std::optional<double> fps;
    if (!names->empty()) {
      Statement statement;
      if (auto s =
              prepare("SELECT value, key FROM metadata WHERE key IN ('fps', 'version')", statement);
          !s.ok()) {
        return s;
      }
      int result = SQLITE_DONE;
      while ((result = sqlite3_step(statement.get())) == SQLITE_ROW) {
        const auto* value = reinterpret_cast<const char*>(sqlite3_column_text(statement.get(), 0));
        const auto* key = reinterpret_cast<const char*>(sqlite3_column_text(statement.get(), 1));
        const std::string_view text = value != nullptr ? value : "";
        double number = 0.0;
        if (!parse_number(trimmed(text), number) || !std::isfinite(number)) {
          return fault(path_, absl::StrCat("table metadata: ", key != nullptr ? key : "?", " is ",
                                           quoted(text), ", must be a number"));
        }
        if (key != nullptr && std::string_view(key) == "fps") {
          fps = number;
        } else if (number < 1.0 || number > 3.0) {
          info_.notes.push_back(absl::StrCat("schema version ", number_text(number),
                                             " is newer than this reader (1 to 3)"));
        }
      }
      if (result != SQLITE_DONE) return broken("table metadata");
    }
    absl::StatusOr<double> rate =
        resolve_fps(path_, fps, options, "table metadata does not say the frame rate (key fps)");
    if (!rate.ok()) return rate.status();
    info_.fps = *rate;
    return absl::OkStatus();
  }

  absl::Status read_geometry() {
    absl::StatusOr<std::vector<std::string>> names = table_columns("geometry");
    if (!names.ok()) return names.status();
    if (std::find(names->begin(), names->end(), "wkt") == names->end()) return absl::OkStatus();
    // The geometry may change from frame to frame; the first is the walkable area that is shown.
    const bool linked =
        has_frame_data_ && std::find(names->begin(), names->end(), "hash") != names->end();
    Statement statement;
    if (absl::Status s = prepare(
            linked ? "SELECT wkt FROM geometry WHERE hash = (SELECT geometry_hash FROM frame_data "
                     "ORDER BY frame LIMIT 1) UNION ALL SELECT wkt FROM geometry LIMIT 1"
                   : "SELECT wkt FROM geometry LIMIT 1",
            statement);
        !s.ok()) {
      return s;
    }
    int result = sqlite3_step(statement.get());
    if (result == SQLITE_ROW) {
      const auto* wkt = reinterpret_cast<const char*>(sqlite3_column_text(statement.get(), 0));
      if (wkt != nullptr) info_.walkable_area_wkt = wkt;
    } else if (result != SQLITE_DONE) {
      return broken("table geometry");
    }
    if (auto s = prepare("SELECT count(*) FROM geometry", statement); !s.ok()) return s;
    result = sqlite3_step(statement.get());
    if (result != SQLITE_ROW) return broken("table geometry");
    const std::int64_t count = sqlite3_column_int64(statement.get(), 0);
    if (count > 1) {
      info_.notes.push_back(
          absl::StrCat("the geometry changes (", count, " of them); the first is used"));
    }
    return absl::OkStatus();
  }

  absl::Status step_frames() {
    const int result = sqlite3_step(frames_.get());
    if (result == SQLITE_DONE) {
      frames_end_ = true;
      return absl::OkStatus();
    }
    if (result != SQLITE_ROW) return broken("table frame_data");
    if (sqlite3_column_type(frames_.get(), 0) != SQLITE_INTEGER) {
      return fault(path_, "table frame_data: frame is not an integer");
    }
    frames_frame_ = sqlite3_column_int64(frames_.get(), 0);
    frames_end_ = false;
    if (std::abs(static_cast<double>(frames_frame_)) > kMaxInteger) {
      return fault(path_,
                   absl::StrCat("table frame_data: frame is ", frames_frame_, ", at most 2^53"));
    }
    return absl::OkStatus();
  }

  absl::Status number_column(int column, std::string_view name, double& value) const {
    const int type = sqlite3_column_type(rows_.get(), column);
    if (type != SQLITE_FLOAT && type != SQLITE_INTEGER) {
      return row_fault(absl::StrCat(std::string(name), " is ",
                                    type == SQLITE_NULL ? "empty" : "not a number",
                                    "; correct or delete the row"));
    }
    value = sqlite3_column_double(rows_.get(), column);
    return absl::OkStatus();
  }

  absl::Status step_rows() {
    const int result = sqlite3_step(rows_.get());
    if (result == SQLITE_DONE) {
      rows_end_ = true;
      return absl::OkStatus();
    }
    if (result != SQLITE_ROW) return broken("table trajectory_data");
    rows_end_ = false;
    sqlite3_stmt* row = rows_.get();
    if (sqlite3_column_type(row, 1) != SQLITE_INTEGER) return row_fault("frame is not an integer");
    row_frame_ = sqlite3_column_int64(row, 1);
    if (std::abs(static_cast<double>(row_frame_)) > kMaxInteger) {
      return row_fault(absl::StrCat("frame is ", row_frame_, ", at most 2^53"));
    }
    const std::int64_t id = sqlite3_column_int64(row, 2);
    if (sqlite3_column_type(row, 2) != SQLITE_INTEGER || id < 0) {
      return row_fault("id must be an integer from 0");
    }
    row_id_ = static_cast<std::uint64_t>(id);
    values_.clear();
    double value = 0.0;
    for (int axis = 0; axis < 2; ++axis) {
      const char* name = axis == 0 ? "pos_x" : "pos_y";
      if (absl::Status s = number_column(3 + axis, name, value); !s.ok()) return s;
      if (!(std::abs(value) <= kMaxPositionM)) {
        return row_fault(absl::StrCat(name, " is ", number_text(value), " m, at most 1e8 m"));
      }
      values_.push_back(value);
    }
    int column = 5;
    if (columns_.heading) {
      double heading = std::numeric_limits<double>::quiet_NaN();
      // SQLite stores NaN as NULL; models without an orientation write (0, 0).
      const double ori_x = sqlite3_column_double(row, 5), ori_y = sqlite3_column_double(row, 6);
      if (std::isfinite(ori_x) && std::isfinite(ori_y) && (ori_x != 0.0 || ori_y != 0.0)) {
        heading = std::atan2(ori_y, ori_x);
      }
      values_.push_back(heading);
      column = 7;
    }
    for (std::size_t i = 0; i < columns_.channels; ++i, ++column) {
      const int type = sqlite3_column_type(row, column);
      value = sqlite3_column_double(row, column);
      const bool number = type == SQLITE_FLOAT || type == SQLITE_INTEGER;
      values_.push_back(
          number && std::abs(value) <= 3e38 ? value : std::numeric_limits<double>::quiet_NaN());
    }
    return absl::OkStatus();
  }

  std::string path_;
  Info info_;
  Columns columns_;
  Database database_;
  Statement rows_, frames_;
  bool has_frame_data_ = false;
  bool rows_end_ = false, frames_end_ = true;
  std::int64_t row_frame_ = 0, frames_frame_ = 0, first_frame_ = 0;
  std::uint64_t row_id_ = 0;
  std::vector<double> values_;
  bool last_had_agents_ = false;
  std::int64_t last_frame_ = 0;
  std::int64_t inserted_ = 0;
};

}  // namespace

ReaderOr open_jupedsim_sqlite(const std::string& path, const ReadOptions& options) {
  auto reader = std::make_unique<SqliteReader>(path);
  if (absl::Status status = reader->open(options); !status.ok()) return status;
  return std::unique_ptr<Reader>(std::move(reader));
}

}  // namespace throng::trajectory::detail
