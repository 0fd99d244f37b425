#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "render/compute/cpu/levels.hpp"
#include "render/raster/element/figure_shadow.hpp"
#include "render/raster/scene.hpp"
#include "render/raster/visibility/cpu/tile.hpp"
#include "render/raster/visibility/element/flat.hpp"
#include "render/raster/visibility/element/shade.hpp"
#include "throng/render/compute.hpp"

namespace throng::render::visibility {

using element::Blob;
using element::make_blob;
using element::TextureInfo;

/// The same for vectors of pixels: all its values are gathered as 32-bit integers. [0] base colour,
/// [1] mask, of one texel where there is none.
struct TextureLevels {
  static constexpr std::size_t kMost = 16;
  std::int32_t first[2][kMost];
  std::int32_t width[2], height[2], last_level[2], log2_width[2];
  std::int32_t has_mask;
};

/// All textures of a cast in one array, texels r g b a as little-endian words.
struct TextureStore {
  std::vector<std::uint32_t> texels;  // one more, as two neighbours are read at once
  std::vector<TextureInfo> infos;
  std::vector<TextureLevels> levels;
};

/// InvalidArgument for a texture that is smaller than it says, ResourceExhausted.
/// @param store  of a cast whose first `kept` members are those of this one: theirs are kept
absl::StatusOr<TextureStore> make_textures(const Cast& cast, TextureStore store = {},
                                           std::size_t kept = 0);

TextureLevels levels_of(const TextureInfo& info);

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

using element::TriangleTone;

/// Of every triangle of every level.
std::vector<TriangleTone> make_tones(const Cast& cast, const LevelTable& levels,
                                     const TextureStore& textures);

/// Where the vertices of shared instances are, and the tones of all.
struct SharedMeshes {
  const float* posed;            // FrameGeometry::posed
  const std::uint32_t* corners;  // LevelTable::corners
  const std::uint32_t* uv;
  const SharedShade* shades;  // [V]
  const TriangleTone* tones;  // by triangle of LevelTable
  // of all figures that have them: a corner's tone is at the triangle's first corner (shared: three
  // times its number) and what its instance adds, modulo 2^32
  const std::uint32_t* corner_tones;
  const std::uint32_t* tone_shift;  // [V]
};

/// What a subset of a pixel's four samples shows: bit 0 left above, 1 right above, 2 left below.
struct SamplePlace {
  float x, y, weight;  // mean place in the pixel, share of it
};
inline constexpr std::array<SamplePlace, 16> kSamplePlaces = [] {
  std::array<SamplePlace, 16> places{};
  for (unsigned bits = 1; bits < 16; ++bits) {
    float samples = 0.0F, x = 0.0F, y = 0.0F;
    for (unsigned k = 0; k < 4; ++k) {
      if ((bits >> k & 1U) == 0) continue;
      samples += 1.0F;
      x += (k & 1U) != 0 ? 0.75F : 0.25F;
      y += (k & 2U) != 0 ? 0.75F : 0.25F;
    }
    places[bits] = {x / samples, y / samples, 0.25F * samples};
  }
  return places;
}();

/// What is shaded in one tile: one item for each pixel and instance seen in it.
struct ShadeItems {
  static constexpr std::size_t kMost =
      4096 + 16;  // four samples a pixel, and room for whole vectors
  // first corner's place in FrameGeometry::indices; of shared instances: in LevelTable::corners
  alignas(64) std::int32_t triangle[kMost];
  alignas(64) std::int32_t instance[kMost];  // visible list
  alignas(64) float weight[kMost];
  alignas(64) std::uint16_t pixel[kMost];  // of the tile
  alignas(64) float rgb[3][kMost];         // out: tone-mapped, linear
  std::size_t count = 0;
};

/// Pixels of textured figures in one tile, by instance.
class FigureItems {
 public:
  static constexpr std::size_t kMost = 4096;  // four samples a pixel
  struct Item {
    std::uint32_t triangle;  // as ShadeItems
    std::uint16_t pixel;     // of the tile
    std::uint16_t samples;   // of kSamplePlaces; from bit 4 on, element::surface_shadow
  };
  struct Group {
    std::uint32_t instance;  // visible list
    std::uint32_t is_shared;
    std::uint32_t count, first;  // of the order
    std::uint32_t slot;
  };
  /// Fewer pixels of an instance than this are shaded together with others'.
  static constexpr std::uint32_t kLeastAlone = 6;

  void clear();
  void add(std::uint32_t instance, bool is_shared, const Item& item) {
    if (count_ == 0 || groups_[last_].instance != instance) last_ = find(instance, is_shared);
    ++groups_[last_].count;
    group_[count_] = static_cast<std::uint16_t>(last_);
    items_[count_++] = item;
  }
  /// Fills the order: groups of kLeastAlone and more one after the other, then the others' items
  /// from `mixed` on.
  void sort();

  std::size_t count() const { return count_; }
  std::size_t mixed() const { return mixed_; }
  std::span<const Group> groups() const { return {groups_, group_count_}; }
  const Item& at(std::size_t place) const { return items_[order_[place]]; }
  const Group& group_at(std::size_t place) const { return groups_[group_[order_[place]]]; }

 private:
  static constexpr std::uint32_t kSlots = 8192;
  std::uint32_t find(std::uint32_t instance, bool is_shared);

  std::size_t count_ = 0, group_count_ = 0, mixed_ = 0;
  std::uint32_t last_ = 0;
  Item items_[kMost];
  std::uint16_t group_[kMost], order_[kMost];
  Group groups_[kMost];
  std::uint16_t slots_[kSlots] = {};  // group + 1, open addressing
};

/// Shades figures and adds what they show to the planes of a tile: perspective-correct corners'
/// mean, texture, tints, sun and sky, haze. The same formulas as gl/shaders.cpp.
void shade_figures(const SceneFrame& scene, const FrameGeometry& geometry,
                   const SharedMeshes& meshes, const InstanceShade* shades,
                   const TextureStore& textures, const FigureItems& items, int tile_x_px,
                   int tile_y_px, float* const rgb[3]);

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

/// Tints, channel, sun and sky, haze: the same light as shade_figures.
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
