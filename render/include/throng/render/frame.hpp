#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>

#include "throng/render/compute.hpp"
#include "throng/render/raster.hpp"

namespace throng::render {

/// Milliseconds of each stage of one frame, by the names used everywhere.
struct StageTimes {
  double advance_ms = 0, cull_ms = 0, select_ms = 0, allocate_ms = 0, generate_ms = 0;
  double raster_ms = 0, resolve_ms = 0, read_back_ms = 0, encode_ms = 0;
};

struct FrameStats {
  StageTimes times;
  StageTimes cpu_times;  // of all threads of the process; see FramePipelineOptions
  // processor time of the drawing threads, which others on the machine add nothing to; 0: not
  // known, since a device or a driver's threads drew too
  double work_ms = 0;
  ComputeCounters counters;
  RasterCounters raster;
  std::int64_t scene_time_us = 0;
  // of a picture that stays on a device: what the frame before took there by its clock; nobody has
  // waited for this one. 0: not known
  double device_before_ms = 0;
};

struct ViewSettings {
  Camera camera;
  Viewport viewport;
  Selection selection;  // pose_mode and geometry are set by what follows
  PoseMode pose_mode = PoseMode::kShared;
  Look look;
  // of perspective cameras; agents that are coloured by a channel are drawn one by one
  FarSettings far;
  int channel = -1;  // index of the channel that colours the agents
  // Pixels drawn for each one of the picture, along a side: 1, or 2 for means of four (16 samples
  // of coverage in place of 4). Sizes and errors of `selection` are of the picture's pixels.
  std::uint32_t oversampling = 1;
};

/// Someone, or a piece of what stands around, who may be in a picture.
struct SeenInstance {
  std::uint64_t agent_id = 0;
  bool surrounding = false;      // no agent
  std::uint32_t visible_px = 0;  // 0: behind others, or so small that no pixel is theirs
  PixelBox visible;              // around those pixels
  PixelBox bounds;               // the picture's part that the whole figure stays within
};

/// What a picture shows beside colours, rows from the top.
struct FramePasses {
  static constexpr std::uint32_t kNothing = PixelFacts::kNothing;
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<float> depth_m;           // [height][width] along the viewing axis; infinity: the sky
  std::vector<std::uint32_t> instance;  // [height][width] of `instances`, or kNothing
  std::vector<SeenInstance> instances;
};

struct FramePipelineOptions {
  BackendKind backend = BackendKind::kCpu;
  RasterKind raster = RasterKind::kAuto;
  unsigned threads = 0;
  bool measure_cpu_times = false;  // of use where nothing else runs in the process
  // empty: fused where the rasterizer takes it
  std::optional<GeometryKind> geometry = std::nullopt;
};

/// The stages of a frame in order, for one view of one crowd at one time:
/// advance, cull, select, allocate, generate, raster, resolve, read_back.
/// One render loop owns it (the GL context stays on that thread); views and uploads are cached.
class FramePipeline {
 public:
  static absl::StatusOr<std::unique_ptr<FramePipeline>> make(std::shared_ptr<const Cast> cast,
                                                             const FramePipelineOptions& options);
  ~FramePipeline();

  /// Renders the crowd at `scene_time_us`. An empty crowd gives the empty scene.
  /// @param passes  may be null. Unimplemented where the rasterizer can't fill it.
  absl::Status render(const Crowd& crowd, std::int64_t scene_time_us, const ViewSettings& settings,
                      Picture& picture, FrameStats& stats, FramePasses* passes = nullptr);

  RasterInfo raster_info() const;
  std::string backend_name() const;

 private:
  FramePipeline();
  absl::Status render_large(const Crowd& crowd, std::int64_t scene_time_us,
                            const ViewSettings& settings, Picture& picture, FrameStats& stats);
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace throng::render
