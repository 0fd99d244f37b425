#include "render/control/work_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace throng::render {
namespace {

constexpr int kUnknowns = FrameWork::kParts + 1;  // the last is what every frame takes
constexpr std::size_t kFrames = 48, kScenes = 24;
constexpr double kWeightOfOlder = 0.94, kWeightOfScene = 0.5;
constexpr double kNoise = 0.03;       // of a frame's time: what frames of the same work differ by
constexpr double kFar = 0.1;          // what is farther off counts for less
constexpr double kSpread = 0.5;       // of a cost: how far it may be from where it started
constexpr double kLeast = 0.05;       // of a cost
constexpr double kSameScene = 0.2;    // of a frame's time: less of it is spent on other work
constexpr double kNewMachine = 0.25;  // a drift that makes older frames useless

using Vector = std::array<double, kUnknowns>;

Vector work_of(const FrameWork& work) {
  Vector result;
  std::copy(std::begin(work.part), std::end(work.part), result.begin());
  result[kUnknowns - 1] = 1.0;
  return result;
}

Vector costs_of(const WorkCost& cost) {
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

/// The same with none under its least: who would be stays there, and the others make up for it.
Vector solve_bounded(const std::array<Vector, kUnknowns>& normal, const Vector& right,
                     const Vector& least) {
  std::array<bool, kUnknowns> held{};
  for (;;) {
    std::array<Vector, kUnknowns> a = normal;
    Vector b = right;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      if (!held[i]) continue;
      for (std::size_t k = 0; k < kUnknowns; ++k) {
        if (!held[k]) b[k] -= normal[k][i] * least[i];
        a[i][k] = a[k][i] = 0.0;
      }
    }
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      if (!held[i]) continue;
      a[i][i] = 1.0;
      b[i] = least[i];
    }
    const Vector result = solve(a, b);
    bool is_new = false;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      if (held[i] || result[i] >= least[i]) continue;
      held[i] = is_new = true;
    }
    if (!is_new) return result;
  }
}

}  // namespace

double WorkModel::ratio(const Frame& frame) const {
  return frame.ms / std::max(cost_.of(frame.work), 1e-6);
}

bool WorkModel::is_like(const FrameWork& a, const FrameWork& b) const {
  double other_ms = 0.0;
  for (int i = 0; i < FrameWork::kParts; ++i) {
    other_ms += cost_.ms[i] * std::abs(a.part[i] - b.part[i]);
  }
  return other_ms < kSameScene * std::max(cost_.of(a), cost_.of(b));
}

void WorkModel::remember(const Frame& frame) {
  std::erase_if(scenes_, [&](const Frame& old) { return is_like(old.work, frame.work); });
  scenes_.push_front(frame);
  if (scenes_.size() > kScenes) scenes_.pop_back();
}

void WorkModel::record(const FrameCost& cost) {
  if (!(cost.frame_ms > 0.0) || !std::isfinite(cost.frame_ms) || !cost.work.known) return;
  const Frame frame{cost.work, cost.frame_ms};
  if (!recent_.empty() && !is_like(recent_.front().work, frame.work)) {
    // of the last three that whose time is the middle one, since one may have been late
    if (of_scene_ >= 3) {
      std::array<Frame, 3> last{recent_[0], recent_[1], recent_[2]};
      std::sort(last.begin(), last.end(),
                [&](const Frame& a, const Frame& b) { return ratio(a) < ratio(b); });
      remember(last[1]);
    }
    of_scene_ = 0;
  }
  recent_.push_front(frame);
  if (recent_.size() > kFrames) recent_.pop_back();
  of_scene_ = std::min(of_scene_ + 1, recent_.size());
  fit();
  const auto measure = [&] {
    if (of_scene_ == 1) return std::clamp(ratio(recent_[0]), 0.5, 2.0);
    if (of_scene_ == 2) return 0.5 * (ratio(recent_[0]) + ratio(recent_[1]));
    const double a = ratio(recent_[0]), b = ratio(recent_[1]), c = ratio(recent_[2]);
    return std::max(std::min(a, b), std::min(std::max(a, b), c));
  };
  drift_ = measure();
  if (of_scene_ > 4 && std::abs(drift_ - 1.0) > kNewMachine) {
    // the same work takes another time: so will that of all scenes
    for (Frame& old : scenes_) old.ms *= drift_;
    recent_.resize(2);
    of_scene_ = 2;
    fit();
    drift_ = measure();
  }
}

void WorkModel::fit() {
  // how fast this machine is beside that of the start
  std::vector<double> speeds;
  for (const Frame& frame : recent_) speeds.push_back(frame.ms / start_.of(frame.work));
  for (const Frame& frame : scenes_) speeds.push_back(frame.ms / start_.of(frame.work));
  const auto middle = speeds.begin() + static_cast<std::ptrdiff_t>(speeds.size() / 2);
  std::nth_element(speeds.begin(), middle, speeds.end());
  Vector prior = costs_of(start_), least;
  for (std::size_t i = 0; i < kUnknowns; ++i) {
    prior[i] *= *middle;
    least[i] = kLeast * prior[i];
  }
  Vector fitted = prior;
  // twice: the first pass tells what is far off
  for (int pass = 0; pass < 2; ++pass) {
    // normal equations with a Gaussian prior, each row in units of its expected error
    std::array<Vector, kUnknowns> normal{};
    Vector right{};
    for (std::size_t i = 0; i < kUnknowns; ++i) {
      const double w = 1.0 / (kSpread * kSpread * prior[i] * prior[i]);
      normal[i][i] = w;
      right[i] = w * prior[i];
    }
    const auto add = [&](const Frame& frame, double weight) {
      const Vector work = work_of(frame.work);
      double expected_ms = 0.0;
      for (std::size_t i = 0; i < kUnknowns; ++i) expected_ms += fitted[i] * work[i];
      const double off = std::abs(frame.ms - expected_ms) / std::max(expected_ms, 1e-6);
      if (pass > 0 && off > kFar) weight *= kFar / off;
      const double error_ms = kNoise * frame.ms;
      const double w = weight / (error_ms * error_ms);
      for (std::size_t i = 0; i < kUnknowns; ++i) {
        for (std::size_t k = 0; k < kUnknowns; ++k) normal[i][k] += w * work[i] * work[k];
        right[i] += w * frame.ms * work[i];
      }
    };
    double weight = 1.0;
    for (const Frame& frame : recent_) {
      add(frame, weight);
      weight *= kWeightOfOlder;
    }
    for (const Frame& frame : scenes_) add(frame, kWeightOfScene);
    fitted = solve_bounded(normal, right, least);
  }
  std::copy(fitted.begin(), fitted.end() - 1, std::begin(cost_.ms));
  cost_.fixed_ms = fitted[kUnknowns - 1];
}

WorkCost WorkModel::cost() const {
  WorkCost result = cost_;
  result.fixed_ms *= drift_;
  for (double& ms : result.ms) ms *= drift_;
  return result;
}

}  // namespace throng::render
