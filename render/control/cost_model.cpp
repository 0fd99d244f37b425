#include "render/control/cost_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>

namespace throng::render {
namespace {

constexpr std::size_t kFrames = 32;
constexpr double kWeightOfOlder = 0.92;
constexpr double kNoise = 0.03;  // of a frame's time: what frames of the same work differ by
// Where a, b and c start and how far they may be from there.
constexpr glm::dvec3 kStart{6.0, 0.6, 14.0}, kSpread{20.0, 1.0, 14.0};
constexpr glm::dvec3 kLeast{0.0, 0.0, 0.02};
constexpr double kNewScene = 0.15;  // of a frame's time: a drift that makes older frames useless

glm::dvec3 work_of(const FrameCost& frame) {
  return {1.0, frame.visible * 1e-3, static_cast<double>(frame.vertices) * 1e-6};
}

}  // namespace

void CostModel::record(const FrameCost& cost) {
  if (!(cost.frame_ms > 0.0) || !std::isfinite(cost.frame_ms)) return;
  frames_.push_front(cost);
  if (frames_.size() > kFrames) frames_.pop_back();
  fit();
  if (frames_.size() < 3) {
    drift_ms_ = frames_[0].frame_ms - line_ms(frames_[0]);
    return;
  }
  std::array<double, 3> miss;
  for (std::size_t i = 0; i < 3; ++i) miss[i] = frames_[i].frame_ms - line_ms(frames_[i]);
  std::sort(miss.begin(), miss.end());
  drift_ms_ = miss[1];
  if (frames_.size() > 3 && std::abs(drift_ms_) > kNewScene * cost.frame_ms) {
    frames_.resize(2);
    fit();
    drift_ms_ = 0.5 * (frames_[0].frame_ms - line_ms(frames_[0]) + frames_[1].frame_ms -
                       line_ms(frames_[1]));
  }
}

double CostModel::line_ms(const FrameCost& frame) const {
  return glm::dot(glm::dvec3(fixed_, per_thousand_, per_million_), work_of(frame));
}

double CostModel::predict_ms(const FrameCost& frame) const { return line_ms(frame) + drift_ms_; }

void CostModel::fit() {
  // Normal equations of weighted least squares with a Gaussian prior, each row in units of its
  // expected error.
  glm::dmat3 normal(0.0);
  glm::dvec3 right(0.0);
  for (int i = 0; i < 3; ++i) {
    normal[i][i] = 1.0 / (kSpread[i] * kSpread[i]);
    right[i] = normal[i][i] * kStart[i];
  }
  double weight = 1.0;
  for (const FrameCost& frame : frames_) {
    const double error_ms = std::max(kNoise * frame.frame_ms, 0.05);
    const double w = weight / (error_ms * error_ms);
    const glm::dvec3 work = work_of(frame);
    normal += w * glm::outerProduct(work, work);
    right += w * frame.frame_ms * work;
    weight *= kWeightOfOlder;
  }
  const glm::dvec3 fitted = glm::max(glm::inverse(normal) * right, kLeast);
  fixed_ = fitted[0];
  per_thousand_ = fitted[1];
  per_million_ = fitted[2];
}

}  // namespace throng::render
