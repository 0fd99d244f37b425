#include "server/scene/overview.hpp"

#include <algorithm>
#include <cmath>

namespace throng::server {
namespace {

constexpr double kGrowSeconds = 0.5;
constexpr double kShrinkSeconds = 8.0;
constexpr double kForgetSeconds = 10.0;  // nobody looked for this long: start afresh
constexpr double kMarginM = 1.0;         // around the agents' positions
constexpr double kLeastSizeM = 6.0;
constexpr double kNearSiteM = 5.0;  // of the site, or half of what the agents span
constexpr double kAgentHeightM = 2.0;
// Closer than this share of its size the box stands still, so frames repeat: half a pixel of 1000.
constexpr double kRest = 5e-4;

double approach(double value, double goal, bool grows, double seconds, double rest_m) {
  if (std::abs(goal - value) < rest_m) return goal;
  const double tau = grows ? kGrowSeconds : kShrinkSeconds;
  return goal + (value - goal) * std::exp(-seconds / tau);
}

}  // namespace

WorldBox OverviewBox::around(const WorldBox& agents) {
  WorldBox box;
  for (int axis = 0; axis < 2; ++axis) {
    const double center = 0.5 * (agents.low[axis] + agents.high[axis]);
    const double half =
        std::max(0.5 * (agents.high[axis] - agents.low[axis]) + kMarginM, 0.5 * kLeastSizeM);
    box.low[axis] = center - half;
    box.high[axis] = center + half;
  }
  box.low.z = agents.low.z;
  box.high.z = agents.high.z + kAgentHeightM;
  return box;
}

WorldBox OverviewBox::follow(const WorldBox& agents, Clock::time_point now, bool shrinks) {
  const WorldBox goal = around(agents);
  const double seconds = std::max(0.0, std::chrono::duration<double>(now - at_).count());
  if (!known_ || seconds > kForgetSeconds) {
    box_ = goal;
    known_ = true;
  } else {
    const double rest_m = kRest * std::max(goal.high.x - goal.low.x, goal.high.y - goal.low.y);
    const auto move = [&](double& value, double to, bool grows) {
      if (grows || shrinks) value = approach(value, to, grows, seconds, rest_m);
    };
    for (int axis = 0; axis < 3; ++axis) {
      move(box_.low[axis], goal.low[axis], goal.low[axis] < box_.low[axis]);
      move(box_.high[axis], goal.high[axis], goal.high[axis] > box_.high[axis]);
    }
  }
  at_ = now;
  return box_;
}

}  // namespace throng::server
