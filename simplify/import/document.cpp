#include "simplify/import/document.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "simplify/import/compressed.hpp"
#include "simplify/import/limits.hpp"

namespace throng::simplify::gltf {
namespace {

using Json = nlohmann::json;

/// A JSON object and its name in messages. The first thing that is wrong stays in `status`; reading
/// on after it is harmless, so a caller checks once for each element.
class Object {
 public:
  Object(const Json& value, std::string where, absl::Status& status)
      : value_(value), where_(std::move(where)), status_(status) {
    if (!value_.is_object()) fail("is not a JSON object");
  }

  const std::string& where() const { return where_; }

  void fail(absl::string_view what) const {
    if (status_.ok()) status_ = absl::InvalidArgumentError(absl::StrCat(where_, " ", what));
  }

  const Json* find(const char* key) const {
    if (!value_.is_object()) return nullptr;
    const auto found = value_.find(key);
    return found == value_.end() ? nullptr : &*found;
  }

  bool ok() const { return status_.ok(); }
  bool has(const char* key) const { return find(key) != nullptr; }

  std::uint64_t count(const char* key, std::uint64_t fallback) const {
    const Json* found = find(key);
    return found == nullptr ? fallback : to_count(*found, key);
  }

  /// A number below `limit`, which counts the elements called `what`.
  std::uint32_t index(const char* key, std::size_t limit, const char* what) const {
    const Json* found = find(key);
    if (found == nullptr) {
      fail(absl::StrCat("has no ", key));
      return 0;
    }
    return to_index(*found, key, limit, what);
  }

  std::int32_t optional_index(const char* key, std::size_t limit, const char* what) const {
    return has(key) ? static_cast<std::int32_t>(index(key, limit, what)) : kNone;
  }

  std::vector<std::uint32_t> indices(const char* key, std::size_t limit, const char* what) const {
    std::vector<std::uint32_t> result;
    const Json* found = find(key);
    if (found == nullptr) return result;
    if (!found->is_array() || found->size() > kMaxElements) {
      fail(absl::StrCat(key, " is not an array of at most ", kMaxElements, " numbers"));
      return result;
    }
    for (const Json& entry : *found) result.push_back(to_index(entry, key, limit, what));
    return result;
  }

  double number(const char* key, double fallback) const {
    const Json* found = find(key);
    if (found == nullptr) return fallback;
    if (!found->is_number()) {
      fail(absl::StrCat(key, " is not a number"));
      return fallback;
    }
    return bounded(found->get<double>(), key);
  }

  bool boolean(const char* key, bool fallback) const {
    const Json* found = find(key);
    if (found == nullptr) return fallback;
    if (!found->is_boolean()) {
      fail(absl::StrCat(key, " is not true or false"));
      return fallback;
    }
    return found->get<bool>();
  }

  std::string text(const char* key) const {
    const Json* found = find(key);
    if (found == nullptr) return {};
    if (!found->is_string()) {
      fail(absl::StrCat(key, " is not a text"));
      return {};
    }
    return found->get<std::string>();
  }

  /// Exactly N numbers into `out`, which keeps its value when the key is missing.
  template <std::size_t N>
  bool numbers(const char* key, double* out) const {
    const Json* found = find(key);
    if (found == nullptr) return false;
    if (!found->is_array() || found->size() != N) {
      fail(absl::StrCat(key, " is not an array of ", N, " numbers"));
      return false;
    }
    for (std::size_t i = 0; i < N; ++i) {
      const Json& entry = (*found)[i];
      if (!entry.is_number()) {
        fail(absl::StrCat(key, " is not an array of ", N, " numbers"));
        return false;
      }
      out[i] = bounded(entry.get<double>(), key);
    }
    return true;
  }

  std::optional<Object> object(const char* key) const {
    const Json* found = find(key);
    if (found == nullptr) return std::nullopt;
    return Object(*found, absl::StrCat(where_, " ", key), status_);
  }

  std::optional<Object> extension(const char* name) const {
    const std::optional<Object> all = object("extensions");
    return all.has_value() ? all->object(name) : std::nullopt;
  }

  /// Calls `body` with each object of an array, named `what` and its number.
  template <typename Body>
  void for_each(const char* key, const char* what, Body body) const {
    const Json* found = find(key);
    if (found == nullptr) return;
    if (!found->is_array() || found->size() > kMaxElements) {
      fail(absl::StrCat(key, " is not an array of at most ", kMaxElements, " elements"));
      return;
    }
    std::size_t i = 0;
    for (const Json& entry : *found) {
      if (!status_.ok()) return;
      body(Object(
          entry,
          where_.empty() ? absl::StrCat(what, " ", i) : absl::StrCat(where_, " ", what, " ", i),
          status_));
      ++i;
    }
  }

  /// Calls `body(name, accessor)` for an object of indices.
  template <typename Body>
  void for_each_index(std::size_t limit, const char* what, Body body) const {
    if (!value_.is_object()) return;
    for (const auto& [name, entry] : value_.items()) {
      body(name, to_index(entry, name.c_str(), limit, what));
    }
  }

 private:
  double bounded(double value, const char* key) const {
    // far beyond any character, and small enough that products of a few stay finite in single
    // precision
    constexpr double kLimit = 1e9;
    if (std::abs(value) <= kLimit) return value;
    fail(absl::StrCat(key, " is ", value, ", the limit is ", kLimit));
    return 0.0;
  }

  std::uint64_t to_count(const Json& value, absl::string_view key) const {
    if (value.is_number_unsigned()) return value.get<std::uint64_t>();
    if (value.is_number_float()) {
      const double number = value.get<double>();
      if (number >= 0.0 && number < 9e15 && number == std::floor(number)) {
        return static_cast<std::uint64_t>(number);
      }
    }
    fail(absl::StrCat(key, " is ",
                      value.dump(-1, ' ', true, Json::error_handler_t::replace).substr(0, 40),
                      ", must be a whole number from 0"));
    return 0;
  }

  std::uint32_t to_index(const Json& value, absl::string_view key, std::size_t limit,
                         absl::string_view what) const {
    const std::uint64_t index = to_count(value, key);
    if (index < limit) return static_cast<std::uint32_t>(index);
    fail(absl::StrCat(key, " is ", index, ", the file has ", limit, " ", what));
    return 0;
  }

  const Json& value_;
  std::string where_;
  absl::Status& status_;
};

/// Parsers recurse or at least nest destructors by depth, so depth is bounded before parsing.
bool is_too_deep(std::string_view text) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      if (c == '"') quoted = false;
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      if (++depth > kMaxJsonDepth) return true;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return false;
}

std::uint32_t little_endian(std::span<const std::uint8_t> bytes, std::size_t offset) {
  return std::uint32_t{bytes[offset]} | std::uint32_t{bytes[offset + 1]} << 8 |
         std::uint32_t{bytes[offset + 2]} << 16 | std::uint32_t{bytes[offset + 3]} << 24;
}

struct Parts {
  std::string_view json;
  std::span<const std::uint8_t> binary;
  bool has_binary = false;
};

/// Splits a .glb (glTF 2.0 section 4.4) or takes the file as JSON.
absl::StatusOr<Parts> split(std::span<const std::uint8_t> file, bool named_glb) {
  Parts parts;
  const bool is_glb = file.size() >= 4 && std::memcmp(file.data(), "glTF", 4) == 0;
  if (!is_glb) {
    if (named_glb) return absl::InvalidArgumentError("does not begin with 'glTF' as a .glb must");
    parts.json = std::string_view(reinterpret_cast<const char*>(file.data()), file.size());
    return parts;
  }
  if (file.size() < 20) {
    return absl::InvalidArgumentError(
        absl::StrCat("ends after ", file.size(), " bytes, a .glb header has 20"));
  }
  if (const std::uint32_t version = little_endian(file, 4); version != 2) {
    return absl::InvalidArgumentError(absl::StrCat("is .glb version ", version, ", must be 2"));
  }
  const std::uint64_t length = little_endian(file, 8);
  if (length > file.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("has ", file.size(), " bytes, its header says ", length));
  }
  std::uint64_t offset = 12;
  for (int chunk = 0; chunk < 2 && offset + 8 <= length; ++chunk) {
    const std::uint64_t size = little_endian(file, offset);
    const std::uint32_t type = little_endian(file, offset + 4);
    offset += 8;
    if (size > length - offset) {
      return absl::InvalidArgumentError(absl::StrCat(
          "chunk ", chunk, " has ", size, " bytes, only ", length - offset, " are left"));
    }
    if (chunk == 0) {
      if (type != 0x4E4F534A) return absl::InvalidArgumentError("chunk 0 is not JSON");
      parts.json = std::string_view(reinterpret_cast<const char*>(file.data()) + offset, size);
    } else if (type == 0x004E4942) {
      parts.binary = file.subspan(offset, size);
      parts.has_binary = true;
    }
    offset += size + (4 - size % 4) % 4;
  }
  return parts;
}

absl::StatusOr<Json> parse_json(std::string_view text) {
  if (text.size() > kMaxJsonBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("JSON has ", text.size(), " bytes, the limit is ", kMaxJsonBytes));
  }
  if (is_too_deep(text)) {
    return absl::InvalidArgumentError(absl::StrCat("JSON is nested deeper than ", kMaxJsonDepth));
  }
  try {
    return Json::parse(text.begin(), text.end());
  } catch (const Json::parse_error& error) {
    return absl::InvalidArgumentError(absl::StrCat("JSON is malformed at byte ", error.byte));
  } catch (const Json::exception&) {
    return absl::InvalidArgumentError("JSON has a number or a text that is out of range");
  }
}

void read_buffers(const Object& root, const Parts& parts, Document& document) {
  std::uint64_t total_bytes = 0;
  std::size_t number = 0;
  root.for_each("buffers", "buffer", [&](const Object& buffer) {
    const std::uint64_t length = buffer.count("byteLength", 0);
    Bytes& bytes = document.buffers.emplace_back();
    const std::optional<Object> meshopt = buffer.extension("EXT_meshopt_compression");
    const bool is_fallback = meshopt.has_value() && meshopt->boolean("fallback", false);
    if (buffer.has("uri")) {
      absl::StatusOr<Bytes> read = read_uri(buffer.text("uri"), document.folder, kMaxFileBytes);
      if (!read.ok()) return buffer.fail(absl::StrCat("uri: ", read.status().message()));
      bytes = *std::move(read);
    } else if (number == 0 && parts.has_binary) {
      bytes.assign(parts.binary.begin(), parts.binary.end());
    } else if (!is_fallback) {
      return buffer.fail("has neither a uri nor a binary chunk");
    }
    ++number;
    // a fallback buffer without data is only named by views that are decoded from another
    if (is_fallback && bytes.empty()) return;
    if (bytes.size() < length) {
      return buffer.fail(absl::StrCat("has ", bytes.size(), " bytes, byteLength says ", length));
    }
    total_bytes += bytes.size();
    if (total_bytes > kMaxFileBytes) {
      buffer.fail(
          absl::StrCat("makes ", total_bytes, " bytes in all, the limit is ", kMaxFileBytes));
    }
  });
}

void read_views(const Object& root, Document& document) {
  const std::size_t stored_buffers = document.buffers.size();
  std::uint64_t decoded_bytes = 0;
  root.for_each("bufferViews", "bufferView", [&](const Object& object) {
    BufferView view;
    view.buffer = object.index("buffer", stored_buffers, "buffers");
    view.offset = object.count("byteOffset", 0);
    view.length = object.count("byteLength", 0);
    const std::uint64_t stride = object.count("byteStride", 0);
    if (stride > 4096) object.fail(absl::StrCat("byteStride is ", stride, ", the limit is 4096"));
    view.stride = static_cast<std::uint32_t>(stride);
    const std::optional<Object> packed = object.extension("EXT_meshopt_compression");

    const auto check = [&](const BufferView& of) {
      if (of.buffer >= stored_buffers) return;  // already told
      const std::uint64_t size = document.buffers[of.buffer].size();
      if (of.offset > size || of.length > size - of.offset) {
        object.fail(absl::StrCat("ends at byte ", of.offset, " + ", of.length, " of buffer ",
                                 of.buffer, ", which has ", size));
      }
    };
    if (!packed.has_value()) {
      check(view);
    } else {
      BufferView source;
      source.buffer = packed->index("buffer", stored_buffers, "buffers");
      source.offset = packed->count("byteOffset", 0);
      source.length = packed->count("byteLength", 0);
      MeshoptPart part;
      part.count = packed->count("count", 0);
      part.stride = packed->count("byteStride", 0);
      part.mode = packed->text("mode");
      part.filter = packed->has("filter") ? packed->text("filter") : "NONE";
      check(source);
      if (object.ok()) {
        absl::StatusOr<Bytes> plain = decode_meshopt(document.bytes(source), part);
        if (!plain.ok()) return packed->fail(plain.status().message());
        decoded_bytes += plain->size();
        if (decoded_bytes > kMaxFileBytes) {
          return packed->fail(
              absl::StrCat("makes ", decoded_bytes, " bytes in all, the limit is ", kMaxFileBytes));
        }
        view = BufferView{static_cast<std::uint32_t>(document.buffers.size()), 0, plain->size(),
                          part.mode == "ATTRIBUTES" ? static_cast<std::uint32_t>(part.stride) : 0};
        document.buffers.push_back(*std::move(plain));
      }
    }
    document.views.push_back(view);
  });
}

std::uint32_t components_of(const std::string& type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  if (type == "VEC4" || type == "MAT2") return 4;
  if (type == "MAT3") return 9;
  if (type == "MAT4") return 16;
  return 0;
}

void read_accessors(const Object& root, Document& document) {
  root.for_each("accessors", "accessor", [&](const Object& object) {
    Accessor accessor;
    accessor.view = object.optional_index("bufferView", document.views.size(), "bufferViews");
    accessor.offset = object.count("byteOffset", 0);
    accessor.component = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(object.count("componentType", 0), 1 << 16));
    accessor.components = components_of(object.text("type"));
    if (accessor.components == 0) object.fail(absl::StrCat("type is '", object.text("type"), "'"));
    accessor.normalized = object.boolean("normalized", false);
    accessor.count = object.count("count", 0);
    if (const std::optional<Object> sparse = object.object("sparse")) {
      accessor.sparse.count = sparse->count("count", 0);
      const std::optional<Object> indices = sparse->object("indices");
      const std::optional<Object> values = sparse->object("values");
      if (!indices.has_value() || !values.has_value())
        return sparse->fail("has no indices or no values");
      accessor.sparse.index_view = static_cast<std::int32_t>(
          indices->index("bufferView", document.views.size(), "bufferViews"));
      accessor.sparse.index_offset = indices->count("byteOffset", 0);
      accessor.sparse.index_component = static_cast<std::uint32_t>(
          std::min<std::uint64_t>(indices->count("componentType", 0), 1 << 16));
      accessor.sparse.value_view = static_cast<std::int32_t>(
          values->index("bufferView", document.views.size(), "bufferViews"));
      accessor.sparse.value_offset = values->count("byteOffset", 0);
    }
    document.accessors.push_back(accessor);
  });
}

void read_meshes(const Object& root, Document& document) {
  const std::size_t accessors = document.accessors.size();
  root.for_each("meshes", "mesh", [&](const Object& object) {
    Mesh mesh;
    mesh.name = object.text("name");
    object.for_each("primitives", "primitive", [&](const Object& part) {
      Primitive primitive;
      if (const std::optional<Object> attributes = part.object("attributes")) {
        attributes->for_each_index(accessors, "accessors",
                                   [&](const std::string& name, std::uint32_t index) {
                                     primitive.attributes[name] = index;
                                   });
      }
      primitive.indices = part.optional_index("indices", accessors, "accessors");
      primitive.material = part.optional_index("material", document.materials.size(), "materials");
      primitive.mode = part.has("mode") ? part.index("mode", 7, "modes") : 4;
      if (const Json* targets = part.find("targets"); targets != nullptr && targets->is_array()) {
        primitive.morph_targets = static_cast<std::uint32_t>(targets->size());
      }
      if (const std::optional<Object> draco = part.extension("KHR_draco_mesh_compression")) {
        DracoPart& packed = primitive.draco.emplace();
        packed.view = draco->index("bufferView", document.views.size(), "bufferViews");
        if (const std::optional<Object> ids = draco->object("attributes")) {
          ids->for_each_index(1 << 16, "ids", [&](const std::string& name, std::uint32_t id) {
            packed.ids[name] = id;
          });
        }
      }
      mesh.primitives.push_back(std::move(primitive));
    });
    document.meshes.push_back(std::move(mesh));
  });
}

void read_skins(const Object& root, std::size_t node_count, Document& document) {
  root.for_each("skins", "skin", [&](const Object& object) {
    Skin skin;
    skin.name = object.text("name");
    skin.joints = object.indices("joints", node_count, "nodes");
    if (skin.joints.empty() || skin.joints.size() > kMaxSkinJoints) {
      object.fail(
          absl::StrCat("has ", skin.joints.size(), " joints, must have 1 to ", kMaxSkinJoints));
    }
    skin.inverse_bind =
        object.optional_index("inverseBindMatrices", document.accessors.size(), "accessors");
    document.skins.push_back(std::move(skin));
  });
}

void read_nodes(const Object& root, std::size_t node_count, Document& document) {
  root.for_each("nodes", "node", [&](const Object& object) {
    Node node;
    node.name = object.text("name");
    node.children = object.indices("children", node_count, "nodes");
    node.mesh = object.optional_index("mesh", document.meshes.size(), "meshes");
    node.skin = object.optional_index("skin", document.skins.size(), "skins");
    double matrix[16];
    if (object.numbers<16>("matrix", matrix)) {
      node.local.is_matrix = true;
      for (int i = 0; i < 16; ++i) node.local.matrix[i / 4][i % 4] = matrix[i];
    }
    object.numbers<3>("translation", &node.local.translation.x);
    object.numbers<3>("scale", &node.local.scale.x);
    if (object.numbers<4>("rotation", &node.local.rotation.x)) {
      const double length = glm::length(node.local.rotation);
      if (length < 1e-9) object.fail("rotation is zero, must be a unit quaternion");
      node.local.rotation /= length > 0.0 ? length : 1.0;
    }
    document.nodes.push_back(std::move(node));
  });
}

TextureRef read_texture_ref(const std::optional<Object>& object, const Document& document) {
  TextureRef ref;
  if (!object.has_value()) return ref;
  ref.texture = object->optional_index("index", document.textures.size(), "textures");
  ref.uv_set =
      object->has("texCoord") ? object->index("texCoord", 8, "texture coordinate sets") : 0;
  if (const std::optional<Object> transform = object->extension("KHR_texture_transform")) {
    transform->numbers<2>("offset", &ref.offset.x);
    transform->numbers<2>("scale", &ref.scale.x);
    ref.rotation_rad = transform->number("rotation", 0.0);
    if (transform->has("texCoord"))
      ref.uv_set = transform->index("texCoord", 8, "texture coordinate sets");
  }
  return ref;
}

void read_materials(const Object& root, Document& document) {
  root.for_each("images", "image", [&](const Object& object) {
    Image image;
    image.uri = object.text("uri");
    image.view = object.optional_index("bufferView", document.views.size(), "bufferViews");
    document.images.push_back(std::move(image));
  });
  root.for_each("samplers", "sampler", [&](const Object& object) {
    Sampler sampler;
    sampler.wrap_s =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(object.count("wrapS", 10497), 1 << 16));
    sampler.wrap_t =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(object.count("wrapT", 10497), 1 << 16));
    document.samplers.push_back(sampler);
  });
  root.for_each("textures", "texture", [&](const Object& object) {
    Texture texture;
    texture.source = object.optional_index("source", document.images.size(), "images");
    texture.sampler = object.optional_index("sampler", document.samplers.size(), "samplers");
    if (texture.source == kNone) {
      for (const char* name :
           {"KHR_texture_basisu", "EXT_texture_webp", "MSFT_texture_dds", "EXT_texture_avif"}) {
        if (object.extension(name).has_value()) texture.unsupported = name;
      }
    }
    document.textures.push_back(std::move(texture));
  });
  root.for_each("materials", "material", [&](const Object& object) {
    Material material;
    material.name = object.text("name");
    if (const std::optional<Object> pbr = object.object("pbrMetallicRoughness")) {
      pbr->numbers<4>("baseColorFactor", &material.factor.x);
      material.base_color = read_texture_ref(pbr->object("baseColorTexture"), document);
    }
    if (const auto old = object.extension("KHR_materials_pbrSpecularGlossiness");
        old.has_value() && !object.has("pbrMetallicRoughness")) {
      old->numbers<4>("diffuseFactor", &material.factor.x);
      material.base_color = read_texture_ref(old->object("diffuseTexture"), document);
    }
    object.numbers<3>("emissiveFactor", &material.emissive.x);
    material.emissive_texture = read_texture_ref(object.object("emissiveTexture"), document);
    const std::string alpha = object.text("alphaMode");
    if (alpha == "MASK") material.alpha = AlphaMode::kMask;
    if (alpha == "BLEND") material.alpha = AlphaMode::kBlend;
    material.alpha_cutoff = object.number("alphaCutoff", 0.5);
    material.double_sided = object.boolean("doubleSided", false);
    document.materials.push_back(std::move(material));
  });
}

void read_animations(const Object& root, Document& document) {
  const std::size_t accessors = document.accessors.size();
  root.for_each("animations", "animation", [&](const Object& object) {
    Animation animation;
    animation.name = object.text("name");
    object.for_each("samplers", "sampler", [&](const Object& part) {
      AnimationSampler sampler;
      sampler.input = part.index("input", accessors, "accessors");
      sampler.output = part.index("output", accessors, "accessors");
      sampler.interpolation = part.has("interpolation") ? part.text("interpolation") : "LINEAR";
      if (sampler.interpolation != "LINEAR" && sampler.interpolation != "STEP" &&
          sampler.interpolation != "CUBICSPLINE") {
        part.fail(absl::StrCat("interpolation is '", sampler.interpolation, "'"));
      }
      animation.samplers.push_back(std::move(sampler));
    });
    object.for_each("channels", "channel", [&](const Object& part) {
      AnimationChannel channel;
      channel.sampler =
          part.index("sampler", animation.samplers.size(), "samplers in this animation");
      if (const std::optional<Object> target = part.object("target")) {
        channel.node = target->optional_index("node", document.nodes.size(), "nodes");
        channel.path = target->text("path");
      }
      animation.channels.push_back(std::move(channel));
    });
    document.animations.push_back(std::move(animation));
  });
}

/// Every node is the child of at most one other and of none of its own descendants.
absl::Status check_tree(const Document& document) {
  std::vector<std::int32_t> parent(document.nodes.size(), kNone);
  for (std::size_t i = 0; i < document.nodes.size(); ++i) {
    for (const std::uint32_t child : document.nodes[i].children) {
      if (parent[child] != kNone) {
        return absl::InvalidArgumentError(absl::StrCat("node ", child, " is a child of node ",
                                                       parent[child], " and of node ", i));
      }
      parent[child] = static_cast<std::int32_t>(i);
    }
  }
  // with one parent each, a node is on a cycle when climbing from it takes as many steps as there
  // are nodes
  std::vector<char> known(document.nodes.size(), 0);
  for (std::size_t i = 0; i < document.nodes.size(); ++i) {
    std::vector<std::size_t> climbed;
    std::size_t at = i;
    while (known[at] == 0) {
      known[at] = 1;
      climbed.push_back(at);
      if (parent[at] == kNone) break;
      at = static_cast<std::size_t>(parent[at]);
    }
    if (!climbed.empty() && known[at] == 1 && parent[climbed.back()] != kNone) {
      return absl::InvalidArgumentError(absl::StrCat("node ", at, " is its own ancestor"));
    }
    for (const std::size_t node : climbed) known[node] = 2;
    if (climbed.size() > kMaxNodeDepth) {
      return absl::InvalidArgumentError(absl::StrCat("node ", i, " has more than ", kMaxNodeDepth,
                                                     " ancestors, which is the limit"));
    }
  }
  return absl::OkStatus();
}

void choose_roots(const Object& root, Document& document) {
  std::vector<std::vector<std::uint32_t>> scenes;
  root.for_each("scenes", "scene", [&](const Object& scene) {
    scenes.push_back(scene.indices("nodes", document.nodes.size(), "nodes"));
  });
  if (!scenes.empty()) {
    const std::uint32_t shown =
        root.has("scene") ? root.index("scene", scenes.size(), "scenes") : 0;
    if (shown < scenes.size()) document.roots = scenes[shown];
    if (scenes.size() > 1) {
      document.notes.push_back(absl::StrCat("scene ", shown, " of ", scenes.size(), " is used"));
    }
  }
  if (document.roots.empty()) {
    std::vector<char> is_child(document.nodes.size(), 0);
    for (const Node& node : document.nodes) {
      for (const std::uint32_t child : node.children) is_child[child] = 1;
    }
    for (std::uint32_t i = 0; i < document.nodes.size(); ++i) {
      if (is_child[i] == 0) document.roots.push_back(i);
    }
  }
}

absl::Status check_extensions(const Object& root) {
  constexpr std::string_view kKnown[] = {
      "KHR_draco_mesh_compression", "EXT_meshopt_compression",
      "KHR_mesh_quantization",      "KHR_texture_transform",
      "KHR_materials_unlit",        "KHR_materials_pbrSpecularGlossiness",
      "KHR_lights_punctual"};
  const Json* required = root.find("extensionsRequired");
  if (required == nullptr || !required->is_array()) return absl::OkStatus();
  for (const Json& entry : *required) {
    if (!entry.is_string()) continue;
    const std::string name = entry.get<std::string>();
    // how light falls on a material doesn't matter here
    if (name.starts_with("KHR_materials_")) continue;
    if (std::find(std::begin(kKnown), std::end(kKnown), name) == std::end(kKnown)) {
      return absl::InvalidArgumentError(
          absl::StrCat("requires the extension ", name.substr(0, 60), ", which isn't supported"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Document> read_document(std::span<const std::uint8_t> file,
                                       const std::string& path) {
  Document document;
  document.path = path;
  document.folder = std::filesystem::path(path).parent_path().string();
  if (file.empty()) return absl::InvalidArgumentError("is empty");
  const absl::StatusOr<Parts> parts = split(file, path.ends_with(".glb"));
  if (!parts.ok()) return parts.status();
  const absl::StatusOr<Json> json = parse_json(parts->json);
  if (!json.ok()) return json.status();

  absl::Status status;
  const Object root(*json, "", status);
  if (!status.ok()) return absl::InvalidArgumentError("JSON is not an object");
  const std::optional<Object> asset = root.object("asset");
  const std::string version = asset.has_value() ? asset->text("version") : "";
  if (!version.starts_with("2.")) {
    return absl::InvalidArgumentError(
        absl::StrCat("asset version is '", version.substr(0, 20), "', must be 2.x"));
  }
  if (absl::Status known = check_extensions(root); !known.ok()) return known;

  // order matters: each step checks its indices against what was read before it
  const auto size_of = [&](const char* key) {
    const Json* found = root.find(key);
    return found != nullptr && found->is_array() ? found->size() : 0;
  };
  read_buffers(root, *parts, document);
  if (status.ok()) read_views(root, document);
  if (status.ok()) read_accessors(root, document);
  if (status.ok()) read_materials(root, document);
  if (status.ok()) read_meshes(root, document);
  if (status.ok()) read_skins(root, size_of("nodes"), document);
  if (status.ok()) read_nodes(root, size_of("nodes"), document);
  if (status.ok()) read_animations(root, document);
  if (status.ok()) choose_roots(root, document);
  if (status.ok()) status = check_tree(document);
  if (!status.ok()) return status;
  return document;
}

}  // namespace throng::simplify::gltf
