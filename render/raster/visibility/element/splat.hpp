#pragma once

#include <cmath>
#include <glm/glm.hpp>

#include "render/compute/element/octahedral.hpp"
#include "render/raster/element/scene_frame.hpp"
#include "render/raster/visibility/element/clip.hpp"
#include "render/raster/visibility/element/shade.hpp"
#include "render/raster/visibility/element/word.hpp"
#include "throng/render/vertex.hpp"

// Points as discs on the sample grid, the same on every backend.
namespace throng::render::element {

/// A splat's disc on the sample grid: the samples (x + i, y + j) with
///
///     i^2 + j^2 + (slope_x i + slope_y j)^2 <= radius^2
///
/// and there the depth is depth + depth_slope (slope_x i + slope_y j). A disc of the surface, seen
/// in parallel projection: an ellipse that is as thin as the surface is steep. 32 bytes.
struct PlacedSplat {
  float x, y;    // samples from the picture's top left
  float radius;  // samples; negative: not seen
  float depth;   // reversed
  float slope_x, slope_y;
  float depth_slope;
  std::uint32_t reserved;
};
static_assert(sizeof(PlacedSplat) == 32);

/// Which splat a word of class point shows: its lower 30 bits.
inline constexpr std::uint32_t kSplatNumber = (1U << 30) - 1;
THRONG_HOST_DEVICE inline std::uint32_t splat_id(std::uint32_t number) {
  return static_cast<std::uint32_t>(SampleClass::kPoint) << 30 | number;
}

THRONG_HOST_DEVICE inline glm::vec3 towards_eye(const SceneFrame& scene,
                                                const glm::vec3& position_relative) {
  return scene.orthographic ? -scene.ray_direction : -position_relative;
}

/// What faces away is not seen unless its radius is negative (a splat without a side).
THRONG_HOST_DEVICE inline PlacedSplat place_splat(const Splat& splat, const SampleGrid& grid,
                                                  const SceneFrame& scene,
                                                  const glm::mat3& view_from_relative) {
  // steeper discs are drawn as if they were not: thinner ones would leave the outline to chance
  constexpr float kLeastFacing = 0.25F;
  constexpr float kLeastRadius = 0.5F;  // far splats still meet a sample now and then
  PlacedSplat placed{};
  placed.radius = -1.0F;
  const glm::vec3& p = splat.position_relative;
  const glm::vec4 clip = grid.clip_from_relative * glm::vec4(p, 1.0F);
  if (!(clip.w > 0.0F) || !(clip.z > 0.0F) || !(clip.z <= clip.w)) return placed;
  const glm::vec3 n = unpack_octahedral(splat.normal);
  const glm::vec3 to_eye = towards_eye(scene, p);
  const float facing = glm::dot(n, to_eye);
  const bool has_side = splat.radius_m >= 0.0F;
  if (has_side && !(facing > 0.0F)) return placed;
  const float inverse_w = 1.0F / clip.w;
  placed.x = (1.0F + clip.x * inverse_w) * 0.5F * static_cast<float>(grid.width);
  placed.y = (1.0F - clip.y * inverse_w) * 0.5F * static_cast<float>(grid.height);
  placed.depth = least(clip.z * inverse_w, 1.0F);
  const float samples_per_m = 2.0F * scene.px_per_tangent * inverse_w;
  placed.radius = most(std::fabs(splat.radius_m) * samples_per_m, kLeastRadius);
  if (!has_side) {
    if (splat.visible == kNobody && splat.regions > 0) {
      const float squeeze =
          255.0F / static_cast<float>(splat.regions < 255U ? splat.regions : 255U);
      placed.slope_x = std::sqrt(squeeze * squeeze - 1.0F);
    }
    return placed;
  }
  const glm::vec3 in_view = view_from_relative * n;
  const float steep = 1.0F / most(facing / glm::length(to_eye), kLeastFacing);
  // towards the eye where the surface rises: -n / n.z, y down on the picture
  placed.slope_x = -in_view.x * steep;
  placed.slope_y = in_view.y * steep;
  // what a sample's step towards the eye adds to the depth: along the view axis z / w changes by
  // its two gradients there
  const glm::mat4& m = grid.clip_from_relative;
  const glm::vec3 nearer =
      glm::vec3(view_from_relative[0].z, view_from_relative[1].z, view_from_relative[2].z);
  const float dz = glm::dot(glm::vec3(m[0].z, m[1].z, m[2].z), nearer);
  const float dw = glm::dot(glm::vec3(m[0].w, m[1].w, m[2].w), nearer);
  placed.depth_slope = (dz - placed.depth * dw) * inverse_w / most(samples_per_m, 1e-12F);
  return placed;
}

/// Samples of a tile that a disc may cover, and where its middle lies, from the tile's corner.
struct SplatBox {
  float middle_x, middle_y;
  int x_low, y_low, x_high, y_high;
};
THRONG_HOST_DEVICE inline SplatBox splat_box(const PlacedSplat& splat, int tile_x, int tile_y,
                                             int tile_side) {
  SplatBox box;
  // sample centres are at halves
  box.middle_x = splat.x - static_cast<float>(tile_x) - 0.5F;
  box.middle_y = splat.y - static_cast<float>(tile_y) - 0.5F;
  const auto last = static_cast<float>(tile_side - 1);
  box.x_low = static_cast<int>(std::ceil(most(box.middle_x - splat.radius, 0.0F)));
  box.x_high = static_cast<int>(std::floor(least(box.middle_x + splat.radius, last)));
  box.y_low = static_cast<int>(std::ceil(most(box.middle_y - splat.radius, 0.0F)));
  box.y_high = static_cast<int>(std::floor(least(box.middle_y + splat.radius, last)));
  return box;
}

/// Depth of a disc at sample (x, y) of a tile; 0: not covered.
THRONG_HOST_DEVICE inline float splat_depth(const PlacedSplat& splat, const SplatBox& box, int x,
                                            int y) {
  const float i = static_cast<float>(x) - box.middle_x, j = static_cast<float>(y) - box.middle_y;
  const float rise = splat.slope_x * i + splat.slope_y * j;
  if (i * i + j * j + rise * rise > splat.radius * splat.radius) return 0.0F;
  return least(most(splat.depth + splat.depth_slope * rise, 1e-30F), 1.0F);
}

/// The normal that is shaded: a disc without a side shows the one it is seen from.
THRONG_HOST_DEVICE inline glm::vec3 splat_normal(const Splat& splat, const SceneFrame& scene) {
  const glm::vec3 normal = unpack_octahedral(splat.normal);
  const bool turns =
      splat.radius_m < 0.0F && glm::dot(normal, towards_eye(scene, splat.position_relative)) < 0.0F;
  return turns ? -normal : normal;
}

}  // namespace throng::render::element
