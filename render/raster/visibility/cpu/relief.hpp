#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "render/raster/scene.hpp"
#include "render/raster/visibility/cpu/tile.hpp"
#include "render/raster/visibility/element/relief.hpp"
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

using element::PlacedBox;
using element::ReliefView;
ReliefView make_relief_view(const SceneFrame& scene, const SampleGrid& grid);

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

}  // namespace throng::render::visibility
