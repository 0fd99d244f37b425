#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "simplify/rebuild/surface.hpp"
#include "simplify/source_character.hpp"

namespace throng::simplify {

struct Atlas {
  SourceImage base_color;
  SourceImage tint_mask;      // empty where no material has one
  std::vector<glm::vec2> uv;  // [C] in the atlas
};

/// Puts the textures of several materials into one image and moves the uvs there. The only texture
/// of a character whose uvs stay inside it is kept texel for texel.
///
/// Only the rectangle that a material's uvs use is copied; where they leave the texture, its wrap
/// mode is baked in. Around each rectangle a gutter continues it, so that filtering and the first
/// mip levels don't mix neighbours. Colours without a texture get a small cell.
/// @param wedge_uv        [C] source uv
/// @param wedge_material  [C]
/// @param triangles       [T] wedges; connected ones (a chart) are shifted by whole numbers
/// together
Atlas make_atlas(const std::vector<SourceMaterial>& materials,
                 const std::vector<glm::vec2>& wedge_uv,
                 const std::vector<std::uint32_t>& wedge_material,
                 const std::vector<glm::uvec3>& triangles, const RebuildOptions& options,
                 std::vector<std::string>& notes);

}  // namespace throng::simplify
