#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "render/raster/scene.hpp"
#include "render/raster/visibility/cpu/tile.hpp"
#include "throng/render/compute.hpp"
#include "throng/render/relief.hpp"

namespace throng::render::visibility {

/// The relief impostors of a cast in one array for each kind.
struct ReliefStore {
  struct Member {
    std::uint32_t first_box = 0, box_count = 0;  // none: has no impostor
  };
  std::vector<Member> members;   // by character
  std::vector<ReliefBox> boxes;  // their faces count in what follows
  std::vector<std::uint32_t> shape;
  std::vector<std::uint32_t> base;  // element::pack_color
  std::vector<std::uint32_t> regions;
};

/// ResourceExhausted beyond 2^31 texels.
/// @param store  of a cast whose first `kept` members are those of this one and who alone had
///               impostors: theirs are kept
absl::StatusOr<ReliefStore> make_relief_store(const Cast& cast, ReliefStore store = {},
                                              std::size_t kept = 0);

/// The rays of one frame by samples, and what depth they have t along them:
/// (z0 + z1 t) / (w0 + w1 t).
struct ReliefView {
  glm::vec3 origin, origin_x, origin_y, direction, direction_x, direction_y;
  float z0, z1, w0, w1;
  float px_per_tangent;
  bool orthographic;
};
ReliefView make_relief_view(const SceneFrame& scene, const SampleGrid& grid);

/// A box where it stands in this frame. One cache line.
struct alignas(64) PlacedBox {
  glm::vec4 box_from_relative[3];              // rows
  std::uint16_t x_low, y_low, x_high, y_high;  // samples, inclusive; x_low > x_high: nothing
  float depth_high;
  float px_per_m;
};
static_assert(sizeof(PlacedBox) == 64);

/// Places an agent's boxes; returns the footprint of them all. What crosses the near plane covers
/// the whole picture.
Footprint place_boxes(const ReliefStore& store, const ReliefStore::Member& member,
                      const VisibleInstance& instance, const JointedInstance& jointed,
                      const float* joints, const ReliefView& view, const SampleGrid& grid,
                      PlacedBox* placed);

/// Draws the boxes over the samples of a tile: a linear search along each ray, then a binary one
/// (Policarpo et al. 2005), for the first place between front and back depth as the face shows them
/// through which the ray enters. `texels` [kTileSamples^2], in the order of the planes, is set to
/// what was hit where an impostor is the nearest.
void draw_relief(const ReliefStore& store, const ReliefStore::Member& member,
                 const PlacedBox* placed, std::uint32_t first_block, const ReliefView& view,
                 const ReliefSearch& search, int tile_x, int tile_y, TilePlanes& planes,
                 std::uint32_t* texels, TileCounters& counters);

/// A place of an impostor's surface as it is shaded.
struct ReliefHit {
  glm::vec3 relative;  // metres, relative to the eye
  glm::vec3 normal;    // world axes, of any length
};
ReliefHit relief_hit(const ReliefStore& store, const ReliefBox& box, std::uint32_t texel,
                     const VisibleInstance& instance, const JointedInstance& jointed,
                     const float* joints, const ReliefView& view, int sample_x, int sample_y,
                     float depth);

}  // namespace throng::render::visibility
