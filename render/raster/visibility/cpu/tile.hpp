#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <vector>

#include "render/raster/visibility/element/clip.hpp"
#include "render/raster/visibility/element/cutout.hpp"
#include "throng/render/compute.hpp"

namespace throng::render::visibility {

inline constexpr int kTileSamples = 64;           // a side
inline constexpr int kTilePx = kTileSamples / 2;  // two samples a pixel and axis
inline constexpr int kCellSamples = 8;            // a side of a cell of the depth pyramid
inline constexpr int kCells = kTileSamples / kCellSamples;

/// Samples of one tile, in 4x4 blocks of 16 consecutive values (one cache line a plane), blocks row
/// by row. The two planes together are the 64-bit words of element/word.hpp.
struct alignas(64) TilePlanes {
  float depth[kTileSamples * kTileSamples];
  std::uint32_t id[kTileSamples * kTileSamples];
  float
      cell_low[kCells * kCells];  // lower bound of the depth in each cell: what is behind is hidden
};

inline constexpr std::size_t sample_index(int x, int y) {
  return static_cast<std::size_t>((((y >> 2) * (kTileSamples / 4) + (x >> 2)) << 4) +
                                  ((y & 3) << 2) + (x & 3));
}

/// All vertices of a frame on the sample grid. `x` is kNeedsClip for a vertex behind the near plane
/// or outside the guard band; its triangles take the clipping path.
struct Projected {
  std::vector<std::int32_t> x, y;  // sub-units from the picture's top left sample corner
  std::vector<float> depth;        // reversed, 0 (infinity) to 1 (near plane)
  std::vector<float> inverse_w;    // 1 / clip w
  void resize(std::size_t count);
};
using element::kNeedsClip;
using element::SampleGrid;

/// Where an instance's vertices fell.
struct Footprint {
  std::int32_t x_low, y_low, x_high, y_high;  // samples, inclusive; x_low > x_high: nothing
  float depth_high;                           // nearest
  bool clipped;                               // some vertex needs clipping
};

/// Projects vertices [begin, end) and returns their footprint.
Footprint project_vertices(const SampleGrid& grid, const BatchVertex* vertices, std::size_t begin,
                           std::size_t end, Projected& projected);

using element::Cutout;

/// One instance's triangles, as the tile needs them.
struct InstanceTriangles {
  const std::uint32_t* indices;  // [3 * count], into the frame's vertices
  std::uint32_t count;
  std::uint32_t first_block;  // of the instance
  bool double_sided;
  bool clipped;
  const Cutout* cutout = nullptr;  // null: no triangle has holes
};

/// Triangles that may cover a sample of the picture, culled once for all the tiles they are seen
/// in. Grows only; `used` of them count. Places are absolute, in sub-units.
struct TriangleList {
  struct Range {
    std::uint32_t first, count;
  };
  /// Corner 0, the steps from it to corners 1 and 2 (x in the low half), depths. Half a cache line.
  struct alignas(32) Small {
    std::int32_t x0, y0;
    std::uint32_t step1, step2;
    float z[3];
    std::uint32_t triangle;
  };
  /// Of any size; of the one that was cut at the near plane when there are several.
  struct Large {
    std::int32_t x[3], y[3];
    float depth[3];
    std::uint32_t triangle;
  };
  std::vector<std::uint32_t> low, high;  // the samples' box: x in the low half, inclusive
  std::vector<Small> small;
  std::size_t used = 0;
  std::vector<Large> large;
  std::size_t size_bytes() const {
    return low.capacity() * (2 * sizeof(std::uint32_t) + sizeof(Small)) +
           large.capacity() * sizeof(Large);
  }
};

/// Corners a posed mesh of the largest level has, and room for whole vectors.
inline constexpr std::size_t kMostShared = 1024 + 16;

/// An agent that shares its pose, as the tile needs it. The vertices are made here, in cache.
struct SharedTriangles {
  const float* posed;  // columns x, y, z of `stride` values, model frame
  std::uint32_t stride;
  std::uint32_t vertex_count;
  const std::uint32_t* corners;  // [count], three vertices in bits 0, 10 and 20
  std::uint32_t count;
  std::uint32_t first_block;
  glm::vec3 feet_relative;
  float cosine_scale, sine_scale, scale;
  bool double_sided;
};

/// Vertices of one agent on the sample grid.
struct SharedScratch {
  alignas(64) std::uint32_t place[kMostShared];  // x, y from the least ones, 16 bits each
  alignas(64) std::int32_t x[kMostShared], y[kMostShared];
  alignas(64) float depth[kMostShared];
};

/// Where a placed box falls: never smaller than the footprint of what is in it. `low` and `high` in
/// the model frame.
Footprint project_box(const SampleGrid& grid, const glm::vec3& low, const glm::vec3& high,
                      const SharedTriangles& placement);

struct TileCounters {
  std::uint64_t triangles = 0;  // set up
  std::uint64_t surviving = 0;  // after back-face, no-sample and off-tile culls
  std::uint64_t instances = 0;  // drawn
  std::uint64_t hidden = 0;     // instances not drawn: behind what is there
  std::uint64_t shaded = 0;     // pixels of figures, each once for every instance seen in it
};

/// Empties the planes.
void clear_tile(TilePlanes& planes);

/// Draws the triangles over the samples of the tile whose top left sample is (tile_x, tile_y).
/// `vertices` and the grid are for triangles that need clipping.
void draw_instance(const InstanceTriangles& triangles, const Projected& projected,
                   const BatchVertex* vertices, const SampleGrid& grid, int tile_x, int tile_y,
                   TilePlanes& planes, TileCounters& counters);

/// Appends the triangles of an instance without cut-outs that may cover a sample of the picture.
/// Returns the instance's footprint by them: no larger than by its vertices.
Footprint list_triangles(const InstanceTriangles& triangles, const Projected& projected,
                         const BatchVertex* vertices, const SampleGrid& grid, TriangleList& list);

/// As draw_instance, of triangles [small.first, ...) and large ones [large.first, ...) of a list.
void draw_listed(const TriangleList& list, TriangleList::Range small, TriangleList::Range large,
                 std::uint32_t first_block, bool double_sided, int tile_x, int tile_y,
                 TilePlanes& planes, TileCounters& counters);

/// As draw_instance, of an agent wholly between the near and the far plane.
void draw_shared(const SharedTriangles& triangles, const SampleGrid& grid, int tile_x, int tile_y,
                 SharedScratch& scratch, TilePlanes& planes, TileCounters& counters);

/// Renews the cells' lower bounds from the depth plane.
void update_cells(TilePlanes& planes);

/// What a 4x4 block shows.
enum class BlockKind : std::uint8_t { kEmpty, kOneTriangle, kMixed };

/// Kinds of the tile's blocks, row by row [kTileSamples / 4]^2.
void classify_blocks(const TilePlanes& planes, BlockKind* kinds);

/// True if every sample of the rectangle (tile samples, inclusive) is nearer than `depth_high`.
bool hidden(const TilePlanes& planes, int x_low, int y_low, int x_high, int y_high,
            float depth_high);

/// Name of the instruction set in use ("AVX3_ZEN4", "AVX2", ...).
const char* simd_name();

}  // namespace throng::render::visibility
