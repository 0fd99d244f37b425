#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <vector>

#include "simplify/import/binding.hpp"
#include "simplify/import/document.hpp"
#include "simplify/import/scene.hpp"
#include "simplify/source_character.hpp"

namespace throng::simplify::gltf {

/// All primitives of the scene as one mesh in the bind frame (units and axes of the file).
struct MergedMesh {
  struct Point {
    glm::vec3 position{0.0F};
    std::array<std::uint32_t, 4> binding{};  // strongest first
    std::array<float, 4> weight{1.0F, 0.0F, 0.0F, 0.0F};
    friend bool operator==(const Point&, const Point&) = default;
  };
  std::vector<Point> points;
  std::vector<glm::vec3> normals;
  std::vector<glm::vec2> uvs;
  std::vector<SourceTriangle> triangles;
  std::vector<SourceMaterial> materials;
  std::vector<Binding> bindings;
};

/// @param moves  nodes that a clip moves [nodes].
/// InvalidArgument names node, mesh, primitive and accessor.
absl::StatusOr<MergedMesh> merge_meshes(const Document& document, const Scene& scene,
                                        std::span<const char> moves,
                                        std::vector<std::string>& notes);

}  // namespace throng::simplify::gltf
