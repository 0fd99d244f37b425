#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "render/raster/visibility/element/coverage.hpp"

namespace throng::render::element {

/// Clip space to sub-units: x = (ndc.x + 1) * scale.x, y = (1 - ndc.y) * scale.y.
struct SampleGrid {
  glm::mat4 clip_from_relative;
  std::int32_t width, height;  // samples
};

/// A corner on the sample grid.
struct SnappedVertex {
  std::int32_t x, y;  // sub-units from the picture's top left
  float depth;        // reversed, 0 (infinity) to 1 (near plane)
  float inverse_w;
};

/// x of a vertex behind the near plane or outside the guard band.
inline constexpr std::int32_t kNeedsClip = INT32_MIN;

/// Most corners a triangle has after six half-spaces.
inline constexpr int kMaxClippedCorners = 9;

/// clip_from_relative * (position, 1), multiplied and added in one written order.
THRONG_HOST_DEVICE inline glm::vec4 to_clip(const glm::mat4& m, const glm::vec3& p) {
  glm::vec4 clip;
  for (int r = 0; r < 4; ++r) {
    clip[r] = ((m[0][r] * p.x + m[1][r] * p.y) + m[2][r] * p.z) + m[3][r];
  }
  return clip;
}

/// Position to sub-units; false when it needs clipping. The one place where positions are rounded.
THRONG_HOST_DEVICE inline bool snap(const SampleGrid& grid, const glm::vec4& clip,
                                    SnappedVertex& vertex) {
  if (!(clip.w > 0.0F) || !(clip.z <= clip.w) || !(clip.z >= 0.0F)) return false;
  const float inverse_w = 1.0F / clip.w;
  const float half_x = static_cast<float>(grid.width) * (kSubUnit / 2);
  const float half_y = static_cast<float>(grid.height) * (kSubUnit / 2);
  const float x = (clip.x * inverse_w) * half_x;
  const float y = (clip.y * inverse_w) * half_y;
  constexpr float kGuard = static_cast<float>(kGuardUnits);
  if (!(std::fabs(x) < kGuard) || !(std::fabs(y) < kGuard)) return false;
  vertex.x = static_cast<std::int32_t>(std::floor((x + half_x) + 0.5F));
  vertex.y = static_cast<std::int32_t>(std::floor((half_y - y) + 0.5F));
  vertex.depth = clip.z * inverse_w;
  vertex.inverse_w = inverse_w;
  return true;
}

/// A point on the sample grid, or kNeedsClip.
THRONG_HOST_DEVICE inline SnappedVertex project(const SampleGrid& grid,
                                                const glm::vec3& position_relative) {
  SnappedVertex vertex{kNeedsClip, 0, 0.0F, 0.0F};
  if (!snap(grid, to_clip(grid.clip_from_relative, position_relative), vertex)) {
    vertex.x = kNeedsClip;
  }
  return vertex;
}

/// Signed distances to the six half-spaces a polygon is cut by: near plane, far plane and the guard
/// band's four sides. Perspective has w >= near just when z <= w, z being the near distance itself.
THRONG_HOST_DEVICE inline float clip_distance(const SampleGrid& grid, int plane,
                                              const glm::vec4& clip) {
  // the guard band in ndc: a quarter less than what `snap` accepts, so cut points are accepted
  const float guard = 0.75F * static_cast<float>(kGuardUnits);
  const float x_units = static_cast<float>(grid.width) * (kSubUnit / 2);
  const float y_units = static_cast<float>(grid.height) * (kSubUnit / 2);
  switch (plane) {
    case 0:
      return clip.w - clip.z;
    case 1:
      return clip.z;
    case 2:
      return clip.w * guard + clip.x * x_units;
    case 3:
      return clip.w * guard - clip.x * x_units;
    case 4:
      return clip.w * guard + clip.y * y_units;
    default:
      return clip.w * guard - clip.y * y_units;
  }
}

/// Where the edge meets the plane; the order of the ends doesn't matter.
THRONG_HOST_DEVICE inline glm::vec4 clip_cut(const glm::vec4& inside, float inside_distance,
                                             const glm::vec4& outside, float outside_distance) {
  const float t = inside_distance / (inside_distance - outside_distance);
  return inside + (outside - inside) * t;
}

/// Clips a triangle (clip space) at the near plane and the guard band and snaps what is left: a
/// convex polygon, returned as its number of corners (0, or 3 to kMaxClippedCorners). An edge
/// shared by two triangles is cut at the same point from both sides, so no crack opens.
THRONG_HOST_DEVICE inline int clip_triangle(const SampleGrid& grid, const glm::vec4 corner_clip[3],
                                            SnappedVertex polygon[kMaxClippedCorners]) {
  glm::vec4 corners[2][kMaxClippedCorners];
  int count = 3;
  for (int i = 0; i < 3; ++i) {
    if (!(std::fabs(corner_clip[i].w) < 1e30F)) return 0;  // not finite
    corners[0][i] = corner_clip[i];
  }
  int from = 0;
  for (int plane = 0; plane < 6 && count >= 3; ++plane) {
    const glm::vec4* source = corners[from];
    glm::vec4* target = corners[1 - from];
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      const glm::vec4& a = source[i];
      const glm::vec4& b = source[(i + 1) % count];
      const float da = clip_distance(grid, plane, a);
      const float db = clip_distance(grid, plane, b);
      if (da >= 0.0F) target[kept++] = a;
      // always from the inside to the outside, whichever way this triangle runs along the edge
      if (da >= 0.0F && db < 0.0F) target[kept++] = clip_cut(a, da, b, db);
      if (da < 0.0F && db >= 0.0F) target[kept++] = clip_cut(b, db, a, da);
    }
    count = kept;
    from = 1 - from;
  }
  if (count < 3) return 0;
  for (int i = 0; i < count; ++i) {
    glm::vec4 corner = corners[from][i];
    // a cut at the near plane may land a rounding step on its far side
    if (corner.z > corner.w) corner.z = corner.w;
    if (corner.z < 0.0F) corner.z = 0.0F;
    if (!snap(grid, corner, polygon[i])) return 0;
  }
  return count;
}

}  // namespace throng::render::element
