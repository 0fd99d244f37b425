#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "throng/render/raster.hpp"

namespace throng::render::visibility {

/// Draws on the first CUDA device, the same words and pictures as the processor's rasterizer.
/// Geometry comes from the device's memory or from the host's. Unavailable with the reason.
absl::StatusOr<std::unique_ptr<Rasterizer>> make_cuda_rasterizer();

}  // namespace throng::render::visibility
