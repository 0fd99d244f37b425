#include "simplify/import/normals.hpp"

#include <absl/container/flat_hash_map.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

namespace throng::simplify::gltf {
namespace {

constexpr float kCosCrease = 0.5F;         // 60 degrees
constexpr std::size_t kMaxCompared = 256;  // faces around a point beyond which all are averaged

struct Fan {
  std::uint32_t triangle = 0;
  glm::vec3 weighted{0.0F};  // face normal times the angle here
};

}  // namespace

std::vector<std::array<glm::vec3, 3>> crease_normals(
    std::span<const glm::vec3> positions, std::span<const std::array<std::uint32_t, 3>> triangles) {
  // one id for each place
  std::vector<std::uint32_t> place(positions.size());
  absl::flat_hash_map<std::tuple<float, float, float>, std::uint32_t> places;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const glm::vec3 p = positions[i] + 0.0F;  // -0 becomes 0
    place[i] = places.try_emplace({p.x, p.y, p.z}, static_cast<std::uint32_t>(places.size()))
                   .first->second;
  }

  std::vector<glm::vec3> face(triangles.size());
  std::vector<std::uint32_t> first(places.size() + 1, 0);
  for (const auto& triangle : triangles) {
    for (const std::uint32_t corner : triangle) ++first[place[corner] + 1];
  }
  for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
  std::vector<Fan> fans(triangles.size() * 3);
  std::vector<std::uint32_t> filled(first.begin(), first.end() - 1);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& triangle = triangles[t];
    const glm::vec3 normal = glm::cross(positions[triangle[1]] - positions[triangle[0]],
                                        positions[triangle[2]] - positions[triangle[0]]);
    const float length = glm::length(normal);
    face[t] = length > 0.0F && std::isfinite(length) ? normal / length : glm::vec3(0.0F);
    for (int c = 0; c < 3; ++c) {
      const glm::vec3 at = positions[triangle[c]];
      const glm::vec3 a = positions[triangle[(c + 1) % 3]] - at;
      const glm::vec3 b = positions[triangle[(c + 2) % 3]] - at;
      const float lengths = glm::length(a) * glm::length(b);
      const float angle =
          lengths > 0.0F ? std::acos(std::clamp(glm::dot(a, b) / lengths, -1.0F, 1.0F)) : 0.0F;
      fans[filled[place[triangle[c]]]++] = Fan{static_cast<std::uint32_t>(t), face[t] * angle};
    }
  }

  std::vector<std::array<glm::vec3, 3>> normals(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int c = 0; c < 3; ++c) {
      const std::uint32_t at = place[triangles[t][c]];
      const std::span<const Fan> around(fans.data() + first[at], first[at + 1] - first[at]);
      glm::vec3 sum(0.0F);
      if (around.size() > kMaxCompared) {
        // a hostile fan would take quadratic time; its first faces stand for all
        for (const Fan& fan : around.first(kMaxCompared)) sum += fan.weighted;
      } else {
        for (const Fan& fan : around) {
          if (glm::dot(face[fan.triangle], face[t]) >= kCosCrease) sum += fan.weighted;
        }
      }
      const float length = glm::length(sum);
      normals[t][c] = length > 1e-12F              ? sum / length
                      : face[t] != glm::vec3(0.0F) ? face[t]
                                                   : glm::vec3(0.0F, 1.0F, 0.0F);
    }
  }
  return normals;
}

}  // namespace throng::simplify::gltf
