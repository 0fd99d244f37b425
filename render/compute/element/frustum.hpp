#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

/// Half-spaces a visible sphere touches; xyz is the unit normal pointing inside.
struct Frustum {
  glm::vec4 planes[6];
};

/// Planes of a clip matrix with z in [0, w]: sums and differences of its rows (Gribb & Hartmann
/// 2001). A plane without a normal (the far plane of an infinite projection) keeps everything.
inline Frustum frustum_from(const glm::mat4& clip_from_relative) {
  const glm::mat4& m = clip_from_relative;
  glm::dvec4 row[4];
  for (int r = 0; r < 4; ++r) row[r] = glm::dvec4(m[0][r], m[1][r], m[2][r], m[3][r]);
  const glm::dvec4 sums[6] = {row[3] + row[0], row[3] - row[0], row[3] + row[1],
                              row[3] - row[1], row[2],          row[3] - row[2]};
  Frustum frustum;
  for (int i = 0; i < 6; ++i) {
    const double length =
        std::sqrt(sums[i].x * sums[i].x + sums[i].y * sums[i].y + sums[i].z * sums[i].z);
    frustum.planes[i] =
        length > 0.0 ? glm::vec4(sums[i] / length) : glm::vec4(0.0F, 0.0F, 0.0F, 1e30F);
  }
  return frustum;
}

/// Touching counts as inside, so an instance that stands exactly on a plane does not flicker.
/// The sphere is relative to the eye; a negative radius is never visible. The slack covers the
/// rounding of the dot product: one too many is allowed, one too few is not.
THRONG_HOST_DEVICE inline bool touches(const Frustum& frustum, const glm::vec4& sphere) {
  const float slack_m =
      fused(std::fabs(sphere.x) + std::fabs(sphere.y) + std::fabs(sphere.z), 4e-7F, sphere.w);
  bool inside = sphere.w >= 0.0F;
  for (const glm::vec4& plane : frustum.planes) {
    const float distance_m =
        fused(plane.x, sphere.x, fused(plane.y, sphere.y, fused(plane.z, sphere.z, plane.w)));
    inside = inside && distance_m >= -slack_m;
  }
  return inside;
}

}  // namespace throng::render::element
