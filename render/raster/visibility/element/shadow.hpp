#pragma once

#include <glm/glm.hpp>

#include "render/raster/element/instance_shade.hpp"
#include "render/raster/visibility/element/clip.hpp"
#include "render/raster/visibility/element/shade.hpp"

namespace throng::render::element {

/// Samples, inclusive; x_low > x_high: nothing.
struct SampleBox {
  std::int32_t x_low, y_low, x_high, y_high;
};

/// Samples that a blob may darken: its rectangle on the ground, a little enlarged; all of them when
/// a corner lies behind the eye.
THRONG_HOST_DEVICE inline SampleBox blob_box(const SampleGrid& grid, const Blob& blob,
                                             float ground_relative_m) {
  SampleBox box{0, 0, grid.width - 1, grid.height - 1};
  if (most(blob.contact, blob.body) < 0.004F) {
    box.x_high = -1;
    return box;
  }
  const glm::mat4& m = grid.clip_from_relative;
  const glm::vec2 aside(-blob.away.y, blob.away.x);
  const glm::vec2 corner = blob.feet_relative + (blob.away * -0.55F + aside * -0.55F) * blob.meter;
  const glm::vec4 origin = to_clip(m, glm::vec3(corner.x, corner.y, ground_relative_m));
  const glm::vec2 along = blob.away * ((blob.reach + 0.9F) * blob.meter);
  const glm::vec2 across = aside * (1.1F * blob.meter);
  const glm::vec4 u = m[0] * along.x + m[1] * along.y, v = m[0] * across.x + m[1] * across.y;
  glm::vec2 low(1e9F, 1e9F), high(-1e9F, -1e9F);
  for (int k = 0; k < 4; ++k) {
    glm::vec4 p = origin;
    if ((k & 1) != 0) p = p + u;
    if ((k & 2) != 0) p = p + v;
    if (!(p.w > 0.0F) || !(p.z <= p.w) || !(p.z >= 0.0F)) return box;
    const float x = p.x / p.w, y = p.y / p.w;
    low = glm::vec2(least(low.x, x), least(low.y, y));
    high = glm::vec2(most(high.x, x), most(high.y, y));
  }
  const auto sample = [](float ndc, std::int32_t count) {
    const float limit = static_cast<float>(count) + 2.0F;
    return static_cast<std::int32_t>(
        least(most((1.0F + ndc) * 0.5F * static_cast<float>(count), -2.0F), limit));
  };
  const auto within = [](std::int32_t value, std::int32_t low_end, std::int32_t high_end) {
    return value < low_end ? low_end : (value < high_end ? value : high_end);
  };
  // an empty one stays so: its low end may lie beyond the last sample
  box.x_low = within(sample(low.x, grid.width) - 1, 0, grid.width + 2);
  box.x_high = within(sample(high.x, grid.width) + 1, -3, grid.width - 1);
  box.y_low = within(sample(-high.y, grid.height) - 1, 0, grid.height + 2);
  box.y_high = within(sample(-low.y, grid.height) + 1, -3, grid.height - 1);
  return box;
}

/// Where the sun throws a point of a figure: on the ground. `height_share`: its height as a share
/// of the figure's, in steps of 1 / 65535.
struct ShadowPoint {
  glm::vec3 position_relative;
  float height_share;
};

THRONG_HOST_DEVICE inline ShadowPoint shadow_point(const SceneFrame& scene,
                                                   const InstanceShade& shade, const glm::vec3& p) {
  const glm::vec3& sun = scene.sun_direction;
  const float height_m = most(p.z - scene.ground_relative_m, 0.0F);
  const float slide = height_m / most(sun.z, 0.05F);
  const auto steps =
      static_cast<std::uint32_t>(least(height_m / most(shade.height_m, 0.1F), 1.0F) * 65535.0F);
  return {glm::vec3(p.x - sun.x * slide, p.y - sun.y * slide, scene.ground_relative_m),
          static_cast<float>(steps) / 65535.0F};
}

/// Share of the light that a caster's shadow takes where the figure touches the ground.
THRONG_HOST_DEVICE inline float cast_shadow_share(const SceneFrame& scene,
                                                  const InstanceShade& shade) {
  const glm::vec3& feet = shade.feet_relative;
  const float distance_m = scene.orthographic ? 1e-3F : most(std::sqrt(dot3(feet, feet)), 1e-3F);
  const float slope = least(std::fabs(scene.ground_relative_m) / distance_m, 1.0F);
  return least(shade.cast_shadow, 1.0F) * (1.0F - exp2_negative(-55.0F * slope));
}

/// And at a share of its height: what is thrown from higher up is weaker.
THRONG_HOST_DEVICE inline float cast_shadow_strength(float share, float height_share) {
  return share * (0.56F - 0.14F * height_share);
}

/// A wall's triangle thrown on the ground, cut where it reaches behind the eye: a convex polygon,
/// returned as its number of corners (0, or 3 to kMaxClippedCorners). Their depth is the strength.
/// @param share  of cast_shadow_share
THRONG_HOST_DEVICE inline int cut_shadow(const SampleGrid& grid, const ShadowPoint corner[3],
                                         float share, SnappedVertex polygon[kMaxClippedCorners]) {
  glm::vec4 clip[3];
  bool cut = false;
  for (int k = 0; k < 3; ++k) {
    clip[k] = to_clip(grid.clip_from_relative, corner[k].position_relative);
    cut = !snap(grid, clip[k], polygon[k]) || cut;
    polygon[k].depth = cast_shadow_strength(share, corner[k].height_share);
  }
  if (!cut) return 3;
  // x, y and w of a cut corner are sums of the corners', and so is its height
  const auto cross = [](const glm::vec4& a, const glm::vec4& b) {
    return glm::dvec3(static_cast<double>(a.y) * b.w - static_cast<double>(a.w) * b.y,
                      static_cast<double>(a.w) * b.x - static_cast<double>(a.x) * b.w,
                      static_cast<double>(a.x) * b.y - static_cast<double>(a.y) * b.x);
  };
  const glm::dvec3 side[3] = {cross(clip[1], clip[2]), cross(clip[2], clip[0]),
                              cross(clip[0], clip[1])};
  const double whole = side[0].x * clip[0].x + side[0].y * clip[0].y + side[0].z * clip[0].w;
  if (whole == 0.0) return 0;  // seen edge on
  const int count = clip_triangle(grid, clip, polygon);
  for (int i = 0; i < count; ++i) {
    SnappedVertex& at = polygon[i];
    const double x = 2.0 * at.x / (static_cast<double>(grid.width) * kSubUnit) - 1.0;
    const double y = 1.0 - 2.0 * at.y / (static_cast<double>(grid.height) * kSubUnit);
    double height = 0.0;
    for (int k = 0; k < 3; ++k) {
      height += (side[k].x * x + side[k].y * y + side[k].z) * corner[k].height_share;
    }
    const auto height_share = static_cast<float>(height / (whole * at.inverse_w));
    at.depth = cast_shadow_strength(share, least(most(height_share, 0.0F), 1.0F));
  }
  return count;
}

}  // namespace throng::render::element
