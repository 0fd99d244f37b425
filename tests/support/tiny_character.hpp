#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <string>
#include <utility>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::test {

struct TinyOptions {
  std::string name = "tiny";
  float height_m = 1.8F;
  float radius_m = 0.25F;
  glm::u8vec3 color{200, 120, 60};
};

/// A small valid animated character: an upright capped cylinder of two joints (root at the feet,
/// upper at half the height) with a texture seam.
///
/// 38 vertices (4 rings of 8 points, the seam column twice, 2 cap centres), 64 triangles; coarsest
/// level 12 vertices (a four-sided prism). The collapse order is made by hand and real: rings
/// first, then every odd column; both copies of a seam point go together, so some counts are not
/// legal. Levels of at most 20 vertices have tones. Clips: "idle" (8 frames) and "walk" (16 frames,
/// stride 1.4 m), both at 16 Hz.
inline render::CharacterData make_tiny_character(const TinyOptions& options = {}) {
  constexpr std::uint32_t kColumns = 8;
  constexpr std::uint32_t kRings = 4;
  constexpr std::uint32_t kVertices = kRings * (kColumns + 1) + 2;
  constexpr std::uint32_t kBottom = kVertices - 2;
  constexpr std::uint32_t kTop = kVertices - 1;
  const auto at = [](std::uint32_t ring, std::uint32_t column) {
    return ring * (kColumns + 1) + column;
  };
  const float height_m = options.height_m;

  // surface, in rows from the feet up
  struct Vertex {
    glm::vec3 position, normal;
    glm::vec2 uv;
    float upper;  // share of the upper joint
  };
  std::vector<Vertex> vertices(kVertices);
  for (std::uint32_t ring = 0; ring < kRings; ++ring) {
    for (std::uint32_t column = 0; column <= kColumns; ++column) {
      // column % kColumns: both copies of a seam point have the same bits
      const float angle_rad = 6.2831853F * static_cast<float>(column % kColumns) / kColumns;
      const float along = static_cast<float>(ring) / (kRings - 1);
      const glm::vec3 outward(std::cos(angle_rad), std::sin(angle_rad), 0.0F);
      vertices[at(ring, column)] = {outward * options.radius_m + glm::vec3(0, 0, along * height_m),
                                    outward,
                                    {static_cast<float>(column) / kColumns, 1.0F - along},
                                    std::clamp(along * 3.0F - 1.0F, 0.0F, 1.0F)};
    }
  }
  vertices[kBottom] = {{0, 0, 0}, {0, 0, -1}, {0.5F, 1.0F}, 0.0F};
  vertices[kTop] = {{0, 0, height_m}, {0, 0, 1}, {0.5F, 0.0F}, 1.0F};
  std::vector<glm::uvec3> triangles;
  for (std::uint32_t column = 0; column < kColumns; ++column) {
    const std::uint32_t next = column + 1;
    for (std::uint32_t ring = 0; ring + 1 < kRings; ++ring) {
      triangles.push_back({at(ring, column), at(ring, next), at(ring + 1, next)});
      triangles.push_back({at(ring, column), at(ring + 1, next), at(ring + 1, column)});
    }
    triangles.push_back({kBottom, at(0, next), at(0, column)});
    triangles.push_back({kTop, at(kRings - 1, column), at(kRings - 1, next)});
  }

  // collapses, first to last; a group goes at once
  using Group = std::vector<std::pair<std::uint32_t, std::uint32_t>>;
  std::vector<Group> groups;
  for (const auto& [ring, into] : {std::pair{1U, 0U}, std::pair{2U, 3U}}) {
    groups.push_back({{at(ring, 0), at(into, 0)}, {at(ring, kColumns), at(into, kColumns)}});
    for (std::uint32_t c = 1; c < kColumns; ++c) groups.push_back({{at(ring, c), at(into, c)}});
  }
  for (std::uint32_t c = 1; c < kColumns; c += 2) {
    groups.push_back({{at(0, c), at(0, c - 1)}});
    groups.push_back({{at(kRings - 1, c), at(kRings - 1, c - 1)}});
  }

  // collapse order: what stays first, then the collapses from last to first
  std::vector<std::uint32_t> old_target(kVertices, 0), order, new_index(kVertices, 0);
  std::vector<bool> goes(kVertices, false), half_collapsed(kVertices + 1, false);
  for (const Group& group : groups) {
    for (const auto& [from, to] : group) {
      old_target[from] = to;
      goes[from] = true;
    }
  }
  for (std::uint32_t i = 0; i < kVertices; ++i) {
    if (!goes[i]) order.push_back(i);
  }
  render::CharacterData data;
  data.coarsest_count = static_cast<std::uint32_t>(order.size());
  data.collapse_error_m.assign(kVertices, 0.0F);
  for (std::size_t g = groups.size(); g-- > 0;) {
    for (std::size_t k = 0; k < groups[g].size(); ++k) {
      if (k > 0) half_collapsed[order.size()] = true;
      data.collapse_error_m[order.size()] = 0.001F * static_cast<float>(g + 1);
      order.push_back(groups[g][k].first);
    }
  }
  for (std::uint32_t i = 0; i < kVertices; ++i) new_index[order[i]] = i;

  data.name = options.name;
  for (std::uint32_t i = 0; i < kVertices; ++i) {
    const Vertex& vertex = vertices[order[i]];
    data.position.push_back(vertex.position);
    data.normal.push_back(render::encode_octahedral(vertex.normal));
    data.uv.push_back(glm::u16vec2(vertex.uv * 65535.0F + 0.5F));
    const auto upper = static_cast<std::uint8_t>(vertex.upper * 255.0F + 0.5F);
    const auto root = static_cast<std::uint8_t>(255 - upper);
    data.joint_index.push_back(upper > root ? glm::u8vec4(1, 0, 0, 0) : glm::u8vec4(0, 1, 0, 0));
    data.joint_weight.push_back({std::max(upper, root), std::min(upper, root), 0, 0});
    data.collapse_target.push_back(goes[order[i]] ? new_index[old_target[order[i]]] : 0);
  }

  // a triangle is drawn from the smallest n at which its corners differ
  std::vector<std::pair<std::uint32_t, glm::uvec3>> alive;
  for (const glm::uvec3& triangle : triangles) {
    glm::uvec3 corner(new_index[triangle.x], new_index[triangle.y], new_index[triangle.z]);
    const glm::uvec3 full = corner;
    std::uint32_t least = data.coarsest_count;
    for (std::uint32_t n = kVertices; n > data.coarsest_count; --n) {
      for (int i = 0; i < 3; ++i) {
        if (corner[i] == n - 1) corner[i] = data.collapse_target[n - 1];
      }
      if (corner.x == corner.y || corner.y == corner.z || corner.z == corner.x) {
        least = n;
        break;
      }
    }
    alive.emplace_back(least, full);
  }
  std::stable_sort(alive.begin(), alive.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [least, triangle] : alive) data.triangle.push_back(triangle);
  data.triangle_flags.assign(data.triangle.size(), 0);
  for (std::uint32_t n = 0; n <= kVertices; ++n) {
    const bool is_legal = n >= data.coarsest_count && !half_collapsed[n];
    data.legal_count.push_back(is_legal ? n : (n == 0 ? 0 : data.legal_count.back()));
    std::uint32_t count = 0;
    while (n >= data.coarsest_count && count < alive.size() && alive[count].first <= n) ++count;
    data.triangle_count_at.push_back(count);
  }

  // coarse levels show tones: the colour, by corner a little darker and less dyed
  std::uint32_t toned = 0;
  for (const std::uint32_t n : {20U, 14U}) {
    data.tone_band.push_back({n, toned});
    toned += data.triangle_count_at[n];
  }
  for (std::uint32_t i = 0; i < 3 * toned; ++i) {
    const float share = static_cast<float>(4 + i % 5) / 8.0F;
    data.corner_tone.push_back(render::pack_corner_tone(glm::vec3(options.color) / 255.0F * share,
                                                        {0.0F, 0.0F, share, 1.0F - share}));
  }

  // two joints; the upper one bends forward and back
  const auto affine = [](const glm::mat4& matrix) {
    const glm::mat4 rows = glm::transpose(matrix);
    return render::Affine{{rows[0], rows[1], rows[2]}};
  };
  const glm::mat4 model_from_upper = glm::translate(glm::mat4(1.0F), {0, 0, height_m / 2});
  data.joints = {{"root", -1, affine(glm::mat4(1.0F))},
                 {"upper", 0, affine(glm::inverse(model_from_upper))}};
  const auto add_clip = [&](const char* name, render::ClipKind kind, std::uint32_t frames,
                            float swing_rad, float stride_m) {
    constexpr float kRate_hz = 16.0F;
    const auto first = static_cast<std::uint32_t>(data.palette.size() / 2);
    data.clips.push_back({name, kind, first, frames, kRate_hz, true, stride_m,
                          stride_m * kRate_hz / static_cast<float>(frames)});
    for (std::uint32_t frame = 0; frame < frames; ++frame) {
      const float phase_rad = 6.2831853F * static_cast<float>(frame) / static_cast<float>(frames);
      const glm::mat4 bent =
          glm::rotate(model_from_upper, swing_rad * std::sin(phase_rad), {0, 1, 0});
      data.palette.push_back(affine(glm::mat4(1.0F)));
      data.palette.push_back(affine(bent * glm::inverse(model_from_upper)));
    }
  };
  add_clip("idle", render::ClipKind::kIdle, 8, 0.05F, 0.0F);
  add_clip("walk", render::ClipKind::kWalk, 16, 0.5F, 1.4F);
  data.bounds = {0, 0, height_m / 2, height_m / 2 + options.radius_m * 1.5F};
  data.height_m = height_m;

  // a checkerboard of 16 px with all its mip levels, and a mask that tints the upper half
  data.base_color_width_px = data.base_color_height_px = 16;
  data.tint_mask_width_px = data.tint_mask_height_px = 4;
  for (std::uint32_t size = 16; size >= 1; size /= 2, ++data.base_color_levels) {
    for (std::uint32_t i = 0; i < size * size; ++i) {
      const bool is_dark = size > 4 && ((i % size) / (size / 4) + (i / size) / (size / 4)) % 2 == 1;
      const int divisor = is_dark ? 2 : 1;
      for (int channel = 0; channel < 3; ++channel) {
        data.base_color.push_back(static_cast<std::uint8_t>(options.color[channel] / divisor));
      }
      data.base_color.push_back(255);
    }
  }
  for (std::uint32_t size = 4; size >= 1; size /= 2, ++data.tint_mask_levels) {
    for (std::uint32_t i = 0; i < size * size; ++i) {
      const std::uint8_t top = i < size * size / 2 ? 255 : 0;
      data.tint_mask.insert(data.tint_mask.end(),
                            {0, 0, top, static_cast<std::uint8_t>(255 - top)});
    }
  }
  return data;
}

}  // namespace throng::test
