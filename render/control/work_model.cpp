#include "render/control/work_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace throng::render {
namespace {

constexpr int kUnknowns = FrameWork::kParts + 1;  // the last is what every frame takes
constexpr std::size_t kFrames = 48;
constexpr double kWeightOfOlder = 0.94;
constexpr double kNoise = 0.03;     // of a frame's time: what frames of the same work differ by
constexpr double kSpread = 0.8;     // of a cost: how far it may be from where it started
constexpr double kNewScene = 0.25;  // a drift that makes older frames useless

using Vector = std::array<double, kUnknowns>;

Vector work_of(const FrameWork& work) {
  Vector result;
  std::copy(std::begin(work.part), std::end(work.part), result.begin());
  result[kUnknowns - 1] = 1.0;
  return result;
}

Vector start() {
  const WorkCost cost;
  Vector result;
  std::copy(std::begin(cost.ms), std::end(cost.ms), result.begin());
  result[kUnknowns - 1] = cost.fixed_ms;
  return result;
}

/// Gaussian elimination; the matrix is symmetric and positive definite, so no pivots are chosen.
Vector solve(std::array<Vector, kUnknowns> a, Vector b) {
  for (std::size_t i = 0; i < kUnknowns; ++i) {
    for (std::size_t row = i + 1; row < kUnknowns; ++row) {
      const double factor = a[row][i] / a[i][i];
      for (std::size_t k = i; k < kUnknowns; ++k) a[row][k] -= factor * a[i][k];
      b[row] -= factor * b[i];
    }
  }
  for (std::size_t i = kUnknowns; i-- > 0;) {
    for (std::size_t k = i + 1; k < kUnknowns; ++k) b[i] -= a[i][k] * b[k];
    b[i] /= a[i][i];
  }
  return b;
}

}  // namespace

void WorkModel::record(const FrameCost& cost) {
  if (!(cost.frame_ms > 0.0) || !std::isfinite(cost.frame_ms) || !cost.work.known) return;
  frames_.push_front(cost);
  if (frames_.size() > kFrames) frames_.pop_back();
  const auto ratio = [this](std::size_t i) {
    return frames_[i].frame_ms / std::max(cost_.of(frames_[i].work), 1e-6);
  };
  const auto measure = [&] {
    if (frames_.size() < 3) {
      drift_ = ratio(0);
      return;
    }
    const double a = ratio(0), b = ratio(1), c = ratio(2);
    drift_ = std::max(std::min(a, b), std::min(std::max(a, b), c));
  };
  fit();
  measure();
  if (frames_.size() > 3 && std::abs(drift_ - 1.0) > kNewScene) {
    frames_.resize(2);
    fit();
    drift_ = 0.5 * (ratio(0) + ratio(1));
  }
}

void WorkModel::fit() {
  // Normal equations with a Gaussian prior, each row in units of its expected error.
  const Vector prior = start();
  std::array<Vector, kUnknowns> normal{};
  Vector right{};
  for (std::size_t i = 0; i < kUnknowns; ++i) {
    const double w = 1.0 / (kSpread * kSpread * prior[i] * prior[i]);
    normal[i][i] = w;
    right[i] = w * prior[i];
  }
  double weight = 1.0;
  for (const FrameCost& frame : frames_) {
    const double error_ms = kNoise * frame.frame_ms;
    const double w = weight / (error_ms * error_ms);
    const Vector work = work_of(frame.work);
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      for (std::size_t k = 0; k < kUnknowns; ++k) normal[i][k] += w * work[i] * work[k];
      right[i] += w * frame.frame_ms * work[i];
    }
    weight *= kWeightOfOlder;
  }
  const Vector fitted = solve(normal, right);
  for (std::size_t i = 0; i < FrameWork::kParts; ++i) {
    cost_.ms[i] = std::max(fitted[i], 0.05 * prior[i]);
  }
  cost_.fixed_ms = std::max(fitted[kUnknowns - 1], 0.05 * prior[kUnknowns - 1]);
}

WorkCost WorkModel::cost() const {
  WorkCost result = cost_;
  result.fixed_ms *= drift_;
  for (double& ms : result.ms) ms *= drift_;
  return result;
}

}  // namespace throng::render
