#include "server/scene/playout_clock.hpp"

#include <algorithm>
#include <cmath>

namespace throng::server {
namespace {

double microseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

constexpr double kDefaultPeriodUs = 100'000.0;
constexpr double kWindowUs = 2'000'000.0;    // pace and spacing are measured over this long
constexpr double kSettleUs = 500'000.0;      // an error of the playhead is halved in about this time
constexpr double kLargestCorrection = 0.25;  // of the pace: more would be seen as hurrying
constexpr double kJumpUs = 3'000'000.0;      // wall time; further off than this, catching up is hopeless
constexpr std::size_t kMostSamples = 512;

}  // namespace

void PlayoutClock::start(double expected_rate_hz) {
  *this = PlayoutClock(settings_);
  expected_rate_hz_ = expected_rate_hz;
  measure();
}

void PlayoutClock::on_frame(std::int64_t scene_time_us, Clock::time_point now) {
  if (samples_.empty()) {
    playhead_us_ = static_cast<double>(scene_time_us);
    playhead_at_ = now;
  } else {
    // After a pause the old spacing says nothing; only the newest sample is kept as an anchor.
    const double gap_us = microseconds(now - samples_.back().arrival);
    if (gap_us > kWindowUs) samples_.erase(samples_.begin(), std::prev(samples_.end()));
  }
  samples_.push_back({scene_time_us, now});
  while (samples_.size() > kMostSamples ||
         (samples_.size() > 3 && microseconds(now - samples_.front().arrival) > kWindowUs)) {
    samples_.pop_front();
  }
  measure();
}

void PlayoutClock::measure() {
  double period_us = expected_rate_hz_ > 0.0 ? 1e6 / expected_rate_hz_ : kDefaultPeriodUs;
  pace_ = 1.0;
  if (samples_.size() >= 3) {
    const double scene_us =
        static_cast<double>(samples_.back().scene_us - samples_.front().scene_us);
    const double wall_us = microseconds(samples_.back().arrival - samples_.front().arrival);
    const double spacings = static_cast<double>(samples_.size() - 1);
    // Frames that came in one burst tell no pace.
    if (wall_us > 100'000.0) {
      pace_ = std::clamp(scene_us / wall_us, 0.01, 1000.0);
      if (std::abs(pace_ - 1.0) < 0.1) pace_ = 1.0;  // live, apart from jitter
      period_us = wall_us / spacings;
    } else if (expected_rate_hz_ <= 0.0) {
      period_us = scene_us / spacings;
    }
  }
  delay_ = std::clamp(
      std::chrono::microseconds(static_cast<std::int64_t>(
          std::min(settings_.delay_periods * period_us, 1e9))),
      settings_.min_delay, settings_.max_delay);
}

std::int64_t PlayoutClock::at(Clock::time_point now) {
  if (samples_.empty()) return 0;
  const Sample& newest = samples_.back();
  const double newest_us = static_cast<double>(newest.scene_us);
  const double delay_us = static_cast<double>(delay_.count());
  const double target_us = std::min(
      newest_us, newest_us + pace_ * (microseconds(now - newest.arrival) - delay_us));
  const double elapsed_us = std::max(0.0, microseconds(now - playhead_at_));
  if (now > playhead_at_) playhead_at_ = now;
  const double error_us = target_us - playhead_us_;

  if (!running_) {
    // Wait on the first frame until the delay is filled.
    if (error_us >= 0.0) {
      running_ = true;
      playhead_us_ = target_us;
    }
  } else if (error_us > kJumpUs * pace_ || elapsed_us > 1e6) {
    playhead_us_ = std::max(playhead_us_, target_us);
  } else {
    const double correction =
        std::clamp(error_us / (kSettleUs * pace_), -kLargestCorrection, kLargestCorrection);
    playhead_us_ = std::min(newest_us, playhead_us_ + elapsed_us * pace_ * (1.0 + correction));
  }
  return static_cast<std::int64_t>(std::floor(playhead_us_));
}

}  // namespace throng::server
