#include "simplify/bake/export_obj.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>

namespace throng::simplify {

std::string obj_of_level(const render::Character& character, std::uint32_t vertices) {
  const std::uint32_t wanted =
      std::clamp(vertices, character.coarsest_count, character.vertex_count());
  const std::uint32_t n = character.legal_count[wanted];
  const std::uint32_t t = character.triangle_count_at[n];
  std::string text = absl::StrFormat(
      "# %s: %u of %u vertices, %u of %u triangles; metres, z up\no %s\n", character.name, n,
      character.vertex_count(), t, character.triangle_count(), character.name);
  for (std::uint32_t i = 0; i < n; ++i) {
    const glm::vec3& p = character.position[i];
    absl::StrAppendFormat(&text, "v %.6f %.6f %.6f\n", p.x, p.y, p.z);
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const glm::vec2 uv = glm::vec2(character.uv[i]) / 65535.0F;
    absl::StrAppendFormat(&text, "vt %.6f %.6f\n", uv.x, 1.0F - uv.y);
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const glm::vec3 normal = render::decode_octahedral(character.normal[i]);
    absl::StrAppendFormat(&text, "vn %.5f %.5f %.5f\n", normal.x, normal.y, normal.z);
  }
  for (std::uint32_t k = 0; k < t; ++k) {
    glm::uvec3 corner = character.triangle[k];
    for (int i = 0; i < 3; ++i) {
      while (corner[i] >= n) corner[i] = character.collapse_target[corner[i]];
      ++corner[i];
    }
    absl::StrAppendFormat(&text, "f %u/%u/%u %u/%u/%u %u/%u/%u\n", corner.x, corner.x, corner.x,
                          corner.y, corner.y, corner.y, corner.z, corner.z, corner.z);
  }
  return text;
}

absl::Status export_obj(const render::Character& character, std::uint32_t vertices,
                        const std::string& path) {
  const std::string temporary = absl::StrCat(path, ".tmp", ::getpid());
  {
    std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
    file << obj_of_level(character, vertices);
    file.flush();
    if (!file) {
      std::remove(temporary.c_str());
      return absl::UnavailableError(absl::StrCat(path, ": can't be written"));
    }
  }
  if (std::rename(temporary.c_str(), path.c_str()) != 0) {
    std::remove(temporary.c_str());
    return absl::UnavailableError(absl::StrCat(path, ": can't be written"));
  }
  return absl::OkStatus();
}

}  // namespace throng::simplify
