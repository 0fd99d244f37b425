#include "throng/render/environment.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <iterator>
#include <new>
#include <string_view>
#include <utility>
#include <vector>

#include "render/environment/geometry.hpp"
#include "render/environment/pieces.hpp"

namespace throng::render {
namespace {

// The texture's columns: sides and tops of walls, surfaces.
constexpr std::array<Rgb, 8> kColors{
    {{196, 191, 182}, {86, 82, 78}, {84, 87, 92}, {170, 164, 154}, {226, 226, 220}, {}, {}, {}}};
constexpr std::uint16_t u_of(std::size_t color) {
  return static_cast<std::uint16_t>((2 * color + 1) * 32768 / kColors.size());
}
constexpr std::uint16_t kSideU = u_of(0), kTopU = u_of(1);

/// What lies on the ground, a little above it and each above the one before: so little that it
/// shows the ground's shadows.
struct Surface {
  std::string_view name;
  std::uint16_t u;
  float height_m;
};
constexpr Surface kSurfaces[] = {
    {"ROAD", u_of(2), 0.010F}, {"WALK", u_of(3), 0.018F}, {"MARK", u_of(4), 0.026F}};

struct Site {
  std::string area;  // WKT; empty: no walls
  std::vector<std::pair<const Surface*, std::string>> surfaces;
};

absl::StatusOr<Site> split(const std::string& text) {
  std::size_t at = text.find("\n;");
  Site site;
  site.area = text.substr(0, at);
  if (at == std::string::npos) return site;
  if (site.area.find_first_not_of(" \t\r\n") == std::string::npos) site.area.clear();
  while (at != std::string::npos) {
    const std::size_t begin = at + 2, blank = text.find(' ', begin);
    at = text.find("\n;", begin);
    const std::string_view name = std::string_view(text).substr(begin, blank - begin);
    const auto* const surface = std::find_if(std::begin(kSurfaces), std::end(kSurfaces),
                                             [&](const Surface& one) { return one.name == name; });
    if (blank == std::string::npos || surface == std::end(kSurfaces)) {
      return absl::InvalidArgumentError(
          "walkable area: what follows ';' must be ROAD, WALK or MARK and WKT");
    }
    site.surfaces.emplace_back(surface, text.substr(blank + 1, at - blank - 1));
  }
  return site;
}

/// Long edges are halved until they are short, those of a top just as those of the side below it,
/// so that their points are the same.
void raise_side(Pieces& pieces, const glm::dvec2& a, const glm::dvec2& b, float height_m,
                double piece_m) {
  if (glm::distance(a, b) > piece_m) {
    const glm::dvec2 middle = 0.5 * (a + b);
    raise_side(pieces, a, middle, height_m, piece_m);
    raise_side(pieces, middle, b, height_m, piece_m);
    return;
  }
  const glm::dvec2 along = glm::normalize(b - a);
  const glm::vec3 outwards(along.y, -along.x, 0.0);
  const glm::vec3 high_a(a, height_m), high_b(b, height_m);
  Corners& piece = piece_at(pieces, 0.5 * (a + b), piece_m);
  piece.add(glm::vec3(a, 0.0), glm::vec3(b, 0.0), high_b, outwards, kSideU);
  piece.add(glm::vec3(a, 0.0), high_b, high_a, outwards, kSideU);
}

void add_top(Pieces& pieces, const std::array<glm::dvec2, 3>& corners, float height_m,
             std::uint16_t u = kTopU, double piece_m = kPieceM) {
  int longest = 0;
  double longest_m = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double length_m = glm::distance(corners[i], corners[(i + 1) % 3]);
    if (length_m > longest_m) {
      longest_m = length_m;
      longest = i;
    }
  }
  const glm::dvec2 &a = corners[longest], &b = corners[(longest + 1) % 3],
                   &c = corners[(longest + 2) % 3];
  if (longest_m > piece_m) {
    const glm::dvec2 middle = 0.5 * (a + b);
    add_top(pieces, {a, middle, c}, height_m, u, piece_m);
    add_top(pieces, {middle, b, c}, height_m, u, piece_m);
    return;
  }
  piece_at(pieces, (a + b + c) / 3.0, piece_m, u == kTopU ? 0 : u / 8192)
      .add(glm::vec3(a, height_m), glm::vec3(b, height_m), glm::vec3(c, height_m),
           glm::vec3(0, 0, 1), u);
}

/// About how many triangles add_top makes of one. Halves of a right-angled isosceles triangle,
/// which all come near to, have an area over an eighth of their longest side's square.
double parts_of(const std::array<glm::dvec2, 3>& corners, double piece_m) {
  const glm::dvec2 u = corners[1] - corners[0], v = corners[2] - corners[0];
  const double longest_m =
      std::max({glm::length(u), glm::length(v), glm::distance(corners[1], corners[2])});
  return 1.0 + 2.0 * longest_m / piece_m +
         4.0 * std::abs(u.x * v.y - u.y * v.x) / (piece_m * piece_m);
}

/// A site may be large or finely drawn, but its parts have to fit into memory.
/// @param what  "its walls" or "its surfaces"
absl::Status check_parts(const char* what, double parts) {
  constexpr double kMostParts = 2e6;
  if (parts <= kMostParts) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("walkable area: ", what, " have about ", parts,
                                                 " triangles, must be at most ", kMostParts));
}

}  // namespace

absl::Status check_environment(const std::string& wkt, const glm::dvec3& origin_world) {
  const absl::StatusOr<Site> site = split(wkt);
  if (!site.ok()) return site.status();
  absl::Status status;
  if (!site->area.empty() || site->surfaces.empty()) {
    status = check_area(site->area, glm::dvec2(origin_world), kMostAreaPoints);
  }
  for (const auto& [surface, polygons] : site->surfaces) {
    if (status.ok()) status = check_area(polygons, glm::dvec2(origin_world), kMostSurfacePoints);
  }
  return status;
}

static absl::StatusOr<std::shared_ptr<const Environment>> make(const std::string& wkt,
                                                               const glm::dvec3& origin_world,
                                                               const EnvironmentOptions& options) {
  for (const auto& [name, value_m] : {std::pair{"wall_height_m", options.wall_height_m},
                                      std::pair{"wall_thickness_m", options.wall_thickness_m}}) {
    if (!(value_m > 0.0 && value_m <= 100.0)) {
      return absl::InvalidArgumentError(
          absl::StrCat("make_environment: ", name, " is ", value_m, ", must be in (0, 100]"));
    }
  }
  const absl::StatusOr<Site> site = split(wkt);
  if (!site.ok()) return site.status();
  const glm::dvec2 origin_m(origin_world);

  struct Laid {
    const Surface* surface;
    std::vector<std::array<glm::dvec2, 3>> triangles;
  };
  std::vector<Laid> laid;
  glm::dvec2 low(1e12), high(-1e12);
  for (const auto& [surface, polygons] : site->surfaces) {
    auto triangles = triangles_of(polygons, origin_m, options.cancelled);
    if (!triangles.ok()) return triangles.status();
    for (const auto& triangle : *triangles) {
      for (const glm::dvec2& corner : triangle) {
        low = glm::min(low, corner);
        high = glm::max(high, corner);
      }
    }
    laid.push_back({surface, *std::move(triangles)});
  }
  // a town has fewer and larger pieces
  constexpr double kManyPieces = 8'000.0;
  double piece_m = kPieceM;
  const auto cells = [&](double from, double to) {
    return 1.0 + std::max(0.0, to - from) / piece_m;
  };
  while (!laid.empty() && cells(low.x, high.x) * cells(low.y, high.y) > kManyPieces) piece_m *= 2.0;
  double parts = 0.0;
  for (const Laid& one : laid) {
    for (const auto& triangle : one.triangles) parts += parts_of(triangle, piece_m);
  }
  if (absl::Status status = check_parts("its surfaces", parts); !status.ok()) return status;
  Pieces pieces;
  for (const Laid& one : laid) {
    for (const auto& triangle : one.triangles) {
      add_top(pieces, triangle, one.surface->height_m, one.surface->u, piece_m);
    }
  }
  std::vector<std::vector<glm::dvec2>> rings;
  if (!site->area.empty() || site->surfaces.empty()) {
    auto footprint =
        solids_around(site->area, origin_m, options.wall_thickness_m, options.cancelled);
    if (!footprint.ok()) return footprint.status();
    parts = 0.0;
    for (const auto& triangle : footprint->triangles) parts += parts_of(triangle, piece_m);
    for (const auto& [a, b] : footprint->edges) parts += 2.0 * glm::distance(a, b) / piece_m + 2.0;
    if (absl::Status status = check_parts("its walls", parts); !status.ok()) return status;
    const auto height_m = static_cast<float>(options.wall_height_m);
    for (const auto& [a, b] : footprint->edges) raise_side(pieces, a, b, height_m, piece_m);
    for (const auto& triangle : footprint->triangles) {
      add_top(pieces, triangle, height_m, kTopU, piece_m);
    }
    rings = std::move(footprint->rings);
  }
  auto environment = finish(pieces, kColors, 0, "walkable area: its walls");
  if (environment.ok()) (*environment)->rings = std::move(rings);
  return environment;
}

void include_environment(const Environment* environment, const glm::dvec3& origin_world,
                         glm::dvec3& low, glm::dvec3& high) {
  if (environment == nullptr || environment->pieces.empty()) return;
  constexpr double kNearM = 5.0, kRoomM = 60.0, kRoomTimes = 3.0;
  const glm::dvec2 all_low =
                       glm::min(glm::dvec2(low), glm::dvec2(origin_world + environment->low_m)),
                   all_high =
                       glm::max(glm::dvec2(high), glm::dvec2(origin_world + environment->high_m));
  const auto span = [](const glm::dvec2& a, const glm::dvec2& b) {
    return std::max(b.x - a.x, b.y - a.y);
  };
  const bool is_room = span(all_low, all_high) <= std::max(kRoomM, kRoomTimes * span(low, high));
  for (int axis = 0; axis < 2; ++axis) {
    const double near_m =
        is_room ? span(all_low, all_high) : std::max(kNearM, 0.5 * (high[axis] - low[axis]));
    const double site_low = origin_world[axis] + environment->low_m[axis];
    const double site_high = origin_world[axis] + environment->high_m[axis];
    low[axis] = std::min(low[axis], std::max(site_low, low[axis] - near_m));
    high[axis] = std::max(high[axis], std::min(site_high, high[axis] + near_m));
  }
}

absl::StatusOr<std::shared_ptr<const Environment>> make_environment(
    const std::string& wkt, const glm::dvec3& origin_world, const EnvironmentOptions& options) {
  // What a stranger's file makes us allocate must not end the process.
  try {
    return make(wkt, origin_world, options);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("walkable area: there is not enough memory for its walls");
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("walkable area: ", error.what()));
  }
}

}  // namespace throng::render
