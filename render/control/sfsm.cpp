#include "render/control/sfsm.hpp"

#include <algorithm>
#include <cmath>

namespace throng::render {
namespace {

constexpr double kTolerance = 0.05;  // of the target: the paper's 10 ms of 300, and some
constexpr double kUnknownReachM = 200.0;

}  // namespace

double SfsmController::reach_m() const {
  return last_.farthest_m > 0.0 ? last_.farthest_m : kUnknownReachM;
}

void SfsmController::record(const FrameCost& cost) {
  if (!(cost.frame_ms > 0.0) || !std::isfinite(cost.frame_ms)) return;
  last_ = cost;
  is_new_ = true;
}

void SfsmController::enter(int state) {
  if (state > state_) below_ms_[state_] = last_.frame_ms;
  state_ = state;
  learned_ = 0;
  const double reach = reach_m();
  if (state == 1) {
    // with d = L everybody moves in every frame: the frame just seen is the first of State 1
    last_distance_m_ = reach;
    last_ms_ = last_.frame_ms;
    distance_m_ = reach * 5.0 / 6.0;
  }
  if (state == 2) {
    distance_m_ = reach * 2.0 / 3.0;
    size_px_ = settings_.least_point_px;
  }
}

void SfsmController::learn_distance(double target_ms) {
  const double reach = reach_m();
  const double now_ms = last_.frame_ms;
  ++learned_;
  if (std::abs(now_ms - target_ms) <= kTolerance * target_ms) return;  // as wanted: d stays
  const double run = distance_m_ - last_distance_m_, rise = now_ms - last_ms_;
  double next;
  if (now_ms < target_ms && learned_ == 1) {
    next = reach * 11.0 / 12.0;
  } else if (run * rise > 0.0) {
    next = distance_m_ + (target_ms - now_ms) * run / rise;
    if (now_ms < target_ms && last_ms_ > target_ms) {
      next = std::clamp(next, std::min(distance_m_, last_distance_m_),
                        std::max(distance_m_, last_distance_m_));
    }
  } else {
    // nothing was won (or noise hid it): one more sixth in the direction that is wanted
    next = distance_m_ + (now_ms > target_ms ? -1.0 : 1.0) * reach / 6.0;
  }
  if (next >= reach && now_ms < target_ms) {
    if (below_ms_[0] <= target_ms) return enter(0);
    next = reach;
  }
  if (next < reach * 2.0 / 3.0) return enter(2);
  if (std::abs(next - distance_m_) >= static_cast<double>(settings_.settled_m) || learned_ < 3) {
    last_distance_m_ = distance_m_;
    last_ms_ = now_ms;
  }
  distance_m_ = next;
}

void SfsmController::set_size(double target_ms) {
  const double miss = (last_.frame_ms - target_ms) / target_ms;
  if (std::abs(miss) <= 0.5 * kTolerance) return;
  const double least = settings_.least_point_px, most = settings_.most_point_px;
  const double next = size_px_ + 0.5 * size_px_ * std::min(miss, 2.0);
  // points can't be finer: only a state that was fast enough is worth a try
  if (next < least && miss < -kTolerance && below_ms_[1] <= target_ms) return enter(1);
  size_px_ = std::clamp(next, least, most);
}

FramePlan SfsmController::next_plan(double target_ms) {
  if (is_new_ && target_ms > 0.0 && std::isfinite(target_ms)) {
    is_new_ = false;
    if (state_ == 0) {
      if (last_.frame_ms > (1.0 + kTolerance) * target_ms) enter(1);
    } else if (state_ == 1) {
      learn_distance(target_ms);
    } else {
      set_size(target_ms);
    }
  }
  FramePlan plan;
  plan.vertex_budget = settings_.start_budget;
  plan.state = state_;
  plan.points = state_ == 2;
  plan.point_size_px = static_cast<float>(size_px_);
  plan.motion_distance_m = state_ == 0 ? 0.0F : static_cast<float>(std::max(distance_m_, 1e-3));
  plan.motion_k_per_m = settings_.k_per_m;
  // its d is where far begins, for all that is done to who is far
  plan.far_distance_m = plan.motion_distance_m;
  return plan;
}

}  // namespace throng::render
