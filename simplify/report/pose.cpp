#include "simplify/report/pose.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace throng::simplify {
namespace {

constexpr std::uint32_t kLandmarks = 160;  // vertices that tell poses apart
constexpr float kSameM2 = 1.0e-6F;         // within 1 mm of a chosen frame: the same pose

glm::mat3x4 blended(const render::Character& character, std::size_t vertex,
                    const render::Affine* palette) {
  glm::mat3x4 rows(0.0F);  // columns of this are the affine's rows
  for (int k = 0; k < 4; ++k) {
    const std::uint8_t weight = character.joint_weight[vertex][k];
    if (weight == 0) continue;
    const render::Affine& joint = palette[character.joint_index[vertex][k]];
    for (int r = 0; r < 3; ++r) rows[r] += (static_cast<float>(weight) / 255.0F) * joint.row[r];
  }
  return rows;
}

glm::vec3 times(const glm::mat3x4& rows, const glm::vec4& v) {
  return {glm::dot(rows[0], v), glm::dot(rows[1], v), glm::dot(rows[2], v)};
}

const render::Affine* palette_of(const render::Character& character, PoseId pose) {
  const std::size_t frame = character.clips[pose.clip].first_frame + std::size_t{pose.frame};
  return character.palette.data() + frame * character.joint_count();
}

}  // namespace

std::string pose_name(const render::Character& character, PoseId pose) {
  return absl::StrCat(character.clips[pose.clip].name, " frame ", pose.frame);
}

void pose_positions(const render::Character& character, std::size_t frame,
                    std::span<glm::vec3> position) {
  const render::Affine* palette = character.palette.data() + frame * character.joint_count();
  for (std::size_t i = 0; i < position.size(); ++i)
    position[i] = times(blended(character, i, palette), glm::vec4(character.position[i], 1.0F));
}

PosedVertices pose_vertices(const render::Character& character, PoseId pose) {
  const render::Affine* palette = palette_of(character, pose);
  PosedVertices posed;
  posed.position.resize(character.vertex_count());
  posed.normal.resize(character.vertex_count());
  for (std::size_t i = 0; i < posed.position.size(); ++i) {
    const glm::mat3x4 rows = blended(character, i, palette);
    posed.position[i] = times(rows, glm::vec4(character.position[i], 1.0F));
    const glm::vec3 n =
        times(rows, glm::vec4(render::decode_octahedral(character.normal[i]), 0.0F));
    const float length = glm::length(n);
    posed.normal[i] = length > 0.0F ? n / length : glm::vec3(0.0F, 0.0F, 1.0F);
  }
  return posed;
}

std::vector<PoseId> choose_poses(const render::Character& character, std::uint32_t count) {
  std::vector<PoseId> frames;
  std::size_t first = 0;
  bool has_walk = false;
  for (std::uint32_t c = 0; c < character.clips.size(); ++c) {
    if (!has_walk && character.clips[c].kind == render::ClipKind::kWalk) {
      first = frames.size();
      has_walk = true;
    }
    for (std::uint32_t f = 0; f < character.clips[c].frame_count; ++f) frames.push_back({c, f});
  }
  if (frames.empty()) return {};

  const std::uint32_t landmarks = std::min(kLandmarks, character.vertex_count());
  std::vector<glm::vec3> place(frames.size() * landmarks);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const render::Affine* palette = palette_of(character, frames[i]);
    for (std::uint32_t k = 0; k < landmarks; ++k) {
      // collapse order spreads its first vertices over the whole figure
      place[i * landmarks + k] =
          times(blended(character, k, palette), glm::vec4(character.position[k], 1.0F));
    }
  }
  std::vector<float> nearest2(frames.size(), std::numeric_limits<float>::max());
  std::vector<PoseId> chosen;
  for (std::size_t next = first; chosen.size() < count;) {
    chosen.push_back(frames[next]);
    std::size_t farthest = next;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      float sum2 = 0.0F;
      for (std::uint32_t k = 0; k < landmarks; ++k) {
        const glm::vec3 d = place[i * landmarks + k] - place[next * landmarks + k];
        sum2 += glm::dot(d, d);
      }
      nearest2[i] = std::min(nearest2[i], sum2 / static_cast<float>(landmarks));
      if (nearest2[i] > nearest2[farthest]) farthest = i;
    }
    if (nearest2[farthest] < kSameM2 * character.height_m * character.height_m) break;
    next = farthest;
  }
  return chosen;
}

}  // namespace throng::simplify
