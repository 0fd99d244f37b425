#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "render/compute/cpu/work_pool.hpp"
#include "render/raster/scene.hpp"
#include "render/raster/visibility/cpu/bins.hpp"
#include "render/raster/visibility/cpu/tile.hpp"
#include "render/raster/visibility/element/speck.hpp"
#include "throng/render/compute.hpp"

namespace throng::render::visibility {

using element::PlacedSpeck;
static_assert(element::kSpeckTilePx == kTilePx);

/// What specks see of the frame; the same in all tiles.
struct SpeckScene {
  const SceneFrame* scene;
  const SampleGrid* grid;
  glm::vec3 camera_up;
  float detail;  // FrameGeometry::speck_detail
  element::ChannelRange range;
};

/// A tile's specks over its figures: r g b of what they show, and how much they leave of what is
/// behind them.
struct SpeckTile {
  alignas(64) float rgb[kTilePx * kTilePx][4];
  alignas(64) float through[kTileSamples * kTileSamples];  // by sample, in the order of TilePlanes
};

/// Of one worker: a tile's specks near to far.
struct SpeckScratch {
  std::vector<std::uint64_t> order;
  std::vector<PlacedSpeck> placed;

  std::uint64_t size_bytes() const {
    return order.capacity() * sizeof(std::uint64_t) + placed.capacity() * sizeof(PlacedSpeck);
  }
};

/// Specks of a frame: placed, listed by tile, blended front to back by the share of each pixel that
/// they cover. Two that meet in a pixel are taken to lie in it at random. Of two that are about
/// equally far the first of the list comes first.
class SpeckStage {
 public:
  void place(const FrameGeometry& geometry, const SpeckScene& scene, std::uint32_t tiles_x,
             std::uint32_t tiles_y, WorkPool& pool);
  void clear() { bins_.clear(); }

  bool any(std::size_t tile) const { return bins_.any(tile); }

  /// Blends a tile's specks whose top left pixel is (x_px, y_px).
  /// @param planes  what is drawn already; null: nothing.
  void draw(std::size_t tile, int x_px, int y_px, const FrameGeometry& geometry,
            const SpeckScene& scene, const TilePlanes* planes, SpeckScratch& scratch,
            SpeckTile& result) const;

  /// Raises `missing` [kTilePx]^2, share of light that is missing on the ground, by their shadows.
  void shade(std::size_t tile, int x_px, int y_px, const FrameGeometry& geometry,
             SpeckScratch& scratch, float* missing) const;

  std::uint64_t size_bytes() const {
    return placed_.capacity() * sizeof(PlacedSpeck) +
           lights_.capacity() * sizeof(element::SpeckLight) + bins_.size_bytes();
  }

 private:
  void gather(std::span<const std::uint64_t> entries, std::vector<PlacedSpeck>& placed) const;

  std::vector<PlacedSpeck> placed_;
  std::vector<element::SpeckLight> lights_;  // by tile, where specks are
  Bins<std::uint64_t> bins_;                 // depth and number: rising is near to far
};

}  // namespace throng::render::visibility
