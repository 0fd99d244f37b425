#pragma once

#include <deque>

#include "throng/render/control.hpp"

namespace throng::render {

/// What the parts of a frame cost on this machine, learned while it draws:
///
///     ms = drift * (fixed + sum of cost_i * work_i)
///
/// The costs by least squares over the last frames, relative to each frame's time, newer ones
/// weighing more, and drawn towards where they started. `drift` is the median of what the last
/// three frames took over what was expected: one late frame moves nothing, two make it.
class WorkModel {
 public:
  /// Frames without a time or without known work are passed over.
  void record(const FrameCost& cost);
  bool empty() const { return frames_.empty(); }

  /// With the drift.
  WorkCost cost() const;

 private:
  void fit();

  std::deque<FrameCost> frames_;  // newest first
  WorkCost cost_;
  double drift_ = 1.0;
};

}  // namespace throng::render
