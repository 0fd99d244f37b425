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
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/environment/pieces.hpp"
#include "throng/render/environment.hpp"

/// A site as a static glTF 2.0 mesh: triangles of the default scene in their materials' base
/// colours.
namespace throng::render {
namespace {

using nlohmann::json;

constexpr std::size_t kMostBytes = 256u << 20;
constexpr std::size_t kMostTriangles = 2'000'000;
constexpr double kFarthestM = 1e7;
constexpr int kDeepest = 64;
constexpr std::size_t kMostColors = 256;
// Above the ground plane, or a floor at z = 0 would flicker through it.
constexpr double kLiftM = 0.01;

absl::Status wrong(const std::string& message) {
  return absl::InvalidArgumentError(absl::StrCat("glTF: ", message));
}

/// A reader that believes nothing: each access is checked, the first error stays.
class Site {
 public:
  Site(std::string folder, const glm::dvec3& origin_world)
      : folder_(std::move(folder)), origin_(origin_world) {}

  absl::StatusOr<std::shared_ptr<const Environment>> read(const std::string& bytes) {
    if (absl::Status s = parse(bytes); !s.ok()) return s;
    if (absl::Status s = load_buffers(); !s.ok()) return s;
    if (absl::Status s = load_materials(); !s.ok()) return s;
    const json* scenes = list("scenes");
    const std::size_t scene = index_of(document_, "scene").value_or(0);
    if (scenes == nullptr || scene >= scenes->size()) return wrong("it has no scene");
    const json* roots = member((*scenes)[scene], "nodes");
    if (roots == nullptr || !roots->is_array()) return wrong("its scene has no nodes");
    // glTF is +Y up; throng +Z.
    glm::dmat4 world_from_scene(0.0);
    world_from_scene[0][0] = world_from_scene[1][2] = world_from_scene[3][3] = 1.0;
    world_from_scene[2][1] = -1.0;
    for (const json& root : *roots) {
      if (absl::Status s = add_node(root, world_from_scene, 0); !s.ok()) return s;
    }
    if (triangles_ == 0) return wrong("its scene has no triangles");
    return finish(pieces_, colors_, kTriangleDoubleSided, "glTF: its triangles");
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

  absl::Status load_buffers() {
    const json* all = list("buffers");
    for (std::size_t i = 0; all != nullptr && i < all->size(); ++i) {
      const json* uri = member((*all)[i], "uri");
      if (uri == nullptr) {
        buffers_.push_back(i == 0 ? std::move(binary_) : std::string());
        continue;
      }
      if (!uri->is_string()) return wrong("a buffer's uri is no text");
      const std::string& text = uri->get_ref<const std::string&>();
      if (absl::StartsWith(text, "data:")) {
        const std::size_t comma = text.find(',');
        std::string decoded;
        if (comma == std::string::npos ||
            !absl::StrContains(absl::string_view(text).substr(0, comma), ";base64") ||
            !absl::Base64Unescape(absl::string_view(text).substr(comma + 1), &decoded)) {
          return wrong("a buffer's data is not base64");
        }
        buffers_.push_back(std::move(decoded));
        continue;
      }
      const std::filesystem::path name(text);
      if (name.is_absolute() || absl::StrContains(text, "..") || absl::StrContains(text, ":")) {
        return wrong(
            absl::StrCat("a buffer is in '", text.substr(0, 80), "', must be beside the file"));
      }
      std::ifstream file(std::filesystem::path(folder_) / name, std::ios::binary | std::ios::ate);
      if (!file || static_cast<std::size_t>(file.tellg()) > kMostBytes) {
        return wrong(absl::StrCat("its buffer ", text.substr(0, 80), " can't be read"));
      }
      std::string data(static_cast<std::size_t>(file.tellg()), '\0');
      file.seekg(0).read(data.data(), static_cast<std::streamsize>(data.size()));
      buffers_.push_back(std::move(data));
    }
    return absl::OkStatus();
  }

  absl::Status load_materials() {
    colors_ = {{200, 200, 200}};  // of triangles without material
    const json* all = list("materials");
    for (std::size_t i = 0; all != nullptr && i < all->size(); ++i) {
      if (colors_.size() == kMostColors) return wrong("it has over 255 materials");
      std::array<double, 3> linear{1.0, 1.0, 1.0};
      const json* metallic = member((*all)[i], "pbrMetallicRoughness");
      const json* factor = metallic != nullptr ? member(*metallic, "baseColorFactor") : nullptr;
      for (std::size_t c = 0; factor != nullptr && factor->is_array() && c < 3; ++c) {
        if (c < factor->size() && (*factor)[c].is_number()) linear[c] = (*factor)[c].get<double>();
      }
      Rgb& color = colors_.emplace_back();
      for (std::size_t c = 0; c < 3; ++c) {
        const double value = std::clamp(linear[c], 0.0, 1.0);
        const double srgb =
            value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1.0 / 2.4) - 0.055;
        color[c] = static_cast<std::uint8_t>(std::lround(255.0 * srgb));
      }
    }
    return absl::OkStatus();
  }

  /// Numbers of an accessor as rows of `width`; floats, or unsigned integers for indices.
  absl::Status numbers(std::optional<std::size_t> index, std::size_t width, bool is_index,
                       std::vector<double>& out) const {
    const json* accessor = item("accessors", index);
    if (accessor == nullptr) return wrong("an accessor is missing");
    if (member(*accessor, "sparse") != nullptr) return wrong("sparse accessors are not read");
    const std::size_t type = index_of(*accessor, "componentType").value_or(0);
    const std::size_t size = type == 5126 || type == 5125 ? 4 : type == 5123 ? 2 : 1;
    const bool is_known = is_index ? type == 5121 || type == 5123 || type == 5125 : type == 5126;
    const json* shape = member(*accessor, "type");
    if (!is_known || shape == nullptr || *shape != (width == 1 ? "SCALAR" : "VEC3")) {
      return wrong(absl::StrCat(is_index ? "indices" : "POSITION", " of component type ", type,
                                " or of an odd shape"));
    }
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
          out[i * width + c] = value;
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

  absl::Status add_node(const json& index, const glm::dmat4& world_from_parent, int depth) {
    if (depth > kDeepest) return wrong("its nodes are nested too deep");
    if (++nodes_ > 100'000) return wrong("it has over 100,000 nodes");
    if (!index.is_number_unsigned()) return wrong("a node's number is none");
    const json* node = item("nodes", index.get<std::size_t>());
    if (node == nullptr) return wrong("a node is missing");
    const glm::dmat4 world_from_node = world_from_parent * local_of(*node);
    if (member(*node, "mesh") != nullptr) {
      const json* mesh = item("meshes", index_of(*node, "mesh"));
      const json* primitives = mesh != nullptr ? member(*mesh, "primitives") : nullptr;
      if (primitives == nullptr || !primitives->is_array()) return wrong("a mesh is missing");
      for (const json& primitive : *primitives) {
        if (absl::Status s = add_primitive(primitive, world_from_node); !s.ok()) return s;
      }
    }
    const json* children = member(*node, "children");
    if (children == nullptr || !children->is_array()) return absl::OkStatus();
    for (const json& child : *children) {
      if (absl::Status s = add_node(child, world_from_node, depth + 1); !s.ok()) return s;
    }
    return absl::OkStatus();
  }

  absl::Status add_primitive(const json& primitive, const glm::dmat4& world_from_node) {
    if (index_of(primitive, "mode").value_or(4) != 4) return absl::OkStatus();  // points, lines
    const json* attributes = member(primitive, "attributes");
    if (attributes == nullptr) return wrong("a primitive has no attributes");
    std::vector<double> positions, indices;
    if (absl::Status s = numbers(index_of(*attributes, "POSITION"), 3, false, positions); !s.ok()) {
      return s;
    }
    const std::size_t corners = positions.size() / 3;
    if (member(primitive, "indices") != nullptr) {
      if (absl::Status s = numbers(index_of(primitive, "indices"), 1, true, indices); !s.ok()) {
        return s;
      }
    } else {
      for (std::size_t i = 0; i < corners; ++i) indices.push_back(static_cast<double>(i));
    }
    const std::size_t color =
        std::min(index_of(primitive, "material").value_or(colors_.size()) + 1, colors_.size());
    const std::uint16_t u = color_u(color < colors_.size() ? color : 0, colors_.size());
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
      std::array<glm::dvec3, 3> triangle;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto corner = static_cast<std::size_t>(indices[i + k]);
        if (corner >= corners) return wrong(absl::StrCat("index ", corner, " of ", corners));
        const double* p = positions.data() + 3 * corner;
        triangle[k] = glm::dvec3(world_from_node * glm::dvec4(p[0], p[1], p[2], 1.0)) - origin_ +
                      glm::dvec3(0.0, 0.0, kLiftM);
        for (int axis = 0; axis < 3; ++axis) {
          if (std::abs(triangle[k][axis]) <= kFarthestM) continue;
          return wrong(absl::StrCat("a corner is at ", triangle[k][axis],
                                    " m from the crowd's origin, must be within 1e7"));
        }
      }
      if (absl::Status s = add_triangle(triangle, u); !s.ok()) return s;
    }
    return absl::OkStatus();
  }

  /// Halves the longest edge until all are short, so that pieces can be culled one by one.
  absl::Status add_triangle(const std::array<glm::dvec3, 3>& t, std::uint16_t u) {
    int longest = 0;
    double longest_m = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double length_m = glm::distance(t[i], t[(i + 1) % 3]);
      if (length_m > longest_m) {
        longest_m = length_m;
        longest = i;
      }
    }
    const glm::dvec3 &a = t[longest], &b = t[(longest + 1) % 3], &c = t[(longest + 2) % 3];
    if (longest_m > kPieceM) {
      const glm::dvec3 middle = 0.5 * (a + b);
      if (absl::Status s = add_triangle({a, middle, c}, u); !s.ok()) return s;
      return add_triangle({middle, b, c}, u);
    }
    const glm::dvec3 across = glm::cross(b - a, c - a);
    const double size = glm::length(across);
    if (!(size > 1e-12)) return absl::OkStatus();  // a line or a point
    if (++triangles_ > kMostTriangles) {
      return wrong(absl::StrCat("it has over ", kMostTriangles, " triangles of at most 16 m"));
    }
    if (pieces_.size() > kMostSquares) {
      return wrong(absl::StrCat("it is in over ", kMostSquares, " squares of ", kPieceM, " m"));
    }
    piece_at(pieces_, glm::dvec2((a + b + c) / 3.0))
        .add(glm::vec3(a), glm::vec3(b), glm::vec3(c), glm::vec3(across / size), u);
    return absl::OkStatus();
  }

  // A far corner would make a map of nothing but squares.
  static constexpr std::size_t kMostSquares = 32'768;

  const std::string folder_;
  const glm::dvec3 origin_;
  json document_;
  std::string binary_;
  std::vector<std::string> buffers_;
  std::vector<Rgb> colors_;  // 0: none, then by material
  Pieces pieces_;
  std::size_t triangles_ = 0, nodes_ = 0;
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
