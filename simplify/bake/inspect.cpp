#include "simplify/bake/inspect.hpp"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "simplify/bake/levels.hpp"

namespace throng::simplify {
namespace {

/// What a clip is asked for by: its kind, or its own name where it has none.
std::string role_of(const render::Clip& clip) {
  return clip.kind == render::ClipKind::kOther ? absl::AsciiStrToLower(clip.name)
                                               : name_of(clip.kind);
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

template <typename T>
std::size_t different(std::vector<T> values) {
  const auto less = [](const T& a, const T& b) { return std::memcmp(&a, &b, sizeof(T)) < 0; };
  std::sort(values.begin(), values.end(), less);
  std::size_t count = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    count += i == 0 || less(values[i - 1], values[i]) ? 1 : 0;
  return count;
}

/// Different texture coordinates of different places; more vertices than these are hard creases.
std::size_t uv_count(const render::Character& character) {
  struct PointUv {
    glm::vec3 position;
    glm::u16vec2 uv;
  };
  static_assert(sizeof(PointUv) == 16);  // no padding: compared by bytes
  std::vector<PointUv> pairs;
  for (std::uint32_t i = 0; i < character.vertex_count(); ++i)
    pairs.push_back({character.position[i], character.uv[i]});
  return different(std::move(pairs));
}

/// Counts of one character as table 1 of Dong & Peng 2019 has them.
struct Counts {
  const char* name;
  std::array<std::size_t, 4> value;  // vertices, triangles, texture UVs, joints
};
constexpr Counts kTable1[] = {
    {"Alien", {2846, 5688, 3334, 64}},    {"Bug", {3047, 6090, 3746, 44}},
    {"Creepy", {2483, 4962, 2851, 67}},   {"Daemon", {3328, 6652, 4087, 55}},
    {"Devourer", {2975, 5946, 3494, 62}}, {"Fat", {2555, 5106, 2960, 50}},
    {"Mutant", {2265, 4526, 2649, 46}},   {"Nasty", {3426, 6848, 3990, 45}},
    {"Pangolin", {2762, 5520, 3257, 49}}, {"Ripper Dog", {2489, 4974, 2982, 48}},
    {"Rock", {2594, 5184, 3103, 62}},     {"Spider", {2936, 5868, 3374, 38}},
    {"Titan", {3261, 6518, 3867, 45}},    {"Troll", {2481, 4958, 2939, 55}}};

Counts counts_of(const render::Character& character) {
  return {character.name.c_str(),
          {point_count(character), character.triangle_count(), uv_count(character),
           character.joint_count()}};
}

/// Largest difference of a count, in % of the paper's.
double difference_percent(const Counts& counts, const Counts& row) {
  double largest = 0.0;
  for (std::size_t k = 0; k < counts.value.size(); ++k) {
    const auto paper = static_cast<double>(row.value[k]);
    largest =
        std::max(largest, 100.0 * std::abs(static_cast<double>(counts.value[k]) - paper) / paper);
  }
  return largest;
}

/// The row that a character has the counts of, within 2 %; null for others.
const Counts* table1_row(const Counts& counts) {
  const Counts* nearest = nullptr;
  for (const Counts& row : kTable1) {
    if (nearest == nullptr ||
        difference_percent(counts, row) < difference_percent(counts, *nearest))
      nearest = &row;
  }
  return difference_percent(counts, *nearest) <= 2.0 ? nearest : nullptr;
}

}  // namespace

std::size_t point_count(const render::Character& character) {
  return different(std::vector<glm::vec3>(character.position.begin(), character.position.end()));
}

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
  const Counts counts = counts_of(character);
  if (const Counts* row = table1_row(counts); row != nullptr) {
    absl::StrAppendFormat(
        &text,
        "  counts of %s (Dong & Peng 2019, table 1), within %.1f %%: %u vertices, "
        "%u triangles, %u UVs, %u joints\n",
        row->name, difference_percent(counts, *row), row->value[0], row->value[1], row->value[2],
        row->value[3]);
  }
  text += "  level      vertices  triangles  error\n";
  for (const Level& level : levels_of(character)) {
    absl::StrAppendFormat(&text, "  %-9s  %8u  %9u  %.1f mm\n", level.name, level.vertices,
                          level.triangles, 1000.0F * level.error_m);
  }
  text += "  clip                          role        frames  rate   stride  speed\n";
  for (const render::Clip& clip : character.clips) {
    absl::StrAppendFormat(&text, "  %-28s  %-10s  %6u  %2.0f Hz  %4.2f m  %4.2f m/s%s\n", clip.name,
                          role_of(clip), clip.frame_count, clip.rate_hz, clip.stride_m,
                          clip.speed_mps, clip.loop ? "" : "  once");
  }
  return text;
}

std::string inspect_table(const std::vector<render::Character>& characters) {
  std::string text =
      absl::StrFormat("%-28s%9s%10s%7s%7s%9s%9s  %-11s%9s%10s%7s%7s%7s\n", "character", "vertices",
                      "triangles", "UVs", "joints", "height", "coarsest", "table 1", "vertices",
                      "triangles", "UVs", "joints", "off");
  for (const render::Character& character : characters) {
    const Counts counts = counts_of(character);
    absl::StrAppendFormat(&text, "%-28s%9u%10u%7u%7u%7.2f m%9u", character.name, counts.value[0],
                          counts.value[1], counts.value[2], counts.value[3], character.height_m,
                          character.coarsest_count);
    if (const Counts* row = table1_row(counts); row != nullptr) {
      absl::StrAppendFormat(&text, "  %-11s%9u%10u%7u%7u%5.1f %%", row->name, row->value[0],
                            row->value[1], row->value[2], row->value[3],
                            difference_percent(counts, *row));
    }
    text += '\n';
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
      {"uvs", uv_count(character)},
      {"joints", character.joint_count()},
      {"coarsest_vertices", character.coarsest_count},
      {"height_m", character.height_m},
      {"bounds", {character.bounds.x, character.bounds.y, character.bounds.z, character.bounds.w}},
      {"base_color_px", {character.base_color.width_px, character.base_color.height_px}},
      {"tint_mask_px", {character.tint_mask.width_px, character.tint_mask.height_px}},
      {"file_bytes", file_bytes}};
  const Counts counts = counts_of(character);
  if (const Counts* row = table1_row(counts); row != nullptr) {
    json["table1"] = {
        {"name", row->name},          {"vertices", row->value[0]},
        {"triangles", row->value[1]}, {"uvs", row->value[2]},
        {"joints", row->value[3]},    {"difference_percent", difference_percent(counts, *row)}};
  }
  for (const Level& level : levels_of(character)) {
    json["levels"].push_back({{"name", level.name},
                              {"vertices", level.vertices},
                              {"triangles", level.triangles},
                              {"error_m", level.error_m}});
  }
  for (const render::Clip& clip : character.clips) {
    json["clips"].push_back({{"name", clip.name},
                             {"kind", name_of(clip.kind)},
                             {"role", role_of(clip)},
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
