#include <algorithm>
#include <cmath>

#include "throng/render/control.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

double total_ms(const StageTimes& times) {
  return times.advance_ms + times.cull_ms + times.select_ms + times.allocate_ms +
         times.generate_ms + times.raster_ms + times.resolve_ms + times.read_back_ms +
         times.encode_ms;
}

ControlSettings sensible(ControlSettings settings) {
  if (!(settings.target_ms > 0.0) || !std::isfinite(settings.target_ms)) settings.target_ms = 40.0;
  if (!(settings.gain > 0.0)) settings.gain = 0.5;
  settings.gain = std::min(settings.gain, 1.0);
  settings.least_budget = std::max<std::uint64_t>(settings.least_budget, 1);
  settings.most_budget = std::max(settings.most_budget, settings.least_budget);
  return settings;
}

class FixedController final : public BudgetController {
 public:
  explicit FixedController(std::uint64_t budget) : budget_(budget) {}
  std::string_view name() const override { return "fixed"; }
  void record(const StageTimes&, std::uint64_t) override {}
  std::uint64_t vertex_budget() const override { return budget_; }

 private:
  std::uint64_t budget_;
};

/// Moves the budget by a share of what the frame missed its target by, at most to the half or the
/// double at once. A crowd that has all its detail already is not given more.
class ProportionalController final : public BudgetController {
 public:
  explicit ProportionalController(const ControlSettings& settings)
      : settings_(settings),
        budget_(static_cast<double>(
            std::clamp(settings.start_budget, settings.least_budget, settings.most_budget))) {}
  std::string_view name() const override { return "proportional"; }

  void record(const StageTimes& times, std::uint64_t vertices) override {
    const double frame_ms = total_ms(times);
    if (!(frame_ms > 0.0) || !std::isfinite(frame_ms)) return;
    const double ratio = std::clamp(settings_.target_ms / frame_ms, 0.5, 2.0);
    const bool is_saturated = static_cast<double>(vertices) < 0.9 * budget_;
    if (ratio > 1.0 && is_saturated) return;
    budget_ = std::clamp(budget_ * (1.0 + settings_.gain * (ratio - 1.0)),
                         static_cast<double>(settings_.least_budget),
                         static_cast<double>(settings_.most_budget));
  }

  std::uint64_t vertex_budget() const override { return static_cast<std::uint64_t>(budget_); }

 private:
  ControlSettings settings_;
  double budget_;
};

}  // namespace

std::unique_ptr<BudgetController> make_controller(const ControlSettings& settings) {
  if (settings.kind == ControllerKind::kProportional) {
    return std::make_unique<ProportionalController>(sensible(settings));
  }
  return std::make_unique<FixedController>(settings.start_budget);
}

}  // namespace throng::render
