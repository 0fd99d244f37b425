#pragma once

#include <deque>

#include "throng/render/control.hpp"

namespace throng::render {

/// What a frame of this machine will take, learned while it draws:
///
///     ms = a + b * visible / 1000 + c * vertices / 1e6 + drift
///
/// a, b and c by least squares over the last frames, newer ones weighing more, drawn towards where
/// they started (a standing view tells nothing about b and c apart from their sum). `drift` is the
/// median miss of the last three frames: one late frame moves nothing, two make it.
class CostModel {
 public:
  void record(const FrameCost& cost);
  bool empty() const { return frames_.empty(); }
  const FrameCost& last() const { return frames_.front(); }

  double predict_ms(const FrameCost& frame) const;  // from its counts
  double ms_per_million() const { return per_million_; }

 private:
  void fit();
  double line_ms(const FrameCost& frame) const;

  std::deque<FrameCost> frames_;                                  // newest first
  double fixed_ = 6.0, per_thousand_ = 0.6, per_million_ = 14.0;  // two cores, before any frame
  double drift_ms_ = 0.0;
};

}  // namespace throng::render
