#include "server/scene/recording.hpp"

#include <spdlog/spdlog.h>

#include <span>
#include <utility>

namespace throng::server {

Recording::Recording(const RecordSettings& settings, trajectory::RecordingSpec spec)
    : crowd_(spec.crowd), writer_(settings.folder, std::move(spec), settings.limit_bytes) {}

void Recording::write(const render::AgentFrame& frame) {
  const std::lock_guard lock(mutex_);
  if (has_failed_ || (has_frames_ && frame.time_us <= last_us_)) return;
  if (frame.membership != membership_) {
    membership_ = frame.membership;
    writer_.set_members(membership_->ids, membership_->names);
  }
  static_assert(sizeof(glm::vec3) == 3 * sizeof(float));
  const std::span<const float> position_m(
      frame.position_m.empty() ? nullptr : &frame.position_m.front().x,
      3 * frame.position_m.size());
  const std::string before = writer_.path();
  const absl::Status status =
      writer_.write(frame.time_us, position_m, frame.heading_rad, frame.channels);
  check(status);
  if (!status.ok()) return;
  last_us_ = frame.time_us;
  has_frames_ = true;
  if (writer_.path() != before) {
    spdlog::info("event=recording crowd={} file=\"{}\"", crowd_, writer_.path());
  }
}

void Recording::set_walkable_area(const std::string& wkt) {
  const std::lock_guard lock(mutex_);
  if (!has_failed_) check(writer_.set_walkable_area(wkt));
}

void Recording::check(const absl::Status& status) {
  if (status.ok()) return;
  has_failed_ = true;
  spdlog::error("event=recording_ended crowd={} error=\"{}\"", crowd_,
                std::string(status.message()));
}

}  // namespace throng::server
