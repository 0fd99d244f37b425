#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace throng::simplify::gltf {

/// Normals for every corner of every triangle [T]: the mean of the faces around the point, weighted
/// by their angle there (Thürmer & Wüthrich 1998), of those that turn less than 60 degrees away
/// from the corner's own face. Points at the same place are one point, so that seams don't show.
std::vector<std::array<glm::vec3, 3>> crease_normals(
    std::span<const glm::vec3> positions, std::span<const std::array<std::uint32_t, 3>> triangles);

}  // namespace throng::simplify::gltf
