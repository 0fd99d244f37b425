#pragma once

#include "throng/render/representation.hpp"

namespace throng::render {

/// From where on a view's far crowd is drawn as one (FarSettings), by the height of the figures
/// there: nearer where time forces a large error, and back where there is time.
///
/// A step nearer is a trial: as the frame's time is given, it has won something if what the others
/// may be off by gets less. If not it is taken back, and the next one waits twice as long. Between
/// the error that asks for a step and the one that allows to go back nothing changes.
class FarChoice {
 public:
  static constexpr float kLeastPx = 16.0F, kMostPx = 48.0F;  // of figures
  static constexpr float kStep = 1.25F;
  static constexpr float kBindsPx = 1.0F, kFreePx = 0.5F;  // of error
  static constexpr int kLook = 8, kLeastWait = 24;         // frames

  /// @param error_px  of the last frame, chosen for its time; 0: not known, which is passed over.
  void record(float error_px);

  /// Who is less high is part of the crowd.
  float least_px() const { return least_px_; }

 private:
  void judge(float mean_px);

  float least_px_ = kLeastPx, kept_px_ = kLeastPx;
  float before_px_ = 0.0F;  // mean error before the trial
  float sum_px_ = 0.0F;     // of errors, over `frames_`
  int frames_ = 0, wait_ = kLeastWait;
  bool is_trial_ = false;
};

}  // namespace throng::render
