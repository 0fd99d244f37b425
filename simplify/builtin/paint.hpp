#pragma once

#include <vector>

#include "simplify/builtin/body.hpp"
#include "simplify/builtin/unwrap.hpp"
#include "simplify/source_character.hpp"

namespace throng::builtin {

inline constexpr std::uint32_t kTextureSize = 2048;
inline constexpr std::uint32_t kMaskSize = 1024;

/// Share of the sky that each vertex sees in the bind pose, [V] in [0, 1].
std::vector<float> sky_visibility(const Mesh& mesh, const std::vector<glm::vec3>& position,
                                  const std::vector<glm::vec3>& normal);

/// Paints base colour and tint mask texel by texel from the canonical position, the normal and the
/// region of the surface; texels between charts take the colour of their neighbours.
void paint(const Figure& figure, const Mesh& mesh, const std::vector<glm::vec3>& normal,
           const std::vector<float>& sky, const Unwrap& layout, simplify::SourceMaterial& material);

}  // namespace throng::builtin
