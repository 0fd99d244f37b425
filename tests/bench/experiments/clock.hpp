#pragma once

#include <ctime>

namespace throng::bench {

/// Seconds that have passed, and seconds that all threads of the process were running: the second
/// is what a machine shared with others still measures.
struct Ticks {
  double wall_s = 0, cpu_s = 0;

  static Ticks now() {
    const auto seconds = [](clockid_t clock) {
      timespec time{};
      clock_gettime(clock, &time);
      return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
    };
    return {seconds(CLOCK_MONOTONIC), seconds(CLOCK_PROCESS_CPUTIME_ID)};
  }
  Ticks since(const Ticks& start) const { return {wall_s - start.wall_s, cpu_s - start.cpu_s}; }
};

}  // namespace throng::bench
