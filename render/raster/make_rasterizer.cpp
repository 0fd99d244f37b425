#include "render/raster/gl/gl_rasterizer.hpp"
#include "throng/render/raster.hpp"

namespace throng::render {

absl::StatusOr<std::unique_ptr<Rasterizer>> make_rasterizer(RasterKind kind, unsigned threads) {
  switch (kind) {
    case RasterKind::kGl:
      return gl::make_gl_rasterizer(threads);
    case RasterKind::kVisibility:
      break;
  }
  return absl::UnavailableError("make_rasterizer: the visibility rasterizer is not built");
}

}  // namespace throng::render
