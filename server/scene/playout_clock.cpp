#include "server/scene/playout_clock.hpp"

#include <algorithm>
#include <cmath>

namespace throng::server {
namespace {

double microseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

constexpr double kDefaultPeriodUs = 100'000.0;
constexpr double kWindowUs = 2'000'000.0;  // pace and spacing are measured over this long
constexpr double kSettleUs = 500'000.0;    // an error of the playhead is halved in about this time
constexpr double kLargestCorrection = 0.25;  // of the pace: more would be seen as hurrying
constexpr double kJumpUs =
    3'000'000.0;  // wall time; further off than this, catching up is hopeless
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
  double jitter_us = 0.0;
  pace_ = 1.0;
  lead_us_ = 0.0;
  if (samples_.size() >= 3) {
    const Sample& newest = samples_.back();
    const auto wall_us = [&](const Sample& sample) {
      return microseconds(sample.arrival - newest.arrival);
    };
    const auto scene_us = [&](const Sample& sample) {
      return static_cast<double>(sample.scene_us - newest.scene_us);
    };
    const double count = static_cast<double>(samples_.size());
    const double window_us = -wall_us(samples_.front());
    // Frames that came in one burst tell no pace.
    if (window_us > 100'000.0) {
      // Slope of the line through all arrivals; its ends alone would carry their jitter.
      double wall_mean = 0.0, scene_mean = 0.0;
      for (const Sample& sample : samples_) {
        wall_mean += wall_us(sample) / count;
        scene_mean += scene_us(sample) / count;
      }
      double covariance = 0.0, variance = 0.0;
      for (const Sample& sample : samples_) {
        const double wall = wall_us(sample) - wall_mean;
        covariance += wall * (scene_us(sample) - scene_mean);
        variance += wall * wall;
      }
      pace_ = std::clamp(covariance / variance, 0.01, 1000.0);
      if (std::abs(pace_ - 1.0) < 0.02) pace_ = 1.0;  // live, apart from jitter
      period_us = window_us / (count - 1.0);

      // How early and how late frames come, compared with the newest.
      double earliest_us = 0.0, latest_us = 0.0;
      for (const Sample& sample : samples_) {
        const double lead_us = scene_us(sample) - pace_ * wall_us(sample);
        earliest_us = std::max(earliest_us, lead_us);
        latest_us = std::min(latest_us, lead_us);
      }
      lead_us_ = earliest_us;
      jitter_us = (earliest_us - latest_us) / pace_;
    } else if (expected_rate_hz_ <= 0.0) {
      period_us = -scene_us(samples_.front()) / (count - 1.0);
    }
  }
  delay_ = std::clamp(std::chrono::microseconds(static_cast<std::int64_t>(
                          std::min(settings_.delay_periods * period_us + jitter_us, 1e9))),
                      settings_.min_delay, settings_.max_delay);
}

std::int64_t PlayoutClock::at(Clock::time_point now) {
  if (samples_.empty()) return 0;
  const Sample& newest = samples_.back();
  const double newest_us = static_cast<double>(newest.scene_us);
  const double delay_us = static_cast<double>(delay_.count());
  // The line of the frames that came earliest, less the delay that covers the latest.
  const double target_us = std::min(
      newest_us, newest_us + lead_us_ + pace_ * (microseconds(now - newest.arrival) - delay_us));
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
