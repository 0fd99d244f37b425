#include "simplify/report/hausdorff.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace throng::simplify {
namespace {

constexpr std::uint32_t kLeafTriangles = 4;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

float box_distance2(const glm::vec3& p, const glm::vec3& low, const glm::vec3& high) {
  const glm::vec3 d = glm::max(glm::max(low - p, p - high), glm::vec3(0.0F));
  return glm::dot(d, d);
}

float segment_distance2(const glm::vec3& p, const glm::vec3& a, const glm::vec3& b) {
  const glm::vec3 ab = b - a;
  const float length2 = glm::dot(ab, ab);
  const float t = length2 > 0.0F ? glm::clamp(glm::dot(p - a, ab) / length2, 0.0F, 1.0F) : 0.0F;
  const glm::vec3 d = p - (a + t * ab);
  return glm::dot(d, d);
}

/// Over the triangle: the distance to its plane; beside it: to the nearest edge.
float triangle_distance2(const glm::vec3& p, const glm::vec3& a, const glm::vec3& b,
                         const glm::vec3& c) {
  const glm::vec3 normal = glm::cross(b - a, c - a);
  const float twice_area2 = glm::dot(normal, normal);
  if (twice_area2 > 0.0F && glm::dot(glm::cross(b - a, p - a), normal) >= 0.0F &&
      glm::dot(glm::cross(c - b, p - b), normal) >= 0.0F &&
      glm::dot(glm::cross(a - c, p - c), normal) >= 0.0F) {
    const float along = glm::dot(p - a, normal);
    return along * along / twice_area2;
  }
  return std::min(
      {segment_distance2(p, a, b), segment_distance2(p, b, c), segment_distance2(p, c, a)});
}

}  // namespace

TriangleTree::TriangleTree(std::span<const glm::vec3> position,
                           std::span<const glm::uvec3> triangles)
    : position_(position), triangles_(triangles), order_(triangles.size()) {
  std::iota(order_.begin(), order_.end(), 0U);
  for (const glm::uvec3& t : triangles)
    centre_.push_back((position[t.x] + position[t.y] + position[t.z]) / 3.0F);
  if (triangles.empty()) return;
  nodes_.reserve(2 * triangles.size());
  nodes_.emplace_back();
  build(0, 0, static_cast<std::uint32_t>(triangles.size()));
}

void TriangleTree::build(std::uint32_t node, std::uint32_t begin, std::uint32_t end) {
  glm::vec3 low(kInfinity), high(-kInfinity), centre_low(kInfinity), centre_high(-kInfinity);
  for (std::uint32_t i = begin; i < end; ++i) {
    for (int k = 0; k < 3; ++k) {
      const glm::vec3& p = position_[triangles_[order_[i]][k]];
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
    centre_low = glm::min(centre_low, centre_[order_[i]]);
    centre_high = glm::max(centre_high, centre_[order_[i]]);
  }
  if (end - begin <= kLeafTriangles) {
    nodes_[node] = {low, high, begin, end - begin};
    return;
  }
  const glm::vec3 size = centre_high - centre_low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
  const std::uint32_t middle = (begin + end) / 2;
  std::nth_element(
      order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
      [&](std::uint32_t a, std::uint32_t b) {
        return centre_[a][axis] != centre_[b][axis] ? centre_[a][axis] < centre_[b][axis] : a < b;
      });
  const auto left = static_cast<std::uint32_t>(nodes_.size());
  nodes_[node] = {low, high, left, 0};
  nodes_.resize(nodes_.size() + 2);
  build(left, begin, middle);
  build(left + 1, middle, end);
}

float TriangleTree::distance2(const glm::vec3& point, float enough2) const {
  if (nodes_.empty()) return kInfinity;
  float best2 = kInfinity;
  struct Pending {
    std::uint32_t node;
    float distance2;
  };
  std::array<Pending, 64> stack;  // halving: 32 levels at most, two entries each
  std::size_t pending = 0;
  stack[pending++] = {0, 0.0F};
  while (pending > 0) {
    const Pending next = stack[--pending];
    if (next.distance2 >= best2) continue;
    const Node& node = nodes_[next.node];
    if (node.count > 0) {
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
        const glm::uvec3& t = triangles_[order_[i]];
        best2 = std::min(best2,
                         triangle_distance2(point, position_[t.x], position_[t.y], position_[t.z]));
      }
      if (best2 <= enough2) return best2;
      continue;
    }
    Pending near{node.first, box_distance2(point, nodes_[node.first].low, nodes_[node.first].high)};
    Pending far{node.first + 1,
                box_distance2(point, nodes_[node.first + 1].low, nodes_[node.first + 1].high)};
    if (far.distance2 < near.distance2) std::swap(near, far);
    stack[pending++] = far;
    stack[pending++] = near;
  }
  return best2;
}

SurfaceSamples::SurfaceSamples(std::span<const glm::vec3> position,
                               std::span<const glm::uvec3> triangles, std::uint32_t between,
                               bool with_corners) {
  std::vector<bool> is_used(position.size());
  std::vector<double> area_up_to(triangles.size());
  double area = 0.0;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const glm::uvec3& t = triangles[i];
    area += glm::length(glm::cross(position[t.y] - position[t.x], position[t.z] - position[t.x]));
    area_up_to[i] = area;
    for (int k = 0; k < 3 && with_corners; ++k) {
      if (is_used[t[k]]) continue;
      is_used[t[k]] = true;
      samples_.push_back({glm::uvec3(t[k]), {1.0F, 0.0F, 0.0F}});
    }
  }
  // even steps of area, and the R2 sequence (Roberts 2018) inside the triangles
  std::size_t triangle = 0;
  for (std::uint32_t i = 0; i < between && area > 0.0; ++i) {
    const double at = area * (i + 0.5) / between;
    while (triangle + 1 < triangles.size() && area_up_to[triangle] < at) ++triangle;
    double whole = 0.0;
    auto u = static_cast<float>(std::modf(0.5 + 0.7548776662466927 * i, &whole));
    auto v = static_cast<float>(std::modf(0.5 + 0.5698402909980532 * i, &whole));
    if (u + v > 1.0F) {
      u = 1.0F - u;
      v = 1.0F - v;
    }
    samples_.push_back({triangles[triangle], {1.0F - u - v, u, v}});
  }
}

float farthest2(const SurfaceSamples& samples, std::span<const glm::vec3> position,
                const TriangleTree& surface, float largest2) {
  // in leaps: neighbours have like distances, and a large one found early saves work
  constexpr std::size_t kLeap = 61;
  for (std::size_t begin = 0; begin < std::min(kLeap, samples.size()); ++begin) {
    for (std::size_t i = begin; i < samples.size(); i += kLeap)
      largest2 = std::max(largest2, surface.distance2(samples.at(i, position), largest2));
  }
  return largest2;
}

}  // namespace throng::simplify
