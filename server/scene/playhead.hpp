#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "server/scene/limits.hpp"

namespace throng::server {

/// One viewer's clock on a crowd: with the producer, or somewhere in the history. A value: where it
/// stands is a function of the wall clock alone, so asking changes nothing.
struct Playhead {
  bool live = true;
  bool paused = false;
  double speed = 1.0;          // scene seconds for each second; below 0: backwards
  std::int64_t anchor_us = 0;  // scene time at `anchor_at`; both count when not live
  Clock::time_point anchor_at{};

  bool operator==(const Playhead&) const = default;

  /// Scene time at `now`, within the history [oldest_us, live_us].
  std::int64_t at(Clock::time_point now, std::int64_t oldest_us, std::int64_t live_us) const {
    if (live) return live_us;
    const double elapsed_us = std::chrono::duration<double, std::micro>(now - anchor_at).count();
    const double moved_us = paused ? 0.0 : std::clamp(elapsed_us * speed, -1e17, 1e17);
    return std::clamp(anchor_us + static_cast<std::int64_t>(std::floor(moved_us)),
                      std::min(oldest_us, live_us), live_us);
  }

  /// From now on at `scene_time_us`, paused or not as before.
  void go_to(std::int64_t scene_time_us, Clock::time_point now) {
    live = false;
    anchor_us = scene_time_us;
    anchor_at = now;
  }
};

}  // namespace throng::server
