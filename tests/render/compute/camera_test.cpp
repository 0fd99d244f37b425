#include "throng/render/camera.hpp"

#include <gtest/gtest.h>

namespace throng::render {
namespace {

glm::vec4 project(const Camera& camera, const Viewport& viewport, const glm::dvec3& world) {
  return clip_from_relative(camera, viewport) * glm::vec4(world - camera.eye_world, 1.0);
}

TEST(CameraTest, NearPlaneIsDepthOneAndFarAwayIsDepthZero) {
  Camera camera;
  camera.eye_world = {0, 0, 0};
  camera.target_world = {0, 1, 0};
  camera.near_m = 0.5;
  const glm::vec4 near = project(camera, {}, {0, 0.5, 0});
  EXPECT_FLOAT_EQ(near.z / near.w, 1.0F);
  const glm::vec4 far = project(camera, {}, {0, 1e6, 0});
  EXPECT_LT(far.z / far.w, 1e-6F);
  EXPECT_GT(far.z, 0.0F);
  const glm::vec4 closer = project(camera, {}, {0, 10, 0});
  EXPECT_GT(closer.z / closer.w, far.z / far.w);
}

TEST(CameraTest, RightIsPositiveXAndUpIsPositiveY) {
  Camera camera;  // looks north
  const glm::vec4 east = project(camera, {}, {1, 0, 1});
  EXPECT_GT(east.x, 0.0F);
  const glm::vec4 above = project(camera, {}, {0, 0, 3});
  EXPECT_GT(above.y / above.w, project(camera, {}, {0, 0, 0}).y / east.w);
}

TEST(CameraTest, LookingStraightDownHasNorthUp) {
  Camera camera;
  camera.eye_world = {5, 7, 50};
  camera.target_world = {5, 7, 0};
  const glm::vec4 north = project(camera, {}, {5, 8, 0});
  EXPECT_GT(north.y, 0.0F);
  EXPECT_NEAR(north.x, 0.0F, 1e-5);
  const glm::vec4 east = project(camera, {}, {6, 7, 0});
  EXPECT_GT(east.x, 0.0F);
}

TEST(CameraTest, OrthographicHeightFillsTheViewport) {
  Camera camera;
  camera.eye_world = {0, 0, 100};
  camera.target_world = {0, 0, 0};
  camera.ortho_height_m = 20.0;
  camera.far_m = 200.0;
  const Viewport viewport{200, 100};
  const glm::vec4 corner = project(camera, viewport, {20, 10, 0});
  EXPECT_NEAR(corner.x, 1.0F, 1e-5);
  EXPECT_NEAR(corner.y, 1.0F, 1e-5);
  EXPECT_FLOAT_EQ(corner.w, 1.0F);
  EXPECT_GT(corner.z, 0.0F);
  EXPECT_LT(corner.z, 1.0F);
}

TEST(CameraTest, OverviewShowsAllCornersOfTheBox) {
  for (const Viewport viewport : {Viewport{1280, 720}, Viewport{300, 900}, Viewport{64, 64}}) {
    for (const double pitch_rad : {0.1, 0.6, 1.5}) {
      const glm::dvec3 low(1000, -40, 0), high(1100, 20, 2);
      const Camera camera = overview_camera(low, high, viewport, pitch_rad);
      glm::vec2 least(1.0F), most(-1.0F);
      for (int c = 0; c < 8; ++c) {
        const glm::dvec3 corner((c & 1) != 0 ? high.x : low.x, (c & 2) != 0 ? high.y : low.y,
                                (c & 4) != 0 ? high.z : low.z);
        const glm::vec4 clip = project(camera, viewport, corner);
        least = glm::min(least, glm::vec2(clip) / clip.w);
        most = glm::max(most, glm::vec2(clip) / clip.w);
        EXPECT_GT(clip.w, 0.0F);
        EXPECT_LE(std::abs(clip.x), clip.w);
        EXPECT_LE(std::abs(clip.y), clip.w);
        EXPECT_LE(clip.z, clip.w);
      }
      // It fills the picture's width or its height, and leaves as much on either side.
      EXPECT_NEAR(std::max(most.x - least.x, most.y - least.y), 2.0F / 1.06F, 0.01F);
      EXPECT_NEAR(least.x, -most.x, 0.01F);
      EXPECT_NEAR(least.y, -most.y, 0.01F);
      EXPECT_NEAR(camera.target_world.z, 1.0, 1e-6);
    }
  }
}

TEST(CameraTest, OverviewOfAPointStandsAFewMetresAway) {
  const Camera camera = overview_camera({1, 2, 0}, {1, 2, 0}, {});
  EXPECT_GE(glm::length(camera.eye_world - camera.target_world), 3.0 - 1e-9);
}

}  // namespace
}  // namespace throng::render
