#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "render/compute/cpu/work_pool.hpp"
#include "render/raster/scene.hpp"
#include "render/raster/visibility/cpu/bins.hpp"
#include "render/raster/visibility/cpu/shade.hpp"
#include "render/raster/visibility/cpu/tile.hpp"
#include "render/raster/visibility/element/splat.hpp"
#include "throng/render/vertex.hpp"

namespace throng::render::visibility {

/// Points of a frame on the way to the visibility buffer: placed, listed by tile, drawn as words of
/// class point whose lower 30 bits number the splat. The picture does not depend on their order.
class SplatStage {
 public:
  /// Places all splats and lists them by tile. What faces away is left out unless its radius is
  /// negative (a splat without a side).
  /// ResourceExhausted is the caller's to check: at most kMostSplats.
  void place(std::span<const Splat> splats, const SampleGrid& grid, const SceneFrame& scene,
             const glm::mat3& view_from_relative, std::uint32_t tiles_x, std::uint32_t tiles_y,
             WorkPool& pool);
  void clear() { bins_.clear(); }

  bool any(std::size_t tile) const { return bins_.any(tile); }

  /// Draws a tile's splats whose top left sample is (tile_x, tile_y).
  void draw(std::size_t tile, int tile_x, int tile_y, TilePlanes& planes) const;

  /// An item for every pixel and splat seen in it.
  /// @param instances  V: the number that splats of nobody take.
  static void collect(const TilePlanes& planes, std::span<const Splat> splats,
                      const SceneFrame& scene, int width, int height, std::uint32_t instances,
                      SurfaceItems& items);

  /// Which splat a word of class point shows.
  static std::uint32_t number_of(std::uint32_t id) { return id & element::kSplatNumber; }

  std::uint64_t size_bytes() const {
    return placed_.capacity() * sizeof(element::PlacedSplat) + bins_.size_bytes();
  }

 private:
  std::vector<element::PlacedSplat> placed_;
  Bins<std::uint32_t> bins_;
};

}  // namespace throng::render::visibility
