#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "render/density/samples.hpp"
#include "render/raster/element/color.hpp"
#include "render/raster/element/tint.hpp"
#include "throng/render/density.hpp"

namespace throng::render {
namespace {

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
  float area = 0.0F, weight = 0.0F;
  for (const CastMember& member : cast.members) {
    if (!member.environment && member.character.points.count() > 0) {
      const auto own = surface_samples(member.character, count, standing_frame(member.character));
      area += std::max(member.weight, 1e-6F) * seen_area_of(member.character);
      weight += std::max(member.weight, 1e-6F);
      for (const Sample& sample : own) {
        samples.push_back(sample);
        samples.back().weight = std::max(member.weight, 0.0F);
      }
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

  // each prefix is seen as large as the figures are on the average
  area /= weight;
  cloud.radius.assign(count, 0.0F);
  std::vector<Disc> discs;
  std::uint32_t before = 0;
  for (const std::uint32_t n : FarFigures::kCounts) {
    const std::uint32_t own = std::min(n, count);
    discs.clear();
    for (std::uint32_t i = 0; i < own; ++i) discs.push_back({cloud.position[i], 1.0F});
    float radius = fitted_factor(discs, area);
    if (before > 0) radius = std::min(radius, cloud.radius[before - 1]);
    for (std::uint32_t i = before; i < own; ++i) {
      const float t = static_cast<float>(i + 1 - before) / static_cast<float>(own - before);
      cloud.radius[i] = before > 0 ? std::lerp(cloud.radius[before - 1], radius, t) : radius;
    }
    before = own;
  }
  for (std::uint32_t i = before; i < count; ++i) cloud.radius[i] = cloud.radius[before - 1];
  return cloud;
}

FarAgents make_far_agents(const Cast& cast, const CrowdCloud& cloud, const Roster& roster) {
  FarAgents agents;
  const std::size_t count = roster.id.size();
  agents.height_m.resize(count);
  agents.colors.resize(4 * count);
  agents.tints.resize(4 * count);
  agents.member = roster.character;
  for (std::size_t i = 0; i < count; ++i) {
    agents.height_m[i] = cast.members[roster.character[i]].character.height_m * roster.scale[i];
    const element::Tints tints = element::tints_of(roster.seed[i]);
    const glm::vec3* tint[4] = {&tints.skin, &tints.hair, &tints.top, &tints.bottom};
    for (int k = 0; k < 4; ++k) {
      const std::size_t at = 4 * i + static_cast<std::size_t>(k);
      agents.colors[at] = element::pack_color(cloud.base[k] * *tint[k]);
      agents.tints[at] = element::pack_tint(*tint[k]);
    }
  }
  return agents;
}

}  // namespace throng::render
