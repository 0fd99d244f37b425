#include "render/raster/visibility/cpu/clip.hpp"

#include <cmath>

#include "render/raster/visibility/element/coverage.hpp"

namespace throng::render::visibility {
namespace {

/// Signed distances to the six half-spaces a polygon is cut by: near plane, far plane and the guard
/// band's four sides. Perspective has w >= near just when z <= w, z being the near distance itself.
float distance(const SampleGrid& grid, int plane, const glm::vec4& clip) {
  // the guard band in ndc: a quarter less than what `snap` accepts, so cut points are accepted
  const float guard = 0.75F * static_cast<float>(element::kGuardUnits);
  const float x_units = static_cast<float>(grid.width) * (element::kSubUnit / 2);
  const float y_units = static_cast<float>(grid.height) * (element::kSubUnit / 2);
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
glm::vec4 cut(const glm::vec4& inside, float inside_distance, const glm::vec4& outside,
              float outside_distance) {
  const float t = inside_distance / (inside_distance - outside_distance);
  return inside + (outside - inside) * t;
}

}  // namespace

glm::vec4 to_clip(const glm::mat4& m, const glm::vec3& p) {
  glm::vec4 clip;
  for (int r = 0; r < 4; ++r) {
    clip[r] = ((m[0][r] * p.x + m[1][r] * p.y) + m[2][r] * p.z) + m[3][r];
  }
  return clip;
}

bool snap(const SampleGrid& grid, const glm::vec4& clip, SnappedVertex& vertex) {
  if (!(clip.w > 0.0F) || !(clip.z <= clip.w) || !(clip.z >= 0.0F)) return false;
  const float inverse_w = 1.0F / clip.w;
  const float half_x = static_cast<float>(grid.width) * (element::kSubUnit / 2);
  const float half_y = static_cast<float>(grid.height) * (element::kSubUnit / 2);
  const float x = (clip.x * inverse_w) * half_x;
  const float y = (clip.y * inverse_w) * half_y;
  constexpr float kGuard = static_cast<float>(element::kGuardUnits);
  if (!(std::fabs(x) < kGuard) || !(std::fabs(y) < kGuard)) return false;
  vertex.x = static_cast<std::int32_t>(std::floor((x + half_x) + 0.5F));
  vertex.y = static_cast<std::int32_t>(std::floor((half_y - y) + 0.5F));
  vertex.depth = clip.z * inverse_w;
  vertex.inverse_w = inverse_w;
  return true;
}

int clip_triangle(const SampleGrid& grid, const glm::vec4 corner_clip[3],
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
      const float da = distance(grid, plane, a);
      const float db = distance(grid, plane, b);
      if (da >= 0.0F) target[kept++] = a;
      // always from the inside to the outside, whichever way this triangle runs along the edge
      if (da >= 0.0F && db < 0.0F) target[kept++] = cut(a, da, b, db);
      if (da < 0.0F && db >= 0.0F) target[kept++] = cut(b, db, a, da);
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

}  // namespace throng::render::visibility
