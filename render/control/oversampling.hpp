#pragma once

#include "render/control/work_model.hpp"

namespace throng::render {

/// Whether a view's next frame is drawn with four times the samples: where the error is so small
/// already that more vertices would not be seen, and the time is there. What takes time is dropped
/// in the other order: first the samples, then detail.
///
/// It is tried after a number of frames that would have had the time, and given up at once where
/// the error that it leaves is seen or a lowered target has no room for it. Each try that is given
/// up soon doubles how long the next one waits, so that pictures do not pump.
class OversamplingChoice {
 public:
  static constexpr float kFinePx = 0.25F;  // an error that more vertices need not lessen
  static constexpr int kLeastWait = 12;    // frames

  explicit OversamplingChoice(std::uint32_t most) : most_(most) {}

  void record(const FrameCost& cost);

  /// 1 or 2. @param small  what frames without it cost.
  std::uint32_t next(double target_ms, const WorkCost& small);

  /// Of frames with it.
  WorkCost cost() const { return large_.cost(); }

 private:
  std::uint32_t most_;
  FrameCost last_;
  bool is_known_ = false, is_tried_ = false;
  WorkModel large_;
  std::uint32_t now_ = 1;
  int waited_ = 0, drawn_ = 0;  // frames that would have had the time; frames since it began
  int wait_ = kLeastWait;
};

}  // namespace throng::render
