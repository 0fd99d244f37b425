#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "throng/trajectory/trajectory.hpp"

namespace throng::trajectory {

/// What a recording says of its crowd before the first frame.
struct RecordingSpec {
  std::string crowd;  // of A-Z a-z 0-9 _ . - ; names the files
  std::string run_id, producer;
  std::array<double, 3> origin_m{};  // positions are offsets from it
  std::uint64_t seed = 0;            // with an agent's id, decides who it is
  double rate_hz = 0.0;              // nominal; 0: not known
  std::vector<std::string> channel_names;
  std::vector<std::string> channel_units;  // as many, or none
};

/// Where a run's recording ends: what lies behind `bytes` of the last part is torn.
struct RecordingEnd {
  std::string path;  // empty: there is none
  std::uint64_t bytes = 0;
};

/// The newest run of a crowd as it was recorded.
struct RecordedRun {
  RecordingSpec spec;
  std::string walkable_area_wkt;  // the last one
  RecordingEnd end;
  std::uint64_t frames = 0;
  std::vector<std::string> notes;  // what could not be read
};

/// Crowds that a folder has recordings of, sorted, but for those whose newest run was given up.
std::vector<std::string> recorded_crowds(const std::string& folder);

/// Says in the folder that a crowd was removed: its recordings so far stay and can be read, and
/// recorded_crowds leaves them out. NAME.removed lies beside the parts of its newest run.
/// Unavailable when it cannot be written.
absl::Status give_up_recordings(const std::string& folder, const std::string& crowd);

/// Reads the last parts of a crowd's newest run, as many as `most_bytes` of files hold (at least
/// one), and gives every frame to `take`: its time is the producer's own, its positions lie in the
/// world, and the reader knows the names of its agents. An error of `take` ends the reading.
/// NotFound: no part of the run can be read.
absl::StatusOr<RecordedRun> read_last_run(
    const std::string& folder, const std::string& crowd, std::uint64_t most_bytes,
    const std::function<absl::Status(const RecordingSpec&, const Frame&, const Reader&)>& take);

/// Keeps what a producer sends in files that `open` reads again ("throng-recording").
///
/// A file is a row of records, each with a checksum and each written by one call, so that a process
/// that is killed at any moment leaves every complete frame. Positions are kept in steps of 0.1 mm
/// (more beyond 200 km from the origin), headings in 0.1 mrad, channels as they are; the
/// differences in time are compressed by zstd. What is not synced yet is lost where the machine
/// loses power.
///
/// FOLDER/CROWD.20260131T235959Z.0001.trec is the first part of a run; parts are an eighth of the
/// limit, 64 MiB at most, and each can be read alone. When all parts of the crowd in the folder,
/// also of runs before, outgrow the limit, the oldest are removed.
///
/// Files are made with the first frame. After an error nothing more is written and every call
/// returns that error. Not thread safe.
class RecordingWriter {
 public:
  /// @param limit_bytes  of all parts of this crowd; a frame that is larger is written all the same
  /// @param continues    the run that goes on, in a part of its own behind this one
  RecordingWriter(std::string folder, RecordingSpec spec, std::uint64_t limit_bytes,
                  RecordingEnd continues = {});
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// The columns of all later frames: ids [A], names [A] or none, cast members [A] or none.
  void set_members(std::span<const std::uint64_t> ids, std::span<const std::string> names,
                   std::span<const std::int32_t> characters = {});
  /// The walkable area from now on.
  absl::Status set_walkable_area(const std::string& wkt);
  /// @param position_m   [3A] finite, within +-1e7
  /// @param heading_rad  [A] or empty; NaN: unknown
  /// @param channels     [channel][A] or empty
  /// @param motion       [A] or empty; 0: by speed; k: motion_names[k - 1], at most 64 of 64 bytes
  /// ResourceExhausted when the disk is full, Unavailable when it cannot be written.
  absl::Status write(std::int64_t time_us, std::span<const float> position_m,
                     std::span<const float> heading_rad,
                     std::span<const std::vector<float>> channels,
                     std::span<const std::uint8_t> motion = {},
                     std::span<const std::string> motion_names = {});

  /// Waits until what was written is on the disk.
  absl::Status sync();

  const std::string& path() const;  // of the part that is written; empty before the first frame

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace throng::trajectory
