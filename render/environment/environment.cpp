#include "throng/render/environment.hpp"

#include <absl/strings/str_cat.h>

#include <array>
#include <cmath>
#include <exception>
#include <new>
#include <utility>

#include "render/environment/geometry.hpp"
#include "render/environment/pieces.hpp"

namespace throng::render {
namespace {

// The texture's two columns: sides and tops.
constexpr std::array<Rgb, 2> kColors{{{196, 191, 182}, {86, 82, 78}}};
constexpr std::uint16_t kSideU = 16384, kTopU = 49151;

/// Long edges are halved until they are short, those of a top just as those of the side below it,
/// so that their points are the same.
void raise_side(Pieces& pieces, const glm::dvec2& a, const glm::dvec2& b, float height_m) {
  if (glm::distance(a, b) > kPieceM) {
    const glm::dvec2 middle = 0.5 * (a + b);
    raise_side(pieces, a, middle, height_m);
    raise_side(pieces, middle, b, height_m);
    return;
  }
  const glm::dvec2 along = glm::normalize(b - a);
  const glm::vec3 outwards(along.y, -along.x, 0.0);
  const glm::vec3 high_a(a, height_m), high_b(b, height_m);
  Corners& piece = piece_at(pieces, 0.5 * (a + b));
  piece.add(glm::vec3(a, 0.0), glm::vec3(b, 0.0), high_b, outwards, kSideU);
  piece.add(glm::vec3(a, 0.0), high_b, high_a, outwards, kSideU);
}

void add_top(Pieces& pieces, const std::array<glm::dvec2, 3>& corners, float height_m) {
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
  if (longest_m > kPieceM) {
    const glm::dvec2 middle = 0.5 * (a + b);
    add_top(pieces, {a, middle, c}, height_m);
    add_top(pieces, {middle, b, c}, height_m);
    return;
  }
  piece_at(pieces, (a + b + c) / 3.0)
      .add(glm::vec3(a, height_m), glm::vec3(b, height_m), glm::vec3(c, height_m),
           glm::vec3(0, 0, 1), kTopU);
}

/// A site may be large or finely drawn, but its parts have to fit into memory.
absl::Status check_size(const Footprint& footprint) {
  constexpr double kMostParts = 2e6;
  double parts = static_cast<double>(footprint.triangles.size());
  for (const auto& [a, b] : footprint.edges) parts += 2.0 * glm::distance(a, b) / kPieceM + 2.0;
  if (parts <= kMostParts) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("walkable area: its walls have about ", parts,
                                                 " triangles, must be at most ", kMostParts));
}

}  // namespace

absl::Status check_environment(const std::string& wkt, const glm::dvec3& origin_world) {
  return check_area(wkt, glm::dvec2(origin_world));
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
  const auto footprint =
      solids_around(wkt, glm::dvec2(origin_world), options.wall_thickness_m, options.cancelled);
  if (!footprint.ok()) return footprint.status();

  if (absl::Status status = check_size(*footprint); !status.ok()) return status;
  Pieces pieces;
  const auto height_m = static_cast<float>(options.wall_height_m);
  for (const auto& [a, b] : footprint->edges) raise_side(pieces, a, b, height_m);
  for (const auto& triangle : footprint->triangles) add_top(pieces, triangle, height_m);
  auto environment = finish(pieces, kColors, 0, "walkable area: its walls");
  if (environment.ok()) (*environment)->rings = std::move(footprint->rings);
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
