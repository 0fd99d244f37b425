#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "throng/trajectory/trajectory.hpp"

namespace throng::trajectory {

/// What a file is to hold; known before its first frame.
struct WriteSpec {
  std::string format;  // of `write_format_names()`; empty: by the ending of the name
  double fps = 0.0;    // needed by formats with frame numbers; 0 where times are irregular
  bool has_z = false, has_heading = false;
  std::vector<std::string> channel_names;
  std::vector<std::string> motion_names;  // of CSV: what Frame::motion counts; empty: no column
  bool has_characters = false;            // of CSV
  std::string walkable_area_wkt;
  double min_x_m = 0, max_x_m = 0, min_y_m = 0, max_y_m = 0;
};

/// Writes frames in order of time, in bounded memory but for the newest frame and, where a format
/// needs it, one id per agent. The file gets its name when `close` succeeds; until then, and after
/// an error, what was there before stays.
class Writer {
 public:
  virtual ~Writer() = default;
  /// `names` has the agents' names or is empty, `characters` the cast members that were chosen for
  /// them (-1: none) or is empty; formats with plain numbers ignore both.
  /// InvalidArgument: a time between two frame numbers, columns that are not as specified, ids or
  /// positions beyond what the format holds, agents that come or go where it knows only who is
  /// always there (Menge). ResourceExhausted or Unavailable: cannot write.
  virtual absl::Status write(const Frame& frame, const std::vector<std::string>& names = {},
                             const std::vector<std::int32_t>& characters = {}) = 0;
  virtual absl::Status close() = 0;
  /// After `close`: what could not be kept and showed only while writing.
  virtual std::vector<std::string> notes() const { return {}; }
};

/// Names that WriteSpec::format takes, as `format_names` has them, and the endings that mean them:
///
///     csv              .csv           metres, radians; everything but the walkable area
///     jupedsim-sqlite  .sqlite .db    version 2: headings, walkable area
///     jupedsim-hdf5    .h5 .hdf5      heights, headings (ox, oy), walkable area; ids below 2^32
///     archive-text     .txt           heights, headings (viewDirX, viewDirY), channels
///     vadere-traj      .traj          a footstep from sample to sample, channels; ids below 2^31
///     sumo-fcd         .xml           persons: heights, angles, the channel speed, names
///     menge-scb        .scb           version 2.4: heights, yaw, classes; the same agents always
///     trajnet-ndjson   .ndjson        positions
///     obsmat           (none)         positions and velocities; says no rate
///
/// Of text .gz may follow, and it is gzipped.
std::vector<std::string> write_format_names();

absl::StatusOr<std::unique_ptr<Writer>> make_writer(const std::string& path, const WriteSpec& spec);

/// Reads one file and writes another, `throng convert`. Ids that do not fit the written format
/// become 1, 2, ... in order of appearance (Menge: 0, 1, ...). Reads the input
/// twice.
/// @param format  empty: by the ending of `output`
/// @param fps     rate of the written frame numbers; 0: that of the input
/// @param goes_on called after every frame with how many are written of how many; false ends it
///                with Cancelled and leaves no file
/// @return what was read; its notes also tell what the written file could not hold
absl::StatusOr<Summary> convert(
    const std::string& input, const std::string& output, const ReadOptions& options = {},
    const std::string& format = {}, double fps = 0.0,
    const std::function<bool(std::uint64_t, std::uint64_t)>& goes_on = {});

}  // namespace throng::trajectory
