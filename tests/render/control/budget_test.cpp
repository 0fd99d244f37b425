#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "throng/render/control.hpp"

namespace throng::render {
namespace {

/// A machine and the crowd in front of its camera.
struct Machine {
  double fixed_ms = 8.0, per_thousand_ms = 0.8, per_million_ms = 20.0, noise = 0.0;
  std::uint32_t visible = 5000;
  std::uint64_t all_vertices = 1'000'000'000, coarsest = 0;

  FrameCost draw(std::uint64_t budget, std::mt19937& random) const {
    FrameCost cost;
    cost.visible = visible;
    cost.vertices = std::clamp(budget, coarsest, std::max(coarsest, all_vertices));
    cost.frame_ms = fixed_ms + per_thousand_ms * visible * 1e-3 +
                    per_million_ms * static_cast<double>(cost.vertices) * 1e-6;
    cost.frame_ms *= std::max(0.5, std::normal_distribution<double>(1.0, noise + 1e-12)(random));
    return cost;
  }
};

struct Drive {
  std::unique_ptr<BudgetController> controller =
      make_controller({.kind = ControllerKind::kPredictive});
  std::mt19937 random{1};
  FrameCost last;

  double frame(const Machine& machine, double target_ms) {
    last = machine.draw(controller->next_budget(target_ms), random);
    controller->record(last);
    return last.frame_ms;
  }
  /// Frames until the time is, and stays for 20 frames, within 10 % of the target.
  int settle(const Machine& machine, double target_ms) {
    int settled = 0;
    for (int i = 0; i < 30; ++i) {
      const double ms = frame(machine, target_ms);
      if (std::abs(ms - target_ms) > 0.1 * target_ms) settled = i + 1;
    }
    return settled;
  }
};

TEST(FixedControllerTest, StaysWhateverHappens) {
  const auto controller = make_controller({.start_budget = 12'345});
  EXPECT_EQ(controller->name(), "fixed");
  controller->record({500.0, 3, 12'345});
  EXPECT_EQ(controller->next_budget(1.0), 12'345U);
}

TEST(PredictiveControllerTest, ReachesTheTargetOfMachinesFastAndSlow) {
  for (const double per_million_ms : {0.1, 2.0, 14.0, 25.0, 120.0}) {
    Machine machine;
    machine.fixed_ms = std::min(8.0, per_million_ms);
    machine.per_thousand_ms = 0.05 * per_million_ms;
    machine.per_million_ms = per_million_ms;
    const double target_ms =
        machine.fixed_ms + machine.per_thousand_ms * 5 + 1.7 * machine.per_million_ms;
    Drive run;
    EXPECT_LE(run.settle(machine, target_ms), 4) << per_million_ms << " ms a million vertices";
  }
}

TEST(PredictiveControllerTest, SettlesInThreeFramesWhenTheViewJumps) {
  Machine near, far;
  near.visible = 300;
  near.fixed_ms = 16.0;  // people that fill the picture
  far.visible = 20'000;
  Drive run;
  run.settle(near, 40.0);
  EXPECT_LE(run.settle(far, 40.0), 3);
  EXPECT_LE(run.settle(near, 40.0), 3);
}

TEST(PredictiveControllerTest, SettlesInThreeFramesWhenTheTargetChanges) {
  Drive run;
  run.settle(Machine(), 100.0);
  EXPECT_LE(run.settle(Machine(), 25.0), 3);
  EXPECT_LE(run.settle(Machine(), 60.0), 3);
}

TEST(PredictiveControllerTest, SettlesInThreeFramesWhenTheMachineIsTakenByOthers) {
  Machine shared;
  shared.fixed_ms *= 1.6;
  shared.per_thousand_ms *= 1.6;
  shared.per_million_ms *= 1.6;
  Drive run;
  run.settle(Machine(), 40.0);
  EXPECT_LE(run.settle(shared, 40.0), 3);
}

TEST(PredictiveControllerTest, KeepsTheRateOfAMovingView) {
  // Control rate 1 - mean |T - t| / t, over a view that goes from near to far and back.
  Drive run;
  Machine machine;
  machine.noise = 0.01;
  double missed = 0.0;
  constexpr int kFrames = 600;
  for (int i = 0; i < kFrames; ++i) {
    const double way = 0.5 - 0.5 * std::cos(i * 2.0 * 3.14159265 / 300);
    machine.visible = static_cast<std::uint32_t>(500 + 15'000 * way);
    machine.fixed_ms = 14.0 - 6.0 * way;
    missed += std::abs(run.frame(machine, 40.0) - 40.0) / 40.0;
  }
  EXPECT_GT(1.0 - missed / kFrames, 0.98);
}

TEST(PredictiveControllerTest, OneLateFrameMovesNothing) {
  Drive run;
  run.settle(Machine(), 40.0);
  const std::uint64_t before = run.controller->next_budget(40.0);
  FrameCost late = run.last;
  late.frame_ms *= 3;
  run.controller->record(late);
  EXPECT_NEAR(static_cast<double>(run.controller->next_budget(40.0)), static_cast<double>(before),
              0.15 * static_cast<double>(before));
}

TEST(PredictiveControllerTest, StandsStillWhileTheTimeIsRight) {
  Machine machine;
  machine.noise = 0.005;
  Drive run;
  run.settle(machine, 40.0);
  const std::uint64_t settled = run.controller->next_budget(40.0);
  int changes = 0;
  for (int i = 0; i < 200; ++i) {
    run.frame(machine, 40.0);
    changes += run.controller->next_budget(40.0) != settled;
  }
  EXPECT_LE(changes, 10);
}

TEST(PredictiveControllerTest, StaysWithinItsLimits) {
  const auto controller = make_controller({.kind = ControllerKind::kPredictive,
                                           .start_budget = 1'000'000,
                                           .least_budget = 100'000,
                                           .most_budget = 2'000'000});
  for (int i = 0; i < 50; ++i) {
    controller->record({1000.0, 10, controller->next_budget(10.0)});
  }
  EXPECT_EQ(controller->next_budget(10.0), 100'000U);
  for (int i = 0; i < 50; ++i) {
    controller->record({0.1, 10, controller->next_budget(10.0)});
  }
  EXPECT_EQ(controller->next_budget(10.0), 2'000'000U);
}

TEST(PredictiveControllerTest, CrowdAtFullDetailIsNotGivenMore) {
  Machine few;
  few.visible = 3;
  few.all_vertices = 9000;
  Drive run;
  run.settle(few, 40.0);
  EXPECT_LE(run.controller->next_budget(40.0), 1'000'000U);
  // and a crowd that walks into view is drawn in time from the first frame on
  Machine crowd;
  EXPECT_LT(run.frame(crowd, 40.0), 60.0);
}

TEST(PredictiveControllerTest, CrowdThatIsTooMuchStaysAtItsCoarsest) {
  Machine crowd;
  crowd.coarsest = 8'000'000;
  Drive run;
  run.settle(crowd, 40.0);
  EXPECT_LT(run.controller->next_budget(40.0), crowd.coarsest);
}

TEST(PredictiveControllerTest, NumbersThatAreNoneChangeNothing) {
  const auto controller = make_controller({.kind = ControllerKind::kPredictive});
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), 0.0, -1.0,
                           std::numeric_limits<double>::infinity()}) {
    controller->record({bad, 5, 1'000'000});
    EXPECT_EQ(controller->next_budget(40.0), 1'000'000U);
    EXPECT_EQ(controller->next_budget(bad), 1'000'000U);
  }
}

TEST(PredictiveControllerTest, SenselessLimitsAreReplaced) {
  const auto controller = make_controller({.kind = ControllerKind::kPredictive,
                                           .start_budget = 500,
                                           .least_budget = 1000,
                                           .most_budget = 10});
  EXPECT_EQ(controller->next_budget(40.0), 1000U);
}

}  // namespace
}  // namespace throng::render
