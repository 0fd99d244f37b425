#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

namespace throng::render {

/// kFixed: the user's N. kPredictive: the N that a frame of the wanted length allows.
enum class ControllerKind { kFixed, kPredictive };

struct ControlSettings {
  ControllerKind kind = ControllerKind::kFixed;
  std::uint64_t start_budget = 1'000'000;  // vertices; what kFixed stays at
  std::uint64_t least_budget = 50'000;
  std::uint64_t most_budget = 20'000'000;
};

/// What a frame drew and how long that took.
struct FrameCost {
  double frame_ms = 0;         // of the time that the target counts
  std::uint32_t visible = 0;   // agents drawn
  std::uint64_t vertices = 0;  // drawn; under the budget where the crowd has no more detail
};

/// Chooses the vertex budget of a view's next frame from what its frames so far took. One per
/// view; not thread safe.
class BudgetController {
 public:
  virtual ~BudgetController() = default;
  virtual std::string_view name() const = 0;

  /// Tells what the last frame took. A time that is not a positive number is passed over.
  virtual void record(const FrameCost& cost) = 0;

  /// The vertex budget of the next frame. A target that is not a positive number leaves it.
  virtual std::uint64_t next_budget(double target_ms) = 0;
};

/// Limits that make no sense (none, least above most) are replaced by the nearest that do.
std::unique_ptr<BudgetController> make_controller(const ControlSettings& settings);

}  // namespace throng::render
