#include <gtest/gtest.h>

#include <glm/glm.hpp>

#include "frame_fixture.hpp"
#include "throng/render/relief.hpp"

namespace throng::render {
namespace {

/// Whose boxes nobody looks into here.
std::shared_ptr<const Cast> cast_with_impostors() {
  auto cast = std::make_shared<Cast>(*test::tiny_cast());
  for (CastMember& member : cast->members) {
    member.character.relief = std::make_shared<const Relief>();
  }
  return cast;
}

constexpr Selection kOwnMesh{.vertex_budget = 20'000'000};

Selection with(FormRule form, PoseMode pose, GeometryKind geometry) {
  return {.vertex_budget = 20'000'000, .pose_mode = pose, .geometry = geometry, .form = form};
}

TEST(FormsTest, ImpostorsHaveJointsInsteadOfVertices) {
  const auto cast = cast_with_impostors();
  const auto crowd = test::walking_crowd(cast, 60, 20.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  for (const FormRule form : {FormRule::kImpostor}) {
    for (const GeometryKind kind : {GeometryKind::kBatched, GeometryKind::kFused}) {
      stage.finish(with(form, PoseMode::kShared, kind));
      const FrameGeometry geometry = stage.geometry();
      const std::size_t count = geometry.instances.size();
      ASSERT_GT(count, 0U);
      EXPECT_TRUE(geometry.vertices.empty());
      EXPECT_TRUE(geometry.indices.empty());
      ASSERT_EQ(geometry.representation.size(), count);
      ASSERT_EQ(geometry.jointed.size(), count);
      const std::size_t joints = cast->members[0].character.joint_count();
      for (const JointedInstance& jointed : geometry.jointed) {
        EXPECT_LE(std::size_t{16} * (jointed.first_joint + joints), geometry.joints.size());
      }
      EXPECT_EQ(stage.counters().drawn_as[form == FormRule::kImpostor ? 2 : 3], count);
      EXPECT_EQ(stage.counters().vertices, 0U);
    }
  }
}

TEST(FormsTest, JointsMoveVerticesToWhereTheMeshHasThem) {
  const auto cast = cast_with_impostors();
  const auto crowd = test::walking_crowd(cast, 20, 10.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  stage.finish(with(FormRule::kImpostor, PoseMode::kExact, GeometryKind::kBatched));
  const FrameGeometry drawn = stage.geometry();
  const std::vector<JointedInstance> jointed(drawn.jointed.begin(), drawn.jointed.end());
  const std::vector<float> joints(drawn.joints.begin(), drawn.joints.end());
  stage.finish(kOwnMesh);
  const FrameGeometry meshes = stage.geometry();
  ASSERT_EQ(jointed.size(), meshes.instances.size());
  for (std::size_t v = 0; v < jointed.size(); ++v) {
    const VisibleInstance& instance = meshes.instances[v];
    const Character& character = cast->members[instance.character].character;
    ASSERT_EQ(instance.vertex_count, character.vertex_count());
    for (std::uint32_t i = 0; i < instance.vertex_count; ++i) {
      glm::vec3 model(0.0F);
      for (int k = 0; k < 4; ++k) {
        const float weight = static_cast<float>(character.joint_weight[i][k]) / 255.0F;
        if (weight == 0.0F) continue;
        const float* m =
            &joints[std::size_t{16} * (jointed[v].first_joint + character.joint_index[i][k])];
        const glm::vec3& p = character.position[i];
        for (int r = 0; r < 3; ++r)
          model[r] += weight * (m[r] * p.x + m[4 + r] * p.y + m[8 + r] * p.z + m[12 + r]);
      }
      const float c = jointed[v].cosine_scale, s = jointed[v].sine_scale;
      const glm::vec3 expected =
          instance.position_relative +
          glm::vec3(c * model.x - s * model.y, s * model.x + c * model.y, instance.scale * model.z);
      const BatchVertex& vertex = meshes.vertices[meshes.vertex_offset[v] + i];
      EXPECT_LT(glm::distance(vertex.position_relative, expected), 1e-4F);
    }
  }
}

TEST(FormsTest, MixedSpendsNoMoreThanTheBudget) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 900, 60.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  for (const std::uint64_t budget : {0ULL, 12'000ULL, 20'000ULL, 1'000'000ULL}) {
    for (const PoseMode pose : {PoseMode::kShared, PoseMode::kExact}) {
      Selection selection = with(FormRule::kMixed, pose, GeometryKind::kFused);
      selection.vertex_budget = budget;
      selection.mixed.error_px = 0.01F;
      stage.finish(selection);
      EXPECT_LE(stage.counters().vertices, stage.counters().effective_budget);
      std::uint64_t least = 0;
      for (const VisibleInstance& instance : stage.geometry().instances) {
        const Character& character = cast->members[instance.character].character;
        EXPECT_EQ(character.legal_count[instance.vertex_count], instance.vertex_count);
        least += character.coarsest_count;
      }
      EXPECT_LE(stage.counters().vertices, std::max(budget, least));
    }
  }
}

TEST(FormsTest, MixedTakesFewerVerticesWhereMoreErrorIsAllowed) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 300, 40.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  std::uint64_t before = ~std::uint64_t{0};
  for (const float error_px : {0.001F, 0.05F, 0.4F, 3.0F}) {
    Selection selection = with(FormRule::kMixed, PoseMode::kShared, GeometryKind::kFused);
    selection.mixed.error_px = error_px;
    stage.finish(selection);
    EXPECT_LE(stage.counters().vertices, before);
    before = stage.counters().vertices;
  }
}

TEST(FormsTest, OfThoseUnderAPixelSomeStandForAll) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 4000, 300.0);
  test::Stage stage(cast);
  stage.camera.eye_world = {0.0, -4000.0, 900.0};  // half a pixel tall
  stage.advance(*crowd, 0);
  stage.finish(with(FormRule::kMixed, PoseMode::kShared, GeometryKind::kFused));
  const ComputeCounters counters = stage.counters();
  const std::uint32_t none = counters.drawn_as[0], drawn = counters.drawn_as[1];
  EXPECT_EQ(none + drawn, counters.visible);
  EXPECT_GT(none, counters.visible / 3);
  EXPECT_GT(drawn, counters.visible / 20);
  // the same agents the next time
  const auto first = stage.geometry().representation;
  const std::vector<Representation> kept(first.begin(), first.end());
  stage.finish(with(FormRule::kMixed, PoseMode::kShared, GeometryKind::kFused));
  const auto again = stage.geometry().representation;
  EXPECT_TRUE(std::equal(kept.begin(), kept.end(), again.begin(), again.end()));
}

}  // namespace
}  // namespace throng::render
