#pragma once

#include "throng/render/control.hpp"

namespace throng::render {

/// The self-feedback state machine (Lyu et al., 3.3).
///
/// State 0 draws the original models; State 1 poses who is beyond a distance d only now and then;
/// State 2 also draws everybody by points, whose size it sets. A frame over the target goes up a
/// state, one under it down.
///
/// Our copy of the paper lacks its formulas. RECONSTRUCTED from its text, with T the time of a
/// frame, t the target and L the farthest visible distance:
///
///     d_1 = L, d_2 = 5/6 L, then     d_{i+1} = d_i + (t - T_i) (d_i - d_{i-1}) / (T_i - T_{i-1})
///
/// (secant steps), where a step that overshoots (T_i < t) goes back between d_i and d_{i-1} by the
/// same line, at the start to 11/12 L; a step under h ends the learning; d < 2/3 L goes to State 2,
/// whose point size changes linearly with the demand:
///
///     s_{i+1} = s_i + s_i / 2 * (T_i - t) / t
///
/// The gain s / (2 t) is ours: the number of points goes with 1 / s^2.
class SfsmController final : public BudgetController {
 public:
  explicit SfsmController(const ControlSettings& settings)
      : settings_(settings), size_px_(settings.least_point_px) {}
  std::string_view name() const override { return "sfsm"; }
  void record(const FrameCost& cost) override;
  std::uint64_t next_budget(double target_ms) override {
    return next_plan(target_ms).vertex_budget;
  }
  FramePlan next_plan(double target_ms) override;

 private:
  void learn_distance(double target_ms);
  void set_size(double target_ms);
  void enter(int state);
  double reach_m() const;

  ControlSettings settings_;
  FrameCost last_;
  bool is_new_ = false;  // a frame was recorded since the last plan
  int state_ = 0;
  int learned_ = 0;                               // frames of State 1 so far
  double distance_m_ = 0.0;                       // d_i
  double last_distance_m_ = 0.0, last_ms_ = 0.0;  // d_{i-1}, T_{i-1}
  double below_ms_[3] = {0, 0, 0};                // what a state took when it was left for the next
  double size_px_;
};

}  // namespace throng::render
