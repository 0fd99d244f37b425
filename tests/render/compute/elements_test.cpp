#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "crowd_fixture.hpp"
#include "render/compute/element/angle.hpp"
#include "render/compute/element/frustum.hpp"
#include "render/compute/element/instance.hpp"
#include "render/compute/element/pose.hpp"
#include "render/compute/element/selection.hpp"
#include "render/compute/element/skinning.hpp"

namespace throng::render::element {
namespace {

TEST(AngleTest, SineAndCosineAreWithinAMillionth) {
  for (int i = -5000; i <= 5000; ++i) {
    const float angle_rad = static_cast<float>(i) * 0.01F;
    const SinCos result = sin_cos(angle_rad);
    EXPECT_NEAR(result.sine, std::sin(static_cast<double>(angle_rad)), 1e-6) << angle_rad;
    EXPECT_NEAR(result.cosine, std::cos(static_cast<double>(angle_rad)), 1e-6) << angle_rad;
  }
}

TEST(AngleTest, InterpolationTakesTheShorterArc) {
  EXPECT_NEAR(std::fabs(lerp_angle(3.0F, -3.0F, 0.5F)), kPi, 1e-5);
  EXPECT_NEAR(lerp_angle(0.5F, -0.5F, 0.5F), 0.0F, 1e-6);
  EXPECT_NEAR(lerp_angle(-3.0F, 3.0F, 0.0F), -3.0F, 1e-6);
  EXPECT_NEAR(lerp_angle(-3.0F, 3.0F, 1.0F), 3.0F, 1e-6);
}

TEST(SelectionTest, CubeRootIsWithinTwoUnitsInTheLastPlace) {
  for (double x = 1e-29; x < 1e30; x *= 1.37) {
    const float value = static_cast<float>(x);
    const double exact = std::cbrt(static_cast<double>(value));
    const float result = cube_root(value);
    const double unit =
        std::nextafter(static_cast<float>(exact), 1e38F) - static_cast<float>(exact);
    EXPECT_LE(std::fabs(result - exact), 2.0 * unit) << value;
  }
}

TEST(SelectionTest, ShareIsAtLeastOneAndBounded) {
  EXPECT_EQ(selection_share(0.0F), 1U);
  EXPECT_EQ(selection_share(-1.0F), 1U);
  EXPECT_EQ(selection_share(std::numeric_limits<float>::quiet_NaN()), 1U);
  EXPECT_EQ(selection_share(std::numeric_limits<float>::infinity()), kLargestShare);
  EXPECT_EQ(selection_share(8.0F), 2097152U);
}

TEST(SelectionTest, DealIsClampedAndNeverOverflows) {
  EXPECT_EQ(deal(std::uint64_t{10} << 32, 7, 1, 1000), 70U);
  EXPECT_EQ(deal(std::uint64_t{10} << 32, 7, 100, 1000), 100U);
  EXPECT_EQ(deal(std::uint64_t{10} << 32, 700, 100, 1000), 1000U);
  EXPECT_EQ(deal(std::numeric_limits<std::uint64_t>::max(), kLargestShare, 3, 4000), 4000U);
  EXPECT_EQ(deal(0, kLargestShare, 3, 4000), 3U);
  // floor, not round: 2/3 of 10 shares
  EXPECT_EQ(deal((std::uint64_t{2} << 32) / 3, 10, 0, 100), 6U);
}

TEST(SelectionTest, WeightIsAreaOverDistance) {
  const Projection projection{500.0F, 1280.0F * 720.0F, 1};
  const float expected =
      static_cast<float>(3.14159265 * (500.0 * 1.0 / 20.0) * (500.0 / 20.0) / 20.0);
  EXPECT_NEAR(selection_weight(projection, 1.0F, 20.0F), expected, 1e-3);
  // inside the sphere: the distance is the radius, the area at most the viewport
  EXPECT_EQ(selection_weight(projection, 2.0F, 0.0F), selection_weight(projection, 2.0F, 1.0F));
  EXPECT_LE(selection_weight(projection, 2.0F, 0.0F), 1280.0F * 720.0F / 2.0F);
}

TEST(OctahedralTest, RoundTripKeepsDirectionWithinATenthOfAMilliradian) {
  for (int i = 0; i < 5000; ++i) {
    const double z = 2.0 * test::noise(2 * i) - 1.0;
    const double turn = 6.283185307 * test::noise(2 * i + 1);
    const double radius = std::sqrt(1.0 - z * z);
    const glm::vec3 unit(radius * std::cos(turn), radius * std::sin(turn), z);
    // any length: blended matrices don't keep it
    const std::uint32_t code = pack_octahedral(unit.x * 3.0F, unit.y * 3.0F, unit.z * 3.0F);
    glm::i16vec2 packed;
    std::memcpy(&packed, &code, sizeof code);
    EXPECT_LT(glm::length(unpack_octahedral(packed) - unit), 1e-4F);
    EXPECT_LE(glm::length(glm::vec2(packed) - glm::vec2(encode_octahedral(unit))), 1.5F);
  }
  EXPECT_EQ(pack_octahedral(0.0F, 0.0F, 0.0F), 0U);
  EXPECT_EQ(pack_octahedral(0.0F, 0.0F, 1.0F), 0U);
}

TEST(FrustumTest, SphereThatOnlyTouchesAPlaneIsInside) {
  Frustum frustum;
  for (glm::vec4& plane : frustum.planes) plane = {0, 0, 0, 1e30F};
  frustum.planes[0] = {1, 0, 0, -10};  // x >= 10
  EXPECT_TRUE(touches(frustum, {9, 0, 0, 1}));
  EXPECT_TRUE(touches(frustum, {9.0F, 1000.0F, -1000.0F, 1.0F}));
  EXPECT_FALSE(touches(frustum, {8.99F, 0, 0, 1}));
  EXPECT_FALSE(touches(frustum, {20, 0, 0, -1})) << "an empty slot";
}

TEST(SkinningTest, AgreesWithDoublePrecisionReference) {
  // random palette, weights and vertices, against equation 2 in float64
  for (int trial = 0; trial < 300; ++trial) {
    std::uint64_t n = 1000 * trial;
    JointMatrix palette[8];
    for (JointMatrix& joint : palette) {
      for (int k = 0; k < 16; ++k) {
        joint.m[k] = k % 4 == 3 ? 0.0F : static_cast<float>(2.0 * test::noise(n++) - 1.0);
      }
    }
    SourceVertex source;
    source.position_m = {test::noise(n), test::noise(n + 1), 2.0 * test::noise(n + 2)};
    source.normal =
        glm::normalize(glm::vec3(test::noise(n + 3) - 0.5, test::noise(n + 4) - 0.5, 0.3));
    n += 5;
    source.joint_weight = {120, 80, 40, 15};
    for (int k = 0; k < 4; ++k)
      source.joint_index[k] = static_cast<std::uint8_t>(8.0 * test::noise(n++));

    glm::dvec3 position(0.0), normal(0.0);
    for (int k = 0; k < 4; ++k) {
      const double weight = source.joint_weight[k] / 255.0;
      const float* m = palette[source.joint_index[k]].m;
      for (int r = 0; r < 3; ++r) {
        position[r] += weight * (static_cast<double>(m[r]) * source.position_m.x +
                                 static_cast<double>(m[4 + r]) * source.position_m.y +
                                 static_cast<double>(m[8 + r]) * source.position_m.z + m[12 + r]);
        normal[r] += weight * (static_cast<double>(m[r]) * source.normal.x +
                               static_cast<double>(m[4 + r]) * source.normal.y +
                               static_cast<double>(m[8 + r]) * source.normal.z);
      }
    }
    const SkinnedVertex result = skin(source, palette);
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(result.position_m[r], position[r], 1e-6);
      EXPECT_NEAR(result.normal[r], normal[r], 1e-6);
    }
  }
}

TEST(SkinningTest, PosedJointTurnsAndScalesTheMixedMatrix) {
  JointMatrix a{}, b{};
  a.m[0] = a.m[5] = a.m[10] = 1.0F;  // identity
  b = a;
  b.m[12] = 2.0F;  // and one moved by 2 m along x
  Pose pose;
  pose.a_frame1 = 1;
  pose.a_t = 0.5F;  // half way
  const JointMatrix frames[2] = {a, b};
  JointMatrix result;
  pose_joint(pose, place(kPi / 2.0F, 1.1F), frames, 1, result);
  // the middle, 1 m along x, is turned to +y and scaled
  EXPECT_NEAR(result.m[12], 0.0F, 1e-6);
  EXPECT_NEAR(result.m[13], 1.1F, 1e-6);
  EXPECT_NEAR(result.m[10], 1.1F, 1e-6);
  EXPECT_NEAR(result.m[1], 1.1F, 1e-6);
}

Gait three_clips() {
  Gait gait;
  gait.idle = {0, 10, 10.0F};
  gait.walk = {10, 20, 20.0F};
  gait.run = {30, 12, 20.0F};
  return gait;
}

TEST(GaitTest, WeightsSumToOneAndNeverMixIdleWithRun) {
  const Gait gait = three_clips();
  for (std::uint32_t seed = 0; seed < 50; ++seed) {
    for (float speed_mps = 0.0F; speed_mps < 6.0F; speed_mps += 0.01F) {
      const GaitWeights weights = gait_weights(gait, seed, speed_mps);
      EXPECT_NEAR(weights.idle + weights.walk + weights.run, 1.0F, 1e-6);
      EXPECT_GE(weights.idle, 0.0F);
      EXPECT_GE(weights.walk, 0.0F);
      EXPECT_TRUE(weights.idle == 0.0F || weights.run == 0.0F);
    }
    EXPECT_EQ(gait_weights(gait, seed, 0.0F).idle, 1.0F);
    EXPECT_EQ(gait_weights(gait, seed, 1.4F).walk, 1.0F);
    EXPECT_EQ(gait_weights(gait, seed, 4.0F).run, 1.0F);
  }
}

TEST(GaitTest, SlowWalkTakesShorterSteps) {
  const Gait gait = three_clips();
  EXPECT_NEAR(stride_m(gait, gait_weights(gait, 1, 1.35F)), 1.4F, 1e-5);
  const float half = stride_m(gait, gait_weights(gait, 1, 0.675F));
  EXPECT_NEAR(half, 1.4F * std::sqrt(0.5F), 1e-4);
  EXPECT_GE(stride_m(gait, gait_weights(gait, 1, 0.0F)), 0.25F * 1.4F - 1e-6F);
}

TEST(PoseTest, WalkPhaseFollowsCyclesAndWrapsToTheFirstFrame) {
  const Gait gait = three_clips();
  const Pose pose = choose_pose(gait, 7, 1.4F, 0.0F, 123.975, 5'000'000);
  EXPECT_EQ(pose.a_frame0, 29U);  // 0.975 of 20 frames: 19.5
  EXPECT_EQ(pose.a_frame1, 10U);
  EXPECT_NEAR(pose.a_t, 0.5F, 1e-4);
  EXPECT_EQ(pose.b_weight, 0.0F);
  const Pose backwards = choose_pose(gait, 7, 1.4F, 0.0F, -0.025, 0);
  EXPECT_EQ(backwards.a_frame0, 29U);
}

TEST(PoseTest, StandingAgentPlaysIdleWithTimeAndItsOwnOffset) {
  const Gait gait = three_clips();
  const Pose now = choose_pose(gait, 7, 0.0F, 0.0F, 3.3, 0);
  const Pose a_second_later = choose_pose(gait, 7, 0.0F, 0.0F, 3.3, 1'000'000);
  EXPECT_LT(now.a_frame0, 10U);
  EXPECT_EQ(now.a_frame0, a_second_later.a_frame0) << "the clip takes one second";
  const Pose half_later = choose_pose(gait, 7, 0.0F, 0.0F, 3.3, 500'000);
  EXPECT_EQ(half_later.a_frame0, (now.a_frame0 + 5) % 10);
  bool differs = false;
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    differs |= choose_pose(gait, seed, 0.0F, 0.0F, 3.3, 0).a_frame0 != now.a_frame0;
  }
  EXPECT_TRUE(differs);
}

TEST(PoseTest, MissingClipsAreStoodInFor) {
  Gait only_walk;
  only_walk.walk = {4, 8, 10.0F};
  EXPECT_GE(choose_pose(only_walk, 1, 0.0F, 0.0F, 0.0, 0).a_frame0, 4U);
  EXPECT_GE(choose_pose(only_walk, 1, 9.0F, 0.0F, 0.0, 0).a_frame0, 4U);
  Gait only_idle;
  only_idle.idle = {2, 3, 10.0F};
  const Pose pose = choose_pose(only_idle, 1, 5.0F, 0.0F, 0.7, 0);
  EXPECT_GE(pose.a_frame0, 2U);
  EXPECT_LT(pose.a_frame0, 5U);
  EXPECT_EQ(pose.b_weight, 0.0F);
}

TEST(BetweenTest, ExtrapolationIsLimitedAndThenHeld) {
  const Between inside = between(0, 100, 25, 500'000);
  EXPECT_FLOAT_EQ(inside.t, 0.25F);
  EXPECT_FALSE(inside.at_newer);
  const Between shortly_after = between(0, 100'000, 300'000, 500'000);
  EXPECT_TRUE(shortly_after.at_newer);
  EXPECT_FLOAT_EQ(shortly_after.ahead_s, 0.2F);
  EXPECT_FLOAT_EQ(shortly_after.pace, 1.0F);
  const Between long_after = between(0, 100'000, 9'000'000, 500'000);
  EXPECT_FLOAT_EQ(long_after.ahead_s, 0.5F);
  EXPECT_FLOAT_EQ(long_after.pace, 0.0F);
  const Between before = between(0, 0, -5'000'000, 500'000);
  EXPECT_FLOAT_EQ(before.ahead_s, 0.0F);
  EXPECT_FLOAT_EQ(before.pace, 1.0F);
}

}  // namespace
}  // namespace throng::render::element
