#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::render {

struct EnvironmentOptions {
  double wall_height_m = 1.2;     // low enough to look over from where crowds are looked at
  double wall_thickness_m = 0.2;  // outwards from the walkable area
};

/// What stands around a crowd: walls and obstacles, cut into pieces of some metres that are culled
/// one by one. A piece is a Character that never moves or loses detail, so that everything which
/// draws characters draws it.
struct Environment {
  std::vector<Character> pieces;  // placed at the crowd's origin, unturned
  std::uint64_t triangles = 0;
};

/// Walls around a walkable area and solid obstacles where it has holes.
///
/// @param wkt  polygons (POLYGON, MULTIPOLYGON or a GEOMETRYCOLLECTION of them) in metres, world
///             frame, as JuPedSim keeps them; an invalid one is repaired where that is possible.
/// @param origin_world  of the crowd: pieces are offsets from it.
/// It takes about a second for 10,000 points; check_environment is quick.
/// InvalidArgument: not WKT (with what the parser says), no area, a coordinate beyond 1e7 m of the
/// origin, over 50,000 points, nested over 64 deep, walls too long, a height or thickness that is
/// not in (0, 100] m.
absl::StatusOr<std::shared_ptr<const Environment>> make_environment(
    const std::string& wkt, const glm::dvec3& origin_world, const EnvironmentOptions& options = {});

/// What make_environment refuses of a walkable area before it begins.
absl::Status check_environment(const std::string& wkt, const glm::dvec3& origin_world);

}  // namespace throng::render
