#include "simplify/rebuild/weld.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <unordered_map>

namespace throng::simplify {
namespace {

/// L1 distance of two sparse weight vectors, 0 to 2.
float weight_distance(const SourcePoint& a, const SourcePoint& b) {
  float distance = 0.0F;
  for (int i = 0; i < 4; ++i) {
    float other = 0.0F;
    bool is_counted = false;
    for (int k = 0; k < 4; ++k) {
      if (b.joint[k] == a.joint[i]) other += b.weight[k];
      if (k < i && a.joint[k] == a.joint[i]) is_counted = true;
    }
    float own = 0.0F;
    for (int k = 0; k < 4; ++k) {
      if (a.joint[k] == a.joint[i]) own += a.weight[k];
    }
    if (!is_counted) distance += std::fabs(own - other);
  }
  for (int i = 0; i < 4; ++i) {
    bool is_shared = false;
    for (int k = 0; k < 4; ++k) is_shared = is_shared || a.joint[k] == b.joint[i];
    if (!is_shared) distance += std::fabs(b.weight[i]);
  }
  return distance;
}

struct CellHash {
  std::size_t operator()(const glm::i64vec3& cell) const {
    const auto x = static_cast<std::uint64_t>(cell.x), y = static_cast<std::uint64_t>(cell.y),
               z = static_cast<std::uint64_t>(cell.z);
    return static_cast<std::size_t>((x * 0x9E3779B97F4A7C15U) ^ (y * 0xC2B2AE3D27D4EB4FU) ^
                                    (z * 0x165667B19E3779F9U));
  }
};

class UnionFind {
 public:
  explicit UnionFind(std::size_t size) : parent_(size) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void unite(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    if (a != b) parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

std::vector<std::uint32_t> weld_points(const std::vector<SourcePoint>& points, float distance_m) {
  // Two copies of a seam point move together but for rounding; what differs by more is two things
  // that only touch in the bind pose.
  constexpr float kSameWeights = 0.05F;
  std::vector<std::uint32_t> welded(points.size());
  std::unordered_multimap<glm::i64vec3, std::uint32_t, CellHash> cells;
  cells.reserve(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    welded[i] = i;
    const glm::dvec3 scaled = glm::dvec3(points[i].position) / static_cast<double>(distance_m);
    const glm::i64vec3 low(glm::floor(scaled - 0.5)), own(glm::floor(scaled));
    // a point within half a cell lies in one of these eight
    bool is_found = false;
    for (int k = 0; k < 8 && !is_found; ++k) {
      const glm::i64vec3 cell = low + glm::i64vec3(k & 1, (k >> 1) & 1, k >> 2);
      const auto [begin, end] = cells.equal_range(cell);
      for (auto it = begin; it != end && !is_found; ++it) {
        const std::uint32_t other = it->second;
        if (glm::distance(points[i].position, points[other].position) > 0.5F * distance_m) continue;
        if (weight_distance(points[i], points[other]) > kSameWeights) continue;
        welded[i] = other;
        is_found = true;
      }
    }
    if (!is_found) cells.emplace(own, i);
  }
  return welded;
}

namespace {

/// One pass of `make_manifold`; triangles in `is_alone` are glued to nothing.
std::vector<glm::uvec3> glue_once(const std::vector<glm::uvec3>& corner,
                                  const std::vector<glm::uvec3>& side,
                                  const std::vector<glm::vec3>& position,
                                  const std::vector<bool>& is_alone,
                                  std::vector<std::uint32_t>& origin) {
  struct HalfEdge {
    std::uint64_t edge;  // both ends, smaller first
    std::uint32_t triangle;
    std::uint8_t from;  // corner of the triangle; it goes to the next one
    bool is_forward;
  };
  std::vector<HalfEdge> half_edges;
  half_edges.reserve(corner.size() * 3);
  for (std::uint32_t t = 0; t < corner.size(); ++t) {
    if (is_alone[t]) continue;
    for (std::uint8_t i = 0; i < 3; ++i) {
      const std::uint32_t a = corner[t][i], b = corner[t][(i + 1) % 3];
      half_edges.push_back({(std::uint64_t{std::min(a, b)} << 32U) | std::max(a, b), t, i, a < b});
    }
  }
  std::sort(half_edges.begin(), half_edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    if (a.edge != b.edge) return a.edge < b.edge;
    return a.triangle != b.triangle ? a.triangle < b.triangle : a.from < b.from;
  });

  UnionFind corners(corner.size() * 3);
  const auto glue = [&](const HalfEdge& a, const HalfEdge& b) {
    corners.unite(a.triangle * 3 + a.from, b.triangle * 3 + (b.from + 1) % 3);
    corners.unite(a.triangle * 3 + (a.from + 1) % 3, b.triangle * 3 + b.from);
  };
  const auto normal = [&](std::uint32_t t) {
    const glm::vec3 cross = glm::cross(position[corner[t].y] - position[corner[t].x],
                                       position[corner[t].z] - position[corner[t].x]);
    const float length = glm::length(cross);
    return length > 0.0F ? cross / length : glm::vec3(0.0F);
  };
  for (std::size_t begin = 0, end = 0; begin < half_edges.size(); begin = end) {
    while (end < half_edges.size() && half_edges[end].edge == half_edges[begin].edge) ++end;
    if (end - begin == 2) {
      const HalfEdge &a = half_edges[begin], &b = half_edges[begin + 1];
      if (a.is_forward != b.is_forward) glue(a, b);
      continue;
    }
    // several partners: the best pair first
    struct Pair {
      float score;
      std::size_t a, b;
    };
    std::vector<Pair> pairs;
    const std::size_t limit = std::min(end, begin + 64);  // a hostile fan must not cost its square
    for (std::size_t a = begin; a < limit; ++a) {
      for (std::size_t b = begin; b < limit; ++b) {
        const HalfEdge &forward = half_edges[a], &backward = half_edges[b];
        if (!forward.is_forward || backward.is_forward) continue;
        const bool is_continued = side[forward.triangle][forward.from] ==
                                      side[backward.triangle][(backward.from + 1) % 3] &&
                                  side[forward.triangle][(forward.from + 1) % 3] ==
                                      side[backward.triangle][backward.from];
        pairs.push_back({glm::dot(normal(forward.triangle), normal(backward.triangle)) +
                             (is_continued ? 4.0F : 0.0F),
                         a, b});
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.score > b.score; });
    std::vector<bool> is_used(end - begin, false);
    for (const Pair& pair : pairs) {
      if (is_used[pair.a - begin] || is_used[pair.b - begin]) continue;
      is_used[pair.a - begin] = is_used[pair.b - begin] = true;
      glue(half_edges[pair.a], half_edges[pair.b]);
    }
  }

  // number the classes in order of first use
  std::vector<glm::uvec3> result(corner.size());
  std::vector<std::uint32_t> number(corner.size() * 3, 0xFFFFFFFFU);
  origin.clear();
  for (std::uint32_t t = 0; t < corner.size(); ++t) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      std::uint32_t& point = number[corners.find(t * 3 + i)];
      if (point == 0xFFFFFFFFU) {
        point = static_cast<std::uint32_t>(origin.size());
        origin.push_back(corner[t][i]);
      }
      result[t][i] = point;
    }
  }
  return result;
}

}  // namespace

std::vector<glm::uvec3> make_manifold(const std::vector<glm::uvec3>& corner,
                                      const std::vector<glm::uvec3>& side,
                                      const std::vector<glm::vec3>& position,
                                      std::vector<std::uint32_t>& origin) {
  // Gluing can leave two edges between the same two points, where sheets that touch along an edge
  // are one sheet elsewhere. Half-edge structures can't hold that, so one triangle is cut out.
  std::vector<bool> is_alone(corner.size(), false);
  for (;;) {
    std::vector<glm::uvec3> result = glue_once(corner, side, position, is_alone, origin);
    std::unordered_map<std::uint64_t, std::uint32_t> directed;
    directed.reserve(result.size() * 3);
    bool is_doubled = false;
    for (std::uint32_t t = 0; t < result.size(); ++t) {
      for (int i = 0; i < 3 && !is_alone[t]; ++i) {
        const std::uint64_t edge = (std::uint64_t{result[t][i]} << 32U) | result[t][(i + 1) % 3];
        if (!directed.emplace(edge, t).second) is_alone[t] = is_doubled = true;
      }
    }
    if (!is_doubled) return result;
  }
}

}  // namespace throng::simplify
