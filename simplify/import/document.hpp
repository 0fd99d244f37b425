#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "simplify/import/file.hpp"

/// The parts of a glTF 2.0 file that a character needs, read and checked for shape. Indices to
/// other elements are checked here too, accessors against their views where they are read.
namespace throng::simplify::gltf {

inline constexpr std::int32_t kNone = -1;

struct BufferView {
  std::uint32_t buffer = 0;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::uint32_t stride = 0;  // 0: tightly packed
};

struct SparsePart {
  std::uint64_t count = 0;
  std::int32_t index_view = kNone;
  std::uint64_t index_offset = 0;
  std::uint32_t index_component = 0;
  std::int32_t value_view = kNone;
  std::uint64_t value_offset = 0;
};

struct Accessor {
  std::int32_t view = kNone;  // kNone: zeros, or filled by an extension
  std::uint64_t offset = 0;
  std::uint32_t component = 0;   // 5120 byte ... 5126 float
  std::uint32_t components = 0;  // 1 to 4, 16 for a 4x4 matrix
  bool normalized = false;
  std::uint64_t count = 0;
  SparsePart sparse;
};

struct DracoPart {
  std::uint32_t view = 0;
  std::map<std::string, std::uint32_t> ids;  // attribute name to Draco's unique id
};

struct Primitive {
  std::map<std::string, std::uint32_t> attributes;  // name to accessor
  std::int32_t indices = kNone;
  std::int32_t material = kNone;
  std::uint32_t mode = 4;
  std::uint32_t morph_targets = 0;
  std::optional<DracoPart> draco;
};

struct Mesh {
  std::string name;
  std::vector<Primitive> primitives;
};

/// A node's transform as it is kept: a matrix, or translation, rotation and scale.
struct Local {
  bool is_matrix = false;
  glm::dmat4 matrix{1.0};
  glm::dvec3 translation{0.0};
  glm::dvec4 rotation{0.0, 0.0, 0.0, 1.0};  // x y z w
  glm::dvec3 scale{1.0};
};

struct Node {
  std::string name;
  Local local;
  std::vector<std::uint32_t> children;
  std::int32_t mesh = kNone;
  std::int32_t skin = kNone;
};

struct Skin {
  std::string name;
  std::vector<std::uint32_t> joints;  // nodes
  std::int32_t inverse_bind = kNone;  // accessor
};

struct TextureRef {
  std::int32_t texture = kNone;
  std::uint32_t uv_set = 0;
  glm::dvec2 offset{0.0};
  double rotation_rad = 0.0;
  glm::dvec2 scale{1.0};
};

enum class AlphaMode { kOpaque, kMask, kBlend };

struct Material {
  std::string name;
  glm::dvec4 factor{1.0};
  TextureRef base_color;
  glm::dvec3 emissive{0.0};
  TextureRef emissive_texture;
  AlphaMode alpha = AlphaMode::kOpaque;
  double alpha_cutoff = 0.5;
  bool double_sided = false;
};

struct Texture {
  std::int32_t source = kNone;
  std::int32_t sampler = kNone;
  std::string unsupported;  // the extension that holds the picture, when nothing else does
};

struct Sampler {
  std::uint32_t wrap_s = 10497;
  std::uint32_t wrap_t = 10497;
};

struct Image {
  std::string uri;
  std::int32_t view = kNone;
};

struct AnimationChannel {
  std::uint32_t sampler = 0;
  std::int32_t node = kNone;
  std::string path;
};

struct AnimationSampler {
  std::uint32_t input = 0;
  std::uint32_t output = 0;
  std::string interpolation;
};

struct Animation {
  std::string name;
  std::vector<AnimationChannel> channels;
  std::vector<AnimationSampler> samplers;
};

struct Document {
  std::string path;
  std::string folder;
  std::vector<Bytes> buffers;
  std::vector<BufferView> views;
  std::vector<Accessor> accessors;
  std::vector<Mesh> meshes;
  std::vector<Node> nodes;
  std::vector<Skin> skins;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<Sampler> samplers;
  std::vector<Image> images;
  std::vector<Animation> animations;
  std::vector<std::uint32_t> roots;  // of the scene that is shown
  std::vector<std::string> notes;

  std::span<const std::uint8_t> bytes(const BufferView& view) const {
    return std::span(buffers[view.buffer]).subspan(view.offset, view.length);
  }
};

/// Reads a file that is in memory, and everything it refers to except images, which is relative to
/// `path`. Errors name the element, without the file.
absl::StatusOr<Document> read_document(std::span<const std::uint8_t> file, const std::string& path);

}  // namespace throng::simplify::gltf
