#include "simplify/collapse/wedges.hpp"

#include <algorithm>
#include <limits>

namespace throng::simplify {
namespace {

/// Index of a point among the three, 3 where it isn't there.
int corner_of(const glm::uvec3& points, std::uint32_t point) {
  return points.x == point ? 0 : points.y == point ? 1 : points.z == point ? 2 : 3;
}

}  // namespace

WedgeMesh::WedgeMesh(const Surface& surface)
    : surface_(&surface),
      points_(surface.triangles.size()),
      wedges_(surface.triangles),
      death_(surface.triangles.size(), kNoIndex),
      users_(surface.wedge_count(), 0),
      point_wedges_(surface.point_count()),
      initial_wedges_(surface.point_count(), 0),
      alive_wedges_(surface.wedge_count()) {
  for (std::size_t t = 0; t < wedges_.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      points_[t][i] = surface.wedge_point[wedges_[t][i]];
      ++users_[wedges_[t][i]];
    }
  }
  for (std::uint32_t w = 0; w < surface.wedge_count(); ++w) {
    point_wedges_[surface.wedge_point[w]].push_back(w);
    ++initial_wedges_[surface.wedge_point[w]];
  }
}

void WedgeMesh::find_moves(std::uint32_t a, std::uint32_t b, std::span<const std::uint32_t> around,
                           std::vector<WedgeMove>& moves) const {
  moves.clear();
  for (const std::uint32_t triangle : around) {
    if (has(triangle, b)) continue;
    const std::uint32_t wedge = wedges_[triangle][corner_of(points_[triangle], a)];
    const bool is_known = std::any_of(moves.begin(), moves.end(),
                                      [&](const WedgeMove& move) { return move.from == wedge; });
    if (is_known) continue;
    // the wedge of b next to it, on the sides of the edge
    WedgeMove move{wedge, kNoIndex, true, false};
    for (const std::uint32_t dying : around) {
      if (!has(dying, b) || wedges_[dying][corner_of(points_[dying], a)] != wedge) continue;
      const std::uint32_t to = wedges_[dying][corner_of(points_[dying], b)];
      if (move.to == kNoIndex) move.to = to;
      move.is_ambiguous |= move.to != to;
    }
    if (move.to == kNoIndex) {
      move.to = nearest_alive_wedge(b, wedge);
      move.is_exact = false;
    }
    moves.push_back(move);
  }
}

std::uint32_t WedgeMesh::nearest_alive_wedge(std::uint32_t point, std::uint32_t wedge) const {
  std::uint32_t nearest = kNoIndex;
  float least = std::numeric_limits<float>::max();
  for (const std::uint32_t candidate : point_wedges_[point]) {
    const glm::vec2 uv = surface_->wedge_uv[candidate] - surface_->wedge_uv[wedge];
    // the normal only decides between wedges at one place of the texture
    const float distance =
        glm::dot(uv, uv) + 1.0e-4F * (1.0F - glm::dot(surface_->wedge_normal[candidate],
                                                      surface_->wedge_normal[wedge]));
    if (distance < least) {
      least = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

void WedgeMesh::kill(std::uint32_t triangle) {
  death_[triangle] = static_cast<std::uint32_t>(steps_.size());
  for (int i = 0; i < 3; ++i) --users_[wedges_[triangle][i]];
}

void WedgeMesh::collapse(std::uint32_t a, std::uint32_t b, std::span<const std::uint32_t> around,
                         std::span<const WedgeMove> moves, float error_m,
                         std::span<const std::uint32_t> twins) {
  Step step;
  step.first_removal = static_cast<std::uint32_t>(removals_.size());
  step.error_m = error_m;

  std::vector<std::uint32_t> touched{b};  // points that may lose wedges besides a
  for (const std::uint32_t triangle : around) {
    if (has(triangle, b) || std::find(twins.begin(), twins.end(), triangle) != twins.end()) {
      for (int i = 0; i < 3; ++i) {
        const std::uint32_t point = points_[triangle][i];
        if (point != a && std::find(touched.begin(), touched.end(), point) == touched.end())
          touched.push_back(point);
      }
      kill(triangle);
      continue;
    }
    const int corner = corner_of(points_[triangle], a);
    std::uint32_t& wedge = wedges_[triangle][corner];
    for (const WedgeMove& move : moves) {
      if (move.from != wedge) continue;
      --users_[wedge];
      ++users_[move.to];
      wedge = move.to;
      break;
    }
    points_[triangle][corner] = b;
  }

  // wedges that are left without a triangle go in the same step, or a level would draw unused
  // vertices
  std::vector<std::uint32_t> orphans;
  for (const std::uint32_t point : touched) {
    std::vector<std::uint32_t>& alive = point_wedges_[point];
    for (std::size_t i = 0; i < alive.size();) {
      if (users_[alive[i]] > 0) {
        ++i;
        continue;
      }
      orphans.push_back(alive[i]);
      alive.erase(alive.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
  for (const std::uint32_t wedge : point_wedges_[a]) {
    std::uint32_t target = kNoIndex;
    for (const WedgeMove& move : moves) {
      if (move.from == wedge) target = move.to;
    }
    if (target == kNoIndex || users_[target] == 0) target = nearest_alive_wedge(b, wedge);
    removals_.push_back({wedge, target});
  }
  for (const std::uint32_t wedge : orphans) {
    const std::uint32_t own = surface_->wedge_point[wedge];
    removals_.push_back({wedge, nearest_alive_wedge(point_wedges_[own].empty() ? b : own, wedge)});
  }
  alive_wedges_ -= static_cast<std::uint32_t>(point_wedges_[a].size() + orphans.size());
  point_wedges_[a].clear();
  step.alive_wedges = alive_wedges_;
  steps_.push_back(step);
}

void WedgeMesh::remove(std::span<const std::uint32_t> triangles, std::uint32_t target,
                       float error_m) {
  Step step;
  step.first_removal = static_cast<std::uint32_t>(removals_.size());
  step.error_m = error_m;
  for (const std::uint32_t triangle : triangles) kill(triangle);
  for (const std::uint32_t triangle : triangles) {
    for (int i = 0; i < 3; ++i) {
      std::vector<std::uint32_t>& alive = point_wedges_[points_[triangle][i]];
      for (const std::uint32_t wedge : alive) removals_.push_back({wedge, target});
      alive_wedges_ -= static_cast<std::uint32_t>(alive.size());
      alive.clear();
    }
  }
  step.alive_wedges = alive_wedges_;
  steps_.push_back(step);
}

}  // namespace throng::simplify
