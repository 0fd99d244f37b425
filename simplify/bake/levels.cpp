#include "simplify/bake/levels.hpp"

#include <algorithm>

namespace throng::simplify {

std::uint32_t level_vertices(const render::Character& character, float share) {
  const auto wanted =
      static_cast<std::uint32_t>(share * static_cast<float>(character.vertex_count()) + 0.5F);
  return character.legal_count[std::max(wanted, character.coarsest_count)];
}

LevelMesh level_mesh(const render::Character& character, std::uint32_t count) {
  LevelMesh mesh;
  mesh.count = count;
  std::vector<bool> is_used(character.vertex_count());
  for (std::uint32_t t = 0; t < character.triangle_count_at[count]; ++t) {
    glm::uvec3 corner = character.triangle[t];
    for (int k = 0; k < 3; ++k) {
      while (corner[k] >= count) corner[k] = character.collapse_target[corner[k]];
      mesh.vertices += is_used[corner[k]] ? 0 : 1;
      is_used[corner[k]] = true;
    }
    mesh.triangles.push_back(corner);
    mesh.triangle_flags.push_back(character.triangle_flags[t]);
  }
  return mesh;
}

LevelMesh level_mesh_of(const render::Character& character, std::uint32_t triangles) {
  std::uint32_t count = character.vertex_count();
  while (count > character.coarsest_count && character.triangle_count_at[count] > triangles)
    count = character.legal_count[count - 1];
  return level_mesh(character, count);
}

}  // namespace throng::simplify
