#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>

#include "render/raster/visibility/element/coverage.hpp"

namespace throng::render::element {

/// The base colour of a character with cut-out triangles: texels with alpha under 128 are holes.
struct Cutout {
  const std::uint8_t* flags;    // Character::triangle_flags
  const std::uint32_t* texels;  // all mip levels, one after the other
  std::int32_t width_px, height_px, levels;
};

/// One mip level.
struct CutoutLevel {
  const std::uint32_t* texels;
  std::int32_t width, height;
};

/// The mip level where a texel is about a sample.
/// @param area  of the triangle, doubled, sub-units squared.
THRONG_HOST_DEVICE inline CutoutLevel cutout_level(const Cutout& cutout, const glm::vec2 uv[3],
                                                   std::int64_t area) {
  const float texels = std::fabs((uv[1].x - uv[0].x) * (uv[2].y - uv[0].y) -
                                 (uv[2].x - uv[0].x) * (uv[1].y - uv[0].y)) *
                       static_cast<float>(cutout.width_px) * static_cast<float>(cutout.height_px);
  float samples = static_cast<float>(area) / (kSubUnit * kSubUnit);
  CutoutLevel level{cutout.texels, cutout.width_px, cutout.height_px};
  for (std::int32_t i = 1; i < cutout.levels && samples * 4.0F <= texels; ++i, samples *= 4.0F) {
    level.texels += static_cast<std::size_t>(level.width) * static_cast<std::size_t>(level.height);
    level.width = level.width > 1 ? level.width >> 1 : 1;
    level.height = level.height > 1 ? level.height >> 1 : 1;
  }
  return level;
}

/// False where a sample lies in a hole.
/// @param e  edge functions opposite to the corners, at the sample.
THRONG_HOST_DEVICE inline bool cutout_covers(const CutoutLevel& level, const glm::vec2 uv[3],
                                             const std::int32_t e[3], const float inverse_w[3]) {
  float share[3], sum = 0.0F;
  for (int k = 0; k < 3; ++k) {
    share[k] = (static_cast<float>(e[k]) + 0.5F) * inverse_w[k];  // perspective-correct
    sum += share[k];
  }
  const glm::vec2 place = (uv[0] * share[0] + uv[1] * share[1] + uv[2] * share[2]) / sum;
  const auto texel = [](float c, std::int32_t size) {
    const auto whole = static_cast<std::int32_t>(c * static_cast<float>(size));
    return whole < 0 ? 0 : (whole < size ? whole : size - 1);
  };
  const std::uint32_t color = level.texels[static_cast<std::size_t>(texel(place.y, level.height)) *
                                               static_cast<std::size_t>(level.width) +
                                           static_cast<std::size_t>(texel(place.x, level.width))];
  return (color >> 24) >= 128U;
}

}  // namespace throng::render::element
