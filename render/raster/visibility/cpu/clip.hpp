#pragma once

#include "render/raster/visibility/cpu/tile.hpp"

namespace throng::render::visibility {

using element::clip_triangle;
using element::kMaxClippedCorners;
using element::snap;
using element::SnappedVertex;
using element::to_clip;

}  // namespace throng::render::visibility
