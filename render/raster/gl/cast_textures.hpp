#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::render::gl {

/// All images of a cast at one size, as a texture array wants them. Level after level, and in each
/// level layer after layer; rows from the top, r g b a.
struct TextureLayers {
  std::uint32_t width_px = 0, height_px = 0, level_count = 0, layer_count = 0;
  std::vector<std::vector<std::uint8_t>> levels;
};

/// Images brought to the smallest power-of-two size that holds the largest, at most `limit_px` a
/// side and 256 MiB in all. Images that have that size keep their baked mip levels; others are
/// resampled bilinearly, in linear light when `srgb`. An empty image becomes a layer of `missing`
/// (r g b a). InvalidArgument when an image has fewer texels than its levels need.
absl::StatusOr<TextureLayers> make_texture_layers(const std::vector<const MipImage*>& images,
                                                  bool srgb, std::uint32_t missing,
                                                  std::uint32_t limit_px);

}  // namespace throng::render::gl
