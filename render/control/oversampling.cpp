#include "render/control/oversampling.hpp"

#include <algorithm>
#include <cmath>

namespace throng::render {
namespace {

constexpr float kFinePx = OversamplingChoice::kFinePx;
constexpr float kSeenPx = 0.5F;  // one that is worse than what more samples mend
// of the target: what such a frame may take before it is tried, as viewers wait for it
constexpr double kRoom = 0.5;
constexpr int kMostWait = 3000, kSoon = 120;  // frames

/// What a frame's work would be if it was off by another error: vertices go with 1 / error^0.7
/// (measured between 0.06 and 0.6 pixels near and far).
FrameWork at_error(FrameWork work, float error_px, float wanted_px) {
  if (!(error_px > 0.0F) || error_px >= wanted_px) return work;
  const double fewer = std::pow(static_cast<double>(error_px / wanted_px), 0.7);
  work.part[FrameWork::kOwnVertices] *= fewer;
  work.part[FrameWork::kSharedVertices] *= fewer;
  work.part[FrameWork::kMeshEdges] *= std::sqrt(fewer);
  return work;
}

FrameWork enlarged(FrameWork work) {
  work.part[FrameWork::kSpeckRows] *= 2.0;
  work.part[FrameWork::kSpeckPixels] *= 4.0;
  work.part[FrameWork::kMeshPixels] *= 4.0;
  work.part[FrameWork::kMeshEdges] *= 2.0;
  return work;
}

}  // namespace

void OversamplingChoice::record(const FrameCost& cost) {
  is_known_ = cost.work.known && cost.frame_ms > 0.0 && std::isfinite(cost.frame_ms);
  if (!is_known_) return;
  last_ = cost;
  if (cost.oversampling > 1) large_.record(cost);
}

std::uint32_t OversamplingChoice::next(double target_ms, const WorkCost& small) {
  if (most_ < 2 || !is_known_) return now_ = 1;
  if (now_ == 1) {
    if (!is_tried_) {
      // the ground's pixels are most of what every frame takes
      WorkCost start = small;
      start.fixed_ms *= 4.0;
      large_ = WorkModel(start);
    }
    const bool has_time =
        last_.error_px > 0.0F && last_.error_px <= kFinePx &&
        large_.cost().of(enlarged(at_error(last_.work, last_.error_px, kFinePx))) <=
            kRoom * target_ms;
    waited_ = has_time ? waited_ + 1 : 0;
    if (waited_ < wait_) return 1;
    is_tried_ = true;
    waited_ = drawn_ = 0;
    return now_ = 2;
  }
  if (last_.oversampling < 2) return 2;  // nothing of it was seen yet
  drawn_ = std::min(drawn_ + 1, kSoon + 1);
  const bool is_seen = last_.error_px > kSeenPx;
  const bool has_room =
      large_.cost().of(at_error(last_.work, last_.error_px, kSeenPx)) <= target_ms;
  if (!is_seen && has_room) {
    if (drawn_ > kSoon) wait_ = kLeastWait;
    return 2;
  }
  if (drawn_ <= kSoon) wait_ = std::min(2 * wait_, kMostWait);
  return now_ = 1;
}

}  // namespace throng::render
