#include "simplify/collapse/attribute_cost.hpp"

#include <algorithm>
#include <cmath>

namespace throng::simplify {
namespace {

// How much an error in an attribute counts against the same distance in position. Silhouettes are
// seen from afar when texture no longer is.
constexpr float kSlide = 0.35F;
constexpr float kMostSlide = 0.12F;     // of the character's size
constexpr float kTorn = 0.03F;          // of the size: texture stretched over a seam, colours alike
constexpr float kTornColor = 0.50F;     // of the size: black becomes white
constexpr float kBaredColor = 0.15F;    // of the size: a white eye goes from a black face
constexpr float kCoveredColor = 0.05F;  // of the size: a black stripe goes from white cloth
constexpr float kNormal = 0.004F;       // of the size: normals at right angles
constexpr float kJoint = 0.01F;  // of the size: moved by quite different joints; poses tell most

float cross(const glm::vec2& a, const glm::vec2& b) { return a.x * b.y - a.y * b.x; }

}  // namespace

AttributeCost::AttributeCost(const WedgeMesh& mesh, float size_m)
    : mesh_(mesh), size_m_(size_m), metres_per_uv_(1.0F) {
  const Surface& surface = mesh.surface();
  double area_m2 = 0.0, area_uv = 0.0;
  for (const glm::uvec3& triangle : surface.triangles) {
    const auto at = [&](int i) {
      return surface.points[surface.wedge_point[triangle[i]]].position;
    };
    const auto uv = [&](int i) { return surface.wedge_uv[triangle[i]]; };
    area_m2 += 0.5 * glm::length(glm::cross(at(1) - at(0), at(2) - at(0)));
    area_uv += 0.5 * std::fabs(cross(uv(1) - uv(0), uv(2) - uv(0)));
  }
  if (area_uv > 1.0e-6) metres_per_uv_ = static_cast<float>(std::sqrt(area_m2 / area_uv));

  std::vector<TextureLevel> levels = small_levels(surface);
  if (!levels.empty()) color_ = std::move(levels.front());
}

glm::vec3 AttributeCost::color_at(const glm::vec2& uv) const {
  if (color_.texels.empty()) return glm::vec3(0.5F);
  const std::uint8_t* at = color_.at(uv);
  return glm::vec3(at[0], at[1], at[2]) / 255.0F;
}

float AttributeCost::color_difference(const std::array<glm::vec2, 3>& before,
                                      const std::array<glm::vec2, 3>& after) const {
  if (color_.texels.empty()) return 0.0F;
  // the centre and a place near each corner
  static constexpr float kShares[4][3] = {
      {1.0F / 3, 1.0F / 3, 1.0F / 3}, {0.8F, 0.1F, 0.1F}, {0.1F, 0.8F, 0.1F}, {0.1F, 0.1F, 0.8F}};
  glm::vec3 sum(0.0F);
  for (const auto& share : kShares) {
    const glm::vec3 a =
        color_at(before[0] * share[0] + before[1] * share[1] + before[2] * share[2]);
    const glm::vec3 b = color_at(after[0] * share[0] + after[1] * share[1] + after[2] * share[2]);
    sum += glm::abs(a - b);
  }
  return (sum.x + sum.y + sum.z) / 12.0F;
}

float AttributeCost::triangle_cost(std::uint32_t triangle, std::uint32_t a, std::uint32_t b,
                                   const WedgeMove& move) const {
  const Surface& surface = mesh_.surface();
  const glm::uvec3& points = mesh_.points(triangle);
  const glm::uvec3& wedges = mesh_.wedges(triangle);
  const int corner = points.x == a ? 0 : points.y == a ? 1 : 2;
  const int second = (corner + 1) % 3, third = (corner + 2) % 3;
  const glm::vec3 &pa = surface.points[a].position, &px = surface.points[points[second]].position,
                  &py = surface.points[points[third]].position, &pb = surface.points[b].position;
  const glm::vec3 ex = px - pa, ey = py - pa;
  const glm::vec3 normal = glm::cross(ex, ey);
  const float doubled_area_m2 = glm::length(normal);
  const glm::vec3 new_normal = glm::cross(px - pb, py - pb);
  const float area_m2 = 0.5F * std::max(doubled_area_m2, glm::length(new_normal));

  const glm::vec2 &uv_a = surface.wedge_uv[move.from], &uv_x = surface.wedge_uv[wedges[second]],
                  &uv_y = surface.wedge_uv[wedges[third]], &uv_b = surface.wedge_uv[move.to];
  float distance_m = 0.0F;
  if (!move.is_exact || move.is_ambiguous) {
    const float difference = color_difference({uv_a, uv_x, uv_y}, {uv_b, uv_x, uv_y});
    // wedges of a crease lie at one place of the texture: nothing tears there
    const glm::vec2 jump = uv_b - uv_a;
    const float apart = std::min(1.0F, glm::length(jump) * metres_per_uv_ / (0.1F * size_m_));
    distance_m = size_m_ * (kTorn * apart + kTornColor * difference);
  } else if (doubled_area_m2 > 1.0e-12F) {
    // b in the triangle's own coordinates: pb = pa + s ex + t ey + out of the plane
    const glm::vec3 to_b = pb - pa;
    const float scale = 1.0F / glm::dot(normal, normal);
    const float s = glm::dot(glm::cross(to_b, ey), normal) * scale;
    const float t = glm::dot(glm::cross(ex, to_b), normal) * scale;
    const glm::vec2 slide = uv_a + s * (uv_x - uv_a) + t * (uv_y - uv_a) - uv_b;
    const float doubled_area_uv = std::fabs(cross(uv_x - uv_a, uv_y - uv_a));
    // A narrow triangle extends wildly, and where one colour fills all of it uvs say nothing.
    const float metres_per_uv =
        doubled_area_uv > 1.0e-9F
            ? std::min(std::sqrt(doubled_area_m2 / doubled_area_uv), 4.0F * metres_per_uv_)
            : metres_per_uv_;
    distance_m = kSlide * std::min(glm::length(slide) * metres_per_uv, kMostSlide * size_m_);
  }
  const glm::vec3 bend = surface.wedge_normal[move.to] - surface.wedge_normal[move.from];
  const float bend_m = kNormal * size_m_;
  return area_m2 / 3.0F * (distance_m * distance_m + bend_m * bend_m * glm::dot(bend, bend));
}

bool AttributeCost::mirrors(std::uint32_t triangle, std::uint32_t a, const WedgeMove& move) const {
  const Surface& surface = mesh_.surface();
  const glm::uvec3& points = mesh_.points(triangle);
  const glm::uvec3& wedges = mesh_.wedges(triangle);
  const int corner = points.x == a ? 0 : points.y == a ? 1 : 2;
  const glm::vec2 &uv_x = surface.wedge_uv[wedges[(corner + 1) % 3]],
                  &uv_y = surface.wedge_uv[wedges[(corner + 2) % 3]];
  const glm::vec2 &uv_a = surface.wedge_uv[move.from], &uv_b = surface.wedge_uv[move.to];
  const float before = cross(uv_x - uv_a, uv_y - uv_a), after = cross(uv_x - uv_b, uv_y - uv_b);
  constexpr float kNothing = 1.0e-9F;
  return std::fabs(before) > kNothing && std::fabs(after) > kNothing && before * after < 0.0F;
}

float AttributeCost::baring_cost(std::uint32_t front, std::uint32_t behind) const {
  const auto corners = [&](std::uint32_t triangle) {
    const glm::uvec3& wedges = mesh_.wedges(triangle);
    const auto& uv = mesh_.surface().wedge_uv;
    return std::array<glm::vec2, 3>{uv[wedges.x], uv[wedges.y], uv[wedges.z]};
  };
  const float distance_m =
      kBaredColor * size_m_ * color_difference(corners(front), corners(behind));
  return distance_m * distance_m;
}

float AttributeCost::covering_cost(std::uint32_t dying, std::uint32_t triangle, std::uint32_t a,
                                   const WedgeMove& move) const {
  const Surface& surface = mesh_.surface();
  const glm::uvec3 &gone = mesh_.wedges(dying), &points = mesh_.points(triangle);
  const auto at = [&](int i) { return surface.points[mesh_.points(dying)[i]].position; };
  glm::vec2 before(0.0F), after(0.0F);
  for (int i = 0; i < 3; ++i) {
    before += surface.wedge_uv[gone[i]] / 3.0F;
    // what lies on the dying triangle is near its other two corners
    const std::uint32_t point = points[i];
    const bool is_near = point == a || mesh_.has(dying, point);
    const std::uint32_t wedge = point == a ? move.to : mesh_.wedges(triangle)[i];
    after += (is_near ? 0.4F : 0.2F) * surface.wedge_uv[wedge];
  }
  const glm::vec3 off = glm::abs(color_at(before) - color_at(after));
  const float distance_m = kCoveredColor * size_m_ * (off.x + off.y + off.z) / 3.0F;
  const float area_m2 = 0.5F * glm::length(glm::cross(at(1) - at(0), at(2) - at(0)));
  return area_m2 * distance_m * distance_m;
}

float AttributeCost::joint_cost(std::uint32_t a, std::uint32_t b) const {
  const SourcePoint &pa = mesh_.surface().points[a], &pb = mesh_.surface().points[b];
  // squared L2 distance of two sparse vectors: 0 to 2
  float same = 0.0F, squares = 0.0F;
  for (int i = 0; i < 4; ++i) {
    squares += pa.weight[i] * pa.weight[i] + pb.weight[i] * pb.weight[i];
    for (int k = 0; k < 4; ++k) {
      if (pa.joint[i] == pb.joint[k]) same += pa.weight[i] * pb.weight[k];
    }
  }
  const float distance_m = kJoint * size_m_;
  return distance_m * distance_m * std::max(0.0F, squares - 2.0F * same);
}

}  // namespace throng::simplify
