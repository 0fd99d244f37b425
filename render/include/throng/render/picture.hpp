#pragma once

#include <cstdint>
#include <memory>
#include <vector>

namespace throng::render {

struct DevicePicture;  // device_picture.hpp

/// 8-bit sRGB picture, rows from the top, 4 bytes a pixel (r g b and 255).
struct Picture {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<std::uint8_t> rgbx;  // [height][width][4]
  // Set by who can take the pixels from a device: a rasterizer that has one then returns while they
  // are still being drawn, leaves them in `on_device` and nothing in `rgbx`.
  bool may_stay = false;
  std::shared_ptr<DevicePicture> on_device = nullptr;
};

}  // namespace throng::render
