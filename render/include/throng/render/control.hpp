#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

namespace throng::render {

struct StageTimes;

enum class ControllerKind { kFixed, kProportional };

struct ControlSettings {
  ControllerKind kind = ControllerKind::kFixed;
  double target_ms = 40.0;                 // of a whole frame
  std::uint64_t start_budget = 1'000'000;  // vertices; what kFixed stays at
  std::uint64_t least_budget = 50'000;
  std::uint64_t most_budget = 20'000'000;
  double gain = 0.5;  // share of the error corrected in one frame, (0, 1]
};

/// Chooses the vertex budget of the next frame from what the last one took. One per view; not
/// thread safe.
class BudgetController {
 public:
  virtual ~BudgetController() = default;
  virtual std::string_view name() const = 0;

  /// Tells what the last frame took, and how many vertices it drew with what budget.
  virtual void record(const StageTimes& times, std::uint64_t vertices) = 0;

  /// The vertex budget of the next frame.
  virtual std::uint64_t vertex_budget() const = 0;
};

/// A number that makes no sense (a target that is not positive, least above most) is replaced by
/// the nearest one that does.
std::unique_ptr<BudgetController> make_controller(const ControlSettings& settings);

}  // namespace throng::render
