#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "row_sorter.hpp"
#include "support.hpp"
#include "throng/trajectory/trajectory.hpp"

namespace throng::trajectory::detail {

/// What the values of a row mean, in this order: x_m, y_m, [z_m], [heading_rad],
/// [motion], channels.
struct Columns {
  bool z = false;
  bool heading = false;
  bool motion = false;
  std::size_t channels = 0;
  std::size_t count() const {
    return 2 + (z ? 1 : 0) + (heading ? 1 : 0) + (motion ? 1 : 0) + channels;
  }
};

/// What the keys of the rows mean.
struct TimeBase {
  enum class Kind {
    kFrames,        // frame numbers, `rate` of them a second
    kSamples,       // frame numbers with a stride; `rate` strides a second
    kMicroseconds,  // times
  };
  Kind kind = Kind::kFrames;
  double rate = 0.0;  // not used for times
};

/// What goes on giving rows of a file that is in order of time.
class RowFeed {
 public:
  virtual ~RowFeed() = default;
  /// Adds rows; false at the end of the file.
  virtual absl::StatusOr<bool> read_on(RowSorter& rows) = 0;
  virtual const IdTable& ids() const = 0;
  virtual const std::vector<std::string>& motion_names() const = 0;
};

/// Appends a row's positions to the columns of a frame.
void append_row(const Columns& columns, std::uint64_t id, std::span<const double> values,
                Frame& frame);
/// Empties a frame and gives it the columns it needs.
void clear_frame(const Columns& columns, std::int64_t time_us, Frame& frame);

/// Frames of sorted rows. When everybody of a frame is gone in the next one and frames lie
/// between, an empty frame follows at once: the file lists no moment without agents.
/// @param feed  null: all rows are there; else `ids` is not used
/// Errors: no rows at all, --source-fps against the times of the file, a span that is too long.
absl::StatusOr<std::unique_ptr<Reader>> make_sorted_reader(
    const std::string& path, Info info, Columns columns, TimeBase base, const ReadOptions& options,
    std::unique_ptr<RowSorter> rows, IdTable ids, std::unique_ptr<RowFeed> feed = nullptr);

}  // namespace throng::trajectory::detail
