#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "throng/render/asset.hpp"

namespace throng::render {
namespace {

using Json = nlohmann::json;

constexpr int kCastVersion = 1;
constexpr std::size_t kMaxMembers = 4096;
constexpr std::uintmax_t kMaxJsonSize = 16U << 20U;

constexpr std::array<const char*, kClipKinds> kClipKindNames = {
    "other", "idle", "walk", "run", "sit", "cheer", "wave", "talk", "phone"};

template <typename... Parts>
absl::Status bad(const Parts&... parts) {
  return absl::InvalidArgumentError(absl::StrCat(parts...));
}

/// A number in [low, high], or `fallback` where the key is missing.
absl::StatusOr<float> number(const Json& object, const char* key, float fallback, float low,
                             float high) {
  const auto found = object.find(key);
  if (found == object.end()) return fallback;
  if (!found->is_number()) return bad(key, " is not a number");
  const float value = found->get<float>();
  if (!(value >= low && value <= high))
    return bad(key, " is ", value, ", must be ", low, " to ", high);
  return value;
}

/// Lets cast.json correct what baking guessed about a clip: "clips": {NAME: {"kind", "stride_m"}}.
absl::Status override_clip(const std::string& name, const Json& change, Character& character) {
  if (!change.is_object()) return bad("clips: ", name, " is not an object");
  for (Clip& clip : character.clips) {
    if (clip.name != name) continue;
    if (const auto kind = change.find("kind"); kind != change.end()) {
      bool is_known = false;
      for (std::uint32_t value = 0; value < kClipKinds; ++value) {
        if (*kind != kClipKindNames[value]) continue;
        clip.kind = static_cast<ClipKind>(value);
        is_known = true;
      }
      if (!is_known) {
        return bad("clips: ", name, ": kind is ", kind->dump(), ", must be one of ",
                   absl::StrJoin(kClipKindNames, ", "));
      }
    }
    const auto stride_m = number(change, "stride_m", clip.stride_m, 0.0F, 1000.0F);
    if (!stride_m.ok()) return bad("clips: ", name, ": ", stride_m.status().message());
    if (*stride_m != clip.stride_m) {
      clip.stride_m = *stride_m;
      clip.speed_mps = clip.stride_m * clip.rate_hz / static_cast<float>(clip.frame_count);
    }
    return absl::OkStatus();
  }
  return bad("clips: the character has no clip ", name);
}

absl::StatusOr<CastMember> read_member(const Json& entry, const std::filesystem::path& folder) {
  if (!entry.is_object()) return bad("is not an object");
  const auto file = entry.find("file");
  if (file == entry.end() || !file->is_string()) return bad("file is missing or not a string");
  const std::filesystem::path file_name = file->get<std::string>();
  if (file_name.empty() || file_name.filename() != file_name || file_name == "." ||
      file_name == "..") {
    return bad("file is ", file->dump(), ", must be a file name in the cast's own folder");
  }
  const auto weight = number(entry, "weight", 1.0F, 0.0F, 1.0e6F);
  if (!weight.ok()) return weight.status();
  auto character = read_character((folder / file_name).string());
  if (!character.ok()) return character.status();
  if (const auto clips = entry.find("clips"); clips != entry.end()) {
    if (!clips->is_object()) return bad("clips is not an object");
    for (const auto& [name, change] : clips->items()) {
      if (auto status = override_clip(name, change, *character); !status.ok()) return status;
    }
  }
  return CastMember{*std::move(character), *weight};
}

}  // namespace

const char* name_of(ClipKind kind) {
  const auto value = static_cast<std::uint32_t>(kind);
  return value < kClipKinds ? kClipKindNames[value] : nullptr;
}

absl::StatusOr<Cast> read_cast(const std::string& folder) {
  const std::filesystem::path path = std::filesystem::path(folder) / "cast.json";
  std::error_code error;
  const std::uintmax_t size_bytes = std::filesystem::file_size(path, error);
  if (error) {
    return absl::NotFoundError(absl::StrCat(path.string(), ": ", error.message(),
                                            "; make a cast with throng-bake --builtin -o ",
                                            folder));
  }
  if (size_bytes > kMaxJsonSize)
    return bad(path.string(), ": has ", size_bytes, " bytes, limit ", kMaxJsonSize);
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(absl::StrCat(path.string(), ": can't be opened"));
  const Json json = Json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded() || !json.is_object()) return bad(path.string(), ": is not a JSON object");

  const auto version = json.find("throng_cast");
  if (version == json.end() || !version->is_number_integer()) {
    return bad(path.string(), ": throng_cast, the version number, is missing");
  }
  if (version->get<std::int64_t>() != kCastVersion) {
    return absl::FailedPreconditionError(absl::StrCat(path.string(), ": throng_cast is ",
                                                      version->dump(), ", this program reads ",
                                                      kCastVersion));
  }
  const auto characters = json.find("characters");
  if (characters == json.end() || !characters->is_array() || characters->empty() ||
      characters->size() > kMaxMembers) {
    return bad(path.string(), ": characters must be a list of 1 to ", kMaxMembers);
  }

  Cast cast;
  cast.folder = folder;
  std::set<std::string> names;
  float total_weight = 0.0F;
  for (std::size_t i = 0; i < characters->size(); ++i) {
    auto member = read_member((*characters)[i], folder);
    if (!member.ok()) {
      return absl::Status(member.status().code(), absl::StrCat(path.string(), ": characters[", i,
                                                               "]: ", member.status().message()));
    }
    if (!names.insert(member->character.name).second) {
      return bad(path.string(), ": characters[", i, "]: second character named ",
                 member->character.name);
    }
    total_weight += member->weight;
    cast.members.push_back(*std::move(member));
  }
  if (!(total_weight > 0.0F)) return bad(path.string(), ": all weights are 0");
  return cast;
}

}  // namespace throng::render
