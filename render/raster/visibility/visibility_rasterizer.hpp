#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "throng/render/raster.hpp"

namespace throng::render::visibility {

/// The visibility rasterizer on the processor.
/// @param threads  0: one for each core.
/// @param why  it was chosen, for RasterInfo::detail; may be empty.
/// @param occlusion  leave out who is behind nearer figures: the same picture in less time.
absl::StatusOr<std::unique_ptr<Rasterizer>> make_visibility_rasterizer(unsigned threads,
                                                                       std::string why,
                                                                       bool occlusion = true);

}  // namespace throng::render::visibility
