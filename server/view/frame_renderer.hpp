#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <string>

#include "throng/render/frame.hpp"

namespace throng::server {

/// What the render loop draws with: a FramePipeline, or a tiny painter in tests. It is made and
/// used on the loop's thread only.
class FrameRenderer {
 public:
  virtual ~FrameRenderer() = default;
  /// As FramePipeline::render.
  virtual absl::Status render(const render::Crowd& crowd, std::int64_t scene_time_us,
                              const render::ViewSettings& settings, render::Picture& picture,
                              render::FrameStats& stats) = 0;
  virtual std::string compute_name() const = 0;
  virtual std::string raster_name() const = 0;
  /// Why this one, and what encodes its pictures; for the log.
  virtual std::string raster_detail() const { return ""; }
};

using MakeRenderer = std::function<absl::StatusOr<std::unique_ptr<FrameRenderer>>()>;

/// Makes the real one.
MakeRenderer pipeline_renderer(std::shared_ptr<const render::Cast> cast,
                               render::FramePipelineOptions options);

}  // namespace throng::server
