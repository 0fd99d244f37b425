#pragma once

#include <cstdint>
#include <vector>

namespace throng::render {

/// 8-bit sRGB picture, rows from the top, 4 bytes a pixel (r g b and 255).
struct Picture {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<std::uint8_t> rgbx;  // [height][width][4]
};

}  // namespace throng::render
