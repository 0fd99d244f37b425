#include "server/scene/recording.hpp"

#include <spdlog/spdlog.h>

#include <bit>
#include <span>
#include <utility>

namespace throng::server {
namespace {

using SteadyClock = std::chrono::steady_clock;

std::uint64_t size_of(const render::AgentFrame& frame) {
  std::uint64_t floats = 3 * frame.position_m.size() + frame.heading_rad.size();
  for (const std::vector<float>& channel : frame.channels) floats += channel.size();
  return sizeof frame + sizeof(float) * floats + frame.motion.size();
}

}  // namespace

Recording::Recording(RecordSettings settings, trajectory::RecordingSpec spec,
                     trajectory::RecordingEnd continues)
    : settings_(std::move(settings)),
      crowd_(spec.crowd),
      writer_(settings_.folder, std::move(spec), settings_.limit_bytes, std::move(continues)),
      thread_([this] { run(); }) {}

Recording::~Recording() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Recording::write(const render::AgentFrame& frame) {
  add({std::make_unique<const render::AgentFrame>(frame), {}, size_of(frame)});
}

void Recording::set_walkable_area(const std::string& wkt) { add({nullptr, wkt, wkt.size()}); }

void Recording::wait_idle() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return queue_.empty() && !is_writing_; });
}

Recording::Counters Recording::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

void Recording::add(Item item) {
  {
    const std::lock_guard lock(mutex_);
    if (item.frame != nullptr && item.frame->time_us <= newest_us_) return;
    // One frame always has room, however large it is.
    if (!queue_.empty() && queued_bytes_ + item.bytes > settings_.queue_bytes) {
      if (item.frame != nullptr) {
        ++counters_.lost_frames;
      } else {
        spdlog::warn("event=recording_lost crowd={} what=\"walkable area\"", crowd_);
      }
      return;
    }
    queued_bytes_ += item.bytes;
    if (item.frame != nullptr) newest_us_ = item.frame->time_us;
    queue_.push_back(std::move(item));
  }
  changed_.notify_all();
}

void Recording::run() {
  const bool syncs = settings_.sync_every.count() > 0;
  SteadyClock::time_point sync_at = SteadyClock::time_point::max();  // when something is unsynced
  std::unique_lock lock(mutex_);
  while (true) {
    const auto is_due = [this] { return stop_ || !queue_.empty(); };
    if (sync_at == SteadyClock::time_point::max()) {
      changed_.wait(lock, is_due);
    } else {
      changed_.wait_until(lock, sync_at, is_due);
    }
    absl::Status status;
    if (!queue_.empty()) {
      const Item item = std::move(queue_.front());
      queue_.pop_front();
      is_writing_ = true;
      lock.unlock();
      if (!has_failed_) status = put(item);
      lock.lock();
      is_writing_ = false;
      queued_bytes_ -= item.bytes;
      const bool is_written = status.ok() && !has_failed_;
      if (item.frame != nullptr) ++(is_written ? counters_.written_frames : counters_.lost_frames);
      if (absl::IsInvalidArgument(status)) {  // what does not fit costs itself only
        if (std::has_single_bit(++unfit_)) {  // each time, a producer could fill the log
          spdlog::warn("event=recording_lost crowd={} frames={} why=\"{}\"", crowd_, unfit_,
                       std::string(status.message()));
        }
        said_lost_ += item.frame != nullptr ? 1 : 0;
        status = absl::OkStatus();
      }
      if (is_written && syncs && sync_at == SteadyClock::time_point::max()) {
        sync_at = SteadyClock::now() + settings_.sync_every;
      }
    }
    const bool ends = stop_ && queue_.empty();
    const std::uint64_t lost = counters_.lost_frames;
    changed_.notify_all();
    if (status.ok() && !has_failed_ && (SteadyClock::now() >= sync_at || (ends && syncs))) {
      lock.unlock();
      status = writer_.sync();
      lock.lock();
      sync_at = SteadyClock::time_point::max();
    }
    if (!status.ok()) {
      has_failed_ = true;
      said_lost_ = lost;
      sync_at = SteadyClock::time_point::max();
      spdlog::error("event=recording_ended crowd={} error=\"{}\"", crowd_,
                    std::string(status.message()));
    } else if (lost != said_lost_ && !has_failed_ && queue_.empty()) {
      spdlog::warn(
          "event=recording_lost crowd={} frames={} why=\"{} MiB wait for the disk, which is the "
          "limit\"",
          crowd_, lost - said_lost_, settings_.queue_bytes >> 20);
      said_lost_ = lost;
    }
    if (ends) return;
  }
}

absl::Status Recording::put(const Item& item) {
  if (item.frame == nullptr) return writer_.set_walkable_area(item.wkt);
  const render::AgentFrame& frame = *item.frame;
  if (frame.membership != membership_) {
    membership_ = frame.membership;
    writer_.set_members(membership_->ids, membership_->names, membership_->characters);
  }
  static_assert(sizeof(glm::vec3) == 3 * sizeof(float));
  const std::span<const float> position_m(
      frame.position_m.empty() ? nullptr : &frame.position_m.front().x,
      3 * frame.position_m.size());
  const std::string before = writer_.path();
  absl::Status status = writer_.write(frame.time_us, position_m, frame.heading_rad, frame.channels,
                                      frame.motion, frame.motion_names);
  if (status.ok() && writer_.path() != before) {
    spdlog::info("event=recording crowd={} file=\"{}\"", crowd_, writer_.path());
  }
  return status;
}

}  // namespace throng::server
