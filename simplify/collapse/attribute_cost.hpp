#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>

#include "simplify/collapse/texture.hpp"
#include "simplify/collapse/wedges.hpp"

namespace throng::simplify {

/// What a collapse does to texture, normals and joint weights, as a distance on the surface: a cost
/// of area times squared metres, so that it adds to the position cost.
class AttributeCost {
 public:
  AttributeCost(const WedgeMesh& mesh, float size_m);

  /// Cost in m^4 of the triangle whose corner of point a moves to point b.
  /// The uv that the triangle's own mapping would have at b is compared with that of the wedge
  /// which takes the place: the difference, on the surface, is how far the texture slides. Where
  /// the move crosses a seam, the colours seen before and after are compared instead.
  float triangle_cost(std::uint32_t triangle, std::uint32_t a, std::uint32_t b,
                      const WedgeMove& move) const;

  /// True if the texture on the triangle would be mirrored by the move.
  bool mirrors(std::uint32_t triangle, std::uint32_t a, const WedgeMove& move) const;

  /// Squared metres: how much of a change of colour it is where one triangle bares another.
  float baring_cost(std::uint32_t front, std::uint32_t behind) const;

  /// Of the colours that are lost where `triangle` of point a comes to lie, by `move`, over `dying`
  /// from the other side of a seam: m^4. A stripe that is its own chart goes so.
  float covering_cost(std::uint32_t dying, std::uint32_t triangle, std::uint32_t a,
                      const WedgeMove& move) const;

  /// Squared metres: how differently the joints move two points.
  float joint_cost(std::uint32_t a, std::uint32_t b) const;

  /// sRGB from 0 to 1, of a small mip level; grey where there is no texture.
  glm::vec3 color_at(const glm::vec2& uv) const;

 private:
  float color_difference(const std::array<glm::vec2, 3>& before,
                         const std::array<glm::vec2, 3>& after) const;

  const WedgeMesh& mesh_;
  float size_m_;
  float metres_per_uv_;  // of the whole surface
  TextureLevel color_;
};

}  // namespace throng::simplify
