#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "render/raster/element/color.hpp"
#include "render/raster/element/tint.hpp"
#include "throng/render/density.hpp"

namespace throng::render {
namespace {

/// A surface point of some member, brought to a figure a metre high.
struct Sample {
  glm::vec3 position, normal, color;
  glm::vec4 regions;
  float weight;
};

glm::vec3 unpacked(std::uint32_t base) {
  glm::vec3 color;
  for (int k = 0; k < 3; ++k) {
    const float root = static_cast<float>(base >> (10 * k) & 1023U) / 1023.0F;
    color[k] = root * root;
  }
  return color;
}

/// The first `count` points of a member in the first frame of its idle clip (or the first frame).
void add_samples(const CastMember& member, std::uint32_t count, std::vector<Sample>& samples) {
  const Character& character = member.character;
  const SurfacePoints& points = character.points;
  const std::size_t joints = character.joint_count();
  std::size_t frame = 0;
  for (const Clip& clip : character.clips) {
    if (clip.kind == ClipKind::kIdle) {
      frame = clip.first_frame;
      break;
    }
  }
  const Affine* palette = character.palette.data() + frame * joints;
  std::uint32_t level = points.count(), first = 0;
  while (level / 2 >= count) {
    first += level;
    level /= 2;
  }
  const auto used = std::min(count, points.count());
  const float scale = 1.0F / std::max(character.height_m, 0.05F);
  for (std::uint32_t i = 0; i < used; ++i) {
    const SurfacePoint& point = points.point[i];
    const glm::vec4 p(point.position, 1.0F);
    const glm::vec4 n(decode_octahedral(point.normal), 0.0F);
    glm::vec3 position(0.0F), normal(0.0F);
    for (int k = 0; k < 4; ++k) {
      const float weight = static_cast<float>(point.joint_weight[k]) / 255.0F;
      if (weight == 0.0F) continue;
      const Affine& m = palette[point.joint_index[k]];
      for (int r = 0; r < 3; ++r) {
        position[r] += weight * glm::dot(m.row[r], p);
        normal[r] += weight * glm::dot(m.row[r], n);
      }
    }
    const PointTone& tone = points.tone[first + i];
    glm::vec4 regions;
    for (int k = 0; k < 4; ++k) {
      regions[k] = static_cast<float>(tone.regions >> (8 * k) & 255U) / 255.0F;
    }
    samples.push_back(
        {position * scale, normal, unpacked(tone.base), regions, std::max(member.weight, 0.0F)});
  }
}

std::size_t nearest_of(const std::vector<glm::vec3>& centres, const glm::vec3& p) {
  std::size_t best = 0;
  float best_m2 = std::numeric_limits<float>::max();
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const glm::vec3 d = centres[i] - p;
    const float m2 = glm::dot(d, d);
    if (m2 < best_m2) {
      best_m2 = m2;
      best = i;
    }
  }
  return best;
}

/// Removes one of the two nearest neighbours again and again; who goes last comes first.
std::vector<std::uint32_t> importance_order(const std::vector<glm::vec3>& points) {
  const auto count = static_cast<std::uint32_t>(points.size());
  std::vector<std::uint8_t> is_here(count, 1);
  std::vector<std::uint32_t> nearest(count, 0), order(count);
  std::vector<float> distance(count);
  const auto look = [&](std::uint32_t i) {
    distance[i] = std::numeric_limits<float>::max();
    nearest[i] = i;
    for (std::uint32_t k = 0; k < count; ++k) {
      if (k == i || is_here[k] == 0) continue;
      const glm::vec3 d = points[k] - points[i];
      const float m2 = glm::dot(d, d);
      if (m2 < distance[i]) {
        distance[i] = m2;
        nearest[i] = k;
      }
    }
  };
  for (std::uint32_t i = 0; i < count; ++i) look(i);
  for (std::uint32_t left = count; left > 0; --left) {
    std::uint32_t gone = 0;
    float least = std::numeric_limits<float>::infinity();
    for (std::uint32_t i = 0; i < count; ++i) {
      if (is_here[i] != 0 && distance[i] < least) {
        least = distance[i];
        gone = i;
      }
    }
    is_here[gone] = 0;
    order[left - 1] = gone;
    for (std::uint32_t i = 0; i < count; ++i) {
      if (is_here[i] != 0 && nearest[i] == gone) look(i);
    }
  }
  return order;
}

}  // namespace

absl::StatusOr<CrowdCloud> make_crowd_cloud(const Cast& cast, std::uint32_t count) {
  constexpr std::uint32_t kMost = 4096;
  if (count < 1 || count > kMost) {
    return absl::InvalidArgumentError(
        absl::StrCat("make_crowd_cloud: count is ", count, ", must be 1 to ", kMost));
  }
  std::vector<Sample> samples;
  for (const CastMember& member : cast.members) {
    if (!member.environment && member.character.points.count() > 0) {
      add_samples(member, count, samples);
    }
  }
  if (samples.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("make_crowd_cloud: none of the cast's ",
                                                   cast.members.size(),
                                                   " members has surface points; bake it again"));
  }

  // the shapes' average: centres of what is nearest to them, from evenly spread ones on (Lloyd
  // 1982)
  count = std::min(count, static_cast<std::uint32_t>(samples.size()));
  std::vector<glm::vec3> centres;
  for (std::uint32_t i = 0; i < count; ++i) {
    centres.push_back(samples[std::size_t{i} * samples.size() / count].position);
  }
  std::vector<Sample> mean;
  for (int round = 0; round < 6; ++round) {
    mean.assign(count,
                Sample{glm::vec3(0.0F), glm::vec3(0.0F), glm::vec3(0.0F), glm::vec4(0.0F), 0.0F});
    for (const Sample& sample : samples) {
      Sample& sum = mean[nearest_of(centres, sample.position)];
      const float w = std::max(sample.weight, 1e-6F);
      sum.position += w * sample.position;
      sum.normal += w * sample.normal;
      sum.color += w * sample.color;
      sum.regions += w * sample.regions;
      sum.weight += w;
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      if (mean[i].weight > 0.0F) centres[i] = mean[i].position / mean[i].weight;
    }
  }

  CrowdCloud cloud;
  glm::vec3 color_sum[4] = {};
  float weight_sum[4] = {};
  std::vector<float> wide;
  for (const std::uint32_t i : importance_order(centres)) {
    cloud.position.push_back(centres[i]);
    const float length = glm::length(mean[i].normal);
    cloud.normal.push_back(length > 1e-6F ? mean[i].normal / length : glm::vec3(0.0F, 0.0F, 1.0F));
    int region = 2;  // what nobody dyes is worn
    for (int k = 0; k < 4; ++k) {
      if (mean[i].regions[k] > mean[i].regions[region]) region = k;
    }
    cloud.region.push_back(static_cast<std::uint8_t>(region));
    color_sum[region] += mean[i].color;
    weight_sum[region] += mean[i].weight;
    wide.push_back(std::abs(centres[i].y));
  }
  for (int k = 0; k < 4; ++k) {
    cloud.base[k] = weight_sum[k] > 0.0F ? color_sum[k] / weight_sum[k] : glm::vec3(0.4F);
  }
  std::nth_element(wide.begin(), wide.begin() + static_cast<std::ptrdiff_t>(wide.size() / 2),
                   wide.end());
  cloud.width = std::clamp(2.4F * wide[wide.size() / 2], 0.05F, 1.0F);

  // covered by a prefix: how far the farthest point is from it
  cloud.radius.resize(count);
  std::vector<float> gap(count, std::numeric_limits<float>::max());
  for (std::uint32_t n = 0; n < count; ++n) {
    float worst = 0.0F;
    for (std::uint32_t i = 0; i < count; ++i) {
      gap[i] = std::min(gap[i], glm::distance(cloud.position[i], cloud.position[n]));
      worst = std::max(worst, gap[i]);
    }
    cloud.radius[n] = worst;
  }
  // and between the points themselves: half the way to a neighbour
  const float own = cloud.radius[count > 1 ? count - 2 : 0];
  for (float& radius : cloud.radius) radius += std::max(0.6F * own, 0.02F);
  return cloud;
}

FarAgents make_far_agents(const Cast& cast, const CrowdCloud& cloud, const Roster& roster) {
  FarAgents agents;
  const std::size_t count = roster.id.size();
  agents.height_m.resize(count);
  agents.colors.resize(4 * count);
  for (std::size_t i = 0; i < count; ++i) {
    agents.height_m[i] = cast.members[roster.character[i]].character.height_m * roster.scale[i];
    const element::Tints tints = element::tints_of(roster.seed[i]);
    const glm::vec3* tint[4] = {&tints.skin, &tints.hair, &tints.top, &tints.bottom};
    for (int k = 0; k < 4; ++k) {
      agents.colors[4 * i + static_cast<std::size_t>(k)] =
          element::pack_color(cloud.base[k] * *tint[k]);
    }
  }
  return agents;
}

}  // namespace throng::render
