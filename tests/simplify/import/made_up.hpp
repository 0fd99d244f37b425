#pragma once

#include <cstdint>
#include <cstring>
#include <glm/glm.hpp>
#include <random>
#include <string>
#include <vector>

#include "simplify/source_character.hpp"

/// Small glTF files put together in test code, and what every imported character must hold.
namespace throng::simplify::test {

/// A folder of this test program for files it writes.
std::string scratch_path(const std::string& name);
void write_file(const std::string& path, const std::vector<std::uint8_t>& bytes);
std::vector<std::uint8_t> read_bytes(const std::string& path);

/// Collects accessors and JSON pieces and writes them as .glb or .gltf.
class GltfBuilder {
 public:
  /// The values as an accessor of this type ("VEC3"); returns its number.
  template <typename T>
  int accessor(const std::vector<T>& values, const std::string& type, bool normalized = false) {
    std::vector<std::uint8_t> bytes(values.size() * sizeof(T));
    std::memcpy(bytes.data(), values.data(), bytes.size());
    return add_accessor(view(bytes), component_of(T{}), values.size(), type, normalized);
  }
  int add_accessor(int view, int component, std::size_t value_count, const std::string& type,
                   bool normalized);
  /// An accessor as JSON text.
  int raw_accessor(const std::string& json);
  /// A buffer view of these bytes; `extra` is more JSON of it (", \"byteStride\": 8").
  int view(const std::vector<std::uint8_t>& bytes, const std::string& extra = "");
  int raw_view(const std::string& json);

  /// A box from `low` to `high` with eight vertices: the JSON of its attributes and indices.
  std::string box(const glm::vec3& low, const glm::vec3& high,
                  const std::string& more_attributes = "");

  // elements of the top-level arrays, each the JSON of one
  std::vector<std::string> nodes, meshes, skins, animations, materials, textures, images, samplers;
  std::string extra;  // more top-level members, each with a comma before it

  std::string json(const std::string& buffer_uri) const;
  std::vector<std::uint8_t> glb() const;
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  static int component_of(float) { return 5126; }
  static int component_of(std::uint32_t) { return 5125; }
  static int component_of(std::uint16_t) { return 5123; }
  static int component_of(std::int16_t) { return 5122; }
  static int component_of(std::uint8_t) { return 5121; }
  static int component_of(std::int8_t) { return 5120; }

  std::vector<std::uint8_t> bytes_;
  std::vector<std::string> views_;
  std::vector<std::string> accessors_;
};

/// One mesh at one node out of a primitive's JSON members.
GltfBuilder one_mesh(GltfBuilder builder, const std::string& primitive);

/// A post of eight boxes' height on two joints, skinned, with a clip that bends the upper joint.
GltfBuilder bending_post();

/// A file with something of everything: skin, clip, picture, sparse rows, colours, a transform, a
/// strip.
GltfBuilder rich_file();

/// Damages one to four bytes; digits of the JSON in [json_begin, json_end) more often than others.
void mutate(std::vector<std::uint8_t>& bytes, std::size_t json_begin, std::size_t json_end,
            std::mt19937& random);

/// Where the JSON of a .glb ends; it begins at 20.
std::size_t json_end_of(const std::vector<std::uint8_t>& glb);

/// Encoded pictures of `width` x `height` texels in one colour, or with a transparent left half.
std::vector<std::uint8_t> png(int width, int height, const glm::u8vec4& color,
                              bool half_clear = false);
std::vector<std::uint8_t> jpeg(int width, int height, const glm::u8vec4& color);

/// Skinned positions of a clip's frame in the model frame.
std::vector<glm::vec3> posed(const SourceCharacter& character, const SourceClip& clip,
                             std::uint32_t frame);

struct Extent {
  glm::vec3 low{1e30F};
  glm::vec3 high{-1e30F};
  glm::vec3 size() const { return high - low; }
};
Extent extent_of(const std::vector<glm::vec3>& points);
Extent extent_of(const SourceCharacter& character);

/// What is wrong with a character that an importer returned, empty when nothing is.
std::string fault_of(const SourceCharacter& character);

}  // namespace throng::simplify::test
