#include "simplify/report/sampling.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "simplify/bake/bake.hpp"
#include "support/source_shapes.hpp"
#include "support/tiny_character.hpp"

namespace throng::simplify {
namespace {

using ::testing::HasSubstr;

// idle: frames 0 to 7, bends a little; walk: 8 to 23, bends most in frames 12 and 20
render::Character tiny() { return *render::make_character(test::make_tiny_character()); }

SamplingCost cost_of(const render::Character& character, std::vector<std::uint32_t> frames) {
  auto cost = measure_sampling(character, frames);
  EXPECT_TRUE(cost.ok()) << cost.status();
  return *std::move(cost);
}

TEST(SamplingTest, AllFramesCostNothing) {
  std::vector<std::uint32_t> frames(24);
  std::iota(frames.begin(), frames.end(), 0U);
  const SamplingCost cost = cost_of(tiny(), frames);
  EXPECT_EQ(cost.frames, 24U);
  EXPECT_EQ(cost.sampled, 24U);
  EXPECT_EQ(cost.farthest, "");
  ASSERT_EQ(cost.levels.size(), 5U);
  for (const SamplingCost::Level& level : cost.levels) {
    EXPECT_EQ(level.excess(level.all), 0.0F);
    EXPECT_EQ(level.worst_left_out, "");
    EXPECT_EQ(level.sampled.max_m, level.all.max_m);
    EXPECT_GE(level.all.max_m, level.all.rms_m);
  }
}

TEST(SamplingTest, MissedPoseRaisesTheFigures) {
  const render::Character character = tiny();
  const SamplingCost good = cost_of(character, {0, 12, 20});
  const SamplingCost bad = cost_of(character, {0, 1, 2, 3, 4});
  EXPECT_EQ(good.sampled, 3U);
  EXPECT_EQ(bad.sampled, 5U);
  EXPECT_TRUE(bad.farthest == "walk frame 4" || bad.farthest == "walk frame 12") << bad.farthest;
  EXPECT_GT(bad.farthest_m, 1.5F * good.farthest_m);
  // the coarsest one has no ring at the bend
  const SamplingCost::Level &seen = good.levels.back(), &missed = bad.levels.back();
  EXPECT_LE(seen.excess(seen.all), 0.0F);
  EXPECT_GT(missed.excess(missed.usual), 0.05F);
  EXPECT_GT(missed.all.max_m, missed.sampled.max_m);
  EXPECT_THAT(missed.worst_left_out, HasSubstr("walk"));
  EXPECT_GT(missed.worst_left_out_rms_m, missed.sampled.rms_m);
  EXPECT_EQ(seen.all.rms_m, missed.all.rms_m);
}

TEST(SamplingTest, OtherClipsAreToldApart) {
  render::CharacterData data = test::make_tiny_character();
  data.clips[1].kind = render::ClipKind::kOther;
  const SamplingCost cost = cost_of(*render::make_character(std::move(data)), {0, 2, 6});
  EXPECT_EQ(cost.frames, 24U);
  EXPECT_EQ(cost.usual, 8U);
  EXPECT_THAT(cost.farthest, HasSubstr("walk"));
  const SamplingCost::Level& coarsest = cost.levels.back();
  EXPECT_LE(coarsest.excess(coarsest.usual), 0.0F);
  EXPECT_GT(coarsest.excess(coarsest.all), 0.05F);
  EXPECT_THAT(coarsest.worst_left_out, HasSubstr("walk"));
}

TEST(SamplingTest, BindPoseAloneIsWhatItIsComparedWith) {
  const SamplingCost cost = cost_of(tiny(), {});
  EXPECT_EQ(cost.sampled, 0U);
  EXPECT_GT(cost.levels.back().sampled.rms_m, 0.0F);
  EXPECT_GT(cost.levels.back().excess(cost.levels.back().all), 0.0F);
}

TEST(SamplingTest, FrameThatIsNotThereIsNamed) {
  const auto cost = measure_sampling(tiny(), std::vector<std::uint32_t>{3, 24});
  EXPECT_EQ(cost.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(cost.status().message()), HasSubstr("sampled frame is 24"));
}

TEST(SamplingTest, BakeTellsItsFramesAndFewerOnesLeaveMoreOut) {
  float farthest_m = -1.0F;
  for (const std::uint32_t most : {2U, 24U}) {
    BakeOptions options;
    options.max_poses = most;
    test::TubeOptions tube;
    tube.has_elbow = true;
    auto result = bake(test::make_tube(tube), options);
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_EQ(result->pose_frames.size() + 1, result->pose_count);
    EXPECT_LE(result->pose_count, most);
    const auto character = render::make_character(std::move(result->character));
    ASSERT_TRUE(character.ok()) << character.status();
    const SamplingCost cost = cost_of(*character, result->pose_frames);
    EXPECT_EQ(cost.sampled, result->pose_frames.size());
    if (farthest_m >= 0.0F) {
      EXPECT_LT(cost.farthest_m, farthest_m);
    }
    farthest_m = cost.farthest_m;
  }
}

}  // namespace
}  // namespace throng::simplify
