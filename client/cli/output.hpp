#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

namespace throng::client {

/// Says what went wrong on stderr; returns the exit code that fits.
int report(const char* command, const absl::Status& status);

/// True if stderr is a terminal that may be drawn on (and NO_COLOR and TERM=dumb are not set).
bool has_terminal();

/// One line of progress on stderr that is written over on a terminal; elsewhere a line every few
/// seconds. An empty text ends it.
class Progress {
 public:
  explicit Progress(bool quiet) : quiet_(quiet) {}
  ~Progress() { end(); }
  void show(const std::string& text);
  void end();

 private:
  bool quiet_;
  bool open_ = false;
  double last_s_ = -1e9;
};

/// Where recorded pictures go: a video (.mp4 .mkv .mov), numbered pictures (frames/####.jpg or
/// .png), or a single picture (a name without #).
class PictureOutput {
 public:
  virtual ~PictureOutput() = default;
  /// @param jpeg     as it came from the server.
  /// @param time_us  since the first picture, not falling. A picture at the time of the one before
  ///                 is left out of a video.
  virtual absl::Status add(const std::string& jpeg, std::int64_t time_us) = 0;
  /// Ends the file. Where it is, for people.
  virtual absl::StatusOr<std::string> finish() = 0;
  /// A single picture: nothing more is wanted after the first.
  virtual bool single() const { return false; }
};

/// InvalidArgument for an extension that is not known or more than one run of #.
absl::StatusOr<std::unique_ptr<PictureOutput>> open_output(const std::string& pattern,
                                                           std::uint32_t width_px,
                                                           std::uint32_t height_px, double fps);

}  // namespace throng::client
