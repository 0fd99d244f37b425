#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::bench {

/// An artificial character with the numbers of a real one: a closed tube of rings and columns, four
/// joints for each vertex, idle, walk and run, collapsed edge by edge in a scattered order.
inline render::CharacterData make_bench_character(std::uint32_t rings, std::uint32_t columns,
                                                  std::uint32_t joints, std::uint32_t salt) {
  const std::uint32_t vertices = rings * columns;
  const auto at = [columns](std::uint32_t r, std::uint32_t c) { return r * columns + c % columns; };
  std::vector<glm::uvec3> triangles;
  for (std::uint32_t r = 0; r + 1 < rings; ++r) {
    for (std::uint32_t c = 0; c < columns; ++c) {
      triangles.push_back({at(r, c), at(r, c + 1), at(r + 1, c + 1)});
      triangles.push_back({at(r, c), at(r + 1, c + 1), at(r + 1, c)});
    }
  }

  // collapse in a scattered order into the first neighbour that is still there
  std::vector<std::uint32_t> order(vertices);
  std::iota(order.begin(), order.end(), 0U);
  std::uint64_t state = 0x9e3779b97f4a7c15ULL + salt;
  const auto random = [&state] {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<std::uint32_t>(state >> 33);
  };
  for (std::uint32_t i = vertices; i > 1; --i) std::swap(order[i - 1], order[random() % i]);
  constexpr std::uint32_t kCoarsest = 24;
  std::vector<std::vector<std::uint32_t>> around(vertices);
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) around[triangles[t][k]].push_back(t);
  }
  std::vector<glm::uvec3> current = triangles;
  std::vector<std::uint32_t> dies_at(triangles.size(), 0), target(vertices, 0), place(vertices);
  for (std::uint32_t i = 0; i < vertices; ++i) place[order[i]] = i;
  for (std::uint32_t n = vertices; n > kCoarsest; --n) {
    const std::uint32_t gone = order[n - 1];
    std::uint32_t into = order[0];
    for (const std::uint32_t t : around[gone]) {
      if (dies_at[t] != 0) continue;
      for (int k = 0; k < 3; ++k) {
        if (current[t][k] != gone) into = current[t][k];
      }
      break;
    }
    target[gone] = into;
    for (const std::uint32_t t : around[gone]) {
      if (dies_at[t] != 0) continue;
      for (int k = 0; k < 3; ++k) {
        if (current[t][k] == gone) current[t][k] = into;
      }
      const glm::uvec3& c = current[t];
      if (c.x == c.y || c.y == c.z || c.z == c.x) {
        dies_at[t] = n;
      } else {
        around[into].push_back(t);
      }
    }
  }

  render::CharacterData data;
  data.name = "bench" + std::to_string(salt);
  data.coarsest_count = kCoarsest;
  for (std::uint32_t i = 0; i < vertices; ++i) {
    const std::uint32_t old = order[i];
    const float along = static_cast<float>(old / columns) / static_cast<float>(rings - 1);
    const float turn_rad =
        6.2831853F * static_cast<float>(old % columns) / static_cast<float>(columns);
    const glm::vec3 outward(std::cos(turn_rad), std::sin(turn_rad), 0.0F);
    data.position.push_back(outward * 0.25F + glm::vec3(0, 0, 1.75F * along));
    data.normal.push_back(render::encode_octahedral(outward));
    data.uv.push_back({static_cast<std::uint16_t>(turn_rad * 10000.0F),
                       static_cast<std::uint16_t>(along * 65535.0F)});
    const auto joint = static_cast<std::uint32_t>(along * static_cast<float>(joints - 1));
    const auto near = [&](std::uint32_t k) {
      return static_cast<std::uint8_t>((joint + k) % joints);
    };
    data.joint_index.push_back({near(0), near(1), near(joints - 1), near(2)});
    data.joint_weight.push_back({140, 70, 30, 15});
    data.collapse_target.push_back(i < kCoarsest ? 0 : place[target[old]]);
    data.collapse_error_m.push_back(0.0F);
  }
  std::vector<std::uint32_t> by_death(triangles.size());
  std::iota(by_death.begin(), by_death.end(), 0U);
  std::stable_sort(by_death.begin(), by_death.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return dies_at[a] < dies_at[b]; });
  for (const std::uint32_t t : by_death) {
    data.triangle.push_back({place[triangles[t].x], place[triangles[t].y], place[triangles[t].z]});
  }
  data.triangle_flags.assign(data.triangle.size(), 0);
  for (std::uint32_t n = 0, alive = 0; n <= vertices; ++n) {
    while (alive < by_death.size() && dies_at[by_death[alive]] <= n) ++alive;
    data.triangle_count_at.push_back(n < kCoarsest ? 0 : alive);
    data.legal_count.push_back(n < kCoarsest ? 0 : n);
  }

  const render::Affine identity{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  for (std::uint32_t j = 0; j < joints; ++j) {
    data.joints.push_back({"j" + std::to_string(j), static_cast<std::int32_t>(j) - 1, identity});
  }
  const auto add_clip = [&](const char* name, render::ClipKind kind, std::uint32_t frames,
                            float stride_m) {
    const auto first = static_cast<std::uint32_t>(data.palette.size() / joints);
    data.clips.push_back({name, kind, first, frames, 30.0F, true, stride_m,
                          stride_m * 30.0F / static_cast<float>(frames)});
    for (std::uint32_t f = 0; f < frames; ++f) {
      for (std::uint32_t j = 0; j < joints; ++j) {
        const float angle_rad =
            0.2F * std::sin(6.28F * static_cast<float>(f) / static_cast<float>(frames) +
                            static_cast<float>(j));
        const glm::mat4 turned =
            glm::transpose(glm::rotate(glm::mat4(1.0F), angle_rad, glm::vec3(0, 1, 0)));
        data.palette.push_back({{turned[0], turned[1], turned[2]}});
      }
    }
  };
  add_clip("idle", render::ClipKind::kIdle, 60, 0.0F);
  add_clip("walk", render::ClipKind::kWalk, 32, 1.4F);
  add_clip("run", render::ClipKind::kRun, 22, 2.4F);
  data.bounds = {0.0F, 0.0F, 0.9F, 1.2F};
  data.height_m = 1.75F;
  data.base_color_width_px = data.base_color_height_px = data.base_color_levels = 1;
  data.base_color = {200, 160, 120, 255};
  return data;
}

}  // namespace throng::bench
