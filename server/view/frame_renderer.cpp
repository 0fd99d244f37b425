#include "server/view/frame_renderer.hpp"

#include <absl/strings/str_cat.h>

#include <exception>
#include <new>
#include <utility>

namespace throng::server {
namespace {

class PipelineRenderer final : public FrameRenderer {
 public:
  explicit PipelineRenderer(std::unique_ptr<render::FramePipeline> pipeline)
      : pipeline_(std::move(pipeline)) {}

  absl::Status render(const render::Crowd& crowd, std::int64_t scene_time_us,
                      const render::ViewSettings& settings, render::Picture& picture,
                      render::FrameStats& stats) override {
    // A view that is too large for this machine's memory is that viewer's error.
    try {
      return pipeline_->render(crowd, scene_time_us, settings, picture, stats);
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError("render: there is not enough memory for this frame");
    } catch (const std::exception& error) {
      return absl::InternalError(absl::StrCat("render: ", error.what()));
    }
  }
  std::string compute_name() const override { return pipeline_->backend_name(); }
  std::string raster_name() const override { return pipeline_->raster_info().name; }
  std::string raster_detail() const override { return pipeline_->raster_info().detail; }

 private:
  std::unique_ptr<render::FramePipeline> pipeline_;
};

}  // namespace

MakeRenderer pipeline_renderer(std::shared_ptr<const render::Cast> cast,
                               render::FramePipelineOptions options) {
  return [cast = std::move(cast), options]() -> absl::StatusOr<std::unique_ptr<FrameRenderer>> {
    auto pipeline = render::FramePipeline::make(cast, options);
    if (!pipeline.ok()) return pipeline.status();
    return std::make_unique<PipelineRenderer>(*std::move(pipeline));
  };
}

}  // namespace throng::server
