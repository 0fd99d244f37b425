#include <gtest/gtest.h>

#include <numeric>

#include "simplify/bake/clips.hpp"
#include "simplify/collapse/collapse.hpp"
#include "support/source_shapes.hpp"

namespace throng::simplify {
namespace {

struct Prepared {
  Surface surface;
  std::vector<render::Affine> palette;
};

Prepared prepare() {
  test::TubeOptions tube;
  tube.has_elbow = true;
  const SourceCharacter source = test::make_tube(tube);
  std::vector<std::string> notes;
  return {*rebuild(source), bake_clips(source, notes)->palette};
}

TEST(PosesTest, BindPoseComesFirst) {
  const Prepared prepared = prepare();
  const PoseSet poses = sample_poses(prepared.surface, prepared.palette, 2, 6);
  EXPECT_EQ(poses.count, 6U);
  for (std::size_t i = 0; i < prepared.surface.points.size(); ++i) {
    EXPECT_EQ(poses.position[i], prepared.surface.points[i].position);
  }
  EXPECT_NEAR(std::accumulate(poses.weight.begin(), poses.weight.end(), 0.0F), 1.0F, 1.0e-5F);
}

TEST(PosesTest, FarthestPoseIsChosenFirst) {
  const Prepared prepared = prepare();
  const PoseSet poses = sample_poses(prepared.surface, prepared.palette, 2, 2);
  ASSERT_EQ(poses.count, 2U);
  // no frame's top is farther from where it stands in the bind pose
  const std::size_t points = prepared.surface.points.size();
  std::vector<glm::vec3> position(points);
  const auto distance_m = [&](std::span<const glm::vec3> at) {
    float sum = 0.0F;
    for (std::size_t i = 0; i < points; ++i)
      sum += glm::distance(at[i], prepared.surface.points[i].position);
    return sum;
  };
  const float chosen = distance_m(std::span(poses.position).subspan(points));
  for (std::size_t f = 0; f < prepared.palette.size() / 2; ++f) {
    skin(prepared.surface.points, std::span(prepared.palette).subspan(f * 2, 2), position);
    EXPECT_LE(distance_m(position), chosen * 1.01F);
  }
}

TEST(PosesTest, EqualFramesAreTakenOnce) {
  Prepared prepared = prepare();
  const std::vector<render::Affine> frame(prepared.palette.begin() + 6,
                                          prepared.palette.begin() + 8);
  prepared.palette.clear();
  for (int i = 0; i < 50; ++i)
    prepared.palette.insert(prepared.palette.end(), frame.begin(), frame.end());
  EXPECT_EQ(sample_poses(prepared.surface, prepared.palette, 2, 24).count, 2U);
}

TEST(PosesTest, NoFrameLeavesTheBindPoseAlone) {
  const Prepared prepared = prepare();
  const PoseSet poses = sample_poses(prepared.surface, {}, 2, 24);
  EXPECT_EQ(poses.count, 1U);
  EXPECT_EQ(poses.weight[0], 1.0F);
}

TEST(PosesTest, AllPosesCountEveryFrameAndNotTheBindPose) {
  const Prepared prepared = prepare();
  const PoseSet poses = all_poses(prepared.surface, prepared.palette, 2);
  EXPECT_EQ(poses.count, 13U);
  EXPECT_EQ(poses.weight[0], 0.0F);
  EXPECT_NEAR(poses.weight[1], 1.0F / 12, 1.0e-6F);
}

TEST(PosesTest, MemoryIsBounded) {
  Prepared prepared = prepare();
  const std::vector<render::Affine> frame(prepared.palette.begin(), prepared.palette.begin() + 2);
  for (int i = 0; i < 1000; ++i)
    prepared.palette.insert(prepared.palette.end(), frame.begin(), frame.end());
  EXPECT_LE(all_poses(prepared.surface, prepared.palette, 2, 1U << 20U).count, 61U);
}

}  // namespace
}  // namespace throng::simplify
