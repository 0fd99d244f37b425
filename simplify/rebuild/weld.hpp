#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "simplify/rebuild/surface.hpp"
#include "simplify/source_character.hpp"

namespace throng::simplify {

/// For each source point the point that it is welded to, itself or an earlier one. Points nearer
/// than `distance_m` are one if what moves them is the same within rounding.
std::vector<std::uint32_t> weld_points(const std::vector<SourcePoint>& points, float distance_m);

/// Splits points so that the triangles become an oriented manifold with border: half-edges of
/// opposite direction are glued in pairs, and a point is what glued corners share.
/// @param corner  [T] point of each corner, no two equal in a triangle
/// @param side    [T][3] tells wedges apart; where an edge has several partners, one that continues
///                both sides is preferred, then the flattest
/// @param position  [P]
/// @return [T] new point of each corner; `origin` receives the old point of each new one
std::vector<glm::uvec3> make_manifold(const std::vector<glm::uvec3>& corner,
                                      const std::vector<glm::uvec3>& side,
                                      const std::vector<glm::vec3>& position,
                                      std::vector<std::uint32_t>& origin);

}  // namespace throng::simplify
