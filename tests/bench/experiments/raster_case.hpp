#pragma once

#include <cstdint>
#include <string>

#include "support/raster_scene.hpp"

namespace throng::bench {

using test::RasterScene;

/// Ellipsoids scattered over the picture, near to far (the order gl likes best).
struct RasterCase {
  std::uint32_t instances = 0;
  std::uint32_t sides = 0;  // around; rings are `rings`
  std::uint32_t rings = 0;
  float height_px = 0;

  std::uint32_t triangles() const { return 2 * sides * (rings - 1); }
  std::string name() const;
};

/// Counts and sizes that the design was measured with.
inline constexpr RasterCase kRasterCases[] = {
    {30000, 6, 8, 20},   {30000, 12, 14, 20}, {30000, 24, 26, 20}, {30000, 12, 14, 40},
    {3000, 24, 26, 100}, {3000, 48, 48, 100}, {300, 48, 48, 300}};

/// Looks along +Y, orthographic, so that every figure has exactly its height; a pixel is 1 cm.
render::Camera raster_camera(const render::Viewport& viewport);

/// The same arrays every time.
RasterScene raster_scene(const RasterCase& one, const render::Camera& camera,
                         const render::Viewport& viewport);

}  // namespace throng::bench
