#include "render/control/far_choice.hpp"

#include <algorithm>
#include <cmath>

namespace throng::render {
namespace {

constexpr float kGain = 0.95F;  // of the error before: less is noise
constexpr int kMostWait = 3000;

}  // namespace

void FarChoice::judge(float mean_px) {
  is_trial_ = false;
  if (mean_px < kGain * before_px_) {
    wait_ = kLeastWait;
    return;
  }
  least_px_ = kept_px_;
  wait_ = std::min(2 * wait_, kMostWait);
}

void FarChoice::record(float error_px) {
  if (!(error_px > 0.0F) || !std::isfinite(error_px)) return;
  // the first frames after a step are drawn by what the ones before it cost
  constexpr int kLate = 3;
  if (++frames_ > (is_trial_ ? kLate : 0)) sum_px_ += error_px;
  if (frames_ < (is_trial_ ? kLate + kLook : kLook)) return;
  const bool is_over = is_trial_ || frames_ >= wait_;
  if (!is_over) return;
  const float mean_px = sum_px_ / static_cast<float>(frames_ - (is_trial_ ? kLate : 0));
  sum_px_ = 0.0F;
  frames_ = 0;
  if (is_trial_) return judge(mean_px);
  if (mean_px > kBindsPx && least_px_ < kMostPx) {
    kept_px_ = least_px_;
    before_px_ = mean_px;
    least_px_ = std::min(kStep * least_px_, kMostPx);
    is_trial_ = true;
  } else if (mean_px < kFreePx) {
    least_px_ = std::max(least_px_ / kStep, kLeastPx);
  }
}

}  // namespace throng::render
