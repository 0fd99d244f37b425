#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <map>
#include <string>
#include <vector>

#include "simplify/import/document.hpp"

namespace throng::simplify::gltf {

/// What moves a vertex: joints of its skin, any number of them.
struct Influence {
  std::uint32_t joint = 0;  // into Skin::joints
  float weight = 0.0F;
};

/// A primitive's arrays out of accessors or Draco, in mesh space. Indices are in range, positions
/// finite, triangles are a plain list with corners that differ.
struct PrimitiveData {
  std::vector<glm::vec3> positions;                     // [N]
  std::vector<glm::vec3> normals;                       // [N] or empty
  std::map<std::uint32_t, std::vector<glm::vec2>> uvs;  // texture coordinate set to [N]
  std::vector<glm::vec4> colors;                        // [N] linear, or empty
  std::uint32_t influence_stride = 0;                   // influences of each vertex, 0: rigid
  std::vector<Influence> influences;                    // [N][influence_stride]
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::uint32_t degenerate = 0;  // triangles with a repeated corner, left out

  bool is_surface = true;  // false: points or lines, everything else is empty
};

/// @param joint_count  of the skin that the mesh is used with, 0: joints and weights are not read.
/// InvalidArgument names accessor, vertex, value and limit.
absl::StatusOr<PrimitiveData> read_primitive(const Document& document, const Primitive& primitive,
                                             std::size_t joint_count);

}  // namespace throng::simplify::gltf
