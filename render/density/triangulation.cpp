#include <algorithm>
#include <boost/polygon/voronoi.hpp>
#include <cmath>
#include <limits>

#include "throng/render/density.hpp"

namespace throng::render {
namespace {

constexpr float kFarthestM = 1.0e7F;
constexpr double kMostCells = 1 << 24;  // along an axis; the sweep is exact with 32 bits

struct GridPoint {
  std::uint64_t cell;  // y above x, so that equal cells are neighbours when sorted
  std::uint32_t agent;
};

/// The agents by cell, sorted. False: more cells than wanted.
bool sort_to_cells(std::span<const glm::vec3> position_m, std::span<const std::uint8_t> present,
                   const glm::dvec2& low_m, double cell_m, std::uint32_t most,
                   std::vector<GridPoint>& points) {
  points.clear();
  for (std::uint32_t i = 0; i < position_m.size(); ++i) {
    if (!present.empty() && present[i] == 0) continue;
    const glm::vec3& p = position_m[i];
    if (!(std::abs(p.x) <= kFarthestM && std::abs(p.y) <= kFarthestM)) continue;
    const double x = std::floor((static_cast<double>(p.x) - low_m.x) / cell_m);
    const double y = std::floor((static_cast<double>(p.y) - low_m.y) / cell_m);
    points.push_back({static_cast<std::uint64_t>(y) << 32 | static_cast<std::uint64_t>(x), i});
  }
  std::sort(points.begin(), points.end(), [](const GridPoint& a, const GridPoint& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.agent < b.agent;
  });
  std::uint32_t cells = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    cells += i == 0 || points[i].cell != points[i - 1].cell ? 1U : 0U;
  }
  return cells <= most;
}

double angle_between(const glm::dvec2& a, const glm::dvec2& b) {
  return std::abs(std::atan2(a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y));
}

}  // namespace

Triangulation triangulate(std::span<const glm::vec3> position_m,
                          std::span<const std::uint8_t> present,
                          const TriangulationOptions& options) {
  Triangulation result;
  result.vertex_of.assign(position_m.size(), Triangulation::kNoVertex);
  result.first_agent.push_back(0);
  glm::dvec2 low_m(std::numeric_limits<double>::max()), high_m(-low_m);
  for (std::size_t i = 0; i < position_m.size(); ++i) {
    if (!present.empty() && present[i] == 0) continue;
    const glm::dvec2 p(position_m[i].x, position_m[i].y);
    if (!(std::abs(p.x) <= double{kFarthestM} && std::abs(p.y) <= double{kFarthestM})) continue;
    low_m = glm::min(low_m, p);
    high_m = glm::max(high_m, p);
  }
  if (!(low_m.x <= high_m.x)) return result;

  double cell_m = std::max(static_cast<double>(options.cell_m), 1e-3);
  const double side_m = std::max(high_m.x - low_m.x, high_m.y - low_m.y);
  while (side_m / cell_m > kMostCells) cell_m *= 2.0;
  std::vector<GridPoint> points;
  const std::uint32_t most = std::max(options.most_vertices, 1U);
  while (!sort_to_cells(position_m, present, low_m, cell_m, most, points)) cell_m *= 2.0;
  result.cell_m = static_cast<float>(cell_m);

  // one vertex for each cell that somebody stands in
  std::vector<boost::polygon::point_data<std::int32_t>> sites;
  std::vector<glm::dvec2> site;
  for (std::size_t begin = 0; begin < points.size();) {
    std::size_t end = begin;
    glm::dvec3 sum(0.0);
    const auto vertex = static_cast<std::uint32_t>(sites.size());
    for (; end < points.size() && points[end].cell == points[begin].cell; ++end) {
      const std::uint32_t agent = points[end].agent;
      result.agents.push_back(agent);
      result.vertex_of[agent] = vertex;
      sum += glm::dvec3(position_m[agent]);
    }
    const auto x = static_cast<std::int32_t>(points[begin].cell & 0xffffffffU);
    const auto y = static_cast<std::int32_t>(points[begin].cell >> 32);
    sites.emplace_back(x, y);
    site.emplace_back(x, y);
    result.position_m.emplace_back(sum / static_cast<double>(end - begin));
    result.first_agent.push_back(static_cast<std::uint32_t>(end));
    begin = end;
  }

  // Delaunay polygons are the Voronoi diagram's vertices, their corners the cells around them
  boost::polygon::voronoi_diagram<double> diagram;
  boost::polygon::construct_voronoi(sites.begin(), sites.end(), &diagram);
  const std::size_t count = sites.size();
  std::vector<double> area(count, 0.0), angle(count, 0.0);
  std::vector<std::size_t> corner;
  for (const auto& vertex : diagram.vertices()) {
    corner.clear();
    const auto* edge = vertex.incident_edge();
    do {
      corner.push_back(edge->cell()->source_index());
      edge = edge->rot_next();
    } while (edge != vertex.incident_edge());
    if (corner.size() < 3) continue;
    ++result.triangles;
    double doubled = 0.0;
    for (std::size_t k = 0; k < corner.size(); ++k) {
      const glm::dvec2& a = site[corner[k]];
      const glm::dvec2& b = site[corner[(k + 1) % corner.size()]];
      doubled += a.x * b.y - a.y * b.x;
    }
    const double share = 0.5 * std::abs(doubled) / static_cast<double>(corner.size());
    for (std::size_t k = 0; k < corner.size(); ++k) {
      const glm::dvec2& here = site[corner[k]];
      const glm::dvec2& before = site[corner[(k + corner.size() - 1) % corner.size()]];
      const glm::dvec2& after = site[corner[(k + 1) % corner.size()]];
      area[corner[k]] += share;
      angle[corner[k]] += angle_between(before - here, after - here);
    }
  }
  // who is in no polygon has neighbours along edges of the diagram, if anybody is there
  std::vector<double> nearest(count, std::numeric_limits<double>::infinity());
  for (const auto& edge : diagram.edges()) {
    const std::size_t a = edge.cell()->source_index(), b = edge.twin()->cell()->source_index();
    const glm::dvec2 between = site[a] - site[b];
    nearest[a] = std::min(nearest[a], glm::dot(between, between));
  }
  constexpr double kTurn = 6.283185307179586;
  result.free_m2.resize(count);
  for (std::size_t v = 0; v < count; ++v) {
    double cells = nearest[v];
    // under a tenth of a turn says little about the rest
    if (angle[v] > 0.1 * kTurn) cells = area[v] * std::max(1.0, kTurn / angle[v]);
    const double agents = result.first_agent[v + 1] - result.first_agent[v];
    double free_m2 = cells * cell_m * cell_m / agents;
    // nobody else anywhere: what one alone would have is theirs together
    if (!std::isfinite(free_m2)) free_m2 = static_cast<double>(options.most_free_m2) / agents;
    result.free_m2[v] =
        static_cast<float>(std::min(free_m2, static_cast<double>(options.most_free_m2)));
  }
  return result;
}

}  // namespace throng::render
