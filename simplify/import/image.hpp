#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>

#include "simplify/source_character.hpp"

namespace throng::simplify::gltf {

/// Decodes PNG or JPEG to 8-bit RGBA. InvalidArgument for another format, damage, or a size over
/// the limits.
absl::StatusOr<SourceImage> decode_image(std::span<const std::uint8_t> bytes);

}  // namespace throng::simplify::gltf
