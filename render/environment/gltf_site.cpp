#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/environment/pieces.hpp"
#include "render/environment/site_texture.hpp"
#include "throng/render/environment.hpp"

/// A site as a glTF 2.0 mesh at rest: triangles of the default scene, each in one colour of its
/// material.
namespace throng::render {
namespace {

using nlohmann::json;

constexpr std::size_t kMostBytes = 256u << 20;
constexpr std::size_t kMostTriangles = 2'000'000;
constexpr double kLeastArea = 1e-12;  // m^2, twice a triangle's
constexpr double kFarthestM = 1e7;
constexpr int kDeepest = 64;
constexpr std::size_t kMostNodes = 100'000;
constexpr double kTexelM = 1.0;                 // textured triangles are cut to this
constexpr std::size_t kMostDetailed = 500'000;  // as long as there are no more than these
// Above the ground plane, or a floor at z = 0 would flicker through it.
constexpr double kLiftM = 0.01;

absl::Status wrong(const std::string& message) {
  return absl::InvalidArgumentError(absl::StrCat("glTF: ", message));
}

struct Material {
  glm::dvec3 factor{1.0};  // linear
  std::shared_ptr<const SiteTexture> texture;
  std::size_t uv_set = 0;
};

/// A reader that believes nothing: each access is checked, the first error stays.
class Site {
 public:
  Site(std::string folder, const glm::dvec3& origin_world)
      : folder_(std::move(folder)), origin_(origin_world) {}

  absl::StatusOr<std::shared_ptr<const Environment>> read(const std::string& bytes) {
    if (absl::Status s = parse(bytes); !s.ok()) return s;
    if (absl::Status s = load_buffers(); !s.ok()) return s;
    load_materials();
    if (absl::Status s = place_nodes(); !s.ok()) return s;
    const json* scenes = list("scenes");
    const std::size_t scene = index_of(document_, "scene").value_or(0);
    if (scenes == nullptr || scene >= scenes->size()) return wrong("it has no scene");
    const json* roots = member((*scenes)[scene], "nodes");
    if (roots == nullptr || !roots->is_array()) return wrong("its scene has no nodes");
    for (const json& root : *roots) {
      if (absl::Status s = add_node(root); !s.ok()) return s;
    }
    if (triangles_.empty()) return wrong("its scene has no triangles");
    for (const Triangle& t : triangles_) {
      const glm::dvec3 normal = glm::cross(t.corner[1] - t.corner[0], t.corner[2] - t.corner[0]);
      piece_at(pieces_, glm::dvec2((t.corner[0] + t.corner[1] + t.corner[2]) / 3.0))
          .add(glm::vec3(t.corner[0]), glm::vec3(t.corner[1]), glm::vec3(t.corner[2]),
               glm::vec3(glm::normalize(normal)), color_u(t.color, palette_.colors().size()));
      if (pieces_.size() > kMostSquares) {
        return wrong(absl::StrCat("it is in over ", kMostSquares, " squares of ", kPieceM, " m"));
      }
    }
    return finish(pieces_, palette_.colors(), kTriangleDoubleSided, "glTF: its triangles");
  }

 private:
  static const json* member(const json& object, const char* key) {
    if (!object.is_object()) return nullptr;
    const auto found = object.find(key);
    return found != object.end() ? &*found : nullptr;
  }
  const json* list(const char* key) const {
    const json* found = member(document_, key);
    return found != nullptr && found->is_array() ? found : nullptr;
  }
  static std::optional<std::size_t> index_of(const json& object, const char* key) {
    const json* found = member(object, key);
    if (found == nullptr || !found->is_number_unsigned()) return std::nullopt;
    return found->get<std::size_t>();
  }
  /// Item `index` of a list of the document.
  const json* item(const char* key, std::optional<std::size_t> index) const {
    const json* all = list(key);
    return all != nullptr && index && *index < all->size() ? &(*all)[*index] : nullptr;
  }

  absl::Status parse(const std::string& bytes) {
    std::string_view text = bytes;
    if (bytes.compare(0, 4, "glTF") == 0) {
      // header of 12 bytes, then chunks: length, type, data
      const auto word = [&](std::size_t at) {
        std::uint32_t value = 0;
        std::memcpy(&value, bytes.data() + at, 4);
        return std::size_t{value};
      };
      if (bytes.size() < 20 || word(4) != 2) return wrong("its binary form is not version 2");
      const std::size_t json_size = word(12);
      if (word(16) != 0x4E4F534A || json_size > bytes.size() - 20) {
        return wrong("its first chunk is not complete JSON");
      }
      text = std::string_view(bytes).substr(20, json_size);
      const std::size_t next = 20 + json_size;
      if (next + 8 <= bytes.size() && word(next + 4) == 0x004E4942) {
        binary_ = bytes.substr(next + 8, std::min(word(next), bytes.size() - next - 8));
      }
    }
    document_ = json::parse(text.begin(), text.end(), nullptr, false);
    if (!document_.is_object()) return wrong("its JSON is broken");
    if (const json* required = list("extensionsRequired"); required != nullptr) {
      for (const json& name : *required) {
        if (name == "KHR_materials_unlit" || name == "KHR_texture_transform") continue;
        return wrong(absl::StrCat("it requires ", name.is_string() ? name.get<std::string>() : "?",
                                  ", which is not read; export without it"));
      }
    }
    return absl::OkStatus();
  }

  /// What a uri holds: base64 in it, or a file beside this one.
  absl::StatusOr<std::string> bytes_of(const json& uri, const char* what) const {
    if (!uri.is_string()) return wrong(absl::StrCat(what, "'s uri is no text"));
    const std::string& text = uri.get_ref<const std::string&>();
    if (absl::StartsWith(text, "data:")) {
      const std::size_t comma = text.find(',');
      std::string decoded;
      if (comma == std::string::npos ||
          !absl::StrContains(absl::string_view(text).substr(0, comma), ";base64") ||
          !absl::Base64Unescape(absl::string_view(text).substr(comma + 1), &decoded)) {
        return wrong(absl::StrCat(what, "'s data is not base64"));
      }
      return decoded;
    }
    const std::filesystem::path name(text);
    if (name.is_absolute() || absl::StrContains(text, "..") || absl::StrContains(text, ":")) {
      return wrong(
          absl::StrCat(what, " is in '", text.substr(0, 80), "', must be beside the file"));
    }
    std::ifstream file(std::filesystem::path(folder_) / name, std::ios::binary | std::ios::ate);
    if (!file || static_cast<std::size_t>(file.tellg()) > kMostBytes) {
      return wrong(absl::StrCat(what, " ", text.substr(0, 80), " can't be read"));
    }
    std::string data(static_cast<std::size_t>(file.tellg()), '\0');
    file.seekg(0).read(data.data(), static_cast<std::streamsize>(data.size()));
    return data;
  }

  absl::Status load_buffers() {
    const json* all = list("buffers");
    for (std::size_t i = 0; all != nullptr && i < all->size(); ++i) {
      const json* uri = member((*all)[i], "uri");
      if (uri == nullptr) {
        buffers_.push_back(i == 0 ? std::move(binary_) : std::string());
        continue;
      }
      absl::StatusOr<std::string> data = bytes_of(*uri, "a buffer");
      if (!data.ok()) return data.status();
      buffers_.push_back(*std::move(data));
    }
    return absl::OkStatus();
  }

  void load_materials() {
    const json* all = list("materials");
    for (std::size_t i = 0; all != nullptr && i < all->size(); ++i) {
      Material& material = materials_.emplace_back();
      const json* metallic = member((*all)[i], "pbrMetallicRoughness");
      if (metallic == nullptr) continue;
      const json* factor = member(*metallic, "baseColorFactor");
      for (int c = 0; factor != nullptr && factor->is_array() && c < 3; ++c) {
        const auto at = static_cast<std::size_t>(c);
        if (at < factor->size() && (*factor)[at].is_number()) {
          material.factor[c] = std::clamp((*factor)[at].get<double>(), 0.0, 1.0);
        }
      }
      const json* texture = member(*metallic, "baseColorTexture");
      if (texture == nullptr) continue;
      material.uv_set = index_of(*texture, "texCoord").value_or(0);
      const json* source = item("textures", index_of(*texture, "index"));
      const auto image = source != nullptr ? index_of(*source, "source") : std::nullopt;
      if (image.has_value()) material.texture = texture_of(*image);
    }
  }

  /// None: its kind is not read, or it is broken; then the factor alone is shown.
  std::shared_ptr<const SiteTexture> texture_of(std::size_t index) {
    if (const auto known = textures_.find(index); known != textures_.end()) return known->second;
    std::shared_ptr<const SiteTexture>& texture = textures_[index];
    const json* image = item("images", index);
    if (image == nullptr) return nullptr;
    std::string bytes;
    if (const json* uri = member(*image, "uri"); uri != nullptr) {
      auto data = bytes_of(*uri, "an image");
      if (data.ok()) bytes = *std::move(data);
    } else if (const json* view = item("bufferViews", index_of(*image, "bufferView"))) {
      const std::size_t buffer = index_of(*view, "buffer").value_or(buffers_.size());
      const std::size_t from = index_of(*view, "byteOffset").value_or(0);
      const std::size_t size = index_of(*view, "byteLength").value_or(0);
      if (buffer < buffers_.size() && from <= buffers_[buffer].size() &&
          size <= buffers_[buffer].size() - from) {
        bytes = buffers_[buffer].substr(from, size);
      }
    }
    texture = SiteTexture::decode(bytes);
    return texture;
  }

  /// Where every node is at rest, without its animations.
  absl::Status place_nodes() {
    const json* all = list("nodes");
    const std::size_t count = all != nullptr ? all->size() : 0;
    if (count > kMostNodes) return wrong(absl::StrCat("it has over ", kMostNodes, " nodes"));
    std::vector<std::size_t> parent(count, count);
    for (std::size_t i = 0; i < count; ++i) {
      const json* children = member((*all)[i], "children");
      for (std::size_t k = 0; children != nullptr && children->is_array() && k < children->size();
           ++k) {
        if (!(*children)[k].is_number_unsigned()) return wrong("a node's number is none");
        const auto child = (*children)[k].get<std::size_t>();
        if (child >= count) return wrong("a node is missing");
        if (parent[child] != count) return wrong("a node has two parents");
        parent[child] = i;
      }
    }
    // glTF is +Y up; throng +Z.
    glm::dmat4 world_from_scene(0.0);
    world_from_scene[0][0] = world_from_scene[1][2] = world_from_scene[3][3] = 1.0;
    world_from_scene[2][1] = -1.0;
    for (std::size_t i = 0; i < count; ++i) {
      glm::dmat4 placed = local_of((*all)[i]);
      int depth = 0;
      for (std::size_t up = parent[i]; up != count; up = parent[up]) {
        if (++depth > kDeepest) return wrong("its nodes are nested too deep");
        placed = local_of((*all)[up]) * placed;
      }
      world_from_node_.push_back(world_from_scene * placed);
    }
    return absl::OkStatus();
  }

  enum class Kind { kIndex, kPosition, kUv, kJoint, kWeight, kMatrix };

  /// Numbers of an accessor, row by row.
  absl::Status numbers(std::optional<std::size_t> index, Kind kind,
                       std::vector<double>& out) const {
    struct Shape {
      const char *name, *type;
      std::size_t width;
      bool floats, integers, words, is_normalized;  // 32-bit integers are `words`
    };
    static constexpr Shape kShapes[] = {
        {"indices", "SCALAR", 1, false, true, true, false},
        {"POSITION", "VEC3", 3, true, false, false, false},
        {"TEXCOORD", "VEC2", 2, true, true, false, true},
        {"JOINTS_0", "VEC4", 4, false, true, false, false},
        {"WEIGHTS_0", "VEC4", 4, true, true, false, true},
        {"inverseBindMatrices", "MAT4", 16, true, false, false, false}};
    const Shape& shape = kShapes[static_cast<std::size_t>(kind)];
    const std::size_t width = shape.width;
    const json* accessor = item("accessors", index);
    if (accessor == nullptr) return wrong("an accessor is missing");
    if (member(*accessor, "sparse") != nullptr) return wrong("sparse accessors are not read");
    const std::size_t type = index_of(*accessor, "componentType").value_or(0);
    const std::size_t size = type == 5126 || type == 5125 ? 4 : type == 5123 ? 2 : 1;
    const bool is_known = (shape.floats && type == 5126) || (shape.words && type == 5125) ||
                          (shape.integers && (type == 5121 || type == 5123));
    const json* named = member(*accessor, "type");
    if (!is_known || named == nullptr || *named != shape.type) {
      return wrong(absl::StrCat(shape.name, " of component type ", type, " or of an odd shape"));
    }
    const double unit = !shape.is_normalized || size == 4 ? 1.0 : size == 2 ? 65535.0 : 255.0;
    const json* view = item("bufferViews", index_of(*accessor, "bufferView"));
    if (view == nullptr) return wrong("an accessor has no buffer view");
    const std::size_t buffer = index_of(*view, "buffer").value_or(buffers_.size());
    if (buffer >= buffers_.size()) return wrong("a buffer view has no buffer");
    const std::string& data = buffers_[buffer];
    const std::size_t count = index_of(*accessor, "count").value_or(0);
    const std::size_t stride = index_of(*view, "byteStride").value_or(width * size);
    const std::size_t from = index_of(*view, "byteOffset").value_or(0);
    const std::size_t inside = index_of(*accessor, "byteOffset").value_or(0);
    // each term is checked, so that no sum wraps
    if (count == 0 || count > kMostBytes || stride < width * size || stride > 4096 ||
        from > data.size() || inside > data.size() ||
        (count - 1) * stride + width * size > data.size() - from ||
        (count - 1) * stride + width * size + inside > data.size() - from) {
      return wrong(absl::StrCat("an accessor of ", count, " rows does not fit its buffer of ",
                                data.size(), " bytes"));
    }
    out.resize(count * width);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t c = 0; c < width; ++c) {
        const char* at = data.data() + from + inside + i * stride + c * size;
        if (type == 5126) {
          float value = 0.0F;
          std::memcpy(&value, at, 4);
          out[i * width + c] = static_cast<double>(value);
        } else {
          std::uint32_t value = 0;
          std::memcpy(&value, at, size);
          out[i * width + c] = value / unit;
        }
      }
    }
    return absl::OkStatus();
  }

  static glm::dmat4 local_of(const json& node) {
    const auto read = [&](const char* key, auto& values) {
      const json* found = member(node, key);
      if (found == nullptr || !found->is_array() || found->size() != values.size()) return false;
      for (std::size_t i = 0; i < values.size(); ++i) {
        if (!(*found)[i].is_number()) return false;
        values[i] = (*found)[i].template get<double>();
      }
      return true;
    };
    if (std::array<double, 16> m{}; read("matrix", m)) {
      glm::dmat4 result;
      for (int i = 0; i < 16; ++i) result[i / 4][i % 4] = m[static_cast<std::size_t>(i)];
      return result;
    }
    std::array<double, 3> t{0, 0, 0}, s{1, 1, 1};
    std::array<double, 4> r{0, 0, 0, 1};
    read("translation", t);
    read("rotation", r);
    read("scale", s);
    glm::dmat4 result = glm::mat4_cast(glm::dquat(r[3], r[0], r[1], r[2]));
    for (int i = 0; i < 3; ++i) result[i] *= s[static_cast<std::size_t>(i)];
    result[3] = glm::dvec4(t[0], t[1], t[2], 1.0);
    return result;
  }

  absl::Status add_node(const json& index) {
    // Nodes have one parent each, so that no walk meets one twice but from two roots.
    if (++visited_ > kMostNodes) return wrong(absl::StrCat("it has over ", kMostNodes, " nodes"));
    if (!index.is_number_unsigned()) return wrong("a node's number is none");
    const auto number = index.get<std::size_t>();
    const json* node = item("nodes", number);
    if (node == nullptr) return wrong("a node is missing");
    if (member(*node, "mesh") != nullptr) {
      const json* mesh = item("meshes", index_of(*node, "mesh"));
      const json* primitives = mesh != nullptr ? member(*mesh, "primitives") : nullptr;
      if (primitives == nullptr || !primitives->is_array()) return wrong("a mesh is missing");
      // A skinned mesh stands where its joints are; its node's own place does not count.
      std::vector<glm::dmat4> world_from_skin;
      if (member(*node, "skin") != nullptr) {
        if (absl::Status s = place_skin(index_of(*node, "skin"), world_from_skin); !s.ok())
          return s;
      }
      for (const json& primitive : *primitives) {
        absl::Status s = add_primitive(primitive, world_from_node_[number], world_from_skin);
        if (!s.ok()) return s;
      }
    }
    const json* children = member(*node, "children");
    if (children == nullptr || !children->is_array()) return absl::OkStatus();
    for (const json& child : *children) {
      if (absl::Status s = add_node(child); !s.ok()) return s;
    }
    return absl::OkStatus();
  }

  /// For each joint: where it is at rest, times its inverse bind matrix.
  absl::Status place_skin(std::optional<std::size_t> index, std::vector<glm::dmat4>& joints) const {
    const json* skin = item("skins", index);
    const json* nodes = skin != nullptr ? member(*skin, "joints") : nullptr;
    if (nodes == nullptr || !nodes->is_array()) return wrong("a skin is missing or has no joints");
    std::vector<double> inverse;
    if (member(*skin, "inverseBindMatrices") != nullptr) {
      absl::Status s = numbers(index_of(*skin, "inverseBindMatrices"), Kind::kMatrix, inverse);
      if (!s.ok()) return s;
      if (inverse.size() / 16 < nodes->size()) return wrong("a skin lacks inverse bind matrices");
    }
    for (std::size_t j = 0; j < nodes->size(); ++j) {
      const json& node = (*nodes)[j];
      if (!node.is_number_unsigned() || node.get<std::size_t>() >= world_from_node_.size()) {
        return wrong("a skin's joint is missing");
      }
      joints.push_back(world_from_node_[node.get<std::size_t>()]);
      if (inverse.empty()) continue;
      glm::dmat4 matrix;
      for (std::size_t i = 0; i < 16; ++i) {
        matrix[static_cast<int>(i / 4)][static_cast<int>(i % 4)] = inverse[16 * j + i];
      }
      joints.back() = joints.back() * matrix;
    }
    return absl::OkStatus();
  }

  absl::Status add_primitive(const json& primitive, const glm::dmat4& world_from_node,
                             const std::vector<glm::dmat4>& world_from_skin) {
    if (index_of(primitive, "mode").value_or(4) != 4) return absl::OkStatus();  // points, lines
    const json* attributes = member(primitive, "attributes");
    if (attributes == nullptr) return wrong("a primitive has no attributes");
    std::vector<double> positions, indices, uvs, joints, weights;
    absl::Status s = numbers(index_of(*attributes, "POSITION"), Kind::kPosition, positions);
    if (!s.ok()) return s;
    const std::size_t corners = positions.size() / 3;
    if (member(primitive, "indices") != nullptr) {
      s = numbers(index_of(primitive, "indices"), Kind::kIndex, indices);
      if (!s.ok()) return s;
    } else {
      for (std::size_t i = 0; i < corners; ++i) indices.push_back(static_cast<double>(i));
    }
    static const Material kPlain{glm::dvec3(0.578), {}, 0};  // sRGB 200
    const std::size_t number = index_of(primitive, "material").value_or(materials_.size());
    const Material& material = number < materials_.size() ? materials_[number] : kPlain;
    const std::string uv_name = absl::StrCat("TEXCOORD_", material.uv_set);
    if (material.texture != nullptr && member(*attributes, uv_name.c_str()) != nullptr) {
      s = numbers(index_of(*attributes, uv_name.c_str()), Kind::kUv, uvs);
      if (!s.ok()) return s;
      if (uvs.size() / 2 < corners) return wrong("TEXCOORD has fewer rows than POSITION");
    }
    if (!world_from_skin.empty() && member(*attributes, "JOINTS_0") != nullptr) {
      s = numbers(index_of(*attributes, "JOINTS_0"), Kind::kJoint, joints);
      if (s.ok()) s = numbers(index_of(*attributes, "WEIGHTS_0"), Kind::kWeight, weights);
      if (!s.ok()) return s;
      if (joints.size() / 4 < corners || weights.size() / 4 < corners) {
        return wrong("JOINTS_0 or WEIGHTS_0 has fewer rows than POSITION");
      }
    }
    std::vector<glm::dvec3> places(corners);
    for (std::size_t i = 0; i < corners; ++i) {
      const glm::dvec4 p(positions[3 * i], positions[3 * i + 1], positions[3 * i + 2], 1.0);
      glm::dvec4 placed = world_from_node * p;
      double sum = 0.0;
      glm::dvec4 skinned(0.0);
      for (std::size_t k = 4 * i; k < 4 * i + 4 && !joints.empty(); ++k) {
        const auto joint = static_cast<std::size_t>(joints[k]);
        if (weights[k] == 0.0) continue;
        if (joint >= world_from_skin.size()) {
          return wrong(absl::StrCat("joint ", joint, " of ", world_from_skin.size()));
        }
        skinned += weights[k] * (world_from_skin[joint] * p);
        sum += weights[k];
      }
      if (sum > 0.0) placed = skinned / sum;
      places[i] = glm::dvec3(placed) - origin_ + glm::dvec3(0.0, 0.0, kLiftM);
      for (int axis = 0; axis < 3; ++axis) {
        if (std::abs(places[i][axis]) <= kFarthestM) continue;
        return wrong(absl::StrCat("a corner is at ", places[i][axis],
                                  " m from the crowd's origin, must be within 1e7"));
      }
    }
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
      std::array<Corner, 3> triangle;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto corner = static_cast<std::size_t>(indices[i + k]);
        if (corner >= corners) return wrong(absl::StrCat("index ", corner, " of ", corners));
        triangle[k].place = places[corner];
        if (!uvs.empty()) triangle[k].uv = {uvs[2 * corner], uvs[2 * corner + 1]};
      }
      if (!(double_area(triangle) > kLeastArea)) continue;  // a line or a point
      s = add_triangle(triangle, material, !uvs.empty());
      if (!s.ok()) return s;
    }
    return absl::OkStatus();
  }

  struct Corner {
    glm::dvec3 place{0.0};
    glm::dvec2 uv{0.0};
  };
  struct Triangle {
    std::array<glm::dvec3, 3> corner;
    std::uint8_t color = 0;
  };

  static double double_area(const std::array<Corner, 3>& t) {
    return glm::length(glm::cross(t[1].place - t[0].place, t[2].place - t[0].place));
  }

  /// Halves the longest edge until all are short, so that pieces can be culled one by one, and a
  /// textured triangle until what it shows is about one colour.
  absl::Status add_triangle(const std::array<Corner, 3>& t, const Material& material, bool has_uv) {
    std::size_t longest = 0;
    double longest_m = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double length_m = glm::distance(t[i].place, t[(i + 1) % 3].place);
      if (length_m > longest_m) {
        longest_m = length_m;
        longest = i;
      }
    }
    const Corner &a = t[longest], &b = t[(longest + 1) % 3], &c = t[(longest + 2) % 3];
    const bool is_textured = has_uv && material.texture != nullptr;
    const double limit_m = is_textured && triangles_.size() < kMostDetailed ? kTexelM : kPieceM;
    if (longest_m > limit_m) {
      const Corner middle{0.5 * (a.place + b.place), 0.5 * (a.uv + b.uv)};
      if (absl::Status s = add_triangle({a, middle, c}, material, has_uv); !s.ok()) return s;
      return add_triangle({middle, b, c}, material, has_uv);
    }
    // What came of slivers counts, too: one that is a kilometre long takes as long as a wall.
    if (pieces_made_++ == kMostTriangles) {
      return wrong(absl::StrCat("it has over ", kMostTriangles, " triangles of at most 16 m"));
    }
    if (!(double_area(t) > kLeastArea)) return absl::OkStatus();
    glm::dvec3 linear = material.factor;
    if (is_textured) linear *= material.texture->mean(a.uv, b.uv, c.uv);
    triangles_.push_back({{a.place, b.place, c.place}, palette_.index_of(linear)});
    return absl::OkStatus();
  }

  // A far corner would make a map of nothing but squares.
  static constexpr std::size_t kMostSquares = 32'768;

  const std::string folder_;
  const glm::dvec3 origin_;
  json document_;
  std::string binary_;
  std::vector<std::string> buffers_;
  std::vector<Material> materials_;
  std::map<std::size_t, std::shared_ptr<const SiteTexture>> textures_;  // by image
  std::vector<glm::dmat4> world_from_node_;
  std::vector<Triangle> triangles_;
  SitePalette palette_;
  Pieces pieces_;
  std::size_t visited_ = 0, pieces_made_ = 0;
};

}  // namespace

absl::StatusOr<std::shared_ptr<const Environment>> read_environment(
    const std::string& path, const glm::dvec3& origin_world, const EnvironmentOptions& options) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) return absl::NotFoundError(absl::StrCat(path, ": can't be opened"));
  const auto size = static_cast<std::int64_t>(file.tellg());
  if (size < 0 || static_cast<std::size_t>(size) > kMostBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": is no file or over ", kMostBytes >> 20, " MiB"));
  }
  try {
    std::string bytes(static_cast<std::size_t>(size), '\0');
    file.seekg(0).read(bytes.data(), size);
    const bool is_gltf =
        bytes.compare(0, 4, "glTF") == 0 || absl::EndsWithIgnoreCase(path, ".gltf");
    absl::StatusOr<std::shared_ptr<const Environment>> made =
        absl::InternalError("not yet");  // StatusOr has no empty value
    if (is_gltf) {
      const std::string folder = std::filesystem::path(path).parent_path().string();
      made = Site(folder.empty() ? "." : folder, origin_world).read(bytes);
    } else {
      const absl::StatusOr<std::string> wkt = walkable_area_of(bytes);
      made = wkt.ok() ? make_environment(*wkt, origin_world, options)
                      : absl::StatusOr<std::shared_ptr<const Environment>>(wkt.status());
    }
    if (made.ok()) return made;
    return absl::Status(made.status().code(), absl::StrCat(path, ": ", made.status().message()));
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(absl::StrCat(path, ": there is not enough memory for it"));
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat(path, ": ", error.what()));
  }
}

}  // namespace throng::render
