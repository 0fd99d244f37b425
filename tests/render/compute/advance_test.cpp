#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "frame_fixture.hpp"

namespace throng::render {
namespace {

using test::frame_at;
using test::members;

/// Feet of the visible agents by id, in the crowd's frame.
std::map<std::uint64_t, VisibleInstance> shown(test::Stage& stage, const Crowd& crowd,
                                               std::int64_t time_us, int channel = -1) {
  stage.advance(crowd, time_us, channel);
  stage.finish();
  std::map<std::uint64_t, VisibleInstance> result;
  const Bracket bracket = crowd.bracket(time_us);
  for (VisibleInstance instance : stage.geometry().instances) {
    instance.position_relative += glm::vec3(stage.camera.eye_world);
    result[bracket.older->roster->id[instance.slot]] = instance;
  }
  return result;
}

TEST(AdvanceTest, PositionsGoStraightBetweenSamples) {
  const auto cast = test::tiny_cast();
  Crowd crowd(cast, {});
  const auto who = members({5, 6});
  ASSERT_TRUE(crowd.push(frame_at(0, who, {{0, 0, 0}, {3, 0, 0}})).ok());
  ASSERT_TRUE(crowd.push(frame_at(1'000'000, who, {{1, 0.5F, 0.25F}, {3, 0, 0}})).ok());
  test::Stage stage(cast);
  const auto agents = shown(stage, crowd, 250'000);
  ASSERT_EQ(agents.size(), 2U);
  EXPECT_NEAR(agents.at(5).position_relative.x, 0.25F, 1e-5);
  EXPECT_NEAR(agents.at(5).position_relative.y, 0.125F, 1e-5);
  EXPECT_NEAR(agents.at(5).position_relative.z, 0.0625F, 1e-5);
  EXPECT_NEAR(agents.at(6).position_relative.x, 3.0F, 1e-5);
}

TEST(AdvanceTest, AgentThatLeavesWalksOnUntilItIsGone) {
  const auto cast = test::tiny_cast();
  Crowd crowd(cast, {});
  const auto both = members({5, 6});
  for (int f = 0; f < 5; ++f) {
    ASSERT_TRUE(crowd.push(frame_at(100'000 * f, both, {{0.1F * f, 0, 0}, {0, 4, 0}})).ok());
  }
  ASSERT_TRUE(crowd.push(frame_at(500'000, members({6}, 2), {{0, 4, 0}})).ok());
  test::Stage stage(cast);
  auto agents = shown(stage, crowd, 450'000);
  ASSERT_EQ(agents.size(), 2U);
  EXPECT_NEAR(agents.at(5).position_relative.x, 0.45F, 1e-3) << "one metre per second";
  agents = shown(stage, crowd, 500'000);
  ASSERT_EQ(agents.size(), 1U);
  EXPECT_EQ(agents.count(6), 1U);
  EXPECT_EQ(stage.counters().agents, 1U);
}

TEST(AdvanceTest, ReusedSlotDoesNotStreakAcross) {
  const auto cast = test::tiny_cast();
  Crowd crowd(cast, {});
  ASSERT_TRUE(crowd.push(frame_at(0, members({5}), {{-8, 0, 0}})).ok());
  ASSERT_TRUE(crowd.push(frame_at(100'000, members({77}, 2), {{8, 0, 0}})).ok());
  const Bracket bracket = crowd.bracket(50'000);
  ASSERT_EQ(bracket.newer->present.size(), 1U) << "77 took the slot of 5";
  test::Stage stage(cast);
  auto agents = shown(stage, crowd, 50'000);
  ASSERT_EQ(agents.size(), 1U);
  EXPECT_NEAR(agents.at(5).position_relative.x, -8.0F, 1e-5);
  EXPECT_EQ(agents.at(5).seed, bracket.older->roster->seed[0]);
  agents = shown(stage, crowd, 100'000);
  EXPECT_NEAR(agents.at(77).position_relative.x, 8.0F, 1e-5);
  EXPECT_EQ(agents.at(77).seed, bracket.newer->roster->seed[0]);
}

TEST(AdvanceTest, TeleportJumpsInsteadOfSliding) {
  const auto cast = test::tiny_cast();
  Crowd crowd(cast, {});
  const auto who = members({5});
  ASSERT_TRUE(crowd.push(frame_at(0, who, {{-9, 0, 0}})).ok());
  ASSERT_TRUE(crowd.push(frame_at(100'000, who, {{9, 0, 0}})).ok());
  test::Stage stage(cast);
  EXPECT_NEAR(shown(stage, crowd, 90'000).at(5).position_relative.x, -9.0F, 1e-5);
  EXPECT_NEAR(shown(stage, crowd, 100'000).at(5).position_relative.x, 9.0F, 1e-5);
}

TEST(AdvanceTest, GapIsExtrapolatedForTheLimitThenHeld) {
  const auto cast = test::tiny_cast();
  CrowdSettings settings;
  settings.extrapolate_limit_us = 300'000;
  Crowd crowd(cast, settings);
  const auto who = members({5});
  for (int f = 0; f < 10; ++f) {
    ASSERT_TRUE(crowd.push(frame_at(100'000 * f, who, {{0.1F * f, 0, 0}})).ok());
  }
  test::Stage stage(cast);
  EXPECT_NEAR(shown(stage, crowd, 1'000'000).at(5).position_relative.x, 1.0F, 1e-3);
  EXPECT_NEAR(shown(stage, crowd, 1'200'000).at(5).position_relative.x, 1.2F, 1e-3);
  EXPECT_NEAR(shown(stage, crowd, 60'000'000).at(5).position_relative.x, 1.2F, 1e-3);
}

TEST(AdvanceTest, TimeBeforeTheHistoryShowsItsFirstSample) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::standing_crowd(cast, {{2, 0, 0}});
  test::Stage stage(cast);
  EXPECT_NEAR(shown(stage, *crowd, -5'000'000).at(1).position_relative.x, 2.0F, 1e-5);
}

TEST(AdvanceTest, AgentFacesItsWayFromTheFirstFrameOn) {
  const auto cast = test::tiny_cast();
  Crowd crowd(cast, {});
  const auto who = members({5});
  ASSERT_TRUE(crowd.push(frame_at(0, who, {{0, 0, 0}})).ok());
  ASSERT_TRUE(crowd.push(frame_at(1'000'000, who, {{-1, 0, 0}})).ok());
  test::Stage stage(cast);
  for (const std::int64_t time_us : {0, 400'000, 1'000'000, 1'200'000}) {
    EXPECT_NEAR(std::fabs(shown(stage, crowd, time_us).at(5).heading_rad), 3.14159F, 1e-4)
        << time_us;
  }
}

TEST(AdvanceTest, ChannelIsInterpolatedAndMissingOneIsNan) {
  const auto cast = test::tiny_cast();
  CrowdSettings settings;
  settings.channel_names = {"density", "stress"};
  Crowd crowd(cast, settings);
  const auto who = members({5});
  AgentFrame first = frame_at(0, who, {{0, 0, 0}});
  first.channels = {{1.0F}, {10.0F}};
  AgentFrame second = frame_at(100'000, who, {{0, 0, 0}});
  second.channels = {{2.0F}, {20.0F}};
  ASSERT_TRUE(crowd.push(first).ok());
  ASSERT_TRUE(crowd.push(second).ok());
  test::Stage stage(cast);
  EXPECT_NEAR(shown(stage, crowd, 50'000, 1).at(5).channel, 15.0F, 1e-4);
  EXPECT_TRUE(std::isnan(shown(stage, crowd, 50'000, -1).at(5).channel));
  EXPECT_TRUE(std::isnan(shown(stage, crowd, 50'000, 9).at(5).channel));
}

TEST(AdvanceTest, SameInstancesForAnyOrderOfPlay) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 300, 20.0, 10);
  test::Stage stage(cast);
  const auto forward = shown(stage, *crowd, 333'000);
  shown(stage, *crowd, 800'000);
  const auto again = shown(stage, *crowd, 333'000);
  ASSERT_EQ(forward.size(), again.size());
  for (const auto& [id, instance] : forward) {
    EXPECT_EQ(instance.position_relative, again.at(id).position_relative);
    EXPECT_EQ(instance.heading_rad, again.at(id).heading_rad);
  }
}

TEST(AdvanceTest, OlderAfterNewerIsRefused) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 3, 5.0, 2);
  test::Stage stage(cast);
  const Bracket bracket = crowd->bracket(50'000);
  const auto older = stage.backend->upload(bracket.older).value();
  const auto newer = stage.backend->upload(bracket.newer).value();
  EXPECT_EQ(stage.backend->advance(*newer, *older, 0, {}, -1, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace throng::render
