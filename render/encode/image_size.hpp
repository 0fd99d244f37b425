#pragma once

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <cstddef>
#include <cstdint>

namespace throng::render {

inline constexpr std::uint32_t kMaxSidePx = 16384;

/// InvalidArgument naming `call` unless both sides are 1..16384 px and `size_bytes` is 4 a pixel.
inline absl::Status check_image(const char* call, std::size_t size_bytes, std::uint32_t width_px,
                                std::uint32_t height_px) {
  if (width_px < 1 || width_px > kMaxSidePx || height_px < 1 || height_px > kMaxSidePx) {
    return absl::InvalidArgumentError(absl::StrCat(call, ": size is ", width_px, "x", height_px,
                                                   " px, each side must be 1 to ", kMaxSidePx));
  }
  const std::size_t expected_bytes = std::size_t{4} * width_px * height_px;
  if (size_bytes != expected_bytes) {
    return absl::InvalidArgumentError(absl::StrCat(call, ": ", size_bytes, " bytes of pixels, ",
                                                   width_px, "x", height_px, " px must have ",
                                                   expected_bytes));
  }
  return absl::OkStatus();
}

}  // namespace throng::render
