#pragma once

#include <deque>
#include <vector>

#include "throng/render/control.hpp"

namespace throng::render {

/// What the parts of a frame cost on this machine, learned while it draws:
///
///     ms = drift * (fixed + sum of cost_i * work_i)
///
/// The costs by least squares, none under a twentieth of where it started, over the last frames
/// and one of each scene before (a scene: frames of about the same work), relative to each frame's
/// time, and drawn towards where they started at this machine's speed; what is far off counts for
/// less. A scene that comes back is known, and what a standing view can't tell apart stays as other
/// views had it.
///
/// `drift` is what the last frames of the scene took over what was expected: the first one's own,
/// since what was not seen before is not known better, and from the third on the median of three:
/// one late frame moves nothing, two make it.
class WorkModel {
 public:
  explicit WorkModel(const WorkCost& start = {}) : start_(start), cost_(start) {}

  /// Frames without a time or without known work are passed over.
  void record(const FrameCost& cost);
  bool empty() const { return recent_.empty(); }

  /// With the drift.
  WorkCost cost() const;

 private:
  struct Frame {
    FrameWork work;
    double ms = 0.0;
  };
  void fit();
  void remember(const Frame& frame);
  bool is_like(const FrameWork& a, const FrameWork& b) const;
  double ratio(const Frame& frame) const;

  WorkCost start_, cost_;
  std::deque<Frame> recent_;  // newest first
  std::deque<Frame> scenes_;  // newest first
  std::size_t of_scene_ = 0;  // of the recent ones, those of the present scene
  double drift_ = 1.0;
};

}  // namespace throng::render
