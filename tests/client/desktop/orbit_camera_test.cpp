#include "client/desktop/orbit_camera.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "throng/render/camera.hpp"
#include "throng/v1/common.pb.h"

namespace throng::client {
namespace {

constexpr glm::dvec2 kSizePx(800.0, 450.0);

OrbitCamera some_camera(bool ortho) {
  OrbitCamera camera;
  camera.target_world = {3.0, -2.0, 1.0};
  camera.distance_m = 17.0;
  camera.yaw_rad = 0.7;
  camera.pitch_rad = 0.4;
  camera.ortho = ortho;
  return camera;
}

/// The camera as the server draws with it.
render::Camera drawn_with(const OrbitCamera& camera) {
  render::Camera drawn;
  drawn.eye_world = camera.eye_world();
  drawn.target_world = camera.target_world;
  drawn.up_world = camera.up();
  drawn.fov_y_rad = camera.fov_y_deg * std::numbers::pi / 180.0;
  drawn.ortho_height_m = camera.ortho ? camera.height_at_target_m() : 0.0;
  return drawn;
}

class OrbitCameraTest : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Projections, OrbitCameraTest, testing::Bool(),
                         [](const auto& info) { return info.param ? "Ortho" : "Perspective"; });

TEST_P(OrbitCameraTest, ProjectsWhereThePictureHasIt) {
  const OrbitCamera camera = some_camera(GetParam());
  const Projector projector(camera, kSizePx);
  const glm::mat4 clip = render::clip_from_relative(drawn_with(camera), {800, 450});
  for (const glm::dvec3& point :
       {glm::dvec3(3, -2, 1), glm::dvec3(0, 0, 0), glm::dvec3(6, 1, 1.8), glm::dvec3(-4, -7, 0)}) {
    const auto place = projector.project(point);
    ASSERT_TRUE(place.has_value());
    const glm::vec4 at = clip * glm::vec4(glm::vec3(point - camera.eye_world()), 1.0F);
    EXPECT_NEAR(place->px.x, (1.0 + at.x / at.w) * 400.0, 0.01);
    EXPECT_NEAR(place->px.y, (1.0 - at.y / at.w) * 225.0, 0.01);
  }
}

TEST_P(OrbitCameraTest, TravelsThroughItsMessage) {
  for (const double pitch_rad : {0.4, std::numbers::pi / 2}) {
    OrbitCamera camera = some_camera(GetParam());
    camera.pitch_rad = pitch_rad;
    v1::Camera message;
    camera.write(message);
    const OrbitCamera back = OrbitCamera::read(message);
    EXPECT_NEAR(glm::distance(back.eye_world(), camera.eye_world()), 0.0, 1e-6);
    EXPECT_NEAR(back.yaw_rad, camera.yaw_rad, 1e-6);
    EXPECT_NEAR(back.distance_m, camera.distance_m, 1e-9);
    EXPECT_EQ(back.ortho, camera.ortho);
  }
}

TEST_P(OrbitCameraTest, ZoomKeepsThePointUnderThePointer) {
  OrbitCamera camera = some_camera(GetParam());
  const glm::dvec2 pointer_px(610.0, 330.0);
  const glm::dvec3 ground = camera.ground_at(pointer_px, kSizePx, 0.0);
  EXPECT_NEAR(ground.z, 0.0, 1e-9);
  camera.zoom(0.5, ground);
  const auto place = Projector(camera, kSizePx).project(ground);
  ASSERT_TRUE(place.has_value());
  EXPECT_NEAR(glm::distance(place->px, pointer_px), 0.0, 1e-6);
  EXPECT_NEAR(camera.distance_m, 8.5, 1e-9);
}

TEST_P(OrbitCameraTest, FitShowsEveryCornerAndNoMoreThanItMust) {
  OrbitCamera camera = some_camera(GetParam());
  const glm::dvec3 low(-10, -5, 0), high(20, 9, 1.8);
  camera.fit(low, high, kSizePx.x / kSizePx.y);
  const Projector projector(camera, kSizePx);
  double nearest_edge_px = 1e9;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const auto place =
        projector.project({(corner & 1U) != 0 ? high.x : low.x, (corner & 2U) != 0 ? high.y : low.y,
                           (corner & 4U) != 0 ? high.z : low.z});
    ASSERT_TRUE(place.has_value());
    nearest_edge_px = std::min({nearest_edge_px, place->px.x, place->px.y, kSizePx.x - place->px.x,
                                kSizePx.y - place->px.y});
  }
  EXPECT_GT(nearest_edge_px, 0.0);
  EXPECT_LT(nearest_edge_px, 60.0);
}

TEST(OrbitCamera, StaysWithinItsLimits) {
  OrbitCamera camera;
  for (int i = 0; i < 100; ++i) camera.orbit(1.0, 1.0);
  EXPECT_NEAR(camera.pitch_rad, std::numbers::pi / 2, 1e-12);
  EXPECT_LE(std::abs(camera.yaw_rad), std::numbers::pi);
  for (int i = 0; i < 100; ++i) camera.zoom(0.1, camera.target_world);
  EXPECT_NEAR(camera.distance_m, 0.6, 1e-9);
  for (int i = 0; i < 100; ++i) camera.zoom(10.0, camera.target_world);
  EXPECT_NEAR(camera.distance_m, 20000.0, 1e-6);
}

TEST(OrbitCamera, ZoomComesCloseToAFace) {
  OrbitCamera camera;
  camera.target_world = {3.0, 4.0, 1.0};
  const glm::dvec2 size_px(1280, 720);
  const glm::dvec3 face(5.0, 6.0, 1.45);
  for (int notch = 0; notch < 60; ++notch) {
    // the pointer is held on the face
    const auto at = Projector(camera, size_px).project(face);
    ASSERT_TRUE(at.has_value()) << notch;
    camera.zoom(0.85, camera.ground_at(at->px, size_px, camera.zoom_height_m()));
  }
  EXPECT_LT(glm::distance(camera.eye_world(), face), 0.9);
  EXPECT_GT(camera.eye_world().z, 1.4);
}

TEST(OrbitCamera, NothingIsSeenBehindTheEye) {
  const OrbitCamera camera = some_camera(false);
  const Projector projector(camera, kSizePx);
  const glm::dvec3 behind = camera.eye_world() + camera.outward() * 5.0;
  EXPECT_FALSE(projector.project(behind).has_value());
  EXPECT_TRUE(projector.line(behind, camera.target_world).has_value());
  EXPECT_FALSE(projector.line(behind, behind + camera.right()).has_value());
}

TEST(OrbitCamera, GlideTakesTheShorterWayRound) {
  OrbitCamera from, to;
  from.yaw_rad = 3.0;
  to.yaw_rad = -3.0;
  to.distance_m = 80.0;
  const OrbitCamera middle = between(from, to, 0.5);
  EXPECT_NEAR(std::abs(middle.yaw_rad), std::numbers::pi, 1e-9);
  EXPECT_NEAR(middle.distance_m, 40.0, 1e-9);
  EXPECT_NEAR(between(from, to, 1.0).yaw_rad, -3.0, 1e-9);
}

}  // namespace
}  // namespace throng::client
