#pragma once

#include <cstdint>
#include <glm/glm.hpp>

#include "render/raster/element/figure_shadow.hpp"
#include "render/raster/element/instance_shade.hpp"
#include "render/raster/element/tone.hpp"
#include "render/raster/visibility/element/clip.hpp"
#include "render/raster/visibility/element/cutout.hpp"
#include "render/raster/visibility/element/flat.hpp"
#include "render/raster/visibility/element/relief.hpp"
#include "render/raster/visibility/element/shade.hpp"
#include "render/raster/visibility/element/shadow.hpp"
#include "render/raster/visibility/element/speck.hpp"
#include "render/raster/visibility/element/splat.hpp"
#include "throng/render/representation.hpp"
#include "throng/render/vertex.hpp"

// What lies in device memory and what the kernels are given. GLM and elements only.
namespace throng::render::visibility::cuda {

using Word = unsigned long long;  // as atomicMax takes it; element/word.hpp says what is in it

/// What drawing needs of a member of the cast.
struct RasterCharacter {
  element::TextureInfo texture;
  float height_m = 0.0F;
  std::uint32_t toned_count = 0;  // CornerTones::most_vertices()
  std::uint32_t first_band = 0, band_count = 0;
  std::uint32_t flags = 0;
  std::uint32_t first_flag = 0;  // of triangle_flags
  std::uint32_t first_uv = 0;    // of uv
  static constexpr std::uint32_t kDoubleSided = 1, kHoles = 2, kSurrounding = 4;
};

/// A level of detail that shadows and shared figures are drawn with.
struct RasterLevel {
  std::uint32_t vertex_count = 0, triangle_count = 0, first_triangle = 0;
};
inline constexpr std::uint32_t kNoLevel = 0xffffffffU;
inline constexpr std::uint32_t kMostLevelVertices = 1024;

/// The impostor of a member of the cast; no boxes: it has none.
struct ReliefMember {
  std::uint32_t first_box = 0, box_count = 0;
};

struct RasterCast {
  const RasterCharacter* character = nullptr;
  const std::uint32_t* texels = nullptr;
  const std::uint8_t* triangle_flags = nullptr;
  const RasterLevel* level = nullptr;
  const std::uint32_t* level_corners = nullptr;  // three vertices in bits 0, 10 and 20
  const element::TriangleTone* tones = nullptr;  // by triangle of the levels
  const std::uint32_t* uv = nullptr;             // unorm16 pairs of all characters' vertices
  const std::uint32_t* level_at = nullptr;       // [members][kMostLevelVertices + 1], or kNoLevel
  const ToneBand* band = nullptr;                // with their places in all characters' tones
  const std::uint32_t* corner_tones = nullptr;
  const ReliefMember* relief_member = nullptr;
  const ReliefBox* relief_box = nullptr;
  const std::uint32_t* relief_shape = nullptr;    // texels of all boxes' faces
  const std::uint32_t* relief_base = nullptr;     // element::pack_color
  const std::uint32_t* relief_regions = nullptr;  // tint masks
  std::uint32_t first_surrounding = 0;
};

/// A triangle that is drawn tile by tile.
struct LargeTriangle {
  element::SnappedVertex v[3];
  std::uint32_t id;
  std::uint32_t flags;
  std::uint32_t first_corner;  // of indices, for the holes' texture coordinates
  std::uint32_t character;
  static constexpr std::uint32_t kDoubleSided = 1, kHoles = 2, kShadow = 4;
};
static_assert(sizeof(LargeTriangle) == 64);

/// Numbers that kernels count, once a frame.
struct RasterCounts {
  std::uint32_t special = 0;  // triangles to clip or with holes
  std::uint32_t large = 0;    // may exceed the room: what has none is drawn at once
  std::uint32_t tiles = 0;    // likewise
  std::uint32_t blob_tiles = 0;
  std::uint32_t own_blocks = 0, small_units = 0, large_units = 0;
  std::uint32_t candidates = 0, casters = 0;
  unsigned long long caster_key = 0;  // candidates above it cast a shadow
  unsigned long long surviving = 0;   // triangles that face the eye and may cover a sample
};

/// Who may cast a shadow, the tallest first: size's bits, then the first in the list.
struct Candidate {
  unsigned long long key;
  std::uint32_t instance, triangles;
};

struct BlobRecord {
  element::Blob blob;
  element::SampleBox box;
};

/// Of a shared figure that one warp draws; larger ones take a block of threads.
inline constexpr std::uint32_t kWarpVertices = 128;

inline constexpr std::uint32_t kTileSide = 64;      // samples
inline constexpr std::uint32_t kBlobTileSide = 64;  // pixels
inline constexpr std::uint32_t kLargeRoom = 1U << 16;
inline constexpr std::uint32_t kTileRoom = 1U << 20;

/// As PixelBox.
struct FactBox {
  std::int32_t x_low, y_low, x_high, y_high;
};

/// One frame. Shapes: V visible instances, B triangle blocks.
struct RasterJob {
  RasterCast cast;
  SceneFrame scene{};
  element::SampleGrid grid{};
  element::ChannelRange channel{};
  std::uint32_t width_px = 0, height_px = 0;
  std::uint32_t word_blocks_x = 0;  // of 4x4 samples

  // batched geometry
  std::uint32_t count = 0;  // V
  std::uint32_t vertices_total = 0;
  std::uint32_t triangles_total = 0;
  std::uint64_t triangles_drawn = 0;               // those of posed meshes too
  const VisibleInstance* instance = nullptr;       // [V]
  const std::uint32_t* vertex_offset = nullptr;    // [V+1]
  const std::uint32_t* triangle_offset = nullptr;  // [V+1]
  const BatchVertex* vertices = nullptr;
  const std::uint32_t* indices = nullptr;
  // fused geometry: who shares a pose has nothing in the arrays above
  const SharedInstance* shared = nullptr;  // [V]; null: batched
  const float* posed = nullptr;
  // forms other than meshes
  const Representation* representation = nullptr;  // [V]; null: all are meshes
  const JointedInstance* jointed = nullptr;        // [V] where representation is not null
  const float* joints = nullptr;
  element::ReliefView relief_view{};
  ReliefSearch relief_search{};
  const Splat* splats = nullptr;
  std::uint32_t splat_count = 0;
  glm::mat3 view_from_relative{1.0F};

  // agents of a few pixels
  const Speck* specks = nullptr;  // [S]
  std::uint32_t speck_count = 0;
  float speck_detail = 1.0F;  // as FrameGeometry's
  // who throws a shadow and is drawn otherwise: specks from here on, which get this image
  std::uint32_t first_shadow = 0;
  static constexpr std::uint32_t kOnlyShadow = 0xffffffffU;
  const SpeckImage* speck_image = nullptr;
  const SpeckSlab* speck_slab = nullptr;  // [SpeckLevels::kSlabs] of each image
  glm::vec3 camera_up{0.0F, 0.0F, 1.0F};
  std::uint32_t speck_tiles_x = 0, speck_tiles = 0;  // T of kSpeckTilePx
  std::uint32_t speck_entries = 0;                   // E: of all tiles' lists
  element::PlacedSpeck* placed_specks = nullptr;     // [S]
  std::uint32_t* first_entry = nullptr;              // [S+1] tiles of each, then their prefix sum
  std::uint32_t* first_of_tile = nullptr;            // [T+1] specks of each, then their prefix sum
  std::uint32_t *nearest = nullptr, *farthest = nullptr;  // [T] complements of depths' bits
  Word* speck_key[2] = {};              // [E] tile and depth: as they come, and sorted
  std::uint32_t* speck_number[2] = {};  // [E]
  // what they leave: r g b of what they show, and the share of light that their shadows take
  glm::vec4* speck_light = nullptr;  // [pixels]
  float* speck_through = nullptr;    // of what is behind them, by sample as words

  // of the frame
  InstanceShade* shade = nullptr;           // [V]
  std::uint32_t* block_count = nullptr;     // [V+1]
  std::uint32_t* first_block = nullptr;     // [V+1] exclusive prefix sum
  std::uint32_t* block_instance = nullptr;  // [B]
  // of fused geometry, in any order: blocks of instances with vertices of their own, and instances
  // that share theirs by their size
  std::uint32_t* own_blocks = nullptr;                           // [B]
  std::uint32_t *small_units = nullptr, *large_units = nullptr;  // [V]
  element::SnappedVertex* projected = nullptr;                   // [vertices_total]
  std::uint32_t* special = nullptr;                              // [triangles_total] ids
  LargeTriangle* large = nullptr;                                // [kLargeRoom]
  glm::uvec2* tiles = nullptr;           // [kTileRoom] large triangle; x | y << 16
  Candidate* candidates = nullptr;       // [V]
  std::uint32_t* casters = nullptr;      // [V]
  BlobRecord* blobs = nullptr;           // [V]
  glm::uvec2* blob_tiles = nullptr;      // [kTileRoom] instance; x | y << 16
  RasterCounts* counts = nullptr;        // [1]
  Word* words = nullptr;                 // samples, see word_index
  std::uint32_t* shadow = nullptr;       // [words] bits of the light that is missing
  std::uint32_t* blob_shadow = nullptr;  // [pixels]
  std::uint32_t* pixels = nullptr;       // [height][width] r g b 255
  element::FigureCells figures;          // no lists: nothing stands around
  // PixelFacts; null: nobody asks
  float* fact_depth = nullptr;             // [pixels]
  std::uint32_t* fact_instance = nullptr;  // [pixels]
  FactBox* fact_bounds = nullptr;          // [V]
};

/// A vertex of an instance that shares its pose, relative to the eye.
THRONG_HOST_DEVICE inline glm::vec3 placed_vertex(const RasterJob& job, std::uint32_t instance,
                                                  std::uint32_t vertex) {
  const SharedInstance& shared = job.shared[instance];
  const float* column = job.posed + shared.posed + kPosedHeader + vertex;
  return element::place_posed(
      job.instance[instance].position_relative, shared.cosine_scale, shared.sine_scale,
      job.instance[instance].scale,
      glm::vec3(column[0], column[shared.stride], column[2 * shared.stride]));
}

/// Whether an instance's vertices are those of a shared pose.
THRONG_HOST_DEVICE inline bool is_shared(const RasterJob& job, std::uint32_t instance) {
  return job.shared != nullptr && job.shared[instance].level != SharedInstance::kOwn;
}

/// Whether an instance is an impostor.
THRONG_HOST_DEVICE inline bool is_relief(const RasterJob& job, std::uint32_t instance) {
  return job.representation != nullptr && job.representation[instance] == Representation::kImpostor;
}

/// Whether the frame has words at all: else nothing but ground and sky is seen.
THRONG_HOST_DEVICE inline bool has_words(const RasterJob& job) {
  return job.count > 0 || job.splat_count > 0;
}

/// Place of a sample: blocks of 4x4 samples row by row, a cache line each; in them the four samples
/// of a pixel side by side (bit 0 right, bit 1 below).
THRONG_HOST_DEVICE inline std::size_t word_index(std::uint32_t word_blocks_x, std::uint32_t x,
                                                 std::uint32_t y) {
  const std::size_t block = static_cast<std::size_t>(y >> 2) * word_blocks_x + (x >> 2);
  const std::uint32_t pixel = (y & 2U) | ((x >> 1) & 1U);
  return (block << 4) | (pixel << 2) | ((y & 1U) << 1) | (x & 1U);
}

}  // namespace throng::render::visibility::cuda
