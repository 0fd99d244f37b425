#pragma once

#include <array>
#include <vector>

#include "simplify/builtin/mesh.hpp"

namespace throng::builtin {

/// Texture coordinates of a triangle mesh: one per wedge.
struct Unwrap {
  std::vector<glm::vec2> uv;               // [W] in [0, 1], (0, 0) top left
  std::vector<std::array<int, 3>> corner;  // [T] into uv
};

/// Opens charts that are not discs: the shortest path between two borders becomes a seam.
void cut_to_discs(Mesh& mesh);

/// Number of wedges that the seams of `mesh` make.
int count_wedges(const Mesh& mesh);

/// Extends `slits` into their charts, one edge at a time, until the mesh has `wedge_count` wedges.
/// The charts lie flat without them, so they open by about a texel only.
void add_slits(Mesh& mesh, const std::vector<std::vector<int>>& slits, int wedge_count);

/// Flattens every chart (Tutte 1963, then as-rigid-as-possible after Liu et al. 2008, every step
/// shortened so that no triangle flips) and packs the charts. `density` scales a chart's texels
/// per metre by its number.
Unwrap unwrap(const Mesh& mesh, const std::vector<glm::vec3>& position,
              const std::vector<float>& density);

}  // namespace throng::builtin
