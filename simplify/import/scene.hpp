#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "simplify/import/document.hpp"

namespace throng::simplify::gltf {

/// The node forest of a document in the order in which transforms are multiplied.
struct Scene {
  std::vector<std::int32_t> parent;  // [nodes], kNone for a root
  std::vector<std::uint32_t> order;  // [nodes], every parent before its children
  std::vector<char> shown;           // [nodes], under a root of the scene that is shown
  std::vector<Local> rest;           // [nodes]
};

Scene make_scene(const Document& document);

/// A node's own matrix, parent_from_node.
glm::dmat4 matrix_of(const Local& local);

/// Splits a matrix node into translation, rotation and scale (shear is lost), others are kept.
Local decomposed(const Local& local);

/// root_from_node of every node [nodes] for these local transforms.
std::vector<glm::dmat4> world_of(const Scene& scene, std::span<const Local> locals);

/// Products of quaternions in glm's form.
glm::dvec4 multiply_rotations(const glm::dvec4& a, const glm::dvec4& b);
glm::dvec4 inverse_rotation(const glm::dvec4& q);

/// True when a matrix can be inverted without losing everything to rounding.
bool is_invertible(const glm::dmat4& matrix);

}  // namespace throng::simplify::gltf
