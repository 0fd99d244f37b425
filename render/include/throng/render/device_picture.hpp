#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <vector>

namespace throng::render {

/// Pixels in the memory of a device, perhaps still being drawn. Its calls wait for them, so that
/// the next frame can be begun meanwhile; they may come from any one thread at a time, also after
/// the rasterizer is gone. A drawing that went wrong is told by the first call (Internal).
struct DevicePicture {
  virtual ~DevicePicture() = default;

  /// Copies the rows to `rgbx`, through page-locked memory.
  virtual absl::Status fetch(std::vector<std::uint8_t>& rgbx) = 0;

  /// Baseline JPEG, 4:2:0, made on the device. Unimplemented where its encoder is missing: fetch
  /// the pixels then, and encode those.
  /// @param quality  1 to 100
  virtual absl::Status encode_jpeg(int quality, std::vector<std::uint8_t>& jpeg) = 0;
};

}  // namespace throng::render
