#pragma once

#include <absl/status/status.h>

#include <nlohmann/json.hpp>

#include "bench/experiments/clock.hpp"
#include "bench/experiments/numbers.hpp"
#include "throng/render/encode.hpp"
#include "throng/render/frame.hpp"

namespace throng::bench {

/// What the frames of one configuration took and drew. `raster` includes resolve and read_back.
struct Measured {
  Range visible, vertices, triangles;
  Range wall_ms, cpu_ms;  // of the frame up to the picture in memory; cpu: of all threads together
  Range encode_wall_ms, encode_cpu_ms;  // JPEG, quality 75, 4:2:0
  render::StageTimes stage_sum;         // wall
  render::StageTimes cpu_stage_sum;
  std::uint64_t frames = 0;

  void add(const render::FrameStats& stats, const Ticks& frame, const Ticks& encode);
  void add(const Measured& other);
  double stage_ms(double render::StageTimes::*stage) const;
  double cpu_stage_ms(double render::StageTimes::*stage) const;
  double fps() const { return wall_ms.mean() > 0 ? 1000.0 / wall_ms.mean() : 0.0; }
  nlohmann::ordered_json json() const;
};

/// Renders one frame into `picture`, encodes it and adds what that took.
absl::Status measure_frame(render::FramePipeline& pipeline, const render::Crowd& crowd,
                           std::int64_t time_us, const render::ViewSettings& view,
                           render::JpegEncoder& jpeg, render::Picture& picture, Measured& measured);

}  // namespace throng::bench
