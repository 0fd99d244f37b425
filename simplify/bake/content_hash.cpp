#include "simplify/bake/content_hash.hpp"

#include <absl/strings/str_cat.h>
#include <xxhash.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>

#include "simplify/bake/code_hash.hpp"

namespace throng::simplify {
namespace {

class Hasher {
 public:
  Hasher() : state_(XXH3_createState(), &XXH3_freeState) { XXH3_64bits_reset(state_.get()); }

  void add(const std::string& bytes) {
    const std::uint64_t size = bytes.size();  // so that neighbours can't trade bytes
    XXH3_64bits_update(state_.get(), &size, sizeof(size));
    XXH3_64bits_update(state_.get(), bytes.data(), bytes.size());
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

std::string tool_version(const BakeOptions& options, const ReliefOptions& relief) {
  return absl::StrCat("throng-bake ", THRONG_VERSION, " ", kBakeCode, " ",
                      options.criterion == Criterion::kPeng2011 ? "peng2011" : "throng", " poses ",
                      options.max_poses, " coarsest ", options.coarsest_count, " height ",
                      options.height_m, " texture ", options.rebuild.max_texture_px, " relief ",
                      relief.texel_m, " ", relief.uniform_px);
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

}  // namespace throng::simplify
