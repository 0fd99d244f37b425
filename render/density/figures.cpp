#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "render/crowd/motion_graph.hpp"
#include "render/density/samples.hpp"
#include "render/raster/element/color.hpp"
#include "throng/render/density.hpp"

namespace throng::render {
namespace {

constexpr std::uint32_t kSamples = 2048;  // of a character's surface
constexpr int kRounds = 5;

/// Opposite normals count as so far apart, halved, where points are for one side of a limb each.
constexpr float kNormalM = 0.04F;
constexpr std::uint32_t kSidesFrom = 32;  // points: with fewer, each goes round
constexpr float kFlat = 0.6F;             // of a mean normal: what is longer is a piece of surface

/// Which of the level's points each sample belongs to: the nearest centre's (Lloyd 1982).
std::vector<std::uint32_t> cluster(const std::vector<Sample>& samples, std::uint32_t count) {
  const float apart = count >= kSidesFrom ? kNormalM : 0.0F;
  const std::size_t size = samples.size();
  // by columns, so that the loop over centres is one of vectors
  std::vector<float> at[6];
  for (auto& column : at) column.resize(count);
  const auto set = [&](std::uint32_t i, const glm::vec3& p, const glm::vec3& n) {
    for (int k = 0; k < 3; ++k) {
      at[k][i] = p[k];
      at[3 + k][i] = apart * n[k];
    }
  };
  for (std::uint32_t i = 0; i < count; ++i) set(i, samples[i].position, samples[i].normal);
  std::vector<std::uint32_t> nearest(size);
  std::vector<float> distance(count);
  for (int round = 0;; ++round) {
    for (std::size_t s = 0; s < size; ++s) {
      const glm::vec3& p = samples[s].position;
      const glm::vec3 n = apart * samples[s].normal;
      for (std::uint32_t i = 0; i < count; ++i) {
        const float dx = at[0][i] - p.x, dy = at[1][i] - p.y, dz = at[2][i] - p.z;
        const float ex = at[3][i] - n.x, ey = at[4][i] - n.y, ez = at[5][i] - n.z;
        distance[i] = dx * dx + dy * dy + dz * dz + (ex * ex + ey * ey + ez * ez);
      }
      nearest[s] = static_cast<std::uint32_t>(std::min_element(distance.begin(), distance.end()) -
                                              distance.begin());
    }
    if (round == kRounds) return nearest;
    std::vector<glm::vec3> position(count, glm::vec3(0.0F)), normal = position;
    std::vector<float> members(count, 0.0F);
    for (std::size_t s = 0; s < size; ++s) {
      position[nearest[s]] += samples[s].position;
      normal[nearest[s]] += samples[s].normal;
      members[nearest[s]] += 1.0F;
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      if (members[i] > 0.0F) set(i, position[i] / members[i], normal[i] / members[i]);
    }
  }
}

constexpr std::size_t kOfMember = std::size_t{FarFigures::kPoses} * FarFigures::kPointsOfAll;

bool has_figure(const CastMember& member) {
  return !member.environment && member.character.points.count() != 0;
}

std::uint32_t packed_regions(const glm::vec4& regions) {
  std::uint32_t word = 0;
  for (int k = 0; k < 4; ++k) {
    word |= static_cast<std::uint32_t>(std::clamp(regions[k], 0.0F, 1.0F) * 255.0F + 0.5F)
            << (8 * k);
  }
  return word;
}

/// A level's points in one pose, as large as the surface that each stands for.
void add_level(const std::vector<Sample>& samples, const std::vector<std::uint32_t>& nearest,
               std::uint32_t count, float surface_m2, FarFigures::Point* out) {
  std::vector<Sample> sum(
      count, Sample{glm::vec3(0.0F), glm::vec3(0.0F), glm::vec3(0.0F), glm::vec4(0.0F), 0.0F});
  for (std::size_t s = 0; s < samples.size(); ++s) {
    Sample& own = sum[nearest[s]];
    own.position += samples[s].position;
    own.normal += samples[s].normal;
    own.color += samples[s].color;
    own.regions += samples[s].regions;
    own.weight += 1.0F;
  }
  std::vector<glm::vec2> square(count, glm::vec2(0.0F));  // of deviations: level and upright
  for (Sample& own : sum) {
    const float each = 1.0F / std::max(own.weight, 1.0F);
    own.position *= each;
    own.normal *= each;
    own.color *= each;
    own.regions *= each;
  }
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const glm::vec3 off = samples[s].position - sum[nearest[s]].position;
    square[nearest[s]] += glm::vec2(0.5F * (off.x * off.x + off.y * off.y), off.z * off.z);
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const Sample& own = sum[i];
    const float own_m2 = surface_m2 * own.weight / static_cast<float>(samples.size());
    const float length = glm::length(own.normal);
    const bool is_flat = count >= kSidesFrom && length > kFlat;
    // a convex body shows a quarter of its surface (Cauchy)
    const float radius = std::sqrt((is_flat ? own_m2 : 0.25F * own_m2) / 3.14159265F);
    float squeeze = 1.0F;
    if (!is_flat)
      squeeze = std::clamp(std::sqrt(square[i].x / std::max(square[i].y, 1e-9F)), 0.25F, 1.0F);
    out[i] = {own.position,
              (is_flat ? radius : -radius / std::sqrt(squeeze)),
              own.normal,
              squeeze,
              element::pack_color(own.color),
              packed_regions(own.regions)};
  }
}

}  // namespace

std::uint32_t FarFigures::level_of(std::uint32_t points) {
  const auto* above = std::upper_bound(std::begin(kCounts), std::end(kCounts), points);
  return above == std::begin(kCounts)
             ? 0U
             : static_cast<std::uint32_t>(above - std::begin(kCounts)) - 1U;
}

const FarFigures::Point* FarFigures::level(std::uint32_t member, std::uint32_t pose,
                                           std::uint32_t level) const {
  std::size_t first = (std::size_t{block[member]} * kPoses + pose) * kPointsOfAll;
  for (std::uint32_t k = 0; k < level; ++k) first += kCounts[k];
  return points.data() + first;
}

absl::StatusOr<FarFigures> begin_far_figures(const Cast& cast) {
  if (std::none_of(cast.members.begin(), cast.members.end(), has_figure)) {
    return absl::InvalidArgumentError(absl::StrCat("far figures: none of the cast's ",
                                                   cast.members.size(),
                                                   " members has surface points; bake it again"));
  }
  FarFigures figures;
  figures.points.resize(kOfMember);
  figures.block.assign(cast.members.size(), FarFigures::kNobody);
  return figures;
}

absl::StatusOr<FarFigures> make_far_figures(const Cast& cast) {
  auto figures = begin_far_figures(cast);
  if (!figures.ok()) return figures.status();
  std::vector<std::uint16_t> all(cast.members.size());
  std::iota(all.begin(), all.end(), std::uint16_t{0});
  add_far_figures(cast, all, *figures);
  return figures;
}

void add_far_figures(const Cast& cast, std::span<const std::uint16_t> members, FarFigures& figures,
                     std::uint32_t most_members) {
  for (const std::uint16_t m : members) {
    if (m >= cast.members.size() || figures.block[m] != FarFigures::kNobody ||
        !has_figure(cast.members[m])) {
      continue;
    }
    const auto made = static_cast<std::uint32_t>(figures.points.size() / kOfMember) - 1;
    if (made >= most_members) {
      figures.block[m] = 1 + m % made;
      continue;
    }
    figures.block[m] = made + 1;
    figures.points.resize(figures.points.size() + kOfMember);
    const Character& character = cast.members[m].character;
    const element::Gait gait = gait_of(character);
    const element::ClipRange& walk = gait.walk.frame_count != 0 ? gait.walk : gait.run;
    std::vector<std::vector<Sample>> poses;
    for (std::uint32_t pose = 0; pose < FarFigures::kPoses; ++pose) {
      std::uint32_t frame = standing_frame(character);
      if (pose > 0 && walk.frame_count > 0) {
        frame = walk.first_frame + (pose - 1) * walk.frame_count / FarFigures::kPhases;
      }
      poses.push_back(surface_samples(character, kSamples, frame));
    }
    const float area = seen_area_of(character), surface = surface_area(character);
    FarFigures::Point* first = figures.points.data() + figures.block[m] * kOfMember;
    for (const std::uint32_t wanted : FarFigures::kCounts) {
      // a character with fewer points has the rest of a level's nowhere: they are not seen
      const auto count = std::min(wanted, static_cast<std::uint32_t>(poses[0].size()));
      const std::vector<std::uint32_t> nearest = cluster(poses[0], count);
      for (std::uint32_t pose = 0; pose < FarFigures::kPoses; ++pose) {
        add_level(poses[pose], nearest, count, surface, first + pose * FarFigures::kPointsOfAll);
      }
      std::vector<Disc> discs;
      for (std::uint32_t i = 0; i < count; ++i) {
        const FarFigures::Point& point = first[i];
        const bool is_flat = point.radius > 0.0F;
        discs.push_back({point.position, std::abs(point.radius), point.squeeze,
                         is_flat ? glm::normalize(point.normal) : glm::vec3(0.0F)});
      }
      const float factor = fitted_factor(discs, area);
      for (std::uint32_t pose = 0; pose < FarFigures::kPoses; ++pose) {
        for (std::uint32_t i = 0; i < count; ++i) {
          first[pose * FarFigures::kPointsOfAll + i].radius *= factor;
        }
      }
      first += wanted;
    }
  }
}

}  // namespace throng::render
