#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "throng/render/crowd.hpp"
#include "throng/trajectory/recording.hpp"

namespace throng::server {

struct RecordSettings {
  std::string folder;                                   // empty: nothing is recorded
  std::uint64_t limit_bytes = std::uint64_t{4} << 30;   // of one crowd, all its runs together
  std::uint64_t queue_bytes = std::uint64_t{64} << 20;  // of one crowd: what may wait to be written
  std::chrono::milliseconds sync_every{1000};           // what a loss of power may cost; 0: never
};

/// What one run's producers send, on its way to a file by a thread of its own: a slow disk delays
/// nobody. What finds no room in the queue is not recorded, counted and logged; so is all that
/// comes after the disk is full or broken. A process that is killed loses what waited, mostly
/// nothing. Thread safe.
class Recording {
 public:
  /// @param continues  the recording that goes on after a restart
  Recording(RecordSettings settings, trajectory::RecordingSpec spec,
            trajectory::RecordingEnd continues = {});
  ~Recording();  // after all that waits was written and synced

  /// A frame that the crowd has taken. One that is not newer than all before is left out: who takes
  /// a crowd over may be quicker than the last frame of who had it, and a file's times must rise.
  void write(const render::AgentFrame& frame);
  void set_walkable_area(const std::string& wkt);
  void wait_idle();  // until nothing waits

  struct Counters {
    std::uint64_t written_frames = 0, lost_frames = 0;
  };
  Counters counters() const;

 private:
  struct Item {
    std::unique_ptr<const render::AgentFrame> frame;  // null: a walkable area
    std::string wkt;
    std::uint64_t bytes = 0;
  };
  void add(Item item);
  void run();
  absl::Status put(const Item& item);

  const RecordSettings settings_;
  const std::string crowd_;
  // Of the thread alone:
  trajectory::RecordingWriter writer_;
  std::shared_ptr<const render::Membership> membership_;
  bool has_failed_ = false;
  std::uint64_t said_lost_ = 0;
  std::uint64_t unfit_ = 0;  // frames and events that the file could not hold
  // Guarded by mutex_:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Item> queue_;
  std::uint64_t queued_bytes_ = 0;
  std::int64_t newest_us_ = std::numeric_limits<std::int64_t>::min();
  bool is_writing_ = false, stop_ = false;
  Counters counters_;
  std::thread thread_;
};

}  // namespace throng::server
