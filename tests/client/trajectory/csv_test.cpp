#include <gmock/gmock.h>

#include <cmath>

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

class CsvTest : public FileTest {};

constexpr const char* kGood =
    "time_s,id,x_m,y_m,heading_rad,speed,group\n"
    "0.0,1,1.5,2.5,1.57,1.2,red\n0.0,2,3,4,,0.9,blue\n0.1,1,1.6,2.5,1.57,,red\n0.2,2,3,5,0,1,"
    "blue\n";

TEST_F(CsvTest, ReadsTimesHeadingsAndChannels) {
  const Reading reading = read_all(write("a.csv", kGood));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.format, "csv");
  EXPECT_NEAR(reading.info.fps, 10.0, 1e-9);
  EXPECT_THAT(reading.info.channel_names, ElementsAre("speed"));
  ASSERT_EQ(reading.frames.size(), 3u);
  EXPECT_EQ(reading.frames[1].time_us, 100000);
  EXPECT_THAT(reading.frames[0].ids, ElementsAre(1u, 2u));
  EXPECT_FLOAT_EQ(reading.frames[0].heading_rad[0], 1.57f);
  EXPECT_TRUE(std::isnan(reading.frames[0].heading_rad[1]));
  EXPECT_THAT(reading.frames[0].channels[0], ElementsAre(1.2f, 0.9f));
  EXPECT_TRUE(std::isnan(reading.frames[1].channels[0][0]));
}

TEST_F(CsvTest, ColumnMotionSaysWhatAgentsDo) {
  const Reading reading =
      read_all(write("a.csv",
                     "time_s,id,x_m,y_m,motion,speed\n"
                     "0,1,1,2,sit,1\n0,2,3,4,,2\n1,1,1,2,cheer,3\n1,2,3,4,sit,4\n"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_THAT(reading.info.motion_names, ElementsAre("sit", "cheer"));
  EXPECT_THAT(reading.info.channel_names, ElementsAre("speed"));
  ASSERT_EQ(reading.frames.size(), 2u);
  EXPECT_THAT(reading.frames[0].motion, ElementsAre(1, 0));
  EXPECT_THAT(reading.frames[1].motion, ElementsAre(2, 1));
  EXPECT_THAT(reading.frames[1].channels[0], ElementsAre(3.0f, 4.0f));
}

TEST_F(CsvTest, CharactersThatAreNoCastMemberAreLeftOutAndTold) {
  const std::string file = write("a.csv",
                                 "time_s,id,x_m,y_m,character\n"
                                 "0,1,1,2,-1\n0,2,3,4,65536\n0,3,3,5,bob\n0,4,3,6,0\n");
  const auto reader = open(file);
  ASSERT_TRUE(reader.ok()) << reader.status();
  for (const std::uint64_t id : {1, 2, 3}) EXPECT_EQ((*reader)->agent_character(id), -1) << id;
  EXPECT_EQ((*reader)->agent_character(4), 0);
  EXPECT_THAT((*reader)->info().notes, Contains(HasSubstr("3 characters left out")));
}

TEST_F(CsvTest, MoreThanSixtyFourMotionsAreLeftOutAndTold) {
  std::string text = "time_s,id,x_m,y_m,motion\n";
  for (int i = 0; i < 70; ++i)
    text += "0," + std::to_string(i) + ",0,0,m" + std::to_string(i) + "\n";
  const Reading reading = read_all(write("a.csv", text));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.motion_names.size(), 64u);
  EXPECT_EQ(reading.frames[0].motion[69], 0);
  EXPECT_THAT(reading.info.notes, Contains(HasSubstr("6 motions left out")));
}

/// A table of `frames` moments with 4,000 agents each, longer than what is looked at ahead.
std::string long_table(int frames) {
  std::string text = "time_s,id,x_m,y_m\n";
  for (int frame = 0; frame < frames; ++frame) {
    for (int id = 3999; id >= 0; --id) {
      text.append(std::to_string(frame)).append(",").append(std::to_string(id)).append(",1,2\n");
    }
  }
  return text;
}

TEST_F(CsvTest, TableInOrderOfTimeIsGivenWhileItIsRead) {
  ReadOptions streams;
  streams.streams = true;
  const std::string bad = write("bad.csv", long_table(40) + "40,1,1,oops\n");
  expect_error(read_all(bad).status, {"bad.csv, line 160002", "oops"});
  const auto reader = open(bad, streams);
  ASSERT_TRUE(reader.ok()) << "the bad row is not read yet: " << reader.status();
  EXPECT_DOUBLE_EQ((*reader)->info().fps, 1.0);
  const Reading cut = read_all(bad, streams);
  expect_error(cut.status, {"bad.csv, line 160002", "oops"});
  EXPECT_GE(cut.frames.size(), 38U);

  const std::string good = write("good.csv", long_table(40) + "45,1,1,2\n");
  const Reading whole = read_all(good), streamed = read_all(good, streams);
  ASSERT_TRUE(whole.status.ok() && streamed.status.ok()) << whole.status << streamed.status;
  ASSERT_EQ(streamed.frames.size(), whole.frames.size());
  for (std::size_t i = 0; i < whole.frames.size(); ++i) {
    EXPECT_EQ(streamed.frames[i].time_us, whole.frames[i].time_us);
    EXPECT_EQ(streamed.frames[i].ids, whole.frames[i].ids) << "in order of ids at " << i;
  }
}

TEST_F(CsvTest, StreamedTableToleratesALittleDisorderAndTellsMore) {
  ReadOptions streams;
  streams.streams = true;
  const std::string little = long_table(40) + "41,1,1,2\n40,2,1,2\n";
  const Reading tolerated = read_all(write("little.csv", little), streams);
  ASSERT_TRUE(tolerated.status.ok()) << tolerated.status;
  EXPECT_THAT(tolerated.frames[40].ids, ElementsAre(2U));
  const Reading much = read_all(write("much.csv", long_table(40) + "7,9000,1,2\n"), streams);
  EXPECT_EQ(much.status.code(), absl::StatusCode::kOutOfRange);
  EXPECT_THAT(std::string(much.status.message()), HasSubstr("much.csv, line 160002"));
  // By agent from the beginning: it is sorted, as without streams.
  std::string by_agent = "time_s,id,x_m,y_m\n";
  for (int row = 0; row < 140'000; ++row) {
    by_agent.append(std::to_string(row % 1000)).append(",").append(std::to_string(row / 1000));
    by_agent.append(",1,2\n");
  }
  const Reading sorted = read_all(write("by_agent.csv", by_agent), streams);
  ASSERT_TRUE(sorted.status.ok()) << sorted.status;
  EXPECT_EQ(sorted.frames.size(), 1000U);
  EXPECT_EQ(sorted.frames[0].ids.size(), 140U);
}

TEST_F(CsvTest, ReadingTellsHowFarItIsAndCanBeStopped) {
  const std::string file = write("long.csv", long_table(40));
  double last = 0.0;
  int calls = 0;
  ReadOptions options;
  options.goes_on = [&](double share) {
    EXPECT_GE(share, last);
    last = share;
    return ++calls < 2;
  };
  const Reading reading = read_all(file, options);
  EXPECT_EQ(reading.status.code(), absl::StatusCode::kCancelled) << reading.status;
  EXPECT_EQ(calls, 2);
  EXPECT_GT(last, 0.5);
  EXPECT_LE(last, 1.0);
}

TEST_F(CsvTest, DelimitersAndSpellingsOfOtherProgramsAreKnown) {
  for (const char* text :
       {"frame;id;x;y\n0;1;150;200\n", "Frame\tID\tX\tY\n0\t1\t150\t200\n",
        "y/cm,x/cm,agent_id,frame_number\n200,150,1,0\n",
        "\"frame\",\"ped_id\",\"x [cm]\",\"y [cm]\"\n0,1,150,200\n", "frame id x y\n0 1 150 200\n",
        "# framerate: 25\nframe,id,x_cm,y_cm\n0,1,150,200,\n"}) {
    const Reading reading = read_all(write("a.csv", text), test::with_fps_and_unit(25, 0.01));
    ASSERT_TRUE(reading.status.ok()) << reading.status << text;
    EXPECT_THAT(reading.frames[0].ids, ElementsAre(1u)) << text;
    EXPECT_DOUBLE_EQ(reading.frames[0].x_m[0], 1.5) << text;
    EXPECT_DOUBLE_EQ(reading.frames[0].y_m[0], 2.0) << text;
  }
}

TEST_F(CsvTest, HeadingInDegreesAndAsVector) {
  Reading reading = read_all(write("a.csv", "t,id,x_m,y_m,angle_deg\n0,1,0,0,-90\n"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_NEAR(reading.frames[0].heading_rad[0], -M_PI / 2, 1e-6);
  reading = read_all(write("a.csv", "t,id,x_m,y_m,ori_x,ori_y\n0,1,0,0,0,-2\n0,2,0,0,0,0\n"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_NEAR(reading.frames[0].heading_rad[0], -M_PI / 2, 1e-6);
  EXPECT_TRUE(std::isnan(reading.frames[0].heading_rad[1]));
}

TEST_F(CsvTest, NamesAsIdsAreHashedAndKept) {
  const std::string file = write("a.csv", "t,id,x_m,y_m\n0,anna,0,0\n0,7,1,1\n0,007,2,2\n");
  absl::StatusOr<std::unique_ptr<Reader>> reader = open(file);
  ASSERT_TRUE(reader.ok()) << reader.status();
  Frame frame;
  ASSERT_TRUE(*(*reader)->next(frame));
  EXPECT_THAT(frame.ids, ::testing::UnorderedElementsAre(hash_id("anna"), 7u, hash_id("007")));
  EXPECT_EQ((*reader)->agent_name(hash_id("anna")), "anna");
  EXPECT_EQ((*reader)->agent_name(7), "");
}

TEST_F(CsvTest, FramesWithoutRateNameTheOption) {
  expect_error(read_all(write("a.csv", "frame,id,x_m,y_m\n0,1,0,0\n")).status,
               {path("a.csv"), "--source-fps"});
}

TEST_F(CsvTest, UnitIsAssumedOnlyWhenPeopleCouldMoveThatFast) {
  const Reading reading = read_all(write("a.csv", "t,id,x,y\n0,1,0,0\n1,1,1.3,0\n"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_THAT(reading.info.notes, ::testing::Contains(::testing::HasSubstr("metres")));
  expect_error(read_all(write("a.csv", "t,id,x,y\n0,1,0,0\n1,1,130,0\n")).status,
               {"130 m/s", "--source-unit"});
}

TEST_F(CsvTest, ContradictionsAreErrors) {
  expect_error(read_all(write("a.csv", kGood), test::with_unit(0.01)).status,
               {"--source-unit", "0.01"});
  expect_error(read_all(write("a.csv", kGood), test::with_fps(30)).status,
               {"--source-fps", "30", "10"});
  expect_error(read_all(write("a.csv", "t,id,x_m,y_cm\n0,1,0,0\n")).status, {"line 1", "y_cm"});
  expect_error(read_all(write("a.csv", "t,time,id,x,y\n0,0,1,0,0\n")).status,
               {"line 1", "'t'", "'time'"});
  expect_error(read_all(write("a.csv", "t_min,id,x [ft],y\n0,1,0,0\n")).status, {"line 1", "'ft'"});
}

TEST_F(CsvTest, BrokenRowsAreNamedWithTheirLine) {
  expect_error(read_all(write("a.csv", "t,id,x_m,y_m\n0,1,0,0\n1,1,abc,0\n")).status,
               {"line 3", "'abc'", "x_m"});
  expect_error(read_all(write("a.csv", "t,id,x_m,y_m\n0,1,0,0\n1,1,\"0,5\",0\n")).status,
               {"line 3", "comma"});
  expect_error(read_all(write("a.csv", "t,id,x_m,y_m\n0,1,0,0\n1,,0,0\n")).status,
               {"line 3", "id is empty"});
  expect_error(read_all(write("a.csv", "t,id,x_m,y_m\n0,1,0,0\n0,1,0,0\n")).status,
               {"line 3", "twice", "line 2"});
  expect_error(read_all(write("a.csv", "t,id,x_m,y_m\ninf,1,0,0\n")).status, {"line 2", "time"});
  expect_error(read_all(write("a.csv", "t,id,x_m,y_m\n0,1,0,0\n1,\"1,0,0\n")).status,
               {"line 3", "quote"});
  expect_error(read_all(write("a.csv", "a,b,c\n0,1,0\n")).status,
               {"line 1", "time_s or frame", "a, b, c"});
  expect_error(read_all(write("a.csv", "0,1,0,0\n1,1,2,0\n")).status, {"line 1", "column names"});
}

TEST_F(CsvTest, TruncatedFileSaysSo) {
  expect_error(read_all(write("a.csv", "t,id,x_m,y_m\n0,1,0,0\n1,1,2")).status,
               {"line 3", "cut short"});
  expect_error(read_all(write("a.csv", "t,id,x_m,y_m\n")).status, {"cut short"});
}

TEST_F(CsvTest, HostileHeaderIsRefused) {
  std::string wide = "t,id,x,y";
  for (int i = 0; i < 5000; ++i) wide += ",c" + std::to_string(i);
  expect_error(read_all(write("a.csv", wide + "\n")).status, {"line 1", "1024"});
  expect_error(
      read_all(write("a.csv", "t,id,x_m,y_m\n0," + std::string(10000, 'a') + ",0,0\n")).status,
      {"line 2", "4096"});
}

TEST_F(CsvTest, MutatedFilesNeverCrash) {
  test::survive_mutations(write("a.csv", kGood), path("m.csv"), 3000);
}

TEST_F(CsvTest, PathfinderUnitsRowAndInactiveAgents) {
  const Reading reading = read_all(write(
      "a.csv",
      "\"t\",\"id\",\"name\",\"active\",\"x\",\"y\",\"z\",\"v\",\"location\"\n\"s\",\"\",\"\",\"\","
      "\"m\",\"m\",\"m\",\"m/s\",\"\"\n"
      "0.0,0,\"00001\",0,1,2,0.5,0,\"Room \"\"A\"\", north\"\n1.0,0,\"00001\",0,1,2,0.5,0,\"R\"\n"
      "2.0,0,\"00001\",1,1,3,0.5,1.0,\"R\"\n3.0,0,\"00001\",0,1,4,0.5,1.0,\"R\"\n4.0,0,\"00001\",0,"
      "1,4,0.5,0,\"R\"\n"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.format, "pathfinder-csv");
  ASSERT_EQ(reading.frames.size(), 5u);
  EXPECT_TRUE(reading.frames[0].ids.empty()) << "long before it enters";
  EXPECT_EQ(reading.frames[1].ids.size(), 1u) << "where its way begins";
  EXPECT_EQ(reading.frames[3].ids.size(), 1u) << "where its way ends";
  EXPECT_TRUE(reading.frames[4].ids.empty());
  EXPECT_THAT(reading.frames[2].z_m, ElementsAre(0.5));
  expect_error(read_all(path("a.csv"), test::with_unit(0.01)).status, {"--source-unit"});
}

TEST_F(CsvTest, SumoTableSkipsVehiclesAndTurnsCompassAngles) {
  const Reading reading = read_all(write(
      "a.csv",
      "timestep_time;person_id;person_x;person_y;person_angle;vehicle_id;vehicle_x;vehicle_y\n"
      "0.00;p0;1;2;90;;;\n0.00;;;;;v0;5;5\n1.00;p0;2;2;0;;;\n"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.format, "sumo-fcd-csv");
  EXPECT_NEAR(reading.frames[0].heading_rad[0], 0.0, 1e-6);
  EXPECT_NEAR(reading.frames[1].heading_rad[0], M_PI / 2, 1e-6);
  EXPECT_THAT(reading.info.notes, ::testing::Contains("1 row of vehicles skipped"));
}

}  // namespace
}  // namespace throng::trajectory
