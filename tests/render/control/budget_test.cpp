#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "throng/render/control.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

StageTimes frame_of(double generate_ms, double raster_ms) {
  StageTimes times;
  times.generate_ms = generate_ms;
  times.raster_ms = raster_ms;
  return times;
}

TEST(BudgetControllerTest, FixedStaysWhateverHappens) {
  const auto controller = make_controller({.start_budget = 12'345});
  EXPECT_EQ(controller->name(), "fixed");
  controller->record(frame_of(500.0, 500.0), 12'345);
  EXPECT_EQ(controller->vertex_budget(), 12'345U);
}

TEST(BudgetControllerTest, ProportionalReachesTheTarget) {
  // a machine that takes 8 ms and 20 ms for each million vertices
  const auto controller = make_controller(
      {.kind = ControllerKind::kProportional, .target_ms = 40.0, .start_budget = 10'000'000});
  double frame_ms = 0.0;
  for (int frame = 0; frame < 40; ++frame) {
    const double millions = static_cast<double>(controller->vertex_budget()) * 1e-6;
    frame_ms = 8.0 + 20.0 * millions;
    controller->record(frame_of(8.0, 20.0 * millions), controller->vertex_budget());
  }
  EXPECT_NEAR(frame_ms, 40.0, 0.5);
}

TEST(BudgetControllerTest, StaysWithinItsLimits) {
  const auto controller = make_controller({.kind = ControllerKind::kProportional,
                                           .target_ms = 10.0,
                                           .start_budget = 1'000'000,
                                           .least_budget = 100'000,
                                           .most_budget = 2'000'000});
  for (int frame = 0; frame < 50; ++frame) controller->record(frame_of(1000.0, 0.0), 100'000);
  EXPECT_EQ(controller->vertex_budget(), 100'000U);
  for (int frame = 0; frame < 50; ++frame) controller->record(frame_of(0.1, 0.0), 100'000'000);
  EXPECT_EQ(controller->vertex_budget(), 2'000'000U);
}

TEST(BudgetControllerTest, CrowdAtFullDetailIsNotGivenMore) {
  const auto controller =
      make_controller({.kind = ControllerKind::kProportional, .start_budget = 1'000'000});
  for (int frame = 0; frame < 50; ++frame) controller->record(frame_of(1.0, 1.0), 3000);
  EXPECT_EQ(controller->vertex_budget(), 1'000'000U);
}

TEST(BudgetControllerTest, TimesThatAreNoNumbersChangeNothing) {
  const auto controller =
      make_controller({.kind = ControllerKind::kProportional, .start_budget = 1'000'000});
  controller->record(frame_of(std::numeric_limits<double>::quiet_NaN(), 0.0), 1'000'000);
  controller->record(frame_of(0.0, 0.0), 1'000'000);
  EXPECT_EQ(controller->vertex_budget(), 1'000'000U);
}

TEST(BudgetControllerTest, SenselessSettingsAreReplaced) {
  const auto controller = make_controller({.kind = ControllerKind::kProportional,
                                           .target_ms = -3.0,
                                           .start_budget = 500,
                                           .least_budget = 1000,
                                           .most_budget = 10,
                                           .gain = 7.0});
  EXPECT_EQ(controller->vertex_budget(), 1000U);
}

}  // namespace
}  // namespace throng::render
