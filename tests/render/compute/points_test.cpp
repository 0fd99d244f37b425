#include <gtest/gtest.h>

#include <glm/glm.hpp>

#include "frame_fixture.hpp"
#include "simplify/points/points.hpp"
#include "support/tiny_character.hpp"

namespace throng::render {
namespace {

std::shared_ptr<const Cast> cast_with_points(std::uint32_t count) {
  CharacterData data = test::make_tiny_character();
  simplify::sample_points(data, {.count = count});
  auto character = make_character(std::move(data));
  EXPECT_TRUE(character.ok()) << character.status();
  Cast cast;
  cast.members.push_back({*std::move(character), 1.0F});
  return std::make_shared<const Cast>(std::move(cast));
}

Selection points(float size_px, PoseMode pose = PoseMode::kExact) {
  return {.pose_mode = pose,
          .geometry = GeometryKind::kFused,
          .form = FormRule::kPoints,
          .point_size_px = size_px};
}

TEST(PointsTest, SmallerPointsAreMore) {
  const auto cast = cast_with_points(1024);
  const auto crowd = test::standing_crowd(cast, {{0, 0, 0}, {3, 30, 0}, {-20, 80, 0}});
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  std::size_t last = 0;
  for (const float size_px : {64.0F, 16.0F, 4.0F, 1.0F}) {
    stage.finish(points(size_px));
    const FrameGeometry geometry = stage.geometry();
    EXPECT_GT(geometry.splats.size(), last);
    last = geometry.splats.size();
    EXPECT_EQ(stage.counters().vertices, last);
    EXPECT_TRUE(geometry.vertices.empty());
    for (const Splat& splat : geometry.splats) {
      const VisibleInstance& instance = geometry.instances[splat.visible];
      const float px_per_m =
          0.5F * 720.0F / std::tan(0.5F * 0.785398F) / glm::length(instance.position_relative);
      const bool all = instance.vertex_count == 1024;
      EXPECT_TRUE(all || 2.0F * splat.radius_m * px_per_m < 1.15F * size_px);
    }
  }
}

TEST(PointsTest, PointsLieOnTheirAgentsSurface) {
  const auto cast = cast_with_points(256);
  const auto crowd = test::walking_crowd(cast, 12, 8.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  stage.finish(points(1.0F));
  const FrameGeometry drawn = stage.geometry();
  ASSERT_GT(drawn.splats.size(), 12U);
  for (const Splat& splat : drawn.splats) {
    const VisibleInstance& instance = drawn.instances[splat.visible];
    const glm::vec3 from_feet =
        (splat.position_relative - instance.position_relative) / instance.scale;
    EXPECT_LT(glm::length(glm::vec2(from_feet)), 0.8F);
    EXPECT_GT(from_feet.z, -0.2F);
    EXPECT_LT(from_feet.z, 2.0F);
  }
}

TEST(PointsTest, SharedPosesDifferLittle) {
  const auto cast = cast_with_points(256);
  const auto crowd = test::walking_crowd(cast, 30, 40.0);
  test::Stage stage(cast);
  stage.camera.eye_world = {0.0, -160.0, 40.0};
  stage.advance(*crowd, 0);
  stage.finish(points(1.0F));
  const FrameGeometry exact = stage.geometry();
  const std::vector<Splat> own(exact.splats.begin(), exact.splats.end());
  stage.finish(points(1.0F, PoseMode::kShared));
  const FrameGeometry shared = stage.geometry();
  EXPECT_GT(stage.counters().shared_poses, 0U);
  ASSERT_EQ(shared.splats.size(), own.size());
  double sum_m = 0.0;
  for (std::size_t i = 0; i < own.size(); ++i) {
    EXPECT_EQ(shared.splats[i].visible, own[i].visible);
    EXPECT_EQ(shared.splats[i].base, own[i].base);
    sum_m += static_cast<double>(
        glm::distance(shared.splats[i].position_relative, own[i].position_relative));
  }
  EXPECT_LT(sum_m / static_cast<double>(own.size()), 0.08);
}

TEST(PointsTest, CharacterWithoutPointsKeepsItsMesh) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 10, 10.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  stage.finish(points(1.0F));
  EXPECT_TRUE(stage.geometry().splats.empty());
  EXPECT_EQ(stage.counters().drawn_as[1], stage.geometry().instances.size());
}

TEST(PointsTest, SizeThatIsNoSizeIsRefusedByName) {
  const auto cast = cast_with_points(16);
  const auto crowd = test::standing_crowd(cast, {{0, 0, 0}});
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  stage.cull();
  for (const float size_px : {0.0F, -1.0F, std::nanf("")}) {
    const absl::Status status = stage.backend->select(*stage.view, points(size_px));
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(std::string(status.message()).find("point_size_px"), std::string::npos);
  }
}

}  // namespace
}  // namespace throng::render
