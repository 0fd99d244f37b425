#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace throng::trajectory {

/// How a file is to be read where it does not say so itself.
struct ReadOptions {
  std::optional<double> source_fps;     // frames per second; contradicting the file is an error
  std::optional<double> source_unit_m;  // metres per unit of length; likewise
  bool ground_z = false;                // false: z is head height (archive) and is ignored
  std::string format;                   // empty: told by content; else a name of `format_names()`
  // Rows held in memory while a file is sorted by time; more go to a temporary file in $TMPDIR,
  // else /var/tmp. Formats that are in order of time need one frame only.
  std::size_t memory_bytes = 128u << 20;
  // A table that is in order of time so far is given while it is read, not at its end: Info is of
  // its beginning, and a row that comes too late is OutOfRange. For who shows frames as they come.
  bool streams = false;
  // Called while a text is read to its end before the first frame, with the share that was read;
  // false ends it with Cancelled.
  std::function<bool(double share)> goes_on;
};

/// What is known of a file before its frames are read.
struct Info {
  std::string format;                      // "jupedsim-sqlite", "archive-text", "csv", ...
  double fps = 0.0;                        // nominal rate; 0 when times are irregular
  std::string walkable_area_wkt;           // empty if the file has none
  std::vector<std::string> channel_names;  // extra columns that become colour channels
  std::vector<std::string> motion_names;   // what Frame::motion counts, at most 64; may grow
  std::vector<std::string> notes;          // what was ignored or assumed, for the user
  std::optional<std::uint64_t> seed;       // of a recording: with an id, decided who it was
};

/// One sample of the crowd. Columns have one entry per agent; an absent agent has left.
/// World frame: right-handed, +Z up, metres; heading in radians counter-clockwise from +X, NaN =
/// unknown.
struct Frame {
  std::int64_t time_us = 0;                  // since the first frame, strictly increasing
  std::vector<std::uint64_t> ids;            // unique within the frame
  std::vector<double> x_m, y_m, z_m;         // z_m is empty when everybody stands on z = 0
  std::vector<float> heading_rad;            // empty when the file has none
  std::vector<std::vector<float>> channels;  // [channel][agent], as Info::channel_names
  // What agents do: 0: stand, walk or run by speed; k: Info::motion_names[k - 1]. Empty: all 0.
  std::vector<std::uint8_t> motion;
};

/// Frames of a trajectory file in order of time.
class Reader {
 public:
  virtual ~Reader() = default;
  virtual const Info& info() const = 0;
  /// Fills `frame` and returns true, or returns false at the end.
  /// InvalidArgument names file, line (or table and row), value and remedy.
  virtual absl::StatusOr<bool> next(Frame& frame) = 0;
  /// How many of the frames so far are not in the file: it lists only frames with somebody, so
  /// an empty one is inserted where everybody of the frame before has left.
  virtual std::int64_t frames_inserted() const { return 0; }
  /// The name of an agent whose id in the file is a string; empty for plain integers.
  virtual std::string agent_name(std::uint64_t id) const { return {}; }
  /// The cast member that its producer chose for an agent; -1: none, its id decides.
  virtual std::int32_t agent_character(std::uint64_t id) const { return -1; }
};

/// Cast members [A] that the producer of a frame's agents chose; -1, the id decides, also for those
/// that a cast of `member_count` does not have. Empty: for all of them.
std::vector<std::int32_t> chosen_characters(const Reader& reader, const Frame& frame,
                                            std::size_t member_count);

/// Opens a file, telling its format by content. NotFound; InvalidArgument with file, line and
/// remedy.
absl::StatusOr<std::unique_ptr<Reader>> open(const std::string& path,
                                             const ReadOptions& options = {});

/// What `throng info FILE` says of a file.
struct Summary {
  Info info;                 // with the notes of the whole file
  std::uint64_t agents = 0;  // distinct ids
  std::uint64_t most_at_once = 0;
  std::uint64_t frames = 0;           // that the file has, with or without anybody
  std::uint64_t frames_inserted = 0;  // see Reader::frames_inserted
  double duration_s = 0.0;            // last frame minus first
  bool has_positions = false;         // the extent holds something
  double min_x_m = 0.0, max_x_m = 0.0, min_y_m = 0.0, max_y_m = 0.0, min_z_m = 0.0, max_z_m = 0.0;
  bool has_z = false;
  bool has_heading = false;      // at least one known heading
  bool has_motion = false;       // somebody does something that its speed does not tell
  bool has_characters = false;   // somebody's character was chosen
  std::uint64_t largest_id = 0;  // above 2^53 where ids are names
};

/// Reads a whole file, in bounded memory but for one id per agent. Errors as of `open` and `next`.
absl::StatusOr<Summary> summarize(const std::string& path, const ReadOptions& options = {});

/// The streets of SUMO's network (.net.xml, plain or gzipped) as a site's text has them: surfaces
/// that follow a walkable area, see render::walkable_area_of. Lanes in their width, junctions;
/// what only people walk on; crossings' stripes. Rails and waterways are left out.
/// NotFound; InvalidArgument with file, line and value.
absl::StatusOr<std::string> read_sumo_net(const std::string& path);

/// Metres of a unit of length as --source-unit spells it: "m", "cm", "mm", or a number of metres.
absl::StatusOr<double> parse_unit(const std::string& text);

/// Names that ReadOptions::format takes.
std::vector<std::string> format_names();

/// A string id as every producer, importer and run maps it: FNV-1a, 64 bit, of its UTF-8 bytes.
std::uint64_t hash_id(const std::string& name);

}  // namespace throng::trajectory
