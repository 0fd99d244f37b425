#include <gtest/gtest.h>

#include <cmath>

#include "frame_fixture.hpp"

namespace throng::render {
namespace {

const Character& character_of(const test::Stage& stage, const VisibleInstance& instance) {
  return stage.cast->members[instance.character].character;
}

void generate(test::Stage& stage, const Crowd& crowd, const Selection& selection) {
  stage.advance(crowd, 0);
  stage.finish(selection);
}

std::uint64_t least_sum(const test::Stage& stage) {
  std::uint64_t sum = 0;
  for (const VisibleInstance& instance : stage.geometry().instances) {
    sum += character_of(stage, instance).coarsest_count;
  }
  return sum;
}

TEST(SelectTest, SpendsNothingOnEmptyCrowd) {
  const auto cast = test::tiny_cast();
  // everybody is behind the camera
  const auto crowd = test::standing_crowd(cast, {{0, -100, 0}, {3, -120, 0}});
  test::Stage stage(cast);
  for (const LodRule rule : {LodRule::kBudget, LodRule::kDong2019}) {
    generate(stage, *crowd, {.vertex_budget = 1000, .rule = rule});
    EXPECT_EQ(stage.counters().vertices, 0U);
    EXPECT_EQ(stage.counters().triangles, 0U);
    EXPECT_EQ(stage.counters().effective_budget, 1000U);
  }
}

TEST(SelectTest, OneInstanceTakesWhatItCanUse) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::standing_crowd(cast, {{0, 0, 0}});
  test::Stage stage(cast);
  for (const LodRule rule : {LodRule::kBudget, LodRule::kDong2019}) {
    generate(stage, *crowd, {.vertex_budget = 1'000'000, .rule = rule});
    EXPECT_EQ(stage.geometry().instances[0].vertex_count, 38U);
    generate(stage, *crowd, {.vertex_budget = 38, .rule = rule});
    EXPECT_EQ(stage.geometry().instances[0].vertex_count, 38U);
    generate(stage, *crowd, {.vertex_budget = 0, .rule = rule});
    EXPECT_EQ(stage.geometry().instances[0].vertex_count, 12U) << "the coarsest";
    EXPECT_EQ(stage.counters().effective_budget, 12U);
  }
}

TEST(SelectTest, CountsAreLegalAndWithinTheCharacter) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 500, 40.0);
  test::Stage stage(cast);
  for (std::uint64_t budget = 0; budget < 22'000; budget += 701) {
    generate(stage, *crowd, {.vertex_budget = budget});
    for (const VisibleInstance& instance : stage.geometry().instances) {
      const Character& character = character_of(stage, instance);
      EXPECT_EQ(character.legal_count[instance.vertex_count], instance.vertex_count);
      EXPECT_GE(instance.vertex_count, character.coarsest_count);
      EXPECT_EQ(instance.triangle_count, character.triangle_count_at[instance.vertex_count]);
    }
  }
}

TEST(SelectTest, BudgetIsNeverExceededAndWellUsed) {
  const auto cast = test::tiny_cast();
  test::Stage stage(cast);
  for (const std::size_t agents : {1U, 2U, 17U, 1000U, 9000U}) {
    for (const double side_m : {4.0, 60.0, 900.0}) {
      const auto crowd = test::walking_crowd(cast, agents, side_m);
      stage.camera.eye_world = {0.0, -0.7 * side_m, 0.3 * side_m};
      for (const std::uint64_t budget :
           {0U, 1U, 100U, 5000U, 20'000U, 100'000U, 200'000U, 1'000'000U}) {
        generate(stage, *crowd, {.vertex_budget = budget});
        const ComputeCounters counters = stage.counters();
        const std::uint64_t least = least_sum(stage);
        EXPECT_EQ(counters.effective_budget, std::max<std::uint64_t>(budget, least));
        EXPECT_LE(counters.vertices, counters.effective_budget)
            << agents << " agents, " << side_m << " m, budget " << budget;
        const std::uint64_t full = 38U * counters.visible;
        const std::uint64_t usable = std::min<std::uint64_t>(full, counters.effective_budget);
        if (counters.visible > 100) {
          EXPECT_GE(static_cast<double>(counters.vertices), 0.97 * static_cast<double>(usable))
              << agents << " agents, " << side_m << " m, budget " << budget;
        }
        EXPECT_TRUE(budget < full || counters.vertices == full);
      }
    }
  }
}

TEST(SelectTest, MoreInstancesThanBudgetGivesEachTheCoarsest) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 2000, 30.0);
  test::Stage stage(cast);
  generate(stage, *crowd, {.vertex_budget = 1500});
  for (const VisibleInstance& instance : stage.geometry().instances) {
    EXPECT_EQ(instance.vertex_count, 12U);
  }
  EXPECT_EQ(stage.counters().effective_budget, 12U * stage.counters().visible);
}

TEST(SelectTest, NearerAgentGetsAtLeastAsManyVertices) {
  const auto cast = test::tiny_cast();
  std::vector<glm::vec3> position_m;
  for (int i = 0; i < 200; ++i) position_m.push_back({0.0F, 2.0F * static_cast<float>(i), 0.0F});
  auto one = std::make_shared<Cast>(*cast);
  one->members.resize(1);
  const auto crowd = test::standing_crowd(one, position_m);
  test::Stage stage(one);
  generate(stage, *crowd, {.vertex_budget = 2000});
  const auto instances = stage.geometry().instances;
  ASSERT_GT(instances.size(), 80U);
  EXPECT_GT(instances[0].vertex_count, instances[instances.size() - 1].vertex_count);
  for (std::size_t i = 1; i < instances.size(); ++i) {
    // scales differ by up to 17 %, which moves the count a little
    EXPECT_LE(instances[i].vertex_count, instances[i - 1].vertex_count + 8);
  }
}

TEST(SelectTest, Dong2019RuleIsEquationOneAndNothingMore) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 700, 80.0);
  test::Stage stage(cast);
  const std::uint64_t budget = 14'000;
  generate(stage, *crowd, {.vertex_budget = budget, .rule = LodRule::kDong2019});
  const auto instances = stage.geometry().instances;
  const double focal_px = 0.5 * stage.viewport.height_px / std::tan(0.5 * stage.camera.fov_y_rad);
  const double viewport_px2 = 1280.0 * 720.0;

  // the printed formula in float64; the share of a vertex that integers lose may move a floor by 1
  std::vector<double> root;
  double sum = 0.0;
  for (const VisibleInstance& instance : instances) {
    const Character& character = character_of(stage, instance);
    const glm::dvec3 center = glm::dvec3(instance.position_relative) +
                              glm::dvec3(0, 0, character.bounds.z * instance.scale);
    const double distance_m = std::max<double>(glm::length(center), instance.radius_m);
    const double radius_px = focal_px * instance.radius_m / distance_m;
    const double area_px2 = std::min(3.14159265358979 * radius_px * radius_px, viewport_px2);
    root.push_back(std::cbrt(area_px2 / distance_m));
    sum += root.back();
  }
  std::uint64_t exact = 0;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const Character& character = character_of(stage, instances[i]);
    const auto printed =
        static_cast<std::int64_t>(std::floor(static_cast<double>(budget) * root[i] / sum));
    bool matches = false;
    for (std::int64_t n = printed - 1; n <= printed + 1; ++n) {
      const auto clamped =
          std::clamp<std::int64_t>(n, character.coarsest_count, character.vertex_count());
      matches |=
          character.legal_count[static_cast<std::size_t>(clamped)] == instances[i].vertex_count;
      if (n == printed) {
        exact +=
            character.legal_count[static_cast<std::size_t>(clamped)] == instances[i].vertex_count;
      }
    }
    EXPECT_TRUE(matches) << "instance " << i;
  }
  EXPECT_GT(exact, instances.size() * 98 / 100);
}

TEST(SelectTest, BudgetRuleDealsOutWhatFullInstancesLeave) {
  const auto cast = test::tiny_cast();
  // two agents right in front of the camera can't use their share
  std::vector<glm::vec3> position_m = {{-0.5F, -28.0F, 13.0F}, {0.5F, -28.0F, 13.0F}};
  for (int i = 0; i < 50; ++i)
    position_m.push_back(
        {static_cast<float>(i % 10) - 5.0F, 5.0F * static_cast<float>(i / 10), 0.0F});
  const auto crowd = test::standing_crowd(cast, position_m);
  test::Stage stage(cast);
  generate(stage, *crowd, {.vertex_budget = 1200, .rule = LodRule::kDong2019});
  const std::uint64_t first_pass = stage.counters().vertices;
  generate(stage, *crowd, {.vertex_budget = 1200, .rule = LodRule::kBudget});
  EXPECT_GT(stage.counters().vertices, first_pass);
  EXPECT_LE(stage.counters().vertices, 1200U);
  EXPECT_GE(stage.counters().vertices, 1150U);
}

TEST(SelectTest, HugeBudgetIsFullDetail) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 300, 20.0);
  test::Stage stage(cast);
  for (const LodRule rule : {LodRule::kBudget, LodRule::kDong2019}) {
    generate(stage, *crowd, {.vertex_budget = ~std::uint64_t{0}, .rule = rule});
    EXPECT_EQ(stage.counters().vertices, 38U * stage.counters().visible);
    EXPECT_EQ(stage.counters().effective_budget, ~std::uint64_t{0});
  }
}

TEST(SelectTest, OrthographicCameraSharesByAreaAlone) {
  auto one = std::make_shared<Cast>(*test::tiny_cast());
  one->members.resize(1);
  std::vector<glm::vec3> position_m(20);
  for (int i = 0; i < 20; ++i)
    position_m[i] = {0.5F * static_cast<float>(i), static_cast<float>(i), 0.0F};
  const auto crowd = test::standing_crowd(one, position_m);
  test::Stage stage(one);
  stage.camera.ortho_height_m = 60.0;
  generate(stage, *crowd, {.vertex_budget = 500});
  ASSERT_EQ(stage.counters().visible, 20U);
  for (const VisibleInstance& instance : stage.geometry().instances) {
    EXPECT_NEAR(instance.vertex_count, 25.0, 6.0);  // scale alone
  }
}

}  // namespace
}  // namespace throng::render
