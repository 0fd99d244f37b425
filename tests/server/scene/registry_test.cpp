#include "server/scene/registry.hpp"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <thread>
#include <utility>

#include "tests/support/temporary_folder.hpp"
#include "throng/trajectory/trajectory.hpp"

namespace throng::server {
namespace {

using testing::HasSubstr;

std::shared_ptr<const render::Cast> tiny_cast() {
  auto cast = std::make_shared<render::Cast>();
  cast->members.resize(1);
  return cast;
}

StartRequest start_of(std::string crowd, std::string run) {
  StartRequest request;
  request.crowd_name = std::move(crowd);
  request.run_id = std::move(run);
  request.producer = "test";
  return request;
}

render::AgentFrame frame_of(std::int64_t time_us, std::vector<glm::vec3> positions) {
  auto membership = std::make_shared<render::Membership>();
  membership->epoch = 1;
  for (std::size_t i = 0; i < positions.size(); ++i) membership->ids.push_back(i + 1);
  render::AgentFrame frame;
  frame.time_us = time_us;
  frame.membership = std::move(membership);
  frame.position_m = std::move(positions);
  return frame;
}

class RegistryTest : public testing::Test {
 protected:
  std::unique_ptr<Publication> open(
      StartRequest request, std::function<void()> revoked = [] {}) {
    auto publication = registry.start(std::move(request), std::move(revoked));
    EXPECT_TRUE(publication.ok()) << publication.status();
    return publication.ok() ? *std::move(publication) : nullptr;
  }

  Limits limits = [] {
    Limits few;
    few.max_crowds = 2;
    few.max_channels = 2;
    return few;
  }();
  Clock::time_point now{std::chrono::hours(1)};
  Registry registry{tiny_cast(), limits, {}, [this] { return now; }};
};

TEST_F(RegistryTest, RefusesNamesThatCouldNotBeAFile) {
  for (const std::string& name : {std::string(), std::string("a/b"), std::string("a b"),
                                  std::string("\xff"), std::string(101, 'a')}) {
    const auto publication = registry.start(start_of(name, "r"), [] {});
    EXPECT_EQ(publication.status().code(), absl::StatusCode::kInvalidArgument) << name;
    EXPECT_THAT(std::string(publication.status().message()), HasSubstr("crowd_name"));
  }
  EXPECT_NE(open(start_of(std::string(100, 'a'), "r")), nullptr);
}

TEST_F(RegistryTest, RefusesOneCrowdTooMany) {
  const auto a = open(start_of("a", "r"));
  const auto b = open(start_of("b", "r"));
  EXPECT_EQ(registry.start(start_of("c", "r"), [] {}).status().code(),
            absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(registry.list().size(), 2U);
}

TEST_F(RegistryTest, RefusesChannelsThatAreTooManyOrTwice) {
  StartRequest request = start_of("a", "r");
  request.channels = {{"speed", "m/s"}, {"speed", ""}};
  EXPECT_EQ(registry.start(request, [] {}).status().code(), absl::StatusCode::kInvalidArgument);
  request.channels = {{"a", ""}, {"b", ""}, {"c", ""}};
  EXPECT_EQ(registry.start(request, [] {}).status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_TRUE(registry.list().empty());
}

TEST_F(RegistryTest, EveryCrowdHasSpeedAsAChannel) {
  const auto plain = open(start_of("a", "r"));
  EXPECT_EQ((*registry.find("a"))->channel_index("speed"), render::kSpeedChannel);
  EXPECT_EQ((*registry.find("a"))->channel_index("heat"), -1);
  ASSERT_EQ(registry.list().front().channels.size(), 1U);
  EXPECT_EQ(registry.list().front().channels.front().unit, "m/s");
  StartRequest own = start_of("b", "r");
  own.channels = {{"speed", "km/h"}};
  const auto told = open(std::move(own));
  EXPECT_EQ((*registry.find("b"))->channel_index("speed"), 0);
  EXPECT_EQ(registry.list().back().channels.size(), 1U);
}

TEST_F(RegistryTest, RefusesTextThatWouldForgeLinesInALog) {
  StartRequest request = start_of("a", "r");
  request.producer = "sim\nevent=stopped";
  EXPECT_EQ(registry.start(request, [] {}).status().message(),
            "start.producer: byte 0x0a is a control character");
  request = start_of("a", "\x1b[2J");
  EXPECT_EQ(registry.start(request, [] {}).status().code(), absl::StatusCode::kInvalidArgument);
  request = start_of("a", "r");
  request.producer = "Fu\xc3\x9fg\xc3\xa4nger 1.0";
  EXPECT_TRUE(registry.start(request, [] {}).ok());
}

TEST_F(RegistryTest, RefusesOriginAndRateThatAreNoNumbers) {
  StartRequest request = start_of("a", "r");
  request.origin_world.y = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(registry.start(request, [] {}).status().code(), absl::StatusCode::kInvalidArgument);
  request = start_of("a", "r");
  request.expected_rate_hz = -1.0;
  EXPECT_EQ(registry.start(request, [] {}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(RegistryTest, OneProducerAtATimeUnlessTakenOver) {
  bool revoked = false;
  const auto first = open(start_of("a", "one"), [&] { revoked = true; });
  EXPECT_EQ(registry.start(start_of("a", "two"), [] {}).status().code(),
            absl::StatusCode::kAlreadyExists);
  EXPECT_FALSE(revoked);
  StartRequest second = start_of("a", "two");
  second.take_over = true;
  const auto taken = open(second);
  EXPECT_TRUE(revoked);
  EXPECT_EQ(first->push(frame_of(0, {{0, 0, 0}})).status().code(), absl::StatusCode::kAborted);
  EXPECT_TRUE(taken->push(frame_of(0, {{0, 0, 0}})).ok());
}

TEST_F(RegistryTest, SameRunContinuesTheHistoryAndEndsItsStaleStream) {
  bool revoked = false;
  const auto stale = open(start_of("a", "run"), [&] { revoked = true; });
  ASSERT_TRUE(stale->push(frame_of(0, {{0, 0, 0}})).ok());
  const auto again = open(start_of("a", "run"));
  EXPECT_TRUE(revoked);
  ASSERT_TRUE(again->push(frame_of(100'000, {{1, 0, 0}})).ok());
  EXPECT_EQ(registry.list().at(0).frames, 2U);
  EXPECT_EQ(registry.list().at(0).oldest_time_us, 0);
  // and another seed would change who everybody is
  StartRequest other = start_of("a", "run");
  other.seed = 7;
  EXPECT_EQ(registry.start(other, [] {}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(RegistryTest, NewRunForgetsTheHistory) {
  {
    const auto first = open(start_of("a", "one"));
    ASSERT_TRUE(first->push(frame_of(5'000'000, {{0, 0, 0}})).ok());
  }
  const auto second = open(start_of("a", "two"));
  EXPECT_EQ(registry.list().at(0).frames, 0U);
  EXPECT_EQ(*second->push(frame_of(1, {{0, 0, 0}})), PushOutcome::kApplied);
}

TEST_F(RegistryTest, LateFramesAreCountedAndDropped) {
  const auto producer = open(start_of("a", "r"));
  EXPECT_EQ(*producer->push(frame_of(100, {{0, 0, 0}})), PushOutcome::kApplied);
  EXPECT_EQ(*producer->push(frame_of(100, {{0, 0, 0}})), PushOutcome::kLate);
  EXPECT_EQ(*producer->push(frame_of(50, {{0, 0, 0}})), PushOutcome::kLate);
  EXPECT_EQ(registry.list().at(0).late_frames, 2U);
}

TEST_F(RegistryTest, LiveWhileAProducerHoldsIt) {
  auto producer = open(start_of("a", "r"));
  EXPECT_TRUE(registry.list().at(0).live);
  EXPECT_EQ(registry.remove("a").code(), absl::StatusCode::kFailedPrecondition);
  producer.reset();
  EXPECT_FALSE(registry.list().at(0).live);
  const auto crowd = *registry.find("a");
  EXPECT_TRUE(registry.remove("a").ok());
  EXPECT_TRUE(crowd->deleted());
  EXPECT_EQ(registry.find("a").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(registry.remove("a").code(), absl::StatusCode::kNotFound);
}

TEST_F(RegistryTest, OverviewFitsTheCrowdAroundItsOrigin) {
  StartRequest request = start_of("a", "r");
  request.origin_world = {1'000'000.0, 0.0, 0.0};
  const auto producer = open(request);
  ASSERT_TRUE(producer->push(frame_of(0, {{0, 0, 0}, {20, 10, 0}})).ok());
  const Moment moment = (*registry.find("a"))->moment(now);
  EXPECT_NEAR(moment.overview.low.x, 999'999.0, 1e-6);
  EXPECT_NEAR(moment.overview.high.x, 1'000'021.0, 1e-6);
  EXPECT_TRUE(moment.live);
}

TEST_F(RegistryTest, OverviewOfNobodyFitsWhereSomebodyWas) {
  const auto producer = open(start_of("a", "r"));
  ASSERT_TRUE(producer->push(frame_of(0, {{30, 40, 0}})).ok());
  ASSERT_TRUE(producer->push(frame_of(100'000, {{50, 45, 0}})).ok());
  ASSERT_TRUE(producer->push(frame_of(200'000, {})).ok());
  const Moment moment = (*registry.find("a"))->moment(now);
  EXPECT_NEAR(moment.overview.low.x, 29.0, 1e-4);
  EXPECT_NEAR(moment.overview.high.x, 51.0, 1e-4);
  EXPECT_EQ(registry.list().at(0).box.low.x, 30.0);
  EXPECT_EQ(registry.list().at(0).agents, 0U);
  ASSERT_TRUE(producer->push(frame_of(300'000, {{32, 41, 0}})).ok());
  EXPECT_EQ(registry.list().at(0).box.low.x, 32.0);
}

TEST_F(RegistryTest, RefusesAWalkableAreaThatIsTooLong) {
  const auto producer = open(start_of("a", "r"));
  EXPECT_TRUE(producer->set_walkable_area("POLYGON ((0 0, 1 0, 1 1, 0 0))").ok());
  EXPECT_EQ(producer->set_walkable_area(std::string(limits.max_environment_bytes + 1, ' ')).code(),
            absl::StatusCode::kResourceExhausted);
  const absl::Status bad = producer->set_walkable_area("POLYGON ((0 0, 1 0");
  EXPECT_EQ(bad.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(bad.message().find("environment.walkable_area_wkt"), std::string::npos) << bad;
  EXPECT_EQ(registry.find("a").value()->report().walkable_area_wkt,
            "POLYGON ((0 0, 1 0, 1 1, 0 0))");
  EXPECT_EQ(registry.list().at(0).walkable_area_wkt, "") << "megabytes, every few seconds";
}

class RegistryRecordingTest : public RegistryTest {
 protected:
  std::vector<std::string> files() const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder.file(""))) {
      found.push_back(entry.path().string());
    }
    return found;
  }

  std::unique_ptr<Registry> started() {
    RecordSettings settings;
    settings.folder = folder.file("");
    settings.limit_bytes = 1u << 20;
    return std::make_unique<Registry>(
        tiny_cast(), limits, PlayoutSettings(), [this] { return now; }, settings);
  }

  test::TemporaryFolder folder;
  std::unique_ptr<Registry> recording = started();
};

TEST_F(RegistryRecordingTest, KeepsWhatWasAppliedAcrossAReconnect) {
  StartRequest request = start_of("hall", "run");
  request.origin_world = {1000.0, 0.0, 0.0};
  auto first = *recording->start(request, [] {});
  ASSERT_TRUE(first->set_walkable_area("POLYGON ((0 0, 1 0, 1 1, 0 0))").ok());
  EXPECT_TRUE(files().empty()) << "a run without frames leaves no file";
  ASSERT_TRUE(first->push(frame_of(0, {{1, 2, 0}})).ok());
  EXPECT_FALSE(first->push(frame_of(50'000, {{1e9F, 2, 0}})).ok());
  auto again = *recording->start(request, [] {});
  EXPECT_EQ(*again->push(frame_of(0, {{5, 5, 0}})), PushOutcome::kLate);
  ASSERT_TRUE(again->push(frame_of(100'000, {{1.5F, 2, 0}, {7, 7, 0}})).ok());

  again.reset();
  first.reset();
  recording.reset();  // writes what waits
  ASSERT_EQ(files().size(), 1U);
  auto reader = trajectory::open(files()[0]);
  ASSERT_TRUE(reader.ok()) << reader.status();
  EXPECT_EQ((*reader)->info().walkable_area_wkt, "POLYGON ((0 0, 1 0, 1 1, 0 0))");
  trajectory::Frame frame;
  ASSERT_TRUE(*(*reader)->next(frame));
  EXPECT_NEAR(frame.x_m[0], 1001.0, 1e-4);
  ASSERT_TRUE(*(*reader)->next(frame));
  EXPECT_EQ(frame.time_us, 100'000);
  EXPECT_EQ(frame.ids.size(), 2U);
  EXPECT_FALSE(*(*reader)->next(frame));
}

TEST_F(RegistryRecordingTest, AnotherRunGetsAnotherFile) {
  auto first = *recording->start(start_of("hall", "one"), [] {});
  ASSERT_TRUE(first->push(frame_of(0, {{1, 2, 0}})).ok());
  StartRequest request = start_of("hall", "two");
  request.take_over = true;
  auto second = *recording->start(request, [] {});
  ASSERT_TRUE(second->push(frame_of(0, {{1, 2, 0}})).ok());
  first.reset();
  second.reset();
  recording.reset();
  EXPECT_EQ(files().size(), 2U);
}

TEST_F(RegistryRecordingTest, BringsTheLastRunBackAndGoesOnWithIt) {
  StartRequest request = start_of("hall", "run");
  request.origin_world = {1000.0, 0.0, 50.0};
  request.channels = {{"mood", "1"}};
  auto producer = *recording->start(request, [] {});
  ASSERT_TRUE(producer->set_walkable_area("POLYGON ((0 0, 1 0, 1 1, 0 0))").ok());
  for (int i = 0; i < 3; ++i) {
    render::AgentFrame frame = frame_of(100'000 * i, {{1.0F + static_cast<float>(i), 2, 0}});
    frame.channels = {{0.5F}};
    ASSERT_TRUE(producer->push(frame).ok());
  }
  producer.reset();

  recording.reset();
  recording = started();
  EXPECT_TRUE(recording->list().empty());
  recording->resume();
  ASSERT_EQ(recording->list().size(), 1U);
  CrowdReport report = recording->find(recording->list().at(0).name).value()->report();
  EXPECT_FALSE(report.live);
  EXPECT_EQ(report.frames, 3U);
  EXPECT_EQ(report.newest_time_us, 200'000);
  EXPECT_EQ(report.run_id, "run");
  EXPECT_EQ(report.channels.at(0).unit, "1");
  EXPECT_EQ(report.walkable_area_wkt, "POLYGON ((0 0, 1 0, 1 1, 0 0))");
  EXPECT_NEAR(report.box.low.x, 1003.0, 1e-4);
  EXPECT_NEAR(report.box.low.z, 50.0, 1e-4);
  EXPECT_EQ((*recording->find("hall"))->moment(now + std::chrono::seconds(9)).scene_time_us,
            200'000);

  auto again = *recording->start(request, [] {});
  EXPECT_EQ(*again->push(frame_of(200'000, {{9, 9, 0}})), PushOutcome::kLate);
  EXPECT_EQ(*again->push(frame_of(300'000, {{4, 2, 0}})), PushOutcome::kApplied);
  EXPECT_EQ(recording->list()[0].frames, 4U);
  EXPECT_EQ(recording->list()[0].oldest_time_us, 0);
  again.reset();
  recording.reset();
  std::vector<std::string> parts = files();
  std::sort(parts.begin(), parts.end());
  ASSERT_EQ(parts.size(), 2U);
  const auto summary = trajectory::summarize(parts[0]);
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_EQ(summary->frames, 4U) << "one recording of the whole run";

  // Another run begins anew, in a recording of its own.
  recording = started();
  recording->resume();
  auto other = *recording->start(start_of("hall", "other"), [] {});
  ASSERT_TRUE(other->push(frame_of(0, {{1, 1, 0}})).ok());
  EXPECT_EQ(recording->list()[0].frames, 1U);
  other.reset();
  recording.reset();
  EXPECT_EQ(files().size(), 3U);
}

TEST_F(RegistryRecordingTest, ARemovedCrowdKeepsItsFilesAndStaysRemoved) {
  for (const char* run : {"one", "two"}) {
    StartRequest request = start_of("hall", run);
    auto producer = *recording->start(request, [] {});
    ASSERT_TRUE(producer->push(frame_of(0, {{1, 2, 0}})).ok());
  }
  ASSERT_TRUE(recording->remove("hall").ok());
  recording = started();
  recording->resume();
  EXPECT_TRUE(recording->list().empty());
  std::vector<std::string> parts = files();
  EXPECT_EQ(std::count_if(parts.begin(), parts.end(),
                          [](const std::string& path) { return path.ends_with(".trec"); }),
            2);

  // Who comes under the same name comes back; the runs before do not.
  auto again = *recording->start(start_of("hall", "three"), [] {});
  ASSERT_TRUE(again->push(frame_of(0, {{1, 2, 0}})).ok());
  again.reset();
  recording = started();
  recording->resume();
  ASSERT_EQ(recording->list().size(), 1U);
  EXPECT_EQ(recording->list()[0].run_id, "three");
}

TEST_F(RegistryRecordingTest, WhoComesWhileACrowdOfThatNameIsRemovedIsNotRemovedToo) {
  for (int round = 0; round < 20; ++round) {
    auto producer = *recording->start(start_of("hall", absl::StrCat("old", round)), [] {});
    ASSERT_TRUE(producer->push(frame_of(0, {{1, 2, 0}})).ok());
    producer.reset();
    const std::shared_ptr<NamedCrowd> old = *recording->find("hall");
    std::thread removing([&] { EXPECT_TRUE(recording->remove("hall").ok()); });
    while (!old->deleted()) std::this_thread::yield();
    // its recording is being written to the end
    auto next = recording->start(start_of("hall", absl::StrCat("new", round)), [] {});
    while (absl::IsUnavailable(next.status())) {
      std::this_thread::yield();
      next = recording->start(start_of("hall", absl::StrCat("new", round)), [] {});
    }
    EXPECT_TRUE(next.ok()) << next.status();
    const bool is_pushed = next.ok() && (*next)->push(frame_of(0, {{1, 2, 0}})).ok();
    removing.join();
    ASSERT_TRUE(is_pushed);
    next->reset();
    recording = started();
    recording->resume();
    ASSERT_EQ(recording->list().size(), 1U) << "round " << round;
    EXPECT_EQ(recording->list()[0].run_id, absl::StrCat("new", round));
    ASSERT_TRUE(recording->remove("hall").ok());
  }
}

TEST_F(RegistryRecordingTest, ARunComesBackWithoutAnAreaThatCanNotBeBuilt) {
  trajectory::RecordingSpec spec;
  spec.crowd = "hall";
  {
    trajectory::RecordingWriter writer(folder.file(""), spec, 1u << 20);
    ASSERT_TRUE(writer.set_walkable_area("POLYGON (broken").ok());
    const std::uint64_t ids[] = {1};
    const float position[] = {1.0F, 2.0F, 0.0F};
    writer.set_members(ids, {});
    ASSERT_TRUE(writer.write(0, position, {}, {}).ok());
  }
  recording->resume();
  ASSERT_EQ(recording->list().size(), 1U);
  EXPECT_EQ(recording->list()[0].agents, 1U);
  EXPECT_EQ(recording->find(recording->list()[0].name).value()->report().walkable_area_wkt, "");
}

TEST_F(RegistryRecordingTest, AFrameThatDoesNotFitCostsItselfOnly) {
  RecordSettings settings;
  settings.folder = folder.file("");
  trajectory::RecordingSpec spec;
  spec.crowd = "odd";
  Recording recorded(settings, spec);
  recorded.write(frame_of(10, {{1, 2, 0}}));
  recorded.write(frame_of(20, {{2e7F, 2, 0}}));
  recorded.write(frame_of(30, {{1, 2, 0}}));
  recorded.wait_idle();
  EXPECT_EQ(recorded.counters().written_frames, 2U);
  EXPECT_EQ(recorded.counters().lost_frames, 1U);
}

TEST_F(RegistryRecordingTest, ABrokenDiskDisturbsNobody) {
  RecordSettings settings;
  settings.folder = folder.file("gone");
  Registry broken(
      tiny_cast(), limits, {}, [this] { return now; }, settings);
  auto producer = *broken.start(start_of("hall", "one"), [] {});
  EXPECT_TRUE(producer->push(frame_of(0, {{1, 2, 0}})).ok());
  EXPECT_TRUE(producer->push(frame_of(1, {{1, 2, 0}})).ok());
}

TEST_F(RegistryRecordingTest, AFullQueueLosesFramesOfTheRecordingAndCountsThem) {
  RecordSettings settings;
  settings.folder = folder.file("gone");
  settings.queue_bytes = 1;
  Recording broken(settings, {});
  for (int i = 0; i < 50; ++i) broken.write(frame_of(i, {{1, 2, 0}}));
  broken.wait_idle();
  EXPECT_EQ(broken.counters().lost_frames, 50U);
  EXPECT_EQ(broken.counters().written_frames, 0U);

  settings.folder = folder.file("");
  trajectory::RecordingSpec spec;
  spec.crowd = "queue";
  {
    Recording narrow(settings, spec);
    for (int i = 0; i < 50; ++i) narrow.write(frame_of(i, {{1, 2, 0}}));
    narrow.wait_idle();
    const Recording::Counters counters = narrow.counters();
    EXPECT_GE(counters.written_frames, 1U);
    EXPECT_EQ(counters.written_frames + counters.lost_frames, 50U);
  }
  ASSERT_EQ(files().size(), 1U);
}

TEST_F(RegistryRecordingTest, AFrameThatCameTooLateSpoilsNoFile) {
  RecordSettings settings;
  settings.folder = folder.file("");
  trajectory::RecordingSpec spec;
  spec.crowd = "late";
  {
    Recording recorded(settings, spec);
    for (const int time_us : {10, 30, 20, 30, 40}) recorded.write(frame_of(time_us, {{1, 2, 0}}));
    recorded.wait_idle();
    EXPECT_EQ(recorded.counters().written_frames, 3U);
  }
  const auto summary = trajectory::summarize(files().at(0));
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_EQ(summary->frames, 3U);
}

}  // namespace
}  // namespace throng::server
