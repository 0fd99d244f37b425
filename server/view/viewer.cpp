#include "server/view/viewer.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace throng::server {
namespace {

// A frame that has waited this long for the connection is replaced by the present. Less would
// render frames that nobody sees; more would be felt as lag.
constexpr std::chrono::milliseconds kStale{250};

bool same_camera(const render::Camera& a, const render::Camera& b) {
  return a.eye_world == b.eye_world && a.target_world == b.target_world &&
         a.up_world == b.up_world && a.fov_y_rad == b.fov_y_rad &&
         a.ortho_height_m == b.ortho_height_m;
}

}  // namespace

bool same_picture(const ViewRequest& a, const ViewRequest& b) {
  if (a.camera.has_value() != b.camera.has_value()) return false;
  if (a.camera.has_value() && !same_camera(*a.camera, *b.camera)) return false;
  return a.crowd == b.crowd && a.viewport.width_px == b.viewport.width_px &&
         a.viewport.height_px == b.viewport.height_px && a.jpeg_quality == b.jpeg_quality &&
         a.vertex_budget == b.vertex_budget && a.channel == b.channel &&
         a.channel_low == b.channel_low && a.channel_high == b.channel_high &&
         a.color_map == b.color_map && a.shadows == b.shadows && a.follow_agent == b.follow_agent &&
         a.playhead == b.playhead;
}

Viewer::Viewer(ViewRequest request, std::uint32_t max_in_flight, Now now,
               std::function<void()> on_frame, std::function<void(absl::Status)> on_end)
    : max_in_flight_(std::max<std::uint32_t>(1, max_in_flight)),
      now_(std::move(now)),
      on_frame_(std::move(on_frame)),
      on_end_(std::move(on_end)),
      request_(std::move(request)),
      next_due_(now_()),
      room_since_(next_due_) {}

Clock::duration Viewer::period() const {
  return std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(1.0 / request_.max_rate_hz));
}

bool Viewer::has_room() const {
  return !ended_ &&
         pending_ + (slot_.frame != nullptr ? 1 : 0) + in_flight_.size() < max_in_flight_;
}

void Viewer::room_changed(bool had_room) {
  if (!had_room && has_room()) room_since_ = now_();
}

void Viewer::set_request(ViewRequest request) {
  const std::lock_guard lock(mutex_);
  request_ = std::move(request);
  // What was asked for now is wanted now, but no faster than the rate allows.
  next_due_ = std::min(next_due_, now_() + period());
}

ViewRequest Viewer::request() const {
  const std::lock_guard lock(mutex_);
  return request_;
}

absl::Status Viewer::ack(std::uint64_t frame_index) {
  const std::lock_guard lock(mutex_);
  if (frame_index > newest_sent_) {
    return absl::InvalidArgumentError(absl::StrCat("acked_frame_index: it is ", frame_index,
                                                   ", the newest sent is ", newest_sent_));
  }
  const bool had_room = has_room();
  newest_acked_ = std::max(newest_acked_, frame_index);
  while (!in_flight_.empty() && in_flight_.front() <= newest_acked_) in_flight_.pop_front();
  room_changed(had_room);
  return absl::OkStatus();
}

std::optional<OutgoingFrame> Viewer::take() {
  const std::lock_guard lock(mutex_);
  if (slot_.frame == nullptr || in_flight_.size() >= max_in_flight_) return std::nullopt;
  const bool had_room = has_room();
  OutgoingFrame outgoing = std::move(slot_);
  slot_ = OutgoingFrame();
  outgoing.skipped_frames = skipped_;
  newest_sent_ = outgoing.frame_index;
  in_flight_.push_back(outgoing.frame_index);
  room_changed(had_room);
  return outgoing;
}

std::optional<Clock::time_point> Viewer::due() const {
  const std::lock_guard lock(mutex_);
  if (ended_) return std::nullopt;
  if (has_room()) return std::max(next_due_, room_since_);
  if (slot_.frame != nullptr && pending_ == 0) return std::max(next_due_, slot_since_ + kStale);
  return std::nullopt;
}

std::uint64_t Viewer::begin_frame(Clock::time_point now, std::uint64_t stamp) {
  const std::lock_guard lock(mutex_);
  // Frames that came due while the viewer had no room were skipped, because it was slow.
  if (has_room() && room_since_ > next_due_) {
    const std::uint64_t missed = static_cast<std::uint64_t>((room_since_ - next_due_) / period());
    skipped_ += missed;
    newest_index_ += missed;
  }
  next_due_ = now - next_due_ > period() ? now + period() : next_due_ + period();
  ++pending_;
  stamps_.emplace_back(++newest_index_, stamp);
  return newest_index_;
}

void Viewer::deliver(std::uint64_t frame_index, std::shared_ptr<const EncodedFrame> frame,
                     HistoryNow history) {
  {
    const std::lock_guard lock(mutex_);
    const bool had_room = has_room();
    --pending_;
    std::uint64_t stamp = 0;
    std::erase_if(stamps_, [&](const auto& entry) {
      if (entry.first == frame_index) stamp = entry.second;
      return entry.first == frame_index;
    });
    if (ended_) return;
    // A frame that needed no encoding may have overtaken this one; the newer one wins.
    if (frame_index < newest_delivered_) {
      ++skipped_;
      room_changed(had_room);
      return;
    }
    newest_delivered_ = frame_index;
    if (slot_.frame != nullptr) ++skipped_;
    slot_.frame_index = frame_index;
    slot_.stamp = stamp;
    slot_.history = history;
    slot_.frame = std::move(frame);
    slot_since_ = now_();
    room_changed(had_room);
  }
  on_frame_();
}

void Viewer::end(absl::Status status) {
  {
    const std::lock_guard lock(mutex_);
    if (ended_) return;
    ended_ = true;
    slot_ = OutgoingFrame();
  }
  on_end_(std::move(status));
}

WorldBox Viewer::overview_of_past(const WorldBox& agents, std::int64_t scene_time_us,
                                  Clock::time_point now) {
  if (std::abs(static_cast<double>(scene_time_us) - static_cast<double>(past_time_us_)) >
      static_cast<double>(kLeapUs)) {
    past_.forget();
  }
  const bool moves = past_time_us_ != scene_time_us;
  past_time_us_ = scene_time_us;
  return past_.follow(agents, now, moves);
}

}  // namespace throng::server
