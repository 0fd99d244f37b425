#include "throng/trajectory/writer.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>

#include "fixture.hpp"

namespace throng::trajectory {
namespace {

using test::expect_error;
using test::FileTest;
using test::read_all;
using test::Reading;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class WriterTest : public FileTest {
 protected:
  /// Times in thirds of a second, a heading, a channel and a moment with nobody.
  std::string good() const {
    return write("in.csv",
                 "time_s,id,x_m,y_m,heading_rad,speed\n"
                 "0,4,0.1,-2.25,1.5,1.25\n0,9,3,4,,\n0.1,4,0.30000000000000004,-2.25,1.5,1\n"
                 "0.4,12,5,5,0,1\n0.5,12,5,5,0,1\n0.6,12,5,5,0,1\n");
  }
  static void expect_equal(const Reading& a, const Reading& b, bool channels) {
    ASSERT_TRUE(a.status.ok()) << a.status;
    ASSERT_TRUE(b.status.ok()) << b.status;
    EXPECT_NEAR(a.info.fps, b.info.fps, 1e-6);
    ASSERT_EQ(a.frames.size(), b.frames.size());
    for (std::size_t i = 0; i < a.frames.size(); ++i) {
      EXPECT_EQ(a.frames[i].time_us, b.frames[i].time_us);
      EXPECT_EQ(a.frames[i].ids, b.frames[i].ids);
      EXPECT_EQ(a.frames[i].x_m, b.frames[i].x_m) << "every digit survives";
      EXPECT_EQ(a.frames[i].y_m, b.frames[i].y_m);
      for (std::size_t k = 0; k < a.frames[i].ids.size(); ++k) {
        const float heading = a.frames[i].heading_rad[k], again = b.frames[i].heading_rad[k];
        EXPECT_TRUE(std::isnan(heading) ? std::isnan(again) : std::abs(heading - again) < 1e-5f);
        if (channels && !std::isnan(a.frames[i].channels[0][k])) {
          EXPECT_EQ(a.frames[i].channels[0][k], b.frames[i].channels[0][k]);
        }
      }
    }
  }
};

TEST_F(WriterTest, CsvReadsBackAsItWas) {
  const absl::StatusOr<Summary> summary = convert(good(), path("out.csv"));
  ASSERT_TRUE(summary.ok()) << summary.status();
  expect_equal(read_all(path("in.csv")), read_all(path("out.csv")), true);
}

TEST_F(WriterTest, CsvKeepsWhatAgentsDoAndWhoTheyWereChosenToBe) {
  const std::string in =
      write("hints.csv",
            "time_s,id,x_m,y_m,motion,character\n"
            "0,1,1,2,sit,3\n0,2,3,4,,\n1,1,1,2,\"wave, both\",3\n1,2,3,4,sit,\n");
  ASSERT_TRUE(convert(in, path("out.csv")).ok());
  const Reading before = read_all(in), after = read_all(path("out.csv"));
  ASSERT_TRUE(after.status.ok()) << after.status;
  EXPECT_THAT(after.info.motion_names, ElementsAre("sit", "wave, both"));
  EXPECT_TRUE(after.info.channel_names.empty());
  ASSERT_EQ(after.frames.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(after.frames[i].motion, before.frames[i].motion);
  const auto reader = open(path("out.csv"));
  ASSERT_TRUE(reader.ok()) << reader.status();
  EXPECT_EQ((*reader)->agent_character(1), 3);
  EXPECT_EQ((*reader)->agent_character(2), -1);

  const absl::StatusOr<Summary> summary = convert(in, path("out.txt"));
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_THAT(summary->info.notes, Contains(HasSubstr("only CSV holds it")));
}

TEST_F(WriterTest, ArchiveTextReadsBackAsItWas) {
  ASSERT_TRUE(convert(good(), path("out.txt")).ok());
  const Reading reading = read_all(path("out.txt"));
  EXPECT_EQ(reading.info.format, "archive-text");
  expect_equal(read_all(path("in.csv")), reading, true);
}

TEST_F(WriterTest, SqliteKeepsMomentsWithNobody) {
  const absl::StatusOr<Summary> summary = convert(good(), path("out.sqlite"));
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_THAT(summary->info.notes, Contains(HasSubstr("channels")));
  const Reading reading = read_all(path("out.sqlite"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.format, "jupedsim-sqlite");
  EXPECT_NEAR(reading.info.fps, 10.0, 1e-6);
  ASSERT_EQ(reading.frames.size(), 7u);
  EXPECT_TRUE(reading.frames[2].ids.empty());
  EXPECT_TRUE(reading.frames[3].ids.empty());
  EXPECT_THAT(reading.frames[0].x_m, ElementsAre(0.1, 3.0));
  EXPECT_TRUE(std::isnan(reading.frames[0].heading_rad[1]));
}

TEST_F(WriterTest, NamesBecomeNumbersWhereTheFormatHasNone) {
  const std::string file =
      write("in.csv", "t,id,x_m,y_m\n0,anna,0,0\n0,\"ben, jr\",1,1\n1,anna,1,0\n");
  absl::StatusOr<Summary> summary = convert(file, path("out.txt"));
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_THAT(summary->info.notes, Contains(HasSubstr("order of appearance")));
  EXPECT_THAT(read_all(path("out.txt")).frames[0].ids, ElementsAre(1u, 2u));
  ASSERT_TRUE(convert(file, path("out.csv")).ok());
  EXPECT_EQ(read_all(path("out.csv")).frames[0].ids, read_all(file).frames[0].ids);
}

TEST_F(WriterTest, WalkableAreaGoesFromSqliteToSqlite) {
  test::write_sqlite(
      path("in.sqlite"),
      "CREATE TABLE trajectory_data(frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL);"
      "CREATE TABLE metadata(key TEXT, value TEXT); CREATE TABLE geometry(wkt TEXT);"
      "INSERT INTO metadata VALUES('fps','25'); INSERT INTO geometry VALUES('POLYGON ((0 0, 1 0, 1 "
      "1, 0 0))');"
      "INSERT INTO trajectory_data VALUES(0,1,1,2),(1,1,1,2);");
  ASSERT_TRUE(convert(path("in.sqlite"), path("out.sqlite")).ok());
  EXPECT_EQ(read_all(path("out.sqlite")).info.walkable_area_wkt, "POLYGON ((0 0, 1 0, 1 1, 0 0))");
}

TEST_F(WriterTest, FailedConversionLeavesTheOldFile) {
  const std::string irregular =
      write("in.csv", "t,id,x_m,y_m\n0,1,0,0\n1,1,1,0\n1.37,1,1,0\n5,1,1,0\n5.1,1,1,0\n");
  write("out.txt", "old");
  expect_error(convert(irregular, path("out.txt")).status(), {"frame rate to write", "CSV"});
  expect_error(convert(irregular, path("out.txt"), {}, "", 10).status(), {"1.37", "no frame"});
  EXPECT_EQ(std::filesystem::file_size(path("out.txt")), 3u);
  EXPECT_FALSE(std::filesystem::exists(path("out.txt.tmp")));
  expect_error(convert(irregular, path("out.bin")).status(), {".csv"});
  expect_error(convert(irregular, path("out.csv"), {}, "scb").status(),
               {"'scb'", "jupedsim-sqlite"});
  EXPECT_EQ(convert(irregular, path("no/such/folder.csv")).status().code(),
            absl::StatusCode::kUnavailable);
}

TEST_F(WriterTest, ConvertEndsWhereItIsToldToAndLeavesNoFile) {
  std::uint64_t last = 0, all = 0;
  const absl::Status status =
      convert(good(), path("out.csv"), {}, "", 0.0, [&](std::uint64_t frames, std::uint64_t of) {
        last = frames;
        all = of;
        return frames < 2;
      }).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(last, 2U);
  EXPECT_GE(all, 2U);
  EXPECT_FALSE(std::filesystem::exists(path("out.csv")));
}

TEST_F(WriterTest, ColumnsOfTheWrongLengthAreRefused) {
  WriteSpec spec;
  spec.fps = 25;
  absl::StatusOr<std::unique_ptr<Writer>> writer = make_writer(path("out.csv"), spec);
  ASSERT_TRUE(writer.ok());
  Frame frame;
  frame.ids = {1, 2};
  frame.x_m = {1.0};
  frame.y_m = {1.0, 2.0};
  expect_error((*writer)->write(frame), {"column", "2 agents"});
}

}  // namespace
}  // namespace throng::trajectory
