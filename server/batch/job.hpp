#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/batch/frame_numbers.hpp"
#include "server/batch/overlay.hpp"
#include "server/batch/passes.hpp"
#include "throng/render/environment.hpp"
#include "throng/render/frame.hpp"
#include "throng/trajectory/trajectory.hpp"

namespace throng::server {

/// One batch: a crowd, a camera, pictures out. A picture depends only on the trajectory, the
/// camera, its number and these settings, so any split into shards gives the same bytes.
struct BatchJob {
  std::string trajectory;              // file; empty: synthetic
  std::uint32_t synthetic_agents = 0;  // with `seed`, `synthetic_seconds`
  double synthetic_seconds = 10.0;
  trajectory::ReadOptions read;
  std::string cast;  // folder
  // out/####.png, .jpg, or one .mp4, or - for PPM pictures on standard output; {camera} becomes the
  // camera's name and {pass} color, depth or id (those two end with .exr)
  std::string output;
  PassSet passes;
  std::string boxes;  // MOTChallenge text, {camera} as above; empty: none
  BoxExtent box_extent = BoxExtent::kVisible;
  std::vector<std::string> cameras{"overview"};  // as CameraPath::parse reads them
  std::string frames;                            // numbers from 1, empty: all
  std::string stats;                             // JSON lines, empty: none
  std::string channel;                           // colours the agents by it
  double channel_low = 0.0, channel_high = 1.0;
  render::ColorMap color_map = render::ColorMap::kViridis;
  std::string environment;  // file of WKT, GeoJSON, a Vadere scenario or a static glTF; empty: what
                            // the trajectory holds
  std::string net;          // SUMO's network: streets; not with `environment`
  bool walls = true;        // false: no environment
  render::EnvironmentOptions environment_options;
  Shard shard;
  double fps = 25.0;  // of the output
  std::uint64_t seed = 0;
  int jpeg_quality = 90;
  bool skip_existing = false;
  render::Viewport viewport;
  render::Selection selection;
  render::Look look;
  render::FarSettings far;
  OverlayItems overlay;
  render::FramePipelineOptions pipeline;
};

/// Exit codes of throng-render, documented in README.md.
enum class ExitCode : int {
  kOk = 0,
  kInternal = 1,
  kUsage = 2,
  kBadInput = 3,
  kNoRenderer = 4,
  kOutput = 5,
  kSomeFramesFailed = 6,
};

struct BatchOutcome {
  ExitCode code = ExitCode::kOk;
  std::string error;               // one clear sentence; empty when all went well
  std::vector<std::string> notes;  // of the reader: what was ignored or assumed
  std::uint32_t written = 0, skipped = 0;
};

/// Called after each picture: how many of how many are done, and the file.
using BatchProgress =
    std::function<void(std::uint32_t done, std::uint32_t total, const std::string& path)>;

/// Runs the job. `stop` is looked at between frames: pictures that are done stay.
BatchOutcome run_batch(const BatchJob& job, const BatchProgress& progress,
                       const std::atomic<bool>& stop);

}  // namespace throng::server
