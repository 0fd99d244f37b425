#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/hash.hpp"
#include "render/compute/element/posed.hpp"
#include "render/raster/visibility/element/shade.hpp"
#include "throng/render/representation.hpp"

// Shading of what has one colour for a whole triangle or point; the vectors of cpu/shade_simd.cpp
// do the same.
namespace throng::render::element {

/// The mean of the textures over one triangle. 8 bytes.
struct TriangleTone {
  std::uint32_t base;     // pack_color
  std::uint32_t regions;  // tint mask, 8 bits each
};

/// Shared figures whose triangles are smaller than this on the average have one colour for each.
inline constexpr float kFlatTrianglePx2 = 1.5F;
inline constexpr float kFlatFigurePx =
    14.0F;  // of larger figures the difference shows (SSIM 0.006)

/// Whether a shared figure's triangles have one colour each. A figure covers about a fifth of its
/// height squared, with half of its triangles; who is on which side of the limit is a little
/// different for each.
THRONG_HOST_DEVICE inline bool is_flat(float size_px, std::uint32_t triangles, std::uint32_t seed) {
  const float triangle_px2 = 0.4F * size_px * size_px / static_cast<float>(triangles);
  const float limit = 0.8F + 0.4F * unit_from_seed(seed, kSeedFlat);
  return triangle_px2 < limit * kFlatTrianglePx2 && size_px < limit * kFlatFigurePx;
}

/// A colour with the channel's or the tints' on it.
THRONG_HOST_DEVICE inline glm::vec3 worn(const InstanceShade& shade, std::uint32_t base,
                                         std::uint32_t regions) {
  const glm::vec3 color = unpack_color(base);
  if (shade.channel != kNoChannel) return channel_tinted(color, shade.channel);
  const auto region = [&](int k) {
    return static_cast<float>((regions >> (8 * k)) & 255U) * (1.0F / 255.0F);
  };
  return tinted(color, glm::vec4(region(0), region(1), region(2), region(3)), shade);
}

/// Impostors and points: colour, normal (any length) and place are known.
THRONG_HOST_DEVICE inline glm::vec3 shade_surface(const SceneFrame& scene,
                                                  const InstanceShade& shade, std::uint32_t base,
                                                  std::uint32_t regions, const glm::vec3& normal,
                                                  const glm::vec3& place) {
  glm::vec3 to_eye = scene.ray_direction * -1.0F;
  if (!scene.orthographic) to_eye = unit3(place * -1.0F);
  return lit(scene, worn(shade, base, regions), unit3(normal), to_eye,
             place.z - shade.feet_relative.z, std::sqrt(dot3(place, place)));
}

/// A triangle of a shared figure in the light of its corners' mean normal.
/// @param z  column of the posed mesh, of `stride` values; the normals' follows.
THRONG_HOST_DEVICE inline glm::vec3 shade_flat(const SceneFrame& scene, const InstanceShade& shade,
                                               const TriangleTone& tone,
                                               const SharedInstance& shared, float scale,
                                               bool double_sided, const float* z,
                                               std::uint32_t corners) {
  glm::vec3 n(0.0F, 0.0F, 0.0F);
  float height = 0.0F;
  for (int k = 0; k < 3; ++k) {
    const std::uint32_t v = (corners >> (10 * k)) & 1023U;
    height = height + z[v];
    n = n + rough_octahedral(float_bits(z[shared.stride + v]));
  }
  n = unit3(turn_posed(shared.cosine_scale, shared.sine_scale, scale, n));
  const glm::vec3& feet = shade.feet_relative;
  glm::vec3 to_eye = scene.ray_direction * -1.0F;
  if (!scene.orthographic) to_eye = unit3(feet * -1.0F);
  // what is double-sided shows the side it is seen from
  if (double_sided && dot3(n, to_eye) < 0.0F) n = n * -1.0F;
  return lit(scene, worn(shade, tone.base, tone.regions), n, to_eye,
             (height * scale) * (1.0F / 3.0F), std::sqrt(dot3(feet, feet)));
}

}  // namespace throng::render::element
