#include <gtest/gtest.h>

#include <cmath>
#include <glm/glm.hpp>

#include "frame_fixture.hpp"
#include "render/compute/cpu/slabs.hpp"
#include "render/compute/cpu/speck_table.hpp"
#include "render/compute/element/forms.hpp"
#include "simplify/points/points.hpp"
#include "support/tiny_character.hpp"

namespace throng::render {
namespace {

std::shared_ptr<const Cast> cast_with_points() {
  CharacterData data = test::make_tiny_character();
  simplify::sample_points(data, {.count = 512});
  Cast cast;
  cast.members.push_back({make_character(std::move(data)).value(), 1.0F});
  return std::make_shared<const Cast>(std::move(cast));
}

Selection mixed(float error_px) {
  Selection selection{.vertex_budget = 20'000'000,
                      .pose_mode = PoseMode::kShared,
                      .geometry = GeometryKind::kFused,
                      .form = FormRule::kMixed};
  selection.mixed.error_px = error_px;
  return selection;
}

std::uint32_t as(const ComputeCounters& counters, Representation form) {
  return counters.drawn_as[static_cast<std::size_t>(form)];
}

TEST(SpecksTest, EveryVisibleAgentIsDrawnAsSomethingOrStoodFor) {
  const auto cast = cast_with_points();
  const auto crowd = test::walking_crowd(cast, 5000, 300.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  for (const double away_m : {40.0, 400.0, 4000.0}) {
    stage.camera.eye_world = {0.0, -away_m, 0.4 * away_m};
    stage.finish(mixed(0.5F));
    const FrameGeometry geometry = stage.geometry();
    const ComputeCounters counters = stage.counters();
    ASSERT_NE(geometry.speck_table, nullptr);
    std::uint32_t specks = 0;
    for (const SpeckRun& run : geometry.speck_runs) {
      specks += run.count;
      ASSERT_LE(run.first + run.count, geometry.specks.size());
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        EXPECT_LT(geometry.specks[i].image, geometry.speck_table->image.size());
      }
    }
    EXPECT_EQ(specks, as(counters, Representation::kSpeck));
    EXPECT_EQ(specks + as(counters, Representation::kNone) + geometry.instances.size(),
              counters.visible);
    if (away_m > 300.0) {
      EXPECT_GT(specks, 0U);
    }
    EXPECT_EQ(as(counters, Representation::kNone) > 0, away_m > 3000.0);
  }
}

TEST(SpecksTest, ThoseThatAreLeftCoverWhatAllWould) {
  const auto cast = cast_with_points();
  const auto crowd = test::walking_crowd(cast, 100'000, 300.0);
  test::Stage stage(cast);
  stage.camera.eye_world = {0.0, -4000.0, 900.0};
  stage.advance(*crowd, 0);
  const auto area = [&](float least_px) {
    Selection selection = mixed(0.5F);
    selection.mixed.least_px = least_px;
    stage.finish(selection);
    double sum = 0.0;
    const FrameGeometry geometry = stage.geometry();
    for (const SpeckRun& run : geometry.speck_runs) {
      for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
        sum += std::pow(static_cast<double>(geometry.specks[i].height_m), 2.0);
      }
    }
    return sum;
  };
  const double all = area(1e-3F);
  EXPECT_NEAR(area(1.0F), all, 0.05 * all);
  EXPECT_NEAR(area(1.5F), all, 0.05 * all);
}

TEST(SpecksTest, SlabsAddUpToTheFigure) {
  const auto cast = cast_with_points();
  const auto crowd = test::standing_crowd(cast, {{0, 0, 0}});
  test::Stage stage(cast);
  stage.camera.eye_world = {0.0, -400.0, 100.0};
  stage.advance(*crowd, 0);
  stage.finish(mixed(0.5F));
  const SpeckTable& table = *stage.geometry().speck_table;
  // what it can't do has no pictures
  const std::size_t images =
      table.image.size() / element::kSpeckPoses * (1 + element::kSpeckPhases);
  for (std::size_t i = 0; i < images; ++i) {
    // each level covers about the same area, in heights squared
    double areas[SpeckTable::kLevels] = {};
    const SpeckSlab* slab = table.slab.data() + i * SpeckTable::kSlabs;
    for (std::uint32_t level = 0; level < SpeckTable::kLevels; ++level) {
      const std::uint32_t slabs = SpeckTable::slabs(level);
      for (std::uint32_t k = 0; k < slabs; ++k, ++slab) {
        areas[level] += (slab->high - slab->low) / SpeckSlab::kPerHeight * slab->fill / 255.0 *
                        (table.image[i].y_high - table.image[i].y_low) / (1 << level);
      }
      EXPECT_GT(areas[level], 0.02);
      EXPECT_NEAR(areas[level], areas[0], 0.06 * areas[0]);
    }
  }
}

TEST(SpecksTest, WhoSitsCheersOrWavesHasAPictureOfThat) {
  element::Gait gait;
  element::Pose pose;
  EXPECT_EQ(element::speck_pose(pose, gait), 0U);
  // codes of the motion graph: stand, sit, cheer, wave, talk, phone
  const std::uint32_t expected[] = {0, 9, 10, 11, 0, 0};
  for (std::uint32_t code = 1; code <= 6; ++code) {
    pose.action = code;
    EXPECT_EQ(element::speck_pose(pose, gait), expected[code - 1]) << code;
  }
}

TEST(SpecksTest, ErrorIsChosenSoThatTheFrameTakesItsTime) {
  const auto cast = cast_with_points();
  const auto crowd = test::walking_crowd(cast, 3000, 200.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  stage.camera.eye_world = {0.0, -150.0, 60.0};
  float last_px = 0.0F;
  // from the dearest that the finest error can take to the cheapest
  for (const double budget_ms : {1e6, 16.0, 13.0, 11.0, 9.5, 0.1}) {
    Selection selection = mixed(0.5F);
    selection.mixed.budget_ms = budget_ms;
    selection.mixed.least_error_px = 0.002F;
    stage.finish(selection);
    const ComputeCounters counters = stage.counters();
    ASSERT_TRUE(counters.work.known);
    const double expected_ms = selection.mixed.cost.of(counters.work);
    const bool at_an_end = counters.error_px <= 0.002F || counters.error_px >= 32.0F;
    if (!at_an_end) {
      EXPECT_LE(expected_ms, 1.021 * budget_ms);
    }
    EXPECT_GE(counters.error_px, last_px);
    last_px = counters.error_px;
  }
  EXPECT_FLOAT_EQ(last_px, 32.0F);
}

TEST(SpecksTest, NoTimeIsTooShortForWhoIsNear) {
  const auto cast = cast_with_points();
  std::vector<glm::vec3> places = {{0.0F, 0.0F, 0.0F}};
  for (int i = 0; i < 200; ++i) places.emplace_back(i - 100.0F, 150.0F + 0.1F * i, 0.0F);
  const auto crowd = test::standing_crowd(cast, places);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  stage.camera.eye_world = {0.0, -4.0, 1.5};
  const auto vertices_of_nearest = [&](const Selection& selection) {
    stage.finish(selection);
    for (const VisibleInstance& instance : stage.geometry().instances) {
      if (instance.slot == 0) return instance.vertex_count;
    }
    return 0U;
  };
  Selection hurried = mixed(0.5F);
  hurried.mixed.budget_ms = 0.1;
  const std::uint32_t kept = vertices_of_nearest(hurried);
  EXPECT_FLOAT_EQ(stage.counters().error_px, 32.0F);
  EXPECT_GT(as(stage.counters(), Representation::kSpeck), 0U);
  EXPECT_EQ(kept, vertices_of_nearest(mixed(hurried.mixed.near_error_px)));
  EXPECT_GT(kept, vertices_of_nearest(mixed(32.0F)));
}

TEST(SpecksTest, ErrorsOfFiguresJoinWithoutAStep) {
  MixedForms forms = mixed(32.0F).mixed;
  const element::Projection projection{800.0F, 1280.0F * 720.0F, 1};
  EXPECT_EQ(element::near_error_of(forms, projection, 500.0F), 32.0F) << "no time was asked for";
  forms.budget_ms = 10.0;
  float last = 0.0F;
  for (float height_px = 700.0F; height_px > 1.0F; height_px *= 0.99F) {
    const float error_px = element::near_error_of(forms, projection, height_px);
    EXPECT_GE(error_px, std::max(last, forms.near_error_px));
    if (last > 0.0F) {
      EXPECT_LT(error_px, 1.05F * last);
    }
    last = error_px;
  }
  EXPECT_EQ(last, 32.0F);
  const float most_px = speck_error_of(forms, projection) / forms.speck_error;
  EXPECT_NEAR(element::near_error_of(forms, projection, most_px), forms.speck_error * most_px,
              1e-3F);
}

}  // namespace
}  // namespace throng::render
