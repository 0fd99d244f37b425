#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

namespace throng::server {

using Clock = std::chrono::steady_clock;
/// The time now; tests put their own here.
using Now = std::function<Clock::time_point()>;

/// What one server allows; GetServerInfo states the values. All are flags of throng-server.
struct Limits {
  std::uint32_t max_message_bytes = 64u << 20;
  std::uint32_t max_crowds = 64;
  std::uint32_t max_viewers = 64;
  std::uint32_t max_agents_per_crowd = 1'000'000;
  std::uint32_t max_channels = 16;
  std::uint64_t max_history_bytes_per_crowd = 256u << 20;
  std::uint32_t max_width_px = 4096;
  std::uint32_t max_height_px = 4096;
  std::uint32_t max_frames_in_flight = 3;
  std::uint64_t max_vertex_budget = 20'000'000;
  double max_rate_hz = 60.0;  // a viewer that asks for more gets this
  std::uint32_t max_environment_bytes = 4u << 20;
  std::uint32_t max_pending_pictures = 16;
};

/// 1 to 100 characters of A-Z a-z 0-9 _ . - ; InvalidArgument otherwise, naming the first bad one.
absl::Status check_crowd_name(const std::string& name);

/// Scene times are microseconds within +-1e17 (three thousand years), so that differences and sums
/// of a few of them never overflow.
absl::Status check_scene_time(const char* field, std::int64_t time_us);

}  // namespace throng::server
