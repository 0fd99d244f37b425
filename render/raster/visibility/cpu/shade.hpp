#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "render/compute/cpu/levels.hpp"
#include "render/raster/scene.hpp"
#include "render/raster/visibility/element/shade.hpp"
#include "throng/render/compute.hpp"

namespace throng::render::visibility {

using element::Blob;
using element::make_blob;
using element::TextureInfo;

/// All textures of a cast in one array, texels r g b a as little-endian words.
struct TextureStore {
  std::vector<std::uint32_t> texels;
  std::vector<TextureInfo> infos;
};

/// InvalidArgument for a texture that is smaller than it says, ResourceExhausted.
absl::StatusOr<TextureStore> make_textures(const Cast& cast);

/// What shading needs of an instance that shares its pose. 32 bytes.
struct SharedShade {
  std::uint32_t posed;   // x column
  std::uint32_t stride;  // to the columns of y, z and normals
  std::uint32_t first_uv;
  std::uint32_t reserved;
  float cosine_scale, sine_scale, scale;
  float double_sided;  // 1 or 0
};
static_assert(sizeof(SharedShade) == 32);

/// The mean of the textures over one triangle. 8 bytes.
struct TriangleTone {
  std::uint32_t base;     // element::pack_color
  std::uint32_t regions;  // tint mask, 8 bits each
};

/// Of every triangle of every level.
std::vector<TriangleTone> make_tones(const Cast& cast, const LevelTable& levels,
                                     const TextureStore& textures);

/// Where the vertices of shared instances are.
struct SharedMeshes {
  const float* posed;            // FrameGeometry::posed
  const std::uint32_t* corners;  // LevelTable::corners
  const std::uint32_t* uv;
  const SharedShade* shades;  // [V]
  const TriangleTone* tones;  // by triangle of LevelTable
};

/// What is shaded in one tile: one item for each pixel and instance seen in it.
struct ShadeItems {
  static constexpr std::size_t kMost =
      4096 + 16;  // four samples a pixel, and room for whole vectors
  // first corner's place in FrameGeometry::indices; of shared instances: in LevelTable::corners
  alignas(64) std::int32_t triangle[kMost];
  alignas(64) std::int32_t instance[kMost];  // visible list
  alignas(64) float x_px[kMost], y_px[kMost];
  alignas(64) float weight[kMost];
  alignas(64) std::uint16_t pixel[kMost];  // of the tile
  alignas(64) float rgb[3][kMost];         // out: tone-mapped, linear
  std::size_t count = 0;
};

/// Shading of agents: perspective-correct corners' mean, texture, tints, sun and sky, haze. The
/// same formulas as gl/shaders.cpp.
void shade_items(const SceneFrame& scene, const FrameGeometry& geometry,
                 const InstanceShade* shades, const TextureStore& textures, ShadeItems& items);

/// The same of instances that share their pose.
void shade_shared_items(const SceneFrame& scene, const SharedMeshes& meshes,
                        const InstanceShade* shades, const TextureStore& textures,
                        ShadeItems& items);

/// The same where triangles are about as small as pixels: each has one colour, its textures' mean
/// in the light of its corners' mean normal. A quarter of the work.
void shade_flat_items(const SceneFrame& scene, const SharedMeshes& meshes,
                      const InstanceShade* shades, ShadeItems& items);

/// Pieces of surface whose colour, normal and place are known already, as of impostors and points.
struct SurfaceItems {
  static constexpr std::size_t kMost = ShadeItems::kMost;
  alignas(64) std::int32_t instance[kMost];  // visible list
  alignas(64) std::uint32_t base[kMost];     // element::pack_color
  alignas(64) std::uint32_t regions[kMost];  // tint mask, 8 bits each
  alignas(64) float normal[3][kMost];        // world axes, of any length
  alignas(64) float relative[3][kMost];      // metres, relative to the eye
  alignas(64) float weight[kMost];           // share of the pixel
  alignas(64) std::uint16_t pixel[kMost];    // of the tile
  alignas(64) float rgb[3][kMost];           // out: tone-mapped, linear
  std::size_t count = 0;
};

/// Tints, channel, sun and sky, haze: the same light as shade_items.
void shade_surface_items(const SceneFrame& scene, const InstanceShade* shades, SurfaceItems& items);

/// Ground, grid and sky of a row of pixels [x, x + count): tone-mapped, linear.
void shade_background(const SceneFrame& scene, int x_px, int y_px, int count, float* r, float* g,
                      float* b);

/// Raises `missing` (share of light that is missing) of `rows` rows of `count` pixels, `stride`
/// values apart, by a blob.
void shade_blob(const SceneFrame& scene, const Blob& blob, int x_px, int y_px, int count, int rows,
                int stride, float* missing);

/// A row of linear colours (0 to 1, aligned to 64 bytes) as 8-bit sRGB r g b 255, rounded.
void encode_row(const float* r, const float* g, const float* b, int count, std::uint8_t* rgbx);

}  // namespace throng::render::visibility
