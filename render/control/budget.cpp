#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "render/control/cost_model.hpp"
#include "render/control/far_choice.hpp"
#include "render/control/oversampling.hpp"
#include "render/control/sfsm.hpp"
#include "render/control/work_model.hpp"
#include "throng/render/control.hpp"

namespace throng::render {
namespace {

ControlSettings sensible(ControlSettings settings) {
  settings.least_budget = std::max<std::uint64_t>(settings.least_budget, 1);
  settings.most_budget = std::max(settings.most_budget, settings.least_budget);
  settings.start_budget =
      std::clamp(settings.start_budget, settings.least_budget, settings.most_budget);
  if (!(settings.least_error_px > 0.0F)) settings.least_error_px = 0.05F;
  if (!(settings.k_per_m > 0.0F)) settings.k_per_m = 0.075F;
  if (!(settings.settled_m > 0.0F)) settings.settled_m = 15.0F;
  if (!(settings.least_point_px > 0.0F)) settings.least_point_px = 1.0F;
  if (!(settings.most_point_px >= settings.least_point_px)) {
    settings.most_point_px = settings.least_point_px;
  }
  return settings;
}

class FixedController final : public BudgetController {
 public:
  explicit FixedController(std::uint64_t budget) : budget_(budget) {}
  std::string_view name() const override { return "fixed"; }
  void record(const FrameCost&) override {}
  std::uint64_t next_budget(double) override { return budget_; }

 private:
  std::uint64_t budget_;
};

/// What a frame would have taken had nobody else used the processors: waiting for them is time that
/// no coarser picture wins back, unless it is so long that only fewer frames or less work help. So
/// frames are taken to last as long for their work as the best one of late, and by kWaiting more
/// where they did.
class OwnTime {
 public:
  double of(const FrameCost& cost) {
    if (!(cost.work_ms > 0.0) || !(cost.frame_ms > 0.0)) return cost.frame_ms;
    // one thread alone takes as long as its work; forgotten slowly, as views differ in how much of
    // them is shared between threads
    best_ = std::min({best_ * kForgets, cost.frame_ms / cost.work_ms, 1.0});
    return std::min(cost.frame_ms, kWaiting * best_ * cost.work_ms);
  }

 private:
  static constexpr double kForgets = 1.002, kWaiting = 1.5;
  double best_ = 1.0;  // of a frame's time, for each of its work
};

/// Leaves it to the backend to choose, of what is in view, what fits into the target by the costs
/// that it learned. Where the backend does not say what it drew (FrameWork), it solves a simpler
/// model for the vertices that fit. The budget stays where it is
/// while it comes out right, so that a standing crowd does not shimmer.
class PredictiveController final : public BudgetController {
 public:
  explicit PredictiveController(const ControlSettings& settings)
      : settings_(settings),
        work_model_(settings.cost),
        oversampling_(settings.most_oversampling),
        budget_(settings.start_budget) {}
  std::string_view name() const override { return "predictive"; }
  WorkCost learned() const override { return work_model_.cost(); }

  void record(const FrameCost& measured) override {
    FrameCost cost = measured;
    cost.frame_ms = own_time_.of(measured);
    model_.record(cost);
    if (cost.oversampling == 1) work_model_.record(cost);
    oversampling_.record(cost);
    far_.record(cost.error_px);
    knows_work_ = cost.work.known;
  }

  FramePlan next_plan(double target_ms) override {
    FramePlan plan;
    plan.vertex_budget = next_budget(target_ms);
    if (!(target_ms > 0.0) || !std::isfinite(target_ms)) target_ms = last_target_ms_;
    last_target_ms_ = target_ms;
    if (!(target_ms > 0.0)) return plan;
    if (knows_work_) plan.vertex_budget = settings_.most_budget;
    plan.mixed = true;
    plan.budget_ms = target_ms;
    plan.least_error_px = settings_.least_error_px;
    plan.cost = work_model_.cost();
    plan.far_least_px = far_.least_px();
    plan.oversampling = oversampling_.next(target_ms, plan.cost);
    if (plan.oversampling > 1) {
      plan.cost = oversampling_.cost();
      plan.least_error_px = std::max(plan.least_error_px, OversamplingChoice::kFinePx);
    }
    return plan;
  }

  std::uint64_t next_budget(double target_ms) override {
    if (!(target_ms > 0.0) || !std::isfinite(target_ms) || model_.empty()) return budget_;
    const FrameCost& last = model_.last();
    const double room_ms = target_ms - model_.predict_ms(last);
    const auto vertices = static_cast<double>(last.vertices);
    const double fitting = vertices + room_ms * 1e6 / model_.ms_per_million();
    const auto budget = static_cast<double>(budget_);
    double next = budget;
    if (vertices < 0.9 * budget && fitting > vertices) {
      next = std::min(budget, fitting);  // all detail there is: more would be given to nobody
    } else if (std::abs(room_ms) > kCalm * target_ms) {
      next = std::min(fitting, kLongestStep * budget);  // what was never tried is not trusted
    }
    budget_ =
        static_cast<std::uint64_t>(std::clamp(next, static_cast<double>(settings_.least_budget),
                                              static_cast<double>(settings_.most_budget)));
    return budget_;
  }

 private:
  static constexpr double kCalm = 0.04, kLongestStep = 4.0;

  ControlSettings settings_;
  OwnTime own_time_;
  CostModel model_;
  WorkModel work_model_;
  OversamplingChoice oversampling_;
  FarChoice far_;
  bool knows_work_ = false;
  double last_target_ms_ = 0.0;
  std::uint64_t budget_;
};

}  // namespace

absl::StatusOr<ControllerKind> controller_named(std::string_view name) {
  if (name == "fixed") return ControllerKind::kFixed;
  if (name == "predictive") return ControllerKind::kPredictive;
  if (name == "sfsm") return ControllerKind::kSfsm;
  return absl::InvalidArgumentError(
      absl::StrCat("controller is '", std::string(name), "', must be fixed, predictive or sfsm"));
}

absl::Status check_control(double target_ms, double vertex_budget) {
  if (!(target_ms > 0.0) || !std::isfinite(target_ms)) {
    return absl::InvalidArgumentError(
        absl::StrCat("controller target is ", target_ms, " ms, must be a number > 0"));
  }
  if (!(vertex_budget >= 1.0) || !std::isfinite(vertex_budget)) {
    return absl::InvalidArgumentError(
        absl::StrCat("vertex budget is ", vertex_budget, ", must be at least 1"));
  }
  return absl::OkStatus();
}

std::unique_ptr<BudgetController> make_controller(const ControlSettings& settings) {
  if (settings.kind == ControllerKind::kSfsm) {
    return std::make_unique<SfsmController>(sensible(settings));
  }
  if (settings.kind == ControllerKind::kPredictive) {
    return std::make_unique<PredictiveController>(sensible(settings));
  }
  return std::make_unique<FixedController>(settings.start_budget);
}

}  // namespace throng::render
