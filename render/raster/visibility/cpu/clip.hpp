#pragma once

#include <cstdint>
#include <glm/glm.hpp>

#include "render/raster/visibility/cpu/tile.hpp"

namespace throng::render::visibility {

/// A corner on the sample grid.
struct SnappedVertex {
  std::int32_t x, y;  // sub-units from the picture's top left
  float depth;
  float inverse_w;
};

/// Most corners a triangle has after six half-spaces.
inline constexpr int kMaxClippedCorners = 9;

/// Clips a triangle (clip space) at the near plane and the guard band and snaps what is left: a
/// convex polygon, returned as its number of corners (0, or 3 to kMaxClippedCorners). An edge
/// shared by two triangles is cut at the same point from both sides, so no crack opens.
int clip_triangle(const SampleGrid& grid, const glm::vec4 corner_clip[3],
                  SnappedVertex polygon[kMaxClippedCorners]);

/// Position to sub-units; false when it needs clipping. The one place where positions are rounded.
bool snap(const SampleGrid& grid, const glm::vec4& clip, SnappedVertex& vertex);

/// clip_from_relative * (position, 1), multiplied and added in one written order.
glm::vec4 to_clip(const glm::mat4& clip_from_relative, const glm::vec3& position_relative);

}  // namespace throng::render::visibility
