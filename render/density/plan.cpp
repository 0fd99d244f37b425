#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "render/compute/element/frustum.hpp"
#include "render/compute/element/hash.hpp"
#include "throng/render/density.hpp"

namespace throng::render {
namespace {

/// A point a pixel is all that shows; half as many more, because they overlap.
constexpr float kPointsPerPx2 = 1.5F;
constexpr float kMarginM = 1.5F;  // a figure around its vertex's place

// the picture's cells in which kVisible counts who covers whom
constexpr int kCellsX = 160, kCellsY = 120;
constexpr float kFilled = 0.75F;     // of a figure's box
constexpr float kLeastSeen = 0.04F;  // who shows less shows nothing

std::uint32_t depth_bits(float distance_m) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &distance_m, sizeof bits);
  return bits;  // positive floats are in the order of their bits
}

struct Seen {
  glm::vec3 relative;  // feet
  float distance_m, sine, cosine;
};

Seen seen_from(const glm::vec3& position_m, const glm::dvec3& eye) {
  Seen seen;
  seen.relative = glm::vec3(glm::dvec3(position_m) - eye);
  seen.distance_m = std::max(glm::length(seen.relative), 0.5F);
  seen.sine = std::clamp(std::abs(seen.relative.z) / seen.distance_m, 0.02F, 1.0F);
  seen.cosine = std::sqrt(1.0F - seen.sine * seen.sine);
  return seen;
}

}  // namespace

FarView make_far_view(const Camera& camera, const Viewport& viewport,
                      const glm::dvec3& origin_world) {
  FarView view;
  view.eye_world = camera.eye_world;
  view.origin_world = origin_world;
  view.clip_from_relative = clip_from_relative(camera, viewport);
  view.px_per_tangent =
      static_cast<float>(0.5 * viewport.height_px / std::tan(0.5 * camera.fov_y_rad));
  return view;
}

void FarPlan::collect(const Triangulation& triangulation, const FarAgents& agents,
                      const CrowdCloud& cloud, const FarView& view, PointShare share) {
  const std::uint32_t count = triangulation.vertex_count();
  weight_.assign(count, 0.0F);
  rest_weight_ = 0.0;
  const element::Frustum frustum = element::frustum_from(view.clip_from_relative);
  const glm::dvec3 eye = view.eye_world - view.origin_world;
  const float margin = kMarginM + triangulation.cell_m;
  for (std::uint32_t v = 0; v < count; ++v) {
    const Seen seen = seen_from(triangulation.position_m[v], eye);
    const glm::vec3& feet = seen.relative;
    if (!element::touches(frustum, glm::vec4(feet.x, feet.y, feet.z + 0.9F, margin))) continue;
    const bool is_near = seen.distance_m + margin + view.walked_m < view.least_m;
    if (is_near && share != PointShare::kVisible) continue;
    const std::uint32_t first = triangulation.first_agent[v],
                        end = triangulation.first_agent[v + 1];
    order_.push_back(std::uint64_t{depth_bits(seen.distance_m)} << 32 | v);
    if (is_near) continue;
    visible_ += end - first;
    // pixels that can be seen of one agent
    const float height_m = agents.height_m[triangulation.agents[first]];
    const float px_per_m = view.px_per_tangent / seen.distance_m;
    const float width_m = cloud.width * height_m;
    float area_m2 = width_m * (height_m * seen.cosine + width_m * seen.sine);
    if (share == PointShare::kDensity) {
      area_m2 =
          std::min(area_m2, triangulation.free_m2[v] * seen.sine + 0.15F * width_m * height_m);
    }
    weight_[v] = area_m2 * px_per_m * px_per_m;
    rest_weight_ += static_cast<double>(weight_[v]) * (end - first);
  }
  std::sort(order_.begin(), order_.end());
}

void FarPlan::hide(const Triangulation& triangulation, const FarAgents& agents,
                   const CrowdCloud& cloud, const FarView& view) {
  open_.assign(std::size_t{kCellsX} * kCellsY, 1.0F);
  rest_weight_ = 0.0;
  const glm::dvec3 eye = view.eye_world - view.origin_world;
  const glm::mat4& m = view.clip_from_relative;
  const float across = glm::length(glm::vec3(m[0].x, m[1].x, m[2].x)) * 0.5F * kCellsX;
  const float upright = glm::length(glm::vec3(m[0].y, m[1].y, m[2].y)) * 0.5F * kCellsY;
  for (const std::uint64_t entry : order_) {
    const auto v = static_cast<std::uint32_t>(entry);
    const std::uint32_t first = triangulation.first_agent[v];
    const std::uint32_t here = triangulation.first_agent[v + 1] - first;
    const float height_m = agents.height_m[triangulation.agents[first]];
    const float width_m = cloud.width * height_m;
    const Seen seen = seen_from(triangulation.position_m[v], eye);
    const glm::vec3& feet = seen.relative;
    const glm::vec4 clip = m * glm::vec4(feet.x, feet.y, feet.z + 0.5F * height_m, 1.0F);
    if (!(clip.w > 0.0F)) {
      weight_[v] = 0.0F;
      continue;
    }
    const float per_w = 1.0F / clip.w;
    const float x = (0.5F + 0.5F * clip.x * per_w) * kCellsX;
    const float y = (0.5F + 0.5F * clip.y * per_w) * kCellsY;
    const float half_x = 0.5F * width_m * across * per_w;
    const float half_y = 0.5F * (height_m * seen.cosine + width_m * seen.sine) * upright * per_w;
    const float x0 = x - half_x, x1 = x + half_x, y0 = y - half_y, y1 = y + half_y;
    // beside the picture, or so near the eye's plane that its place is beyond all numbers
    if (!(x1 > 0.0F && y1 > 0.0F && x0 < kCellsX && y0 < kCellsY)) {
      weight_[v] = 0.0F;
      continue;
    }
    const int cx1 = static_cast<int>(std::min(x1, kCellsX - 1.0F));
    const int cy1 = static_cast<int>(std::min(y1, kCellsY - 1.0F));
    float open = 0.0F;
    for (int cy = static_cast<int>(std::max(y0, 0.0F)); cy <= cy1; ++cy) {
      const auto bottom = static_cast<float>(cy);
      const float high = std::min(y1, bottom + 1.0F) - std::max(y0, bottom);
      for (int cx = static_cast<int>(std::max(x0, 0.0F)); cx <= cx1; ++cx) {
        const auto left = static_cast<float>(cx);
        const float overlap = high * (std::min(x1, left + 1.0F) - std::max(x0, left));
        if (!(overlap > 0.0F)) continue;
        float& cell = open_[static_cast<std::size_t>(cy) * kCellsX + static_cast<std::size_t>(cx)];
        open += overlap * cell;
        const float left_open = 1.0F - std::min(kFilled * overlap, 1.0F);
        cell *= here == 1 ? left_open : std::pow(left_open, static_cast<float>(here));
      }
    }
    float share = open / std::max(4.0F * half_x * half_y, 1e-12F);
    if (share < kLeastSeen) share = 0.0F;
    weight_[v] *= share;
    rest_weight_ += static_cast<double>(weight_[v]) * here;
  }
}

absl::Status FarPlan::make(const Triangulation& triangulation, const FarAgents& agents,
                           const CrowdCloud& cloud, const FarView& view, std::uint64_t budget,
                           const FarRule& rule) {
  shares_.clear();
  order_.clear();
  points_ = 0;
  visible_ = 0;
  if (budget == 0) {
    return absl::InvalidArgumentError("far plan: the budget is 0 points, must be at least 1");
  }
  if (agents.height_m.size() < triangulation.vertex_of.size()) {
    return absl::InvalidArgumentError(absl::StrCat("far plan: ", agents.height_m.size(),
                                                   " agents, the triangulation has ",
                                                   triangulation.vertex_of.size()));
  }
  collect(triangulation, agents, cloud, view, rule.share);
  if (rule.share == PointShare::kVisible) hide(triangulation, agents, cloud, view);

  // near to far; what the near ones have no use for is left to the rest
  std::uint64_t rest = budget;
  double owed = 0.0;  // fractions of points that vertices so far were dealt
  const double most = rule.figures ? FarFigures::kCounts[FarFigures::kLevels - 1] : cloud.count();
  for (const std::uint64_t entry : order_) {
    if (rest == 0) break;
    const auto v = static_cast<std::uint32_t>(entry);
    const std::uint32_t first = triangulation.first_agent[v];
    const std::uint32_t here = triangulation.first_agent[v + 1] - first;
    const double weight = static_cast<double>(weight_[v]);
    if (!(weight > 0.0)) continue;
    double each = static_cast<double>(budget) / static_cast<double>(visible_);
    if (rule.share != PointShare::kEqual) {
      each = static_cast<double>(rest) * weight / std::max(rest_weight_, 1e-30);
      each = std::min(each, std::max(1.0, static_cast<double>(kPointsPerPx2) * weight));
    }
    each = std::min(each, most);
    rest_weight_ -= weight * here;
    owed = std::min(owed, std::max(each, 1.0));
    // who begins is decided by hash, so that no one of a vertex is always the one
    const auto turn = static_cast<std::uint32_t>(element::mix64(v) % here);
    for (std::uint32_t k = 0; k < here && rest > 0; ++k) {
      // whole points: the rest of one goes to the next agent, and who gets none is not looked at
      const double wait = each < 1.0 ? std::ceil((1.0 - owed) / each - 1.0) : 0.0;
      if (wait > 0.0) {
        const double skipped = std::min(wait, static_cast<double>(here - k));
        owed += skipped * each;
        k += static_cast<std::uint32_t>(skipped);
        if (k >= here) break;
      }
      owed += each;
      auto points = static_cast<std::uint32_t>(
          std::min({std::floor(owed + 1e-9), most, static_cast<double>(rest)}));
      if (points == 0) continue;
      if (rule.figures) points = FarFigures::kCounts[FarFigures::level_of(points)];
      owed -= points;
      // so few stand for those who have none: as much larger, but no more than a figure
      float radius = rule.figures ? 1.0F : cloud.radius[points - 1];
      if (each < 1.0) {
        const auto larger = static_cast<float>(std::sqrt(1.0 / each));
        radius = rule.figures ? std::min(larger, 1.5F) : std::min(radius * larger, 0.4F);
      }
      shares_.push_back({triangulation.agents[first + (k + turn) % here], points, radius});
      points_ += points;
      rest -= points;
    }
  }
  return absl::OkStatus();
}

}  // namespace throng::render
