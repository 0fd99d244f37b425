#pragma once

#include <cstdint>

#include "render/compute/element/host_device.hpp"
#include "throng/render/tone.hpp"

namespace throng::render::element {

/// Where the tones of a level's first triangle are; three for each triangle.
/// @param n  vertices of the level, at most those of the first of `count` >= 1 bands
THRONG_HOST_DEVICE inline std::uint32_t first_tone(const ToneBand* bands, std::uint32_t count,
                                                   std::uint32_t n) {
  std::uint32_t b = 0;
  while (b + 1 < count && n <= bands[b + 1].vertex_count) ++b;
  return 3 * bands[b].first;
}

}  // namespace throng::render::element
