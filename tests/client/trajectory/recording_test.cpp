#include "throng/trajectory/recording.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "fixture.hpp"

namespace throng::trajectory {
namespace {

using test::expect_error;
using test::FileTest;
using test::read_all;
using test::Reading;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class RecordingTest : public FileTest {
 protected:
  static RecordingSpec spec() {
    RecordingSpec spec;
    spec.crowd = "hall";
    spec.producer = "test";
    spec.origin_m = {692'000.0, 5'337'000.0, 500.0};
    spec.seed = 11;
    spec.channel_names = {"mood"};
    spec.channel_units = {"1"};
    return spec;
  }
  static float x_at(std::uint64_t id, int frame) {
    return 0.37F * static_cast<float>(id) + 0.0123F * static_cast<float>(frame * (id % 5));
  }
  /// Frames of `agents` who walk; at frame 5 the first leaves and another comes.
  static void write_frames(RecordingWriter& writer, int first, int last, std::uint64_t agents) {
    for (int frame = first; frame < last; ++frame) {
      if (frame == first || frame == 5) {
        std::vector<std::uint64_t> ids;
        std::vector<std::string> names;
        for (std::uint64_t i = 0; i < agents; ++i) ids.push_back((frame >= 5 ? 2 : 1) + i);
        for (const std::uint64_t id : ids)
          names.push_back(id % 2 ? std::string("p").append(std::to_string(id)) : "");
        writer.set_members(ids, names);
      }
      std::vector<float> position, heading;
      std::vector<std::vector<float>> channels(1);
      for (std::uint64_t i = 0; i < agents; ++i) {
        const std::uint64_t id = (frame >= 5 ? 2 : 1) + i;
        position.insert(position.end(), {x_at(id, frame), -4.5F, id == 3 ? 1.25F : 0.0F});
        heading.push_back(id % 7 == 0 ? std::numeric_limits<float>::quiet_NaN()
                                      : std::remainder(0.1F * static_cast<float>(frame), 6.28F));
        channels[0].push_back(0.1F * static_cast<float>(id) - static_cast<float>(frame));
      }
      ASSERT_TRUE(writer.write(1'000'000 + frame * 100'000, position, heading, channels).ok());
    }
  }
  std::string recorded(int frames, std::uint64_t agents = 20) {
    RecordingWriter writer(path(""), spec(), 1u << 30);
    EXPECT_TRUE(writer.set_walkable_area("POLYGON ((0 0, 9 0, 9 9, 0 0))").ok());
    write_frames(writer, 0, frames, agents);
    return writer.path();
  }
};

TEST_F(RecordingTest, ReadsBackAsItWasSent) {
  const Reading reading = read_all(recorded(12));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.format, "throng-recording");
  EXPECT_EQ(reading.info.seed, 11U);
  EXPECT_THAT(reading.info.channel_names, ElementsAre("mood"));
  EXPECT_THAT(reading.info.walkable_area_wkt, HasSubstr("POLYGON"));
  EXPECT_TRUE(reading.info.notes.empty());
  ASSERT_EQ(reading.frames.size(), 12U);
  for (int f = 0; f < 12; ++f) {
    const Frame& frame = reading.frames[static_cast<std::size_t>(f)];
    EXPECT_EQ(frame.time_us, f * 100'000);
    ASSERT_EQ(frame.ids.size(), 20U);
    EXPECT_EQ(frame.ids[0], f >= 5 ? 2U : 1U);
    for (std::size_t i = 0; i < 20; ++i) {
      EXPECT_NEAR(frame.x_m[i], 692'000.0 + static_cast<double>(x_at(frame.ids[i], f)), 0.6e-4);
      EXPECT_NEAR(frame.y_m[i], 5'337'000.0 - 4.5, 0.6e-4);
      EXPECT_NEAR(frame.z_m[i], frame.ids[i] == 3 ? 501.25 : 500.0, 0.6e-4);
      EXPECT_EQ(frame.channels[0][i],
                0.1F * static_cast<float>(frame.ids[i]) - static_cast<float>(f));
      EXPECT_EQ(std::isnan(frame.heading_rad[i]), frame.ids[i] % 7 == 0);
      if (frame.ids[i] % 7 != 0) {
        EXPECT_NEAR(frame.heading_rad[i], 0.1 * f, 1e-4);
      }
    }
  }
}

TEST_F(RecordingTest, KeepsNames) {
  absl::StatusOr<std::unique_ptr<Reader>> reader = open(recorded(2));
  ASSERT_TRUE(reader.ok()) << reader.status();
  EXPECT_EQ((*reader)->agent_name(3), "p3");
  EXPECT_EQ((*reader)->agent_name(4), "");
}

TEST_F(RecordingTest, KeepsWhatAgentsDoAndWhoTheyWereChosenToBe) {
  RecordingWriter writer(path(""), spec(), 1u << 30);
  const std::uint64_t ids[] = {7, 8};
  const std::int32_t characters[] = {3, -1};
  const float position[] = {0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F};
  const std::string names[] = {"sit", "wave"}, others[] = {"wave", "phone"};
  const std::uint8_t sits[] = {1, 0}, both[] = {2, 1}, nothing[] = {0, 0}, wrong[] = {3, 0};
  writer.set_members(ids, {}, characters);
  ASSERT_TRUE(writer.write(0, position, {}, {}).ok());
  ASSERT_TRUE(writer.write(1, position, {}, {}, sits, names).ok());
  ASSERT_TRUE(writer.write(2, position, {}, {}, sits, names).ok());
  ASSERT_TRUE(writer.write(3, position, {}, {}, both, others).ok());
  ASSERT_TRUE(writer.write(4, position, {}, {}, nothing, names).ok());
  EXPECT_FALSE(writer.write(5, position, {}, {}, wrong, names).ok());
  writer.set_members(std::span(ids).first(1), {});
  ASSERT_TRUE(writer.write(6, std::span(position).first(3), {}, {}).ok());

  const Reading reading = read_all(writer.path());
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_THAT(reading.info.motion_names, ElementsAre("sit", "wave", "phone"));
  ASSERT_EQ(reading.frames.size(), 6U);
  EXPECT_TRUE(reading.frames[0].motion.empty());
  EXPECT_THAT(reading.frames[1].motion, ElementsAre(1, 0));
  EXPECT_THAT(reading.frames[2].motion, ElementsAre(1, 0));
  EXPECT_THAT(reading.frames[3].motion, ElementsAre(3, 2));
  EXPECT_THAT(reading.frames[4].motion, ElementsAre(0, 0));
  EXPECT_TRUE(reading.frames[5].motion.empty()) << "others are there now";

  const auto reader = open(writer.path());
  ASSERT_TRUE(reader.ok()) << reader.status();
  EXPECT_EQ((*reader)->agent_character(7), 3);
  EXPECT_EQ((*reader)->agent_character(8), -1);
  EXPECT_THAT(chosen_characters(**reader, reading.frames[1], 14), ElementsAre(3, -1));
  EXPECT_THAT(chosen_characters(**reader, reading.frames[1], 3), ElementsAre()) << "a smaller cast";
  test::survive_mutations(writer.path(), path("mutant.trec"), 300);
}

TEST_F(RecordingTest, CutAnywhereItGivesEveryCompleteFrame) {
  const std::string whole = bytes_of(recorded(8, 3));
  std::size_t frames_before = 0;
  for (std::size_t size = whole.size() % 5; size <= whole.size(); size += 5) {
    const Reading reading = read_all(write("cut.trec", whole.substr(0, size)));
    if (!reading.status.ok()) {
      EXPECT_THAT(std::string(reading.status.message()), HasSubstr("cut.trec"));
      EXPECT_EQ(frames_before, 0U) << "a frame was lost at " << size;
      continue;
    }
    EXPECT_GE(reading.frames.size(), frames_before) << "at " << size;
    frames_before = reading.frames.size();
  }
  EXPECT_EQ(frames_before, 8U);
}

TEST_F(RecordingTest, AFlippedBitIsFoundAndWhatIsBeforeItIsGiven) {
  std::string bytes = bytes_of(recorded(8));
  bytes[bytes.size() * 3 / 4] ^= 4;
  const Reading reading = read_all(write("bad.trec", bytes));
  expect_error(reading.status, {"bad.trec", "byte ", "damaged"});
  EXPECT_GT(reading.frames.size(), 2U);
}

TEST_F(RecordingTest, SurvivesMutations) {
  test::survive_mutations(recorded(8), path("mutant.trec"), 300);
}

TEST_F(RecordingTest, FarFromTheOriginStepsGrow) {
  RecordingWriter writer(path(""), spec(), 1u << 30);
  const std::uint64_t id = 1;
  writer.set_members({&id, 1}, {});
  const std::vector<float> xs = {1.0F, 9.9e6F, -9.9e6F, 2.0F};
  for (std::size_t i = 0; i < xs.size(); ++i) {
    const float position[] = {xs[i], 0.0F, 0.0F};
    ASSERT_TRUE(writer.write(static_cast<std::int64_t>(i), position, {}, {}).ok());
  }
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(), 0.0F, 0.0F};
  EXPECT_FALSE(writer.write(20, bad, {}, {}).ok());
  const Reading reading = read_all(writer.path());
  ASSERT_EQ(reading.frames.size(), xs.size());
  for (std::size_t i = 0; i < xs.size(); ++i) {
    EXPECT_NEAR(reading.frames[i].x_m[0], 692'000.0 + static_cast<double>(xs[i]), 0.01);
  }
}

TEST_F(RecordingTest, KeepsToItsLimitAndReadsOnFromPartToPart) {
  constexpr std::uint64_t kLimit = 128u << 10;
  RecordingWriter writer(path(""), spec(), kLimit);
  write_frames(writer, 0, 3000, 100);
  std::uint64_t bytes = 0;
  std::string oldest, other = write("hall2.20260101T000000Z.0001.trec", "another crowd's");
  for (const auto& entry : std::filesystem::directory_iterator(path(""))) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("hall.", 0) != 0) continue;
    bytes += entry.file_size();
    if (oldest.empty() || entry.path().string() < oldest) oldest = entry.path().string();
  }
  EXPECT_LE(bytes, kLimit);
  EXPECT_GT(bytes, kLimit / 2);
  EXPECT_THAT(oldest, ::testing::Not(HasSubstr(".0001.trec")));
  const Reading reading = read_all(oldest);
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  ASSERT_GT(reading.frames.size(), 500U) << "it goes on in the parts after it";
  EXPECT_NEAR(reading.frames.back().x_m[0], 692'000.0 + static_cast<double>(x_at(2, 2999)), 0.6e-4);
  EXPECT_TRUE(std::filesystem::exists(other));
}

TEST_F(RecordingTest, ARunGoesOnBehindWhatAKillTore) {
  const std::string first = recorded(8);
  write(std::filesystem::path(first).filename().string(), bytes_of(first) + "FRAM torn");
  std::vector<std::int64_t> times;
  const auto take = [&](const RecordingSpec& spec, const Frame& frame, const Reader& reader) {
    EXPECT_EQ(spec.seed, 11U);
    EXPECT_EQ(reader.agent_name(3), "p3");
    times.push_back(frame.time_us);
    return absl::OkStatus();
  };
  absl::StatusOr<RecordedRun> run = read_last_run(path(""), "hall", 1u << 30, take);
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_EQ(run->frames, 8U);
  EXPECT_EQ(times.front(), 1'000'000) << "as the producer sent it";
  EXPECT_EQ(run->spec.producer, "test");
  EXPECT_EQ(run->spec.channel_units, std::vector<std::string>{"1"});
  EXPECT_THAT(run->walkable_area_wkt, HasSubstr("POLYGON"));
  EXPECT_EQ(run->end.path, first);
  // A part that was killed before its first frame is passed over.
  std::string empty = first;
  empty.replace(empty.size() - 6, 1, "2");
  std::ofstream(empty) << "THRONG";
  {
    RecordingWriter writer(path(""), run->spec, 1u << 30, run->end);
    write_frames(writer, 8, 12, 20);
    EXPECT_TRUE(writer.sync().ok());
    EXPECT_THAT(writer.path(), HasSubstr(".0003.trec"));
  }
  const Reading whole = read_all(first);
  ASSERT_TRUE(whole.status.ok()) << whole.status;
  EXPECT_EQ(whole.frames.size(), 12U) << "one recording from the first part on";
  EXPECT_TRUE(whole.info.notes.empty());
  times.clear();
  run = read_last_run(path(""), "hall", 1, take);
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_THAT(times, ElementsAre(1'800'000, 1'900'000, 2'000'000, 2'100'000)) << "the last part";
  EXPECT_THAT(recorded_crowds(path("")), ElementsAre("hall"));
  EXPECT_EQ(read_last_run(path(""), "hal", 1, take).status().code(), absl::StatusCode::kNotFound);
  // A crowd is called as its files are.
  std::string renamed = std::filesystem::path(first).filename().string();
  write(renamed.replace(0, 4, "gate"), bytes_of(first));
  run = read_last_run(path(""), "gate", 1, take);
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_EQ(run->spec.crowd, "gate");
}

TEST_F(RecordingTest, WhatIsDamagedInItsMiddleIsNotCut) {
  const std::string part = recorded(8);
  std::string bytes = bytes_of(part);
  bytes[bytes.size() / 2] ^= 4;
  write(std::filesystem::path(part).filename().string(), bytes);
  const absl::StatusOr<RecordedRun> run =
      read_last_run(path(""), "hall", 1u << 30,
                    [](const auto&, const auto&, const auto&) { return absl::OkStatus(); });
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_LT(run->frames, 8U);
  EXPECT_TRUE(run->end.path.empty());
  ASSERT_FALSE(run->notes.empty());
  EXPECT_THAT(run->notes.back(), HasSubstr("damaged"));
}

TEST_F(RecordingTest, WhatCannotBeWrittenEndsItWithOneError) {
  RecordingSpec bad = spec();
  RecordingWriter writer(path("no-such-folder"), bad, 1u << 20);
  const std::uint64_t id = 1;
  writer.set_members({&id, 1}, {});
  const float position[] = {0.0F, 0.0F, 0.0F};
  const absl::Status status = writer.write(0, position, {}, {});
  EXPECT_FALSE(status.ok());
  EXPECT_THAT(std::string(status.message()), HasSubstr("no-such-folder"));
  EXPECT_EQ(writer.write(1, position, {}, {}), status);
}

TEST_F(RecordingTest, RefusesAnotherRate) {
  ReadOptions options;
  options.source_fps = 10.0;
  expect_error(read_all(recorded(2), options).status, {"--source-fps"});
}

}  // namespace
}  // namespace throng::trajectory
