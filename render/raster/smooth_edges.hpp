#pragma once

#include <vector>

#include "throng/render/raster.hpp"

namespace throng::render {

class WorkPool;

/// Memory of `smooth_edges`, kept from frame to frame.
struct SmoothScratch {
  std::vector<std::uint8_t> brightness;  // [height][width]
  struct Change {
    std::uint32_t pixel;
    std::uint32_t rgbx;
  };
  std::vector<std::vector<Change>> changes;  // by chunk
};

/// Smooths the stairs of a picture drawn with one sample a pixel, in place.
///
/// Morphological, in the manner of FXAA (T. Lottes, 2009): where the four neighbours differ enough,
/// finds the edge a pixel lies at, follows it both ways, and mixes in what lies beyond the edge by
/// the share of the pixel that the edge cuts off. Flat parts are left as they are. The same bytes
/// for any number of threads.
void smooth_edges(Picture& picture, SmoothScratch& scratch, WorkPool& pool);

}  // namespace throng::render
