#include <algorithm>
#include <cmath>
#include <cstring>

#include "render/compute/cpu/work_pool.hpp"
#include "render/compute/element/frustum.hpp"
#include "render/compute/element/hash.hpp"
#include "render/compute/element/octahedral.hpp"
#include "throng/render/density.hpp"

namespace throng::render {
namespace {

/// A point a pixel is all that shows; half as many more, because they overlap.
constexpr float kPointsPerPx2 = 1.5F;
constexpr float kMarginM = 1.5F;  // a figure around its vertex's place

std::uint32_t depth_bits(float distance_m) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &distance_m, sizeof bits);
  return bits;  // positive floats are in the order of their bits
}

}  // namespace

void FarPlan::make(const Triangulation& triangulation, const FarAgents& agents,
                   const CrowdCloud& cloud, const FarView& view, std::uint64_t budget,
                   PointShare share) {
  shares_.clear();
  order_.clear();
  points_ = 0;
  visible_ = 0;
  const std::uint32_t count = triangulation.vertex_count();
  weight_.assign(count, 0.0F);
  const element::Frustum frustum = element::frustum_from(view.clip_from_relative);
  const glm::dvec3 eye = view.eye_world - view.origin_world;
  double rest_weight = 0.0;
  for (std::uint32_t v = 0; v < count; ++v) {
    const glm::vec2& p = triangulation.position_m[v];
    const glm::vec3 relative(static_cast<float>(p.x - eye.x), static_cast<float>(p.y - eye.y),
                             static_cast<float>(-eye.z));
    const float margin = kMarginM + triangulation.cell_m;
    if (!element::touches(frustum, glm::vec4(relative.x, relative.y, relative.z + 0.9F, margin)))
      continue;
    const std::uint32_t first = triangulation.first_agent[v],
                        end = triangulation.first_agent[v + 1];
    visible_ += end - first;
    const float distance_m = std::max(glm::length(relative), 0.5F);
    order_.push_back(std::uint64_t{depth_bits(distance_m)} << 32 | v);
    // pixels that can be seen of one agent
    const float height_m = agents.height_m[triangulation.agents[first]];
    const float px_per_m = view.px_per_tangent / distance_m;
    const float sine = std::clamp(std::abs(relative.z) / distance_m, 0.02F, 1.0F);
    const float cosine = std::sqrt(1.0F - sine * sine);
    const float width_m = cloud.width * height_m;
    float area_m2 = width_m * (height_m * cosine + width_m * sine);
    if (share == PointShare::kDensity) {
      area_m2 = std::min(area_m2, triangulation.free_m2[v] * sine + 0.15F * width_m * height_m);
    }
    weight_[v] = area_m2 * px_per_m * px_per_m;
    rest_weight += static_cast<double>(weight_[v]) * (end - first);
  }
  std::sort(order_.begin(), order_.end());

  // near to far; what the near ones have no use for is left to the rest
  std::uint64_t rest = budget;
  std::uint64_t rest_agents = visible_;
  double owed = 0.0;  // fractions of points that vertices so far were dealt
  const std::uint32_t most = cloud.count();
  for (const std::uint64_t entry : order_) {
    if (rest == 0) break;
    const auto v = static_cast<std::uint32_t>(entry);
    const std::uint32_t first = triangulation.first_agent[v],
                        end = triangulation.first_agent[v + 1];
    const std::uint32_t here = end - first;
    const double weight = static_cast<double>(weight_[v]);
    double each = share == PointShare::kDensity
                      ? static_cast<double>(rest) * weight / std::max(rest_weight, 1e-30)
                      : static_cast<double>(budget) / static_cast<double>(visible_);
    const double enough = std::max(1.0, static_cast<double>(kPointsPerPx2) * weight);
    if (share == PointShare::kDensity) each = std::min(each, enough);
    each = std::min(each, static_cast<double>(most));
    rest_weight -= weight * here;
    rest_agents -= here;
    // whole points: the rest of one goes to the next agent
    for (std::uint32_t k = 0; k < here && rest > 0; ++k) {
      // who begins is decided by hash, so that no one of a vertex is always the one
      const std::uint32_t turn = static_cast<std::uint32_t>(element::mix64(v) % here);
      const std::uint32_t agent = triangulation.agents[first + (k + turn) % here];
      owed += each;
      const auto points = static_cast<std::uint32_t>(
          std::min({std::floor(owed), static_cast<double>(most), static_cast<double>(rest)}));
      owed -= points;
      if (points == 0) continue;
      const float height_m = agents.height_m[agent];
      float radius_m = cloud.radius[points - 1] * height_m;
      if (points < 4) {
        // so few cover what they stand for: their agents' part of the picture, at most a figure
        const float shown_m2 = weight_[v] / std::max(static_cast<float>(each), 1e-6F);
        const float distance_m = [&] {
          float m = 0.0F;
          const auto bits = static_cast<std::uint32_t>(entry >> 32);
          std::memcpy(&m, &bits, sizeof m);
          return m;
        }();
        const float px_per_m = view.px_per_tangent / distance_m;
        radius_m = std::min(std::sqrt(shown_m2 / 3.14159265F) / px_per_m, 0.3F * height_m);
      }
      shares_.push_back({agent, points, radius_m});
      points_ += points;
      rest -= points;
    }
  }
}

void generate_far(const FarPlan& plan, const FarAgents& agents, const CrowdCloud& cloud,
                  std::span<const glm::vec3> position_m, std::span<const float> heading_rad,
                  const FarView& view, WorkPool& pool, std::vector<Splat>& splats) {
  const std::span<const FarShare> shares = plan.shares();
  splats.resize(plan.points());
  constexpr std::size_t kChunk = 2048;
  const std::size_t chunks = (shares.size() + kChunk - 1) / kChunk;
  std::vector<std::uint64_t> first(chunks + 1, 0);
  for (std::size_t c = 0; c < chunks; ++c) {
    std::uint64_t sum = first[c];
    for (std::size_t i = c * kChunk; i < std::min(shares.size(), (c + 1) * kChunk); ++i) {
      sum += shares[i].points;
    }
    first[c + 1] = sum;
  }
  const glm::dvec3 eye = view.eye_world - view.origin_world;
  pool.run(chunks, [&](std::size_t chunk, unsigned) {
    Splat* out = splats.data() + first[chunk];
    const std::size_t end = std::min(shares.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      const FarShare& share = shares[i];
      const glm::vec3& p = position_m[share.agent];
      const glm::vec3 feet(static_cast<float>(p.x - eye.x), static_cast<float>(p.y - eye.y),
                           static_cast<float>(p.z - eye.z));
      const float heading = heading_rad[share.agent];
      const bool is_known = heading == heading;
      const float cosine = is_known ? std::cos(heading) : 1.0F;
      const float sine = is_known ? std::sin(heading) : 0.0F;
      const float height_m = agents.height_m[share.agent];
      const std::uint32_t* colors = agents.colors.data() + std::size_t{4} * share.agent;
      for (std::uint32_t k = 0; k < share.points; ++k, ++out) {
        const glm::vec3& q = cloud.position[k];
        const glm::vec3& n = cloud.normal[k];
        out->position_relative =
            feet + height_m * glm::vec3(q.x * cosine - q.y * sine, q.x * sine + q.y * cosine, q.z);
        // the mean of many shapes has no clear sides: points always face the eye
        out->radius_m = -share.radius_m;
        const std::uint32_t code =
            element::pack_octahedral(n.x * cosine - n.y * sine, n.x * sine + n.y * cosine, n.z);
        std::memcpy(&out->normal, &code, sizeof code);
        out->base = colors[cloud.region[k]];
        out->regions = 0;
        out->visible = kNobody;
      }
    }
  });
}

}  // namespace throng::render
