#include <gtest/gtest.h>

#include <cmath>

#include "throng/render/control.hpp"

namespace throng::render {
namespace {

/// A view whose agents are drawn with less error for more work, on a machine whose costs are its
/// own; the backend's part is played too: it takes the least error that fits by the plan's costs.
struct Machine {
  double agents = 20'000;
  double pixels = 0.3e6;
  double times = 1.0;  // as long as the costs that everybody starts with
  double vertex_times = 1.0;

  FrameWork work(double error_px) const {
    FrameWork work;
    work.known = true;
    const double own = std::min(1.0, 0.05 / error_px), specks = std::min(1.0, error_px / 4.0);
    work.part[FrameWork::kOwn] = 1e-3 * agents * own * (1.0 - specks);
    work.part[FrameWork::kShared] = 1e-3 * agents * (1.0 - own) * (1.0 - specks);
    const double vertices = std::min(30.0 / error_px, 3000.0);
    work.part[FrameWork::kOwnVertices] = 1e-3 * work.part[FrameWork::kOwn] * vertices;
    work.part[FrameWork::kSharedVertices] = 1e-3 * work.part[FrameWork::kShared] * vertices;
    work.part[FrameWork::kSpecks] = 1e-3 * agents * specks;
    work.part[FrameWork::kSpeckRows] = 6e-6 * agents * specks;
    work.part[FrameWork::kSpeckPixels] = 1e-5 * agents * specks;
    work.part[FrameWork::kMeshPixels] = 1e-6 * pixels * (1.0 - specks);
    work.part[FrameWork::kMeshEdges] =
        std::sqrt(work.part[FrameWork::kMeshPixels] *
                  (work.part[FrameWork::kOwnVertices] + work.part[FrameWork::kSharedVertices]));
    return work;
  }

  FrameWork work_of(const FramePlan& plan, double error_px) const {
    FrameWork result = work(error_px);
    if (plan.oversampling == 1) return result;
    for (const auto part : {FrameWork::kSpeckPixels, FrameWork::kMeshPixels})
      result.part[part] *= 4;
    for (const auto part : {FrameWork::kSpeckRows, FrameWork::kMeshEdges}) result.part[part] *= 2;
    return result;
  }

  FrameCost draw(const FramePlan& plan) const {
    EXPECT_TRUE(plan.mixed);
    double low = static_cast<double>(plan.least_error_px), high = 4.0;
    for (int i = 0; i < 40; ++i) {
      const double middle = std::sqrt(low * high);
      (plan.cost.of(work_of(plan, middle)) > plan.budget_ms ? low : high) = middle;
    }
    FrameCost cost;
    cost.work = work_of(plan, high);
    cost.error_px = static_cast<float>(high);
    cost.oversampling = plan.oversampling;
    WorkCost truth;
    if (plan.oversampling > 1) truth.fixed_ms *= 4.0;
    truth.ms[FrameWork::kOwnVertices] *= vertex_times;
    truth.ms[FrameWork::kSharedVertices] *= vertex_times;
    truth.ms[FrameWork::kMeshEdges] *= vertex_times;
    cost.frame_ms = times * truth.of(cost.work);
    cost.visible = static_cast<std::uint32_t>(agents);
    return cost;
  }
};

/// Frames until the time stays within a tenth of the target; -1: it never does.
int settling(BudgetController& controller, const Machine& machine, double target_ms, int frames) {
  int settled = -1;
  for (int i = 1; i <= frames; ++i) {
    const FrameCost cost = machine.draw(controller.next_plan(target_ms));
    const bool is_within = std::abs(cost.frame_ms - target_ms) <= 0.1 * target_ms;
    if (!is_within) settled = -1;
    if (is_within && settled < 0) settled = i;
    controller.record(cost);
  }
  return settled;
}

std::unique_ptr<BudgetController> predictive() {
  return make_controller({.kind = ControllerKind::kPredictive, .least_error_px = 0.004F});
}

TEST(WorkModelTest, SettlesInThreeFramesOnMachinesFastAndSlow) {
  for (const double times : {0.5, 1.0, 2.5}) {
    for (const double vertex_times : {0.5, 1.0, 2.0}) {
      const auto controller = predictive();
      const Machine machine{.times = times, .vertex_times = vertex_times};
      const int settled = settling(*controller, machine, 60.0 * times, 20);
      EXPECT_GE(settled, 1);
      EXPECT_LE(settled, 3) << times << " " << vertex_times;
    }
  }
}

TEST(WorkModelTest, SettlesInThreeFramesWhenTargetOrViewChanges) {
  const auto controller = predictive();
  Machine machine{.times = 1.4, .vertex_times = 1.5};
  settling(*controller, machine, 300.0, 20);
  for (const double target_ms : {90.0, 40.0, 150.0}) {
    const int settled = settling(*controller, machine, target_ms, 12);
    EXPECT_GE(settled, 1);
    EXPECT_LE(settled, 3) << target_ms;
  }
  for (const double agents : {3000.0, 30'000.0, 12'000.0}) {
    machine.agents = agents;
    machine.pixels = 0.8e6 - 2e1 * agents;
    const int settled = settling(*controller, machine, 90.0, 12);
    EXPECT_GE(settled, 1);
    EXPECT_LE(settled, 3) << agents;
  }
}

TEST(WorkModelTest, WaitingForOthersIsNotTakenForCost) {
  const auto controller = predictive();
  const Machine machine;
  const auto draw = [&](double waits) {
    FrameCost cost = machine.draw(controller->next_plan(60.0));
    cost.work_ms = 1.8 * cost.frame_ms;  // of two threads
    cost.frame_ms *= waits;
    controller->record(cost);
    return cost;
  };
  for (int i = 0; i < 20; ++i) draw(1.0);
  const float quiet_px = draw(1.0).error_px;
  // somebody else has most of the machine for seconds
  for (int i = 0; i < 50; ++i) draw(4.0);
  const float busy_px = draw(4.0).error_px;
  const auto same = predictive();
  const Machine slower{.times = 2.0};
  settling(*same, slower, 60.0, 20);
  EXPECT_LT(busy_px, slower.draw(same->next_plan(60.0)).error_px);
  EXPECT_GE(busy_px, quiet_px);
}

TEST(WorkModelTest, OneLateFrameMovesLittle) {
  const auto controller = predictive();
  const Machine machine;
  settling(*controller, machine, 60.0, 20);
  const double before = machine.draw(controller->next_plan(60.0)).frame_ms;
  FrameCost late = machine.draw(controller->next_plan(60.0));
  late.frame_ms *= 3.0;
  controller->record(late);
  EXPECT_NEAR(machine.draw(controller->next_plan(60.0)).frame_ms, before, 0.1 * before);
}

TEST(WorkModelTest, SceneThatComesBackIsKnown) {
  const auto controller = predictive();
  const Machine near{.agents = 2000, .pixels = 0.7e6, .times = 1.3, .vertex_times = 1.8};
  const Machine far{.agents = 18'000, .pixels = 0.1e6, .times = 1.3, .vertex_times = 1.8};
  settling(*controller, near, 60.0, 20);
  settling(*controller, far, 60.0, 100);
  const double again_ms = near.draw(controller->next_plan(60.0)).frame_ms;
  EXPECT_NEAR(again_ms, 60.0, 3.0);
}

TEST(WorkModelTest, NextViewStartsFromWhatWasLearned) {
  const auto first = predictive();
  const Machine machine{.times = 2.5, .vertex_times = 0.5};
  settling(*first, machine, 100.0, 20);
  const auto next = make_controller(
      {.kind = ControllerKind::kPredictive, .least_error_px = 0.004F, .cost = first->learned()});
  EXPECT_NEAR(machine.draw(next->next_plan(100.0)).frame_ms, 100.0, 5.0);
}

TEST(OversamplingTest, TimeThatIsLeftIsSpentOnSamplesAndTakenFromThemFirst) {
  const auto controller = predictive();
  const Machine machine{.agents = 500, .pixels = 0.1e6, .times = 1.2};
  settling(*controller, machine, 200.0, 40);
  EXPECT_EQ(controller->next_plan(200.0).oversampling, 2U);
  // they stay as long as there is time
  settling(*controller, machine, 200.0, 40);
  EXPECT_EQ(controller->next_plan(200.0).oversampling, 2U);
  EXPECT_EQ(controller->next_plan(10.0).oversampling, 1U);
}

TEST(OversamplingTest, DoesNotComeAndGo) {
  for (const double target_ms : {20.0, 30.0, 40.0, 60.0, 80.0, 120.0}) {
    const auto controller = predictive();
    Machine machine{.agents = 2000, .pixels = 0.3e6};
    std::uint32_t last = 1;
    int changes = 0;
    for (int i = 0; i < 1000; ++i) {
      machine.times = i % 7 == 0 ? 1.1 : 1.0;  // a machine that others use too
      const FramePlan plan = controller->next_plan(target_ms);
      changes += plan.oversampling != last ? 1 : 0;
      last = plan.oversampling;
      controller->record(machine.draw(plan));
    }
    EXPECT_LE(changes, 12) << target_ms;
  }
}

TEST(OversamplingTest, WhoDoesNotWantItHasNone) {
  const auto controller =
      make_controller({.kind = ControllerKind::kPredictive, .most_oversampling = 1});
  const Machine machine{.agents = 100, .pixels = 0.1e6};
  settling(*controller, machine, 300.0, 60);
  EXPECT_EQ(controller->next_plan(300.0).oversampling, 1U);
}

TEST(WorkModelTest, NumbersThatAreNoneChangeNothing) {
  const auto controller = predictive();
  const Machine machine;
  settling(*controller, machine, 60.0, 10);
  const FramePlan before = controller->next_plan(60.0);
  for (const double bad : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    FrameCost cost = machine.draw(before);
    cost.frame_ms = bad;
    controller->record(cost);
    const FramePlan plan = controller->next_plan(bad);
    EXPECT_EQ(plan.budget_ms, 60.0);
    EXPECT_EQ(plan.cost.fixed_ms, before.cost.fixed_ms);
  }
}

}  // namespace
}  // namespace throng::render
