#pragma once

#include <memory>
#include <mutex>
#include <string>

#include "throng/render/crowd.hpp"
#include "throng/trajectory/recording.hpp"

namespace throng::server {

struct RecordSettings {
  std::string folder;                                  // empty: nothing is recorded
  std::uint64_t limit_bytes = std::uint64_t{4} << 30;  // of one crowd, all its runs together
};

/// What one run's producers send, on its way to a file. The frame is written before the producer
/// hears that it was applied. A disk that is full or broken ends the recording, is logged once and
/// disturbs nobody. Thread safe.
class Recording {
 public:
  Recording(const RecordSettings& settings, trajectory::RecordingSpec spec);

  /// A frame that the crowd has taken. One that is not newer than the last is left out.
  void write(const render::AgentFrame& frame);
  void set_walkable_area(const std::string& wkt);

 private:
  void check(const absl::Status& status);

  const std::string crowd_;
  std::mutex mutex_;
  trajectory::RecordingWriter writer_;
  std::shared_ptr<const render::Membership> membership_;
  std::int64_t last_us_ = 0;
  bool has_frames_ = false, has_failed_ = false;
};

}  // namespace throng::server
