#include <gmock/gmock.h>

#include <cmath>

#include "fixture.hpp"

namespace throng::trajectory {
namespace {

using test::expect_error;
using test::FileTest;
using test::read_all;
using test::Reading;
using ::testing::ElementsAre;

class ArchiveTextTest : public FileTest {};

constexpr const char* kGood =
    "# PeTrack project: demo.pet\n"
    "# framerate: 25 fps\n"
    "# z: can be 3d position or height of person\n"
    "# id frame x/m y/m z/m\n"
    "1 10 1.5 2.5 1.76\n"
    "1 11 1.6 2.5 1.76\n"
    "2 11 -3 4 1.80\n"
    "2 12 -3.1 4 1.80\n";

TEST_F(ArchiveTextTest, RowsSortedByAgentComeOutByFrame) {
  const Reading reading = read_all(write("a.txt", kGood));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.format, "archive-text");
  EXPECT_EQ(reading.info.fps, 25.0);
  ASSERT_EQ(reading.frames.size(), 3u);
  EXPECT_EQ(reading.frames[0].time_us, 0);
  EXPECT_EQ(reading.frames[2].time_us, 80000);
  EXPECT_THAT(reading.frames[1].ids, ElementsAre(1u, 2u));
  EXPECT_THAT(reading.frames[1].x_m, ElementsAre(1.6, -3.0));
  EXPECT_TRUE(reading.frames[1].z_m.empty()) << "the height of heads is no ground";
  EXPECT_TRUE(reading.frames[1].heading_rad.empty());
}

TEST_F(ArchiveTextTest, GroundZIsReadOnlyWhenAskedFor) {
  ReadOptions options;
  options.ground_z = true;
  const Reading reading = read_all(write("a.txt", kGood), options);
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_THAT(reading.frames[1].z_m, ElementsAre(1.76, 1.80));
}

TEST_F(ArchiveTextTest, BytesThatEditorsAddAreNoData) {
  const Reading reading =
      read_all(write("a.txt",
                     "\xEF\xBB\xBF# framerate: 25.00\r\n\r\n# "
                     "id\tframe\tx/cm\ty/cm\tz/cm\r\n\r\n1\t0\t150\t-20\t176\r\n"
                     "1 1  +151   -20.5 176"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  ASSERT_EQ(reading.frames.size(), 2u);
  EXPECT_DOUBLE_EQ(reading.frames[0].x_m[0], 1.5);
  EXPECT_DOUBLE_EQ(reading.frames[1].y_m[0], -0.205);
}

TEST_F(ArchiveTextTest, GzippedFileReadsAlike) {
  const Reading reading = read_all(write_gz("a.txt.gz", kGood));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.frames.size(), 3u);
}

TEST_F(ArchiveTextTest, ViewDirectionBecomesHeadingAndZeroIsUnknown) {
  const Reading reading =
      read_all(write("a.txt",
                     "# framerate: 10\n# id frame x/m y/m z/m viewDirX viewDirY\n"
                     "1 0 0 0 1.7 0 1\n2 0 1 1 1.7 0 0\n"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_NEAR(reading.frames[0].heading_rad[0], M_PI / 2, 1e-6);
  EXPECT_TRUE(std::isnan(reading.frames[0].heading_rad[1]));
}

TEST_F(ArchiveTextTest, EverybodyGoneMeansAnEmptyFrame) {
  const Reading reading = read_all(
      write("a.txt",
            "# framerate: 10\n# x/m\n1 0 0 0\n1 1 0 0\n1 2 0 0\n2 50 5 5\n2 51 5 5\n2 53 5 5\n"),
      test::with_unit(1.0));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  ASSERT_EQ(reading.frames.size(), 7u);
  EXPECT_EQ(reading.inserted, 1);
  EXPECT_EQ(reading.frames[3].time_us, 300000);
  EXPECT_TRUE(reading.frames[3].ids.empty());
  EXPECT_EQ(reading.frames[4].time_us, 5000000);
  EXPECT_EQ(reading.frames[6].time_us, 5300000) << "a lost frame of somebody who stays is no exit";
}

TEST_F(ArchiveTextTest, MissingRateNamesTheOption) {
  expect_error(read_all(write("a.txt", "1 0 1 2\n"), test::with_unit(1.0)).status,
               {path("a.txt"), "frame rate", "--source-fps"});
}

TEST_F(ArchiveTextTest, MissingUnitNamesTheOption) {
  expect_error(read_all(write("a.txt", "# framerate: 25\n1 0 1 2\n")).status,
               {path("a.txt"), "--source-unit"});
}

TEST_F(ArchiveTextTest, OptionsFillWhatTheFileLeavesOut) {
  const Reading reading =
      read_all(write("a.txt", "1 0 100 200 170\n"), test::with_fps_and_unit(16, 0.01));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.fps, 16.0);
  EXPECT_DOUBLE_EQ(reading.frames[0].x_m[0], 1.0);
}

TEST_F(ArchiveTextTest, ContradictionsAreErrors) {
  const std::string file = write("a.txt", kGood);
  expect_error(read_all(file, test::with_fps(30)).status, {file, "30", "25", "--source-fps"});
  expect_error(read_all(file, test::with_unit(0.01)).status, {file, "0.01", "--source-unit"});
  expect_error(
      read_all(write("b.txt", "# framerate: 25\n# x in m\n# id frame x/cm y/cm z/cm\n1 0 1 2 3\n"))
          .status,
      {"line 3", "line 2"});
  expect_error(
      read_all(write("c.txt", "# framerate: 25\n# framerate: 16\n# x/m\n1 0 1 2 3\n")).status,
      {"line 2", "16", "25", "line 1"});
}

TEST_F(ArchiveTextTest, BrokenRowsAreNamedWithTheirLine) {
  const std::string head = "# framerate: 25\n# id frame x/m y/m z/m\n1 0 1 2 1.7\n";
  expect_error(read_all(write("a.txt", head + "1 1 x 2 1.7\n")).status,
               {path("a.txt"), "line 4", "'x'"});
  expect_error(read_all(write("a.txt", head + "1 1 1,5 2 1.7\n")).status, {"line 4", "comma"});
  expect_error(read_all(write("a.txt", head + "1 1.5 1 2 1.7\n")).status,
               {"line 4", "frame", "'1.5'"});
  expect_error(read_all(write("a.txt", head + "-1 1 1 2 1.7\n")).status, {"line 4", "id", "'-1'"});
  expect_error(read_all(write("a.txt", head + "1 1 nan 2 1.7\n")).status, {"line 4", "x is nan"});
  expect_error(read_all(write("a.txt", head + "1 1 1e9 2 1.7\n")).status, {"line 4", "1e8"});
  expect_error(read_all(write("a.txt", head + "1 0 3 2 1.7\n")).status,
               {"line 4", "twice", "line 3"});
  expect_error(read_all(write("a.txt", head + "1 99999999999999999999 3 2 1.7\n")).status,
               {"line 4", "frame"});
}

TEST_F(ArchiveTextTest, TruncatedFileSaysSo) {
  const std::string good = kGood;
  expect_error(read_all(write("a.txt", good.substr(0, good.size() - 9))).status,
               {"line 8", "cut short", "last line"});
  expect_error(read_all(write("a.txt", "# framerate: 25\n# id frame x/m y/m z/m\n")).status,
               {path("a.txt"), "cut short"});
  std::string packed(good);
  const std::string file = write_gz("b.txt.gz", good);
  std::string bytes;
  {
    FILE* in = std::fopen(file.c_str(), "rb");
    char buffer[4096];
    bytes.assign(buffer, std::fread(buffer, 1, sizeof buffer, in));
    std::fclose(in);
  }
  expect_error(read_all(write("c.txt.gz", bytes.substr(0, bytes.size() / 2))).status,
               {"cut short"});
}

TEST_F(ArchiveTextTest, HostileFilesEndInOneError) {
  expect_error(read_all(write("a.txt", "")).status, {"empty"});
  expect_error(read_all(write("a.txt", " \n\n")).status, {"blanks"});
  expect_error(read_all(write("a.txt", std::string("\x7f"
                                                   "ELF\0\0\0\0",
                                                   8)))
                   .status,
               {"binary"});
  expect_error(read_all(write("a.txt", "1 0 1 2 3\n" + std::string(3u << 20, '7'))).status,
               {"--source-fps"});
  expect_error(read_all(write("a.txt", "# framerate: 25\n# x in m\n1 0 1 2 3\n" +
                                           std::string(3u << 20, '7')))
                   .status,
               {"line 4", "longer"});
  expect_error(read_all(write("a.txt", "# framerate: 0\n# x/m\n1 0 1 2 3\n")).status,
               {"line 1", "0"});
  EXPECT_EQ(read_all(path("nothing")).status.code(), absl::StatusCode::kNotFound);
  expect_error(read_all(path(".")).status, {"regular file"});
  // Frames at both ends of what is allowed cost no more than two frames.
  const Reading far = read_all(write(
      "a.txt", "# framerate: 100000\n# x in m\n1 -9007199254740992 0 0\n1 9007199254740992 1 1\n"));
  ASSERT_TRUE(far.status.ok()) << far.status;
  EXPECT_EQ(far.frames.size(), 2u);
}

TEST_F(ArchiveTextTest, MoreRowsThanMemoryAreSortedThroughAFile) {
  std::string text = "# framerate: 25\n# x in m\n";
  for (int id = 0; id < 50; ++id) {
    for (int frame = 0; frame < 200; ++frame) {
      text += std::to_string(id) + " " + std::to_string(frame) + " " + std::to_string(id) + " " +
              std::to_string(frame) + "\n";
    }
  }
  ReadOptions options;
  options.memory_bytes = 10000;
  const Reading reading = read_all(write("a.txt", text), options);
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  ASSERT_EQ(reading.frames.size(), 200u);
  for (int frame = 0; frame < 200; ++frame) {
    const Frame& got = reading.frames[static_cast<std::size_t>(frame)];
    ASSERT_EQ(got.ids.size(), 50u);
    EXPECT_EQ(got.ids[49], 49u);
    EXPECT_EQ(got.x_m[49], 49.0);
    EXPECT_EQ(got.y_m[0], frame);
  }
  const bool noted =
      std::any_of(reading.info.notes.begin(), reading.info.notes.end(),
                  [](const std::string& note) { return note.find("temporary") != note.npos; });
  EXPECT_TRUE(noted);
}

TEST_F(ArchiveTextTest, MutatedFilesNeverCrash) {
  test::survive_mutations(write("a.txt", kGood), path("m.txt"), 3000);
}

constexpr const char* kJpscore =
    "#description: jpscore (0.9.6)\n#count: 1\n#framerate: 8.00\n#geometry: geo.xml\n"
    "#ID: the agent ID\n#FR: the current frame\n#X,Y,Z: the agents coordinates (in metres)\n"
    "#A, B: semi-axes of the ellipse\n#ANGLE: orientation of the ellipse\n\n"
    "#ID\tFR\tX\tY\tZ\tA\tB\tANGLE\tCOLOR\n"
    "1\t0\t1.0\t2.0\t0.0\t0.2\t0.3\t90.0\t255\n2\t0\t3.0\t4.0\t0.0\t0.2\t0.3\t-180.0\t120\n";

class JpscoreTextTest : public FileTest {};

TEST_F(JpscoreTextTest, AngleIsDegreesAndColourAChannel) {
  const Reading reading = read_all(write("a.txt", kJpscore));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.format, "jpscore-text");
  EXPECT_EQ(reading.info.fps, 8.0);
  EXPECT_NEAR(reading.frames[0].heading_rad[0], M_PI / 2, 1e-6);
  EXPECT_NEAR(std::abs(reading.frames[0].heading_rad[1]), M_PI, 1e-6);
  EXPECT_THAT(reading.info.channel_names, ElementsAre("a", "b", "color"));
  EXPECT_THAT(reading.frames[0].channels[2], ElementsAre(255.0f, 120.0f));
}

TEST_F(JpscoreTextTest, CentimetresContradictIt) {
  expect_error(read_all(write("a.txt", kJpscore), test::with_unit(0.01)).status, {"--source-unit"});
}

TEST_F(JpscoreTextTest, TruncatedRowIsNamed) {
  expect_error(read_all(write("a.txt", std::string(kJpscore) + "3\t0\t1")).status,
               {"line 14", "cut short"});
}

TEST_F(JpscoreTextTest, MutatedFilesNeverCrash) {
  test::survive_mutations(write("a.txt", kJpscore), path("m.txt"), 2000);
}

class ObsmatTest : public FileTest {};

constexpr const char* kObsmat =
    "  1.0e+00 1.0e+00 -2.5 0.0e+00 18.5 0 0 -1.3\n  1.1e+01 1.0e+00 -2.5 0.0e+00 18.0 0 0 -1.3\n"
    "  2.1e+01 2.0e+00 5 0 3 0 0 0\n";

TEST_F(ObsmatTest, GroundIsTheThirdAndFifthColumn) {
  const Reading reading = read_all(write("obsmat.txt", kObsmat));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.format, "obsmat");
  EXPECT_DOUBLE_EQ(reading.info.fps, 2.5);
  ASSERT_EQ(reading.frames.size(), 3u);
  EXPECT_EQ(reading.frames[1].time_us, 400000);
  EXPECT_EQ(reading.frames[0].x_m[0], -2.5);
  EXPECT_EQ(reading.frames[0].y_m[0], 18.5);
}

TEST_F(ObsmatTest, RateOfTheVideoMayBeGiven) {
  const Reading reading = read_all(write("obsmat.txt", kObsmat), test::with_fps(50));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_DOUBLE_EQ(reading.info.fps, 5.0);
  expect_error(read_all(write("obsmat.txt", kObsmat), test::with_fps(-1)).status,
               {"--source-fps", "-1"});
  expect_error(read_all(write("obsmat.txt", kObsmat), test::with_unit(0.01)).status,
               {"--source-unit"});
}

TEST_F(ObsmatTest, TruncatedRowIsNamed) {
  expect_error(read_all(write("obsmat.txt", std::string(kObsmat) + " 3.1e+01 2.0 5")).status,
               {"line 4", "cut short"});
}

TEST_F(ObsmatTest, MutatedFilesNeverCrash) {
  test::survive_mutations(write("obsmat.txt", kObsmat), path("m.txt"), 2000);
}

}  // namespace
}  // namespace throng::trajectory
