#include <absl/strings/str_cat.h>
#include <sqlite3.h>

#include <cerrno>
#include <cmath>
#include <cstdio>

#include "writers.hpp"

namespace throng::trajectory::detail {
namespace {

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
      const bool known = heading_known(frame, i);
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
      status = cannot_write(path_, errno);
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

}  // namespace

WriterOr write_jupedsim_sqlite(const std::string& path, const WriteSpec& spec) {
  return opened<SqliteWriter>(path, spec);
}

}  // namespace throng::trajectory::detail
