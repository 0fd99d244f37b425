#pragma once

#include <glm/glm.hpp>

#include "server/scene/limits.hpp"

namespace throng::server {

/// Box in the world frame, metres.
struct WorldBox {
  glm::dvec3 low{0.0};
  glm::dvec3 high{0.0};
};

/// The box that overview cameras of a crowd are fitted to. It follows the crowd smoothly: it grows
/// within a second, so that nobody walks out of the picture, and shrinks over many, so that the
/// camera rests while people come and go. Not thread safe.
class OverviewBox {
 public:
  /// @param agents   box of the agents now, world frame. Returns the box to show.
  /// @param shrinks  false: it only grows, for a moment that stands still, whose picture should
  /// too.
  WorldBox follow(const WorldBox& agents, Clock::time_point now, bool shrinks = true);
  void forget() { known_ = false; }

  /// The box to show of agents that are looked at once, with nothing before to follow.
  static WorldBox around(const WorldBox& agents);

 private:
  WorldBox box_;
  Clock::time_point at_{};
  bool known_ = false;
};

}  // namespace throng::server
