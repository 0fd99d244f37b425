#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string_view>

#include "throng/render/representation.hpp"

namespace throng::render {

/// kFixed: the user's N. kPredictive: the N that a frame of the wanted length allows. kSfsm: the
/// self-feedback state machine of Lyu et al.
enum class ControllerKind { kFixed, kPredictive, kSfsm };

/// InvalidArgument: no controller has this name.
absl::StatusOr<ControllerKind> controller_named(std::string_view name);

struct ControlSettings {
  ControllerKind kind = ControllerKind::kFixed;
  std::uint64_t start_budget = 1'000'000;  // vertices; what kFixed stays at
  std::uint64_t least_budget = 50'000;
  std::uint64_t most_budget = 20'000'000;
  float least_error_px = 0.05F;  // kPredictive spends no time on what is less off
  WorkCost cost{};               // what it starts from: of another view of this machine, if known
  // kPredictive: samples a pixel are multiplied (ViewSettings::oversampling) where the target
  // leaves time for it; 1: never
  std::uint32_t most_oversampling = 2;
  // kSfsm
  float k_per_m = 0.075F;       // how fast far agents' motion gets rare, 0.05 to 0.1
  float settled_m = 15.0F;      // h: steps of the learned distance under this end the learning
  float least_point_px = 1.0F;  // size of points, from the finest on
  float most_point_px = 24.0F;
};

/// What a frame drew and how long that took.
struct FrameCost {
  double frame_ms = 0;         // of the time that the target counts
  std::uint32_t visible = 0;   // agents drawn
  std::uint64_t vertices = 0;  // drawn; under the budget where the crowd has no more detail
  double farthest_m = 0;       // L: farthest agent in view; 0: not known
  FrameWork work{};
  float error_px = 0.0F;           // chosen for the time, of the picture's pixels; 0: not known
  std::uint32_t oversampling = 1;  // it was drawn with
  double work_ms = 0;              // processor time in frame_ms, of all threads; 0: not known
};

/// What a view's next frame is drawn with.
struct FramePlan {
  std::uint64_t vertex_budget = 0;
  // kPredictive: each agent in the cheapest form that looks right, and what looks right is chosen
  // by these costs so that the frame takes its time
  bool mixed = false;
  double budget_ms = 0.0;
  float least_error_px = 0.05F;
  WorkCost cost{};
  std::uint32_t oversampling = 1;
  bool points = false;             // agents are drawn by points instead of meshes
  float point_size_px = 1.25F;     // then
  float motion_distance_m = 0.0F;  // who is farther is posed less often; 0: all in every frame
  float motion_k_per_m = 0.0F;
  // Where there is a far crowd that is drawn as one (FarSettings), and the user does not say from
  // where on: figures under this height are part of it, or who is farther; 0: as the user has it.
  float far_least_px = 0.0F, far_distance_m = 0.0F;
  int state = 0;  // kSfsm: 0, 1 or 2
};

/// Chooses what a view's next frame is drawn with from what its frames so far took. One per view;
/// not thread safe.
class BudgetController {
 public:
  virtual ~BudgetController() = default;
  virtual std::string_view name() const = 0;

  /// Tells what the last frame took. A time that is not a positive number is passed over.
  virtual void record(const FrameCost& cost) = 0;

  /// What the parts of a frame cost on this machine, as far as that was learned: what the next view
  /// on it may start from.
  virtual WorkCost learned() const { return {}; }

  /// The vertex budget of the next frame. A target that is not a positive number leaves it.
  virtual std::uint64_t next_budget(double target_ms) = 0;

  /// The next frame; call one of the two for a frame. A target that is not a positive number leaves
  /// everything as it is.
  virtual FramePlan next_plan(double target_ms) {
    FramePlan plan;
    plan.vertex_budget = next_budget(target_ms);
    return plan;
  }
};

/// Limits that make no sense (none, least above most) are replaced by the nearest that do.
std::unique_ptr<BudgetController> make_controller(const ControlSettings& settings);

/// For what users type: InvalidArgument names a target that is not a positive number, or a budget
/// that is not one of vertices.
absl::Status check_control(double target_ms, double vertex_budget);

}  // namespace throng::render
