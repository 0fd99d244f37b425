#pragma once

#include <absl/container/flat_hash_map.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "simplify/import/document.hpp"
#include "simplify/import/primitive.hpp"
#include "simplify/source_character.hpp"

namespace throng::simplify::gltf {

/// A primitive's material and the texture coordinates of its corners.
struct Dressed {
  std::uint32_t material = 0;                       // into MaterialTable::materials
  std::vector<std::array<glm::vec2, 3>> corner_uv;  // [triangles]
};

/// The materials that are really used, with pictures decoded and vertex colours folded in: one
/// colour for a whole primitive goes into the factor, several become a palette picture with one
/// texel block for each (each triangle takes the mean of its corners), and on top of a texture they
/// are averaged.
class MaterialTable {
 public:
  explicit MaterialTable(const Document& document) : document_(document) {}

  absl::StatusOr<Dressed> dress(const Primitive& primitive, const PrimitiveData& data,
                                std::vector<std::string>& notes);

  std::vector<SourceMaterial> take() { return std::move(materials_); }

 private:
  absl::StatusOr<std::uint32_t> find_or_make(std::int32_t material, bool with_texture,
                                             const glm::vec4& tint,
                                             std::vector<std::string>& notes);
  absl::StatusOr<SourceImage> decode(std::uint32_t image);

  const Document& document_;
  std::vector<SourceMaterial> materials_;
  absl::flat_hash_map<std::tuple<std::int32_t, bool, std::uint32_t>, std::uint32_t> known_;
  absl::flat_hash_map<std::uint32_t, SourceImage> images_;
  std::uint64_t texels_ = 0;
};

}  // namespace throng::simplify::gltf
