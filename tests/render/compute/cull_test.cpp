#include <gtest/gtest.h>

#include <vector>

#include "frame_fixture.hpp"

namespace throng::render {
namespace {

class CullTest : public testing::TestWithParam<BackendKind> {
 protected:
  void SetUp() override {
    if (auto backend = make_backend(GetParam()); !backend.ok()) {
      GTEST_SKIP() << backend.status().message();
    }
  }
};

INSTANTIATE_TEST_SUITE_P(Backends, CullTest, testing::Values(BackendKind::kCpu, BackendKind::kCuda),
                         [](const auto& info) {
                           return info.param == BackendKind::kCpu ? "Cpu" : "Cuda";
                         });

TEST_P(CullTest, AgreesWithBruteForceInClipSpace) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 3000, 120.0);
  test::Stage stage(cast, GetParam());
  stage.camera.eye_world = {5.0, -20.0, 6.0};
  stage.camera.target_world = {0.0, 10.0, 0.0};
  stage.viewport = {640, 360};
  stage.advance(*crowd, 0);
  stage.cull();
  std::vector<std::uint8_t> visible(stage.instances->count);
  ASSERT_TRUE(stage.backend->read_visible(*stage.view, visible).ok());

  // a sphere is outside when all of it is beyond one side of clip space: distances to the planes in
  // float64, normals from the matrix
  const glm::dmat4 m(clip_from_relative(stage.camera, stage.viewport));
  const Snapshot& snapshot = *crowd->newest();
  std::uint32_t kept = 0, disputed = 0;
  for (std::size_t slot = 0; slot < visible.size(); ++slot) {
    const Roster& roster = *crowd->bracket(0).older->roster;
    const glm::dvec4 bounds(cast->members[roster.character[slot]].character.gait_bounds);
    const double scale = roster.scale[slot];
    const glm::dvec3 center = glm::dvec3(crowd->bracket(0).older->position_m[slot]) +
                              glm::dvec3(0, 0, bounds.z * scale) - stage.camera.eye_world;
    const double radius = bounds.w * scale;
    const auto row = [&](int r) { return glm::dvec4(m[0][r], m[1][r], m[2][r], m[3][r]); };
    double margin = 1e9;
    for (const glm::dvec4& plane :
         {row(3) + row(0), row(3) - row(0), row(3) + row(1), row(3) - row(1), row(3) - row(2)}) {
      margin = std::min(
          margin, (glm::dot(glm::dvec3(plane), center) + plane.w) / glm::length(glm::dvec3(plane)) +
                      radius);
    }
    if (std::abs(margin) < 1e-3) {
      ++disputed;
    } else {
      EXPECT_EQ(visible[slot] != 0, margin > 0.0) << "slot " << slot << " margin " << margin;
    }
    EXPECT_TRUE(margin < 0.0 || visible[slot] == 1) << "one too few";
    kept += visible[slot];
  }
  EXPECT_EQ(stage.counters().visible, kept);
  EXPECT_GT(kept, 100U);
  EXPECT_LT(kept, 2900U);
  EXPECT_LT(disputed, 10U);
  EXPECT_EQ(stage.counters().agents, snapshot.present_count);
}

TEST_P(CullTest, KeepsSphereThatOnlyTouchesPlane) {
  const auto cast = test::tiny_cast();
  // looking along +Y with an orthographic window 20 m high and wide: the right side is x = 10
  test::Stage stage(cast, GetParam());
  stage.viewport = {512, 512};
  stage.camera.eye_world = {0.0, -50.0, 0.0};
  stage.camera.target_world = {0.0, 0.0, 0.0};
  stage.camera.ortho_height_m = 20.0;
  stage.camera.far_m = 100.0;
  const auto probe = test::standing_crowd(cast, {{0, 0, 0}});
  stage.advance(*probe, 0);
  stage.finish();
  const float radius_m = stage.geometry().instances[0].radius_m;

  const auto crowd = test::standing_crowd(cast, {{10.0F + radius_m, 0, 0}});
  stage.advance(*crowd, 0);
  stage.cull();
  EXPECT_EQ(stage.counters().visible, 1U);
  const auto beyond = test::standing_crowd(cast, {{10.0F + radius_m + 0.01F, 0, 0}});
  stage.advance(*beyond, 0);
  stage.cull();
  EXPECT_EQ(stage.counters().visible, 0U);
}

TEST_P(CullTest, WhoStandsAtTheEyeIsLeftOut) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::standing_crowd(cast, {{0.2F, 0.2F, 0}, {0.5F, 0.2F, 0}, {0, 0.2F, 8}});
  test::Stage stage(cast, GetParam());
  stage.camera.eye_world = {0.0, 0.0, 1.6};
  stage.camera.target_world = {0.0, 1.0, 1.6};
  stage.advance(*crowd, 0);
  stage.cull();
  std::vector<std::uint8_t> visible(3);
  ASSERT_TRUE(stage.backend->read_visible(*stage.view, visible).ok());
  EXPECT_EQ(visible, (std::vector<std::uint8_t>{0, 1, 0}));  // the last is above the picture
  stage.camera.eye_world.z = 30.0;
  stage.camera.target_world = {0.0, 0.01, 0.0};  // from far above nobody is at the eye
  stage.cull();
  EXPECT_EQ(stage.counters().visible, 3U);
  stage.camera.eye_world.z = 1.6;
  stage.camera.ortho_height_m = 10.0;  // nor where rays have no common eye
  stage.camera.target_world = {0.0, 1.0, 1.6};
  stage.cull();
  ASSERT_TRUE(stage.backend->read_visible(*stage.view, visible).ok());
  EXPECT_EQ(visible[0], 1U);
}

TEST_P(CullTest, VisibleListKeepsTheOrderOfSlots) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 20'000, 300.0);
  test::Stage stage(cast, GetParam(), 3);
  stage.advance(*crowd, 0);
  stage.finish({.vertex_budget = 1000});
  const auto instances = stage.geometry().instances;
  ASSERT_GT(instances.size(), 1000U);
  for (std::size_t v = 1; v < instances.size(); ++v) {
    ASSERT_LT(instances[v - 1].slot, instances[v].slot);
  }
}

TEST_P(CullTest, WorksFarFromTheOriginOfTheWorld) {
  const auto cast = test::tiny_cast();
  CrowdSettings settings;
  settings.origin_world = {5e6, -3e6, 120.0};
  const auto crowd = test::standing_crowd(cast, {{1.25F, 2.5F, 0.0F}}, settings);
  test::Stage stage(cast, GetParam());
  stage.camera.eye_world = settings.origin_world + glm::dvec3(1.0, -10.0, 2.0);
  stage.camera.target_world = settings.origin_world;
  stage.advance(*crowd, 0);
  stage.finish();
  ASSERT_EQ(stage.geometry().instances.size(), 1U);
  const glm::vec3 feet = stage.geometry().instances[0].position_relative;
  EXPECT_EQ(feet, glm::vec3(0.25F, 12.5F, -2.0F));
}

TEST_P(CullTest, EmptyCrowdIsAllowed) {
  const auto cast = test::tiny_cast();
  Crowd crowd(cast, {});
  ASSERT_TRUE(crowd.push(test::frame_at(0, test::members({}), {})).ok());
  test::Stage stage(cast, GetParam());
  stage.advance(crowd, 0);
  stage.finish();
  EXPECT_EQ(stage.counters().visible, 0U);
  EXPECT_EQ(stage.counters().vertices, 0U);
  ASSERT_EQ(stage.geometry().vertex_offset.size(), 1U);
  EXPECT_EQ(stage.geometry().vertex_offset[0], 0U);
}

TEST_P(CullTest, RejectsWhatTheCallerBroke) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::standing_crowd(cast, {{0, 0, 0}, {1, 0, 0}});
  test::Stage stage(cast, GetParam());
  EXPECT_EQ(stage.backend->select(*stage.view, {}).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(stage.backend->allocate(*stage.view).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(stage.backend->generate(*stage.view).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(stage.geometry().vertices.size(), 0U);
  stage.advance(*crowd, 0);
  EXPECT_EQ(stage.backend->cull(*stage.view, nullptr, stage.camera, stage.viewport).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(stage.backend->cull(*stage.view, stage.instances, stage.camera, {0, 720}).code(),
            absl::StatusCode::kInvalidArgument);
  Camera camera = stage.camera;
  camera.eye_world.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(stage.backend->cull(*stage.view, stage.instances, camera, stage.viewport).code(),
            absl::StatusCode::kInvalidArgument);
  camera = stage.camera;
  camera.fov_y_rad = 4.0;
  EXPECT_EQ(stage.backend->cull(*stage.view, stage.instances, camera, stage.viewport).code(),
            absl::StatusCode::kInvalidArgument);
  stage.cull();
  std::vector<std::uint8_t> mask(1);
  const absl::Status status = stage.backend->read_visible(*stage.view, mask);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status.message(), "read_visible: visible has 1 elements, must have 2");
  const absl::Status alpha = stage.backend->select(*stage.view, {.alpha = -1.0F});
  EXPECT_EQ(alpha.message(), "select: alpha is -1, must be 3");
}

TEST(BackendTest, CudaIsUnavailableWithAReasonWhereItWasNotBuilt) {
  const auto backend = make_backend(BackendKind::kCuda);
  if (backend.ok()) GTEST_SKIP() << "this machine has CUDA";
  EXPECT_EQ(backend.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_FALSE(backend.status().message().empty());
}

TEST(BackendTest, SnapshotBeforeCastIsRefused) {
  auto backend = make_backend(BackendKind::kCpu, 1).value();
  const auto crowd = test::standing_crowd(test::tiny_cast(), {{0, 0, 0}});
  EXPECT_EQ(backend->upload(crowd->newest()).status().code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST(BackendTest, SnapshotWithForeignCharacterIsRefused) {
  auto backend = make_backend(BackendKind::kCpu, 1).value();
  auto small = std::make_shared<Cast>(*test::tiny_cast());
  small->members.resize(1);
  ASSERT_TRUE(backend->upload(small).ok());
  const auto crowd = test::walking_crowd(test::tiny_cast(), 50, 10.0);
  EXPECT_EQ(backend->upload(crowd->newest()).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace throng::render
