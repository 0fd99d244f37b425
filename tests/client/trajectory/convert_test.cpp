#include <gmock/gmock.h>
#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "fixture.hpp"
#include "throng/trajectory/writer.hpp"

/// Every format that `throng convert` writes, read again by the reader of that format.
namespace throng::trajectory {
namespace {

using test::expect_error;
using test::FileTest;
using test::read_all;
using test::Reading;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

struct Case {
  std::string format, ending;
  bool z, heading, speed, names;
  double tolerance_m;
};

std::vector<Case> cases() {
  return {
      {"csv", ".csv", true, true, true, false, 0.0},
      {"archive-text", ".txt", true, true, true, false, 0.0},
      {"jupedsim-sqlite", ".sqlite", false, true, false, false, 0.0},
#ifdef THRONG_WITH_HDF5
      {"jupedsim-hdf5", ".h5", true, true, false, false, 0.0},
#endif
      // the heading is that of the step, the channels those at its start
      {"vadere-traj", ".traj", false, true, true, false, 1e-9},
      {"sumo-fcd", ".xml", true, true, true, true, 0.0},
      {"sumo-fcd", ".xml.gz", true, true, true, true, 0.0},
      {"menge-scb", ".scb", true, true, false, false, 1e-5},
      {"trajnet-ndjson", ".ndjson", false, false, false, false, 0.0},
      {"trajnet-ndjson", ".ndjson.gz", false, false, false, false, 0.0},
      {"obsmat", ".txt", false, false, false, false, 0.0},
  };
}

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class ConvertTest : public FileTest {
 protected:
  /// Three that walk straight ahead all the time, at the rate of obsmat.
  std::string walkers() const {
    std::string rows = "time_s,id,x_m,y_m,z_m,heading_rad,speed\n";
    for (int step = 0; step < 8; ++step) {
      for (int id = 0; id < 3; ++id) {
        const double heading = 0.5 + 2.0 * id, speed = 1.0 + 0.25 * id, t = 0.4 * step;
        rows += std::to_string(t) + "," + std::to_string(id) + ",";
        char numbers[160];
        std::snprintf(numbers, sizeof numbers, "%.17g,%.17g,%g,%.9g,%g\n",
                      3.0 * id + std::cos(heading) * speed * t, std::sin(heading) * speed * t - 1.0,
                      0.5 * id, heading, speed);
        rows += numbers;
      }
    }
    return write("walkers.csv", rows);
  }

  static ReadOptions reading(double fps) {
    ReadOptions options;
    options.source_fps = fps;
    options.ground_z = true;
    return options;
  }
};

TEST_F(ConvertTest, EveryFormatBecomesEveryOther) {
  for (const Case& from : cases()) {
    const std::string source = path("from" + from.ending);
    ASSERT_TRUE(convert(walkers(), source, {}, from.format).ok()) << from.format;
    const Reading a = read_all(source, reading(2.5));
    ASSERT_TRUE(a.status.ok()) << a.status;
    EXPECT_EQ(a.info.format, from.format);
    ASSERT_EQ(a.frames.size(), 8u) << from.format;
    for (const Case& to : cases()) {
      SCOPED_TRACE(from.format + from.ending + " to " + to.format + to.ending);
      const std::string target = path("to" + to.ending);
      const auto summary = convert(source, target, reading(2.5), to.format);
      ASSERT_TRUE(summary.ok()) << summary.status();
      const Reading b = read_all(target, reading(2.5));
      ASSERT_TRUE(b.status.ok()) << b.status;
      EXPECT_EQ(b.info.format, to.format);
      EXPECT_NEAR(b.info.fps, 2.5, 1e-5);
      ASSERT_EQ(b.frames.size(), 8u);
      const auto reader = open(target, reading(2.5));
      ASSERT_TRUE(reader.ok()) << reader.status();
      for (std::size_t i = 0; i < 8; ++i) {
        const Frame &before = a.frames[i], &after = b.frames[i];
        EXPECT_NEAR(before.time_us, after.time_us, 1.0);
        ASSERT_EQ(after.ids.size(), 3u);
        Frame ignored;
        ASSERT_TRUE((*reader)->next(ignored).ok());
        // Ids that are names become numbers from 1 on, but for Menge's places.
        const bool renumbered =
            from.names && !to.names && to.format != "csv" && to.format != "menge-scb";
        const double tolerance_m = std::max(from.tolerance_m, to.tolerance_m);
        for (std::size_t k = 0; k < 3; ++k) {
          const std::string name = (*reader)->agent_name(after.ids[k]);
          EXPECT_EQ(name.empty() ? std::to_string(after.ids[k]) : name,
                    std::to_string(k + (renumbered ? 1 : 0)));
          EXPECT_NEAR(before.x_m[k], after.x_m[k], tolerance_m);
          EXPECT_NEAR(before.y_m[k], after.y_m[k], tolerance_m);
          EXPECT_NEAR(after.x_m[k],
                      3.0 * static_cast<double>(k) + std::cos(0.5 + 2.0 * static_cast<double>(k)) *
                                                         (1.0 + 0.25 * static_cast<double>(k)) *
                                                         0.4 * static_cast<double>(i),
                      1e-5)
              << "what the first file said";
          if (from.z && to.z) {
            ASSERT_EQ(after.z_m.size(), 3u);
            EXPECT_EQ(after.z_m[k], 0.5 * static_cast<double>(k));
          }
          if ((from.heading && to.heading) || to.format == "vadere-traj") {
            ASSERT_EQ(after.heading_rad.size(), 3u);
            EXPECT_NEAR(std::remainder(after.heading_rad[k] - (0.5 + 2.0 * static_cast<double>(k)),
                                       2.0 * M_PI),
                        0.0, 1e-5);
          }
          if (from.speed && to.speed) {
            ASSERT_THAT(b.info.channel_names, ElementsAre("speed"));
            EXPECT_EQ(after.channels[0][k], 1.0f + 0.25f * static_cast<float>(k));
          }
        }
      }
    }
  }
}

/// What is lost is told in one line, and what is not lost is not.
TEST_F(ConvertTest, TellsWhatIsLostOnce) {
  for (const Case& to : cases()) {
    const auto summary = convert(walkers(), path("to" + to.ending), {}, to.format);
    ASSERT_TRUE(summary.ok()) << summary.status();
    std::vector<std::string> told;
    for (const std::string& note : summary->info.notes) {
      if (note.find("not written") != std::string::npos) told.push_back(note);
    }
    const bool headings_lost = !to.heading || to.format == "vadere-traj";
    EXPECT_EQ(told.size(), to.z && !headings_lost && to.speed ? 0u : 1u) << to.format;
    for (const auto& [word, lost] :
         {std::pair("heights", !to.z), std::pair("headings", headings_lost),
          std::pair("channels", !to.speed)}) {
      if (lost) {
        EXPECT_THAT(told, Contains(HasSubstr(word))) << to.format;
      }
      if (!lost) {
        EXPECT_THAT(told, Each(Not(HasSubstr(word)))) << to.format;
      }
    }
  }
}

/// People come, go, are there for one moment, and for a while there is nobody.
TEST_F(ConvertTest, WhoComesAndGoesIsThereWhenItWas) {
  const std::string in = write("in.csv",
                               "time_s,id,x_m,y_m\n0,4,0.1,-2.25\n0,9,3,4\n0.033333,4,0.2,-2.25\n"
                               "0.066667,4,0.3,-2.25\n0.3,12,5,5\n0.333333,12,5.1,5\n"
                               "0.366667,12,5.2,5\n0.366667,13,1,1\n0.4,12,5.3,5\n");
  for (const Case& to : cases()) {
    if (to.format == "menge-scb") continue;
    SCOPED_TRACE(to.format + to.ending);
    const auto summary = convert(in, path("to" + to.ending), {}, to.format, 30.0);
    ASSERT_TRUE(summary.ok()) << summary.status();
    const Reading before = read_all(in);
    // FCD keeps times, whose rate no longer is regular where nobody is
    Reading after = read_all(
        path("to" + to.ending),
        to.format == "vadere-traj" || to.format == "obsmat" ? reading(30.0) : ReadOptions());
    ASSERT_TRUE(after.status.ok()) << after.status;
    const auto nobody = [](const Frame& frame) { return frame.ids.empty(); };
    std::vector<Frame> expected = before.frames;
    std::erase_if(expected, nobody);
    std::erase_if(after.frames, nobody);
    ASSERT_EQ(after.frames.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_NEAR(after.frames[i].time_us, expected[i].time_us, 1.0);
      ASSERT_EQ(after.frames[i].ids.size(), expected[i].ids.size()) << "frame " << i;
      for (std::size_t k = 0; k < expected[i].ids.size(); ++k) {
        if (!to.names) {
          EXPECT_EQ(after.frames[i].ids[k], expected[i].ids[k]);
        }
        EXPECT_NEAR(after.frames[i].x_m[k], expected[i].x_m[k], 1e-9);
      }
    }
  }
}

TEST_F(ConvertTest, VadereTellsWhoStandsWhereItWasAway) {
  const std::string in =
      write("in.csv", "time_s,id,x_m,y_m\n0,1,0,0\n0,2,5,5\n1,2,5,6\n2,1,1,0\n2,2,5,7\n");
  const auto summary = convert(in, path("out.traj"));
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_THAT(summary->info.notes, Contains(HasSubstr("1 agent that left and came back")));
  EXPECT_EQ(bytes_of(path("out.traj")),
            "pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1\n"
            "2 0 1 5 5 5 6\n1 0 0 0 0 0 0\n2 1 2 5 6 5 7\n1 2 2 1 0 1 0\n");
}

TEST_F(ConvertTest, VadereKeepsIrregularTimesAndItsOwnColumnsApart) {
  const std::string in = write("in.csv",
                               "time_s,id,x_m,y_m,endTime,my value\n0,1,0,0,7,\n0.13,1,1,0,8,2.5\n"
                               "5,1,2,0,9,3\n5.1,1,2,0,9,3\n");
  const auto summary = convert(in, path("out.traj"));
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_THAT(summary->info.notes, Contains(HasSubstr("'endTime' is written as 'endTime_value'")));
  const Reading again = read_all(path("out.traj"), test::with_fps(100));
  ASSERT_TRUE(again.status.ok()) << again.status;
  EXPECT_THAT(again.info.channel_names, ElementsAre("endTime_value", "my_value"));
  EXPECT_EQ(again.frames[13].x_m[0], 1.0);
  EXPECT_EQ(again.frames[13].channels[1][0], 2.5f);
}

TEST_F(ConvertTest, MengeHoldsOnlyWhoIsAlwaysThere) {
  const std::string leaves =
      write("leaves.csv", "time_s,id,x_m,y_m\n0,1,0,0\n0,2,5,5\n1,2,5,6\n2,2,5,7\n");
  expect_error(convert(leaves, path("out.scb")).status(),
               {"1 agents at 1 s", "the 2 of the first"});
  const std::string other = write("other.csv", "time_s,id,x_m,y_m\n0,1,0,0\n1,2,5,6\n2,2,5,7\n");
  expect_error(convert(other, path("out.scb"), {}, "", 1).status(), {"same agents"});
  const std::string gap =
      write("gap.csv", "time_s,id,x_m,y_m\n0,1,0,0\n1,1,5,6\n2,1,5,6\n4,1,5,7\n5,1,5,6\n");
  expect_error(convert(gap, path("out.scb"), {}, "", 1).status(),
               {"no frame before 4 s", "every 1 s"});
  EXPECT_FALSE(std::filesystem::exists(path("out.scb")));
  EXPECT_FALSE(std::filesystem::exists(path("out.scb.tmp")));
}

TEST_F(ConvertTest, MengeTellsTheStepsOfItsPositionsAndRefusesLargeOnes) {
  const std::string far =
      write("far.csv", "time_s,id,x_m,y_m,class\n0,7,500000.3,0,3\n1,7,500001,0,3\n");
  const auto summary = convert(far, path("out.scb"));
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_THAT(summary->info.notes, Contains(HasSubstr("steps of up to 31.25 mm")));
  EXPECT_THAT(summary->info.notes, Contains(HasSubstr("written as NaN")));
  const Reading again = read_all(path("out.scb"));
  EXPECT_NEAR(again.frames[0].x_m[0], 500000.3, 0.016);
  EXPECT_THAT(again.frames[0].channels[0], ElementsAre(3.0f));
  EXPECT_TRUE(std::isnan(again.frames[0].heading_rad[0]));
  const std::string utm = write("utm.csv", "time_s,id,x_m,y_m\n0,7,692152,5337384.2\n1,7,1,1\n");
  expect_error(convert(utm, path("utm.scb")).status(), {"5337384.2", "1048576", "origin"});
}

TEST_F(ConvertTest, SumoKeepsNamesThatXmlHoldsAndRefusesOthers) {
  const std::string in = write("in.csv",
                               "time_s,id,x_m,y_m,heading_rad,speed\n0,\"<a> & 'b\"\"\",0,0,0,\n"
                               "0,J\xC3\xBCrg,1,1,,1.5\n0.5,J\xC3\xBCrg,1,1,-3,1.5\n");
  ASSERT_TRUE(convert(in, path("out.xml")).ok());
  EXPECT_THAT(bytes_of(path("out.xml")),
              HasSubstr("    <timestep time=\"0.50\">\n        <person id=\"J\xC3\xBCrg\" x=\"1\" "
                        "y=\"1\" angle=\"261.88"));
  const Reading before = read_all(in), after = read_all(path("out.xml"));
  ASSERT_TRUE(after.status.ok()) << after.status;
  ASSERT_EQ(after.frames.size(), 2u);
  EXPECT_THAT(after.frames[0].ids, ::testing::UnorderedElementsAreArray(before.frames[0].ids));
  EXPECT_NEAR(after.frames[1].heading_rad[0], -3.0f, 1e-5f);
  const auto east =
      std::find(before.frames[0].ids.begin(), before.frames[0].ids.end(), hash_id("<a> & 'b\""));
  ASSERT_NE(east, before.frames[0].ids.end());

  for (const char* bad :
       {"\xFF", "a\x01", "\xC0\xAF", "\xED\xA0\x80", "\xE2\x82", "\xEF\xBF\xBF"}) {
    const std::string file =
        write("bad.csv", std::string("time_s,id,x_m,y_m\n0,") + bad + ",0,0\n1," + bad + ",0,0\n");
    expect_error(convert(file, path("bad.xml")).status(), {"XML", "rename"});
  }
}

TEST_F(ConvertTest, SumoKeepsMomentsWithNobodyAndFineTimes) {
  Frame frame;
  WriteSpec spec;
  auto writer = make_writer(path("out.xml"), spec);
  ASSERT_TRUE(writer.ok()) << writer.status();
  frame.ids = {3};
  frame.x_m = frame.y_m = {1.0};
  ASSERT_TRUE((*writer)->write(frame).ok());
  frame = Frame();
  frame.time_us = 1'000'001;
  ASSERT_TRUE((*writer)->write(frame).ok());
  ASSERT_TRUE((*writer)->close().ok());
  EXPECT_EQ(bytes_of(path("out.xml")),
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fcd-export>\n    <timestep "
            "time=\"0.00\">\n        <person id=\"3\" x=\"1\" y=\"1\"/>\n    </timestep>\n    "
            "<timestep time=\"1.000001\"/>\n</fcd-export>\n");
  const Reading again = read_all(path("out.xml"));
  ASSERT_EQ(again.frames.size(), 2u) << again.status;
  EXPECT_TRUE(again.frames[1].ids.empty());
}

TEST_F(ConvertTest, TrajnetCountsSamplesASecondWhenFrameNumbersGoUpByMore) {
  const std::string in =
      write("in.csv", "time_s,id,x_m,y_m\n0,5,0,1.5\n0.4,5,1,1\n0.8,5,2,1\n1.2,6,2,1\n");
  ASSERT_TRUE(convert(in, path("out.ndjson"), {}, "", 25.0).ok());
  EXPECT_EQ(bytes_of(path("out.ndjson")),
            "{\"track\": {\"f\": 0, \"p\": 5, \"x\": 0, \"y\": 1.5}}\n"
            "{\"track\": {\"f\": 10, \"p\": 5, \"x\": 1, \"y\": 1}}\n"
            "{\"track\": {\"f\": 20, \"p\": 5, \"x\": 2, \"y\": 1}}\n"
            "{\"track\": {\"f\": 30, \"p\": 6, \"x\": 2, \"y\": 1}}\n"
            "{\"scene\": {\"id\": 0, \"p\": 5, \"s\": 0, \"e\": 30, \"fps\": 2.5, \"tag\": 0}}\n");
  EXPECT_EQ(read_all(path("out.ndjson")).frames[3].time_us, 1'200'000);
}

TEST_F(ConvertTest, ObsmatHasTheVelocityOfTheWayToTheNextSample) {
  const std::string in =
      write("in.csv", "time_s,id,x_m,y_m\n0,5,0,1\n0,8,3,3\n0.5,5,1,1\n1,5,1,0\n1.5,6,2,1\n");
  const auto summary = convert(in, path("out.txt"), {}, "obsmat");
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_THAT(summary->info.notes, Contains(HasSubstr("--source-fps 2")));
  EXPECT_EQ(bytes_of(path("out.txt")),
            "0 5 0 0 1 2 0 0\n0 8 3 0 3 0 0 0\n1 5 1 0 1 0 0 -2\n2 5 1 0 0 0 0 -2\n"
            "3 6 2 0 1 0 0 0\n");
  EXPECT_EQ(read_all(path("out.txt"), test::with_fps(2)).frames[3].time_us, 1'500'000);
}

TEST_F(ConvertTest, IdsBeyondAFormatsNumbersAreCountedAnew) {
  const std::string in = write("in.csv", "time_s,id,x_m,y_m\n0,5000000000,0,0\n1,5000000000,1,0\n");
  for (const Case& to : cases()) {
    const bool fits = to.format == "csv" || to.format == "archive-text" || to.names ||
                      to.format == "jupedsim-sqlite" || to.format == "trajnet-ndjson" ||
                      to.format == "obsmat";
    if (to.format == "menge-scb") continue;
    const auto summary = convert(in, path("to" + to.ending), {}, to.format);
    ASSERT_TRUE(summary.ok()) << summary.status();
    const std::uint64_t id = read_all(path("to" + to.ending)).frames[0].ids[0];
    if (!to.names) {
      EXPECT_EQ(id, fits ? 5'000'000'000u : 1u) << to.format;
    }
    if (!fits) {
      EXPECT_THAT(summary->info.notes, Contains(HasSubstr("order of appearance")));
    }
  }
  // who writes by itself is told
  Frame frame;
  frame.ids = {5'000'000'000u};
  frame.x_m = frame.y_m = {0.0};
  WriteSpec spec;
  spec.fps = 25;
  auto writer = make_writer(path("own.traj"), spec);
  ASSERT_TRUE(writer.ok()) << writer.status();
  expect_error((*writer)->write(frame), {"5000000000", "2147483647"});
}

TEST_F(ConvertTest, WalkableAreaGoesIntoBothOfJuPedSims) {
  test::write_sqlite(
      path("in.sqlite"),
      "CREATE TABLE trajectory_data(frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL);"
      "CREATE TABLE metadata(key TEXT, value TEXT); CREATE TABLE geometry(wkt TEXT);"
      "INSERT INTO metadata VALUES('fps','25');"
      "INSERT INTO geometry VALUES('POLYGON ((0 0, 1 0, 1 1, 0 0))');"
      "INSERT INTO trajectory_data VALUES(0,1,1,2),(1,1,1,2);");
  for (const Case& to : cases()) {
    const bool holds = to.format.starts_with("jupedsim");
    const std::string out = path("to" + to.ending);
    const auto summary = convert(path("in.sqlite"), out, {}, to.format);
    ASSERT_TRUE(summary.ok()) << summary.status();
    EXPECT_EQ(read_all(out).info.walkable_area_wkt, holds ? "POLYGON ((0 0, 1 0, 1 1, 0 0))" : "");
    if (!holds) {
      EXPECT_THAT(summary->info.notes, Contains(HasSubstr("SQLite and HDF5 hold it")));
    }
  }
}

TEST_F(ConvertTest, WhatCannotBeWrittenLeavesWhatWasThere) {
  const std::string irregular = write(
      "irregular.csv", "t,id,x_m,y_m\n0,1,0,0\n0.1,1,1,0\n0.137,1,1,0\n0.5,1,1,0\n0.6,1,1,0\n");
  for (const Case& to : cases()) {
    SCOPED_TRACE(to.format + to.ending);
    EXPECT_EQ(convert(walkers(), path("no/such/folder" + to.ending), {}, to.format).status().code(),
              absl::StatusCode::kUnavailable);
    const std::string out = write("old" + to.ending, "old");
    EXPECT_EQ(convert(walkers(), out, {}, to.format, 0.0,
                      [](std::uint64_t frames, std::uint64_t) { return frames < 3; })
                  .status()
                  .code(),
              absl::StatusCode::kCancelled);
    EXPECT_EQ(bytes_of(out), "old");
    EXPECT_FALSE(std::filesystem::exists(out + ".tmp"));
    const bool times = to.format == "csv" || to.format == "vadere-traj" || to.names;
    const absl::Status status = convert(irregular, out, {}, to.format, 10.0).status();
    if (times) {
      EXPECT_TRUE(status.ok()) << status;
    }
    if (!times) {
      expect_error(status, {"0.137", "no frame"});
    }
    if (!times) {
      EXPECT_EQ(bytes_of(out), "old");
    }
  }
  expect_error(convert(walkers(), path("out.scb.gz")).status(), {"Menge", "gzip"});
  expect_error(convert(walkers(), path("out.bin")).status(), {".ndjson", "obsmat"});
}

TEST_F(ConvertTest, GzipIsReallyThere) {
  ASSERT_TRUE(convert(walkers(), path("out.csv.gz")).ok());
  ASSERT_TRUE(convert(walkers(), path("out.csv")).ok());
  EXPECT_EQ(bytes_of(path("out.csv.gz")).substr(0, 2), "\x1f\x8b");
  gzFile file = gzopen(path("out.csv.gz").c_str(), "rb");
  std::string text(1 << 16, '\0');
  text.resize(static_cast<std::size_t>(gzread(file, text.data(), 1 << 16)));
  gzclose(file);
  EXPECT_EQ(text, bytes_of(path("out.csv")));
}

}  // namespace
}  // namespace throng::trajectory
