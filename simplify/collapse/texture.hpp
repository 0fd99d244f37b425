#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "simplify/rebuild/surface.hpp"

namespace throng::simplify {

/// A mip level, as far as costs look at it.
struct TextureLevel {
  std::vector<std::uint8_t> texels;  // rgba, rows from the top; empty where there is no texture
  std::uint32_t width_px = 0, height_px = 0;

  /// The four bytes at `uv`, which is clamped to the texture. Not for an empty one.
  const std::uint8_t* at(const glm::vec2& uv) const {
    const auto texel = [](float value, std::uint32_t size) {
      return static_cast<std::size_t>(
          std::clamp(value * static_cast<float>(size), 0.0F, static_cast<float>(size) - 1.0F));
    };
    return &texels[4 * (texel(uv.y, height_px) * width_px + texel(uv.x, width_px))];
  }
};

/// The mip levels of at most 128 pixels, widest first; the last one in any case. What is dyed at
/// run time (surface.tint_mask) gets one colour for tops and another for bottoms: both may be grey
/// in the file, but are not alike to the eye.
std::vector<TextureLevel> small_levels(const Surface& surface);

}  // namespace throng::simplify
