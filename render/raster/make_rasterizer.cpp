#include <absl/strings/str_cat.h>

#include <utility>

#include "render/raster/gl/gl_rasterizer.hpp"
#include "render/raster/visibility/visibility_rasterizer.hpp"
#if THRONG_WITH_CUDA
#include "render/raster/visibility/cuda/cuda_rasterizer.hpp"
#endif
#include "throng/render/raster.hpp"

namespace throng::render {

absl::StatusOr<std::unique_ptr<Rasterizer>> make_rasterizer(RasterKind kind, unsigned threads,
                                                            BackendKind compute) {
  switch (kind) {
    case RasterKind::kAuto: {
      std::string cuda;
#if THRONG_WITH_CUDA
      if (compute == BackendKind::kCuda) {
        auto rasterizer = visibility::make_cuda_rasterizer();
        if (rasterizer.ok()) return rasterizer;
        cuda = absl::StrCat(rasterizer.status().message(), "; ");
      }
#endif
      auto gl = gl::make_gl_rasterizer(threads, /*hardware_only=*/true, compute);
      if (gl.ok()) return gl;
      return visibility::make_visibility_rasterizer(
          threads, absl::StrCat("auto: ", cuda, gl.status().message()));
    }
    case RasterKind::kGl:
      return gl::make_gl_rasterizer(threads, /*hardware_only=*/false, compute);
    case RasterKind::kVisibility:
#if THRONG_WITH_CUDA
      if (compute == BackendKind::kCuda) return visibility::make_cuda_rasterizer();
#endif
      return visibility::make_visibility_rasterizer(threads, "");
  }
  return absl::InvalidArgumentError("make_rasterizer: unknown kind");
}

}  // namespace throng::render
