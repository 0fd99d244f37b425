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

/// Writes frames in order of time. The file gets its name when `close` succeeds; until then, and
/// after an error, what was there before stays.
class Writer {
 public:
  virtual ~Writer() = default;
  /// `names` has the agents' names or is empty, `characters` the cast members that were chosen for
  /// them (-1: none) or is empty; formats with plain numbers ignore both.
  /// InvalidArgument: a time between two frame numbers, columns that are not as specified, ids
  /// above 2^53 in formats of plain numbers. ResourceExhausted or Unavailable: cannot write.
  virtual absl::Status write(const Frame& frame, const std::vector<std::string>& names = {},
                             const std::vector<std::int32_t>& characters = {}) = 0;
  virtual absl::Status close() = 0;
};

/// "csv" (.csv), "jupedsim-sqlite" (.sqlite, version 2) and "archive-text" (.txt).
std::vector<std::string> write_format_names();

absl::StatusOr<std::unique_ptr<Writer>> make_writer(const std::string& path, const WriteSpec& spec);

/// Reads one file and writes another, `throng convert`. Ids that do not fit the written format
/// become 1, 2, ... in order of appearance. Reads the input twice.
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
