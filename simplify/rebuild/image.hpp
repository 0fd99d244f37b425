#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "simplify/rebuild/surface.hpp"
#include "simplify/source_character.hpp"

namespace throng::simplify {

float linear_from_srgb(std::uint8_t value);
std::uint8_t srgb_from_linear(float value);

/// A texel of `image` at whole coordinates, which may lie outside: wrapped as the material says.
glm::u8vec4 wrapped_texel(const SourceImage& image, Wrap wrap_u, Wrap wrap_v, std::int64_t x,
                          std::int64_t y);

/// Box-filtered copy; colour is averaged in linear light where `is_srgb`.
SourceImage resize(const SourceImage& image, std::uint32_t width_px, std::uint32_t height_px,
                   bool is_srgb);

/// All mip levels of an image. Only texels under a triangle count (and those next to one): the rest
/// takes the colour of what is used nearby, so that no background bleeds over a seam when a mesh is
/// far away or a level of detail reaches over a chart's border.
/// @param triangle_uv  three corners for each triangle, 0 to 1
MipChain make_mips(const SourceImage& image, std::span<const glm::vec2> triangle_uv, bool is_srgb);

}  // namespace throng::simplify
