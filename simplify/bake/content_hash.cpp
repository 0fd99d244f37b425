#include "simplify/bake/content_hash.hpp"

#include <absl/strings/str_cat.h>
#include <xxhash.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <vector>

namespace throng::simplify {
namespace {

// Counts up when baking changes what it makes of the same input.
constexpr int kBakeRevision = 1;

class Hasher {
 public:
  Hasher() : state_(XXH3_createState(), &XXH3_freeState) { XXH3_64bits_reset(state_.get()); }

  void add(const void* bytes, std::size_t size) {
    const std::uint64_t length = size;  // so that neighbours can't trade bytes
    XXH3_64bits_update(state_.get(), &length, sizeof(length));
    if (size > 0) XXH3_64bits_update(state_.get(), bytes, size);
  }
  void add(const std::string& text) { add(text.data(), text.size()); }
  template <typename T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void add(const T& value) { add(&value, sizeof(value)); }
  template <typename T>
  void add(const std::vector<T>& values) {
    add(values.data(), values.size() * sizeof(T));
  }

  std::string hex() const {
    return absl::StrCat(absl::Hex(XXH3_64bits_digest(state_.get()), absl::kZeroPad16));
  }

 private:
  std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state_;
};

absl::StatusOr<std::string> read_file(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return absl::NotFoundError(absl::StrCat(path.string(), ": is not a file"));
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(absl::StrCat(path.string(), ": can't be opened"));
  return std::string(std::istreambuf_iterator<char>(file), {});
}

}  // namespace

std::string tool_version(const BakeOptions& options) {
  return absl::StrCat("throng-bake ", THRONG_VERSION, " r", kBakeRevision, " ",
                      options.criterion == Criterion::kPeng2011 ? "peng2011" : "throng", " poses ",
                      options.max_poses, " coarsest ", options.coarsest_count, " height ",
                      options.height_m, " texture ", options.rebuild.max_texture_px);
}

absl::StatusOr<std::string> hash_input(const std::string& path) {
  auto bytes = read_file(path);
  if (!bytes.ok()) return bytes.status();
  Hasher hasher;
  hasher.add(*bytes);
  if (std::filesystem::path(path).extension() == ".gltf") {
    // a missing or strange file is for the importer to report
    const auto json = nlohmann::json::parse(*bytes, nullptr, /*allow_exceptions=*/false);
    for (const char* list : {"buffers", "images"}) {
      if (!json.is_object() || !json.contains(list) || !json[list].is_array()) continue;
      for (const auto& entry : json[list]) {
        if (!entry.is_object() || !entry.contains("uri") || !entry["uri"].is_string()) continue;
        const std::string uri = entry["uri"].get<std::string>();
        if (uri.rfind("data:", 0) == 0) continue;
        const auto other = read_file(std::filesystem::path(path).parent_path() / uri);
        if (other.ok()) hasher.add(*other);
      }
    }
  }
  return hasher.hex();
}

std::string hash_character(const SourceCharacter& character) {
  Hasher hasher;
  hasher.add(character.name);
  for (const SourcePoint& point : character.points) {
    hasher.add(&point.position, sizeof(point.position));
    hasher.add(&point.joint, sizeof(point.joint));
    hasher.add(&point.weight, sizeof(point.weight));
  }
  hasher.add(character.normals);
  hasher.add(character.uvs);
  for (const SourceTriangle& triangle : character.triangles) {
    hasher.add(triangle.corner.data(), sizeof(triangle.corner));
    hasher.add(triangle.material);
  }
  for (const SourceMaterial& material : character.materials) {
    hasher.add(material.name);
    for (const SourceImage* image : {&material.base_color, &material.tint_mask}) {
      hasher.add(image->width_px);
      hasher.add(image->height_px);
      hasher.add(image->rgba);
    }
    hasher.add(&material.factor, sizeof(material.factor));
    hasher.add(material.wrap_u);
    hasher.add(material.wrap_v);
    hasher.add(material.double_sided);
    hasher.add(material.alpha_cutout);
    hasher.add(material.alpha_cutoff);
  }
  for (const SourceJoint& joint : character.joints) {
    hasher.add(joint.name);
    hasher.add(joint.parent);
    hasher.add(&joint.joint_from_model, sizeof(joint.joint_from_model));
  }
  for (const SourceClip& clip : character.clips) {
    hasher.add(clip.name);
    hasher.add(clip.kind);
    hasher.add(clip.rate_hz);
    hasher.add(clip.loop);
    hasher.add(clip.frame_count);
    hasher.add(clip.model_from_joint);
    hasher.add(clip.stride_m);
  }
  return hasher.hex();
}

}  // namespace throng::simplify
