#pragma once

#include <cstdint>
#include <deque>

#include "server/scene/limits.hpp"

namespace throng::server {

struct PlayoutSettings {
  double delay_periods = 1.5;  // frames are shown this many frame spacings behind the newest
  std::chrono::microseconds min_delay{40'000};
  std::chrono::microseconds max_delay{2'000'000};
};

/// Which scene time the viewers of a crowd see now.
///
/// Frames come in jumps; people must walk smoothly. The playhead therefore runs with the wall clock
/// at the producer's own pace (1 for a live simulation, measured over the last two seconds), a
/// playout delay behind the newest frame, so that there is nearly always a newer snapshot to
/// interpolate towards. The delay is a multiple of the frame spacing and what arrivals jitter by.
/// It catches up or falls back by at most a quarter of that pace, never goes backwards, jumps only
/// when it is seconds off, and holds on the newest frame when the producer stops. Not thread safe.
class PlayoutClock {
 public:
  explicit PlayoutClock(PlayoutSettings settings = {}) : settings_(settings) {}

  /// A new run: forgets everything. @param expected_rate_hz  frames per second, 0: unknown.
  void start(double expected_rate_hz);

  /// A frame newer than all before has arrived.
  void on_frame(std::int64_t scene_time_us, Clock::time_point now);

  /// Scene time to show at `now`, which never decreases from call to call; 0 before any frame.
  std::int64_t at(Clock::time_point now);

  /// Scene seconds for each second of the wall clock.
  double pace() const { return pace_; }
  /// Playout delay on the wall clock.
  std::chrono::microseconds delay() const { return delay_; }

 private:
  struct Sample {
    std::int64_t scene_us;
    Clock::time_point arrival;
  };
  void measure();

  PlayoutSettings settings_;
  double expected_rate_hz_ = 0.0;
  std::deque<Sample> samples_;  // of the last two seconds
  double pace_ = 1.0;
  double lead_us_ = 0.0;  // scene time by which the earliest frames came before the newest's line
  std::chrono::microseconds delay_{150'000};
  double playhead_us_ = 0.0;
  Clock::time_point playhead_at_{};
  bool running_ = false;  // the first delay has passed
};

}  // namespace throng::server
