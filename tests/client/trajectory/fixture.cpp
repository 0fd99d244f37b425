#include "fixture.hpp"

#include <gmock/gmock.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

namespace throng::trajectory::test {

FileTest::FileTest() {
  std::string name = ::testing::TempDir() + "throng-trajectory-XXXXXX";
  EXPECT_NE(mkdtemp(name.data()), nullptr);
  folder_ = name;
}

FileTest::~FileTest() {
  std::error_code error;
  std::filesystem::remove_all(folder_, error);
}

std::string FileTest::write(const std::string& name, std::string_view bytes) const {
  std::ofstream(path(name), std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return path(name);
}

std::string FileTest::write_gz(const std::string& name, std::string_view bytes) const {
  gzFile file = gzopen(path(name).c_str(), "wb");
  EXPECT_EQ(gzwrite(file, bytes.data(), static_cast<unsigned>(bytes.size())),
            static_cast<int>(bytes.size()));
  gzclose(file);
  return path(name);
}

Reading read_all(const std::string& path, const ReadOptions& options) {
  Reading reading;
  absl::StatusOr<std::unique_ptr<Reader>> reader = open(path, options);
  if (!reader.ok()) {
    reading.status = reader.status();
    return reading;
  }
  Frame frame;
  while (true) {
    absl::StatusOr<bool> more = (*reader)->next(frame);
    if (!more.ok()) reading.status = more.status();
    if (!more.ok() || !*more) break;
    reading.frames.push_back(frame);
  }
  reading.info = (*reader)->info();
  reading.inserted = (*reader)->frames_inserted();
  return reading;
}

void expect_error(const absl::Status& status, const std::vector<std::string>& pieces) {
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  for (const std::string& piece : pieces) {
    EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr(piece));
  }
}

ReadOptions with_fps(double fps) {
  ReadOptions options;
  options.source_fps = fps;
  return options;
}

ReadOptions with_unit(double metres) {
  ReadOptions options;
  options.source_unit_m = metres;
  return options;
}

ReadOptions with_fps_and_unit(double fps, double metres) {
  ReadOptions options = with_fps(fps);
  options.source_unit_m = metres;
  return options;
}

void write_sqlite(const std::string& path, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  char* error = nullptr;
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, &error), SQLITE_OK)
      << (error != nullptr ? error : "");
  sqlite3_free(error);
  sqlite3_close(database);
}

void survive_mutations(const std::string& good_path, const std::string& scratch_path, int count,
                       const ReadOptions& options) {
  std::ifstream input(good_path, std::ios::binary);
  const std::string good{std::istreambuf_iterator<char>(input), std::istreambuf_iterator<char>()};
  ASSERT_FALSE(good.empty());
  std::mt19937 random(20260101);  // the same files every time
  const auto below = [&](std::size_t limit) { return random() % std::max<std::size_t>(limit, 1); };
  static constexpr std::string_view kNasty[] = {"-",
                                                "nan",
                                                "inf",
                                                "1e999",
                                                "99999999999999999999",
                                                "\n",
                                                "\0",
                                                "\"",
                                                "<",
                                                "&",
                                                ";",
                                                ",",
                                                "\t",
                                                "#",
                                                "-1",
                                                "1e300",
                                                "9223372036854775807",
                                                "  ",
                                                "{",
                                                "]",
                                                "0",
                                                "\xff\xfe"};
  int failed = 0;
  for (int i = 0; i < count && !::testing::Test::HasFailure(); ++i) {
    std::string bad = good;
    for (std::size_t edits = 1 + below(4); edits > 0 && !bad.empty(); --edits) {
      const std::size_t at = below(bad.size());
      switch (below(6)) {
        case 0:
          bad.resize(at);
          break;
        case 1:
          bad[at] = static_cast<char>(random());
          break;
        case 2:
          bad[at] = static_cast<char>(bad[at] ^ (1 << below(8)));
          break;
        case 3:
          bad.erase(at, 1 + below(20));
          break;
        case 4:
          bad.insert(at, bad.substr(below(bad.size()), 1 + below(60)));
          break;
        default:
          bad.insert(at, kNasty[below(std::size(kNasty))]);
          break;
      }
    }
    // A new file each time: file systems flush one that is cut to nothing and written again.
    std::filesystem::remove(scratch_path);
    std::ofstream(scratch_path, std::ios::binary)
        .write(bad.data(), static_cast<std::streamsize>(bad.size()));

    absl::StatusOr<std::unique_ptr<Reader>> reader = open(scratch_path, options);
    absl::Status status = reader.status();
    std::int64_t last_us = -1;
    Frame frame;
    for (int frames = 0; reader.ok() && frames < 2000; ++frames) {
      absl::StatusOr<bool> more = (*reader)->next(frame);
      if (!more.ok()) status = more.status();
      if (!more.ok() || !*more) break;
      ASSERT_GT(frame.time_us, last_us);
      last_us = frame.time_us;
      const std::size_t agents = frame.ids.size();
      ASSERT_EQ(frame.x_m.size(), agents);
      ASSERT_EQ(frame.y_m.size(), agents);
      ASSERT_TRUE(frame.z_m.empty() || frame.z_m.size() == agents);
      ASSERT_TRUE(frame.heading_rad.empty() || frame.heading_rad.size() == agents);
      ASSERT_EQ(frame.channels.size(), (*reader)->info().channel_names.size());
      for (const auto& channel : frame.channels) ASSERT_EQ(channel.size(), agents);
      for (const double x : frame.x_m) ASSERT_TRUE(std::isfinite(x));
      for (const double y : frame.y_m) ASSERT_TRUE(std::isfinite(y));
    }
    if (!status.ok()) {
      ++failed;
      ASSERT_NE(std::string(status.message()).find(scratch_path), std::string::npos) << status;
    }
  }
  // Most damage is noticed; if none is, the mutations do not reach the reader.
  EXPECT_GT(failed, 0);
}

}  // namespace throng::trajectory::test
