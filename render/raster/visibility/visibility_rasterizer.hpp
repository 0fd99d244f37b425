#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "throng/render/raster.hpp"

namespace throng::render::visibility {

/// The visibility rasterizer on the processor. @param threads  0: one for each core.
absl::StatusOr<std::unique_ptr<Rasterizer>> make_visibility_rasterizer(unsigned threads);

}  // namespace throng::render::visibility
