#include "simplify/bake/inspect.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <unordered_set>

#include "simplify/bake/levels.hpp"

namespace throng::simplify {
namespace {

using render::ClipKind;

const char* name_of(ClipKind kind) {
  switch (kind) {
    case ClipKind::kOther:
      return "other";
    case ClipKind::kIdle:
      return "idle";
    case ClipKind::kWalk:
      return "walk";
    case ClipKind::kRun:
      return "run";
    case ClipKind::kSit:
      return "sit";
    case ClipKind::kCheer:
      return "cheer";
  }
  return "unknown";
}

struct Level {
  const char* name;
  std::uint32_t vertices, triangles;
  float error_m;
};

std::vector<Level> levels_of(const render::Character& character) {
  std::vector<Level> levels;
  for (const LevelSpec& spec : kLevelSpecs) {
    const std::uint32_t n = level_vertices(character, spec.share);
    const float error_m = n < character.vertex_count() ? character.collapse_error_m[n] : 0.0F;
    levels.push_back({spec.name, n, character.triangle_count_at[n], error_m});
  }
  return levels;
}

/// Different places, of which the vertices are the wedges.
std::size_t point_count(const render::Character& character) {
  struct Hash {
    std::size_t operator()(const glm::vec3& p) const {
      const std::hash<float> hash;
      return hash(p.x) ^ (hash(p.y) * 0x9E3779B1U) ^ (hash(p.z) * 0x85EBCA77U);
    }
  };
  std::unordered_set<glm::vec3, Hash> places(character.position.begin(), character.position.end());
  return places.size();
}

}  // namespace

std::string inspect_text(const render::Character& character, std::uint64_t file_bytes) {
  std::string text = absl::StrFormat(
      "%s\n  %u vertices (uv wedges of %u points), %u triangles, %u joints, %.2f m tall, %.1f "
      "MiB\n",
      character.name, character.vertex_count(), point_count(character), character.triangle_count(),
      character.joint_count(), character.height_m,
      static_cast<double>(file_bytes) / (1024.0 * 1024.0));
  absl::StrAppendFormat(&text, "  bounds: centre (%.2f, %.2f, %.2f), radius %.2f m\n",
                        character.bounds.x, character.bounds.y, character.bounds.z,
                        character.bounds.w);
  absl::StrAppendFormat(&text, "  base colour %u x %u px, %u levels; tint mask ",
                        character.base_color.width_px, character.base_color.height_px,
                        character.base_color.level_count);
  if (character.tint_mask.texels.empty()) {
    text += "none\n";
  } else {
    absl::StrAppendFormat(&text, "%u x %u px\n", character.tint_mask.width_px,
                          character.tint_mask.height_px);
  }
  text += "  level      vertices  triangles  error\n";
  for (const Level& level : levels_of(character)) {
    absl::StrAppendFormat(&text, "  %-9s  %8u  %9u  %.1f mm\n", level.name, level.vertices,
                          level.triangles, 1000.0F * level.error_m);
  }
  text += "  clip                          kind   frames  rate   stride  speed\n";
  for (const render::Clip& clip : character.clips) {
    absl::StrAppendFormat(&text, "  %-28s  %-5s  %6u  %2.0f Hz  %4.2f m  %4.2f m/s%s\n", clip.name,
                          name_of(clip.kind), clip.frame_count, clip.rate_hz, clip.stride_m,
                          clip.speed_mps, clip.loop ? "" : "  once");
  }
  return text;
}

std::string inspect_json(const render::Character& character, std::uint64_t file_bytes) {
  using Json = nlohmann::ordered_json;
  Json json = {
      {"name", character.name},
      {"vertices", character.vertex_count()},
      {"points", point_count(character)},
      {"triangles", character.triangle_count()},
      {"joints", character.joint_count()},
      {"coarsest_vertices", character.coarsest_count},
      {"height_m", character.height_m},
      {"bounds", {character.bounds.x, character.bounds.y, character.bounds.z, character.bounds.w}},
      {"base_color_px", {character.base_color.width_px, character.base_color.height_px}},
      {"tint_mask_px", {character.tint_mask.width_px, character.tint_mask.height_px}},
      {"file_bytes", file_bytes}};
  for (const Level& level : levels_of(character)) {
    json["levels"].push_back({{"name", level.name},
                              {"vertices", level.vertices},
                              {"triangles", level.triangles},
                              {"error_m", level.error_m}});
  }
  for (const render::Clip& clip : character.clips) {
    json["clips"].push_back({{"name", clip.name},
                             {"kind", name_of(clip.kind)},
                             {"frames", clip.frame_count},
                             {"rate_hz", clip.rate_hz},
                             {"loop", clip.loop},
                             {"stride_m", clip.stride_m},
                             {"speed_mps", clip.speed_mps}});
  }
  // names in files need not be UTF-8
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace throng::simplify
