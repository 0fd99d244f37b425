#pragma once

#include <absl/status/statusor.h>

#include <atomic>
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
  const std::atomic<bool>* cancelled = nullptr;  // set by another thread: give up soon
};

/// What stands around a crowd: walls and obstacles, cut into pieces of some metres that are culled
/// one by one. A piece is a Character that never moves or loses detail, so that everything which
/// draws characters draws it.
struct Environment {
  std::vector<Character> pieces;  // placed at the crowd's origin, unturned
  std::uint64_t triangles = 0;
  glm::dvec3 low_m{0.0}, high_m{0.0};  // box of all pieces, from the crowd's origin
  // Of the walkable area, from the crowd's origin: inside is what an odd number of rings is around.
  // Empty where the area is not known.
  std::vector<std::vector<glm::dvec2>> rings;
};

/// Grows a box of agents (world frame, metres) by what stands about them, for cameras to be fitted
/// to. A room is shown whole: an environment that spans, with the agents, up to 60 m or three times
/// what they span. Of a larger one, what is within half of what the agents span, at least 5 m: a
/// city in which a few people stand does not make them specks.
/// @param environment  null: the box stays
/// @param origin_world  of the crowd
void include_environment(const Environment* environment, const glm::dvec3& origin_world,
                         glm::dvec3& low, glm::dvec3& high);

/// Walls around a walkable area and solid obstacles where it has holes, and surfaces on the ground.
///
/// @param wkt  polygons (POLYGON, MULTIPOLYGON or a GEOMETRYCOLLECTION of them) in metres, world
///             frame, as JuPedSim keeps them; an invalid one is repaired where that is possible.
/// @param origin_world  of the crowd: pieces are offsets from it.
/// It takes well under a second for 10,000 points; check_environment is quick.
/// Cancelled: see the options. ResourceExhausted: out of memory.
/// InvalidArgument: not WKT (with what the parser says), no area, a coordinate beyond 1e7 m of the
/// origin, over 50,000 points, nested over 64 deep, walls too long, a height or thickness that is
/// not in (0, 100] m.
absl::StatusOr<std::shared_ptr<const Environment>> make_environment(
    const std::string& wkt, const glm::dvec3& origin_world, const EnvironmentOptions& options = {});

/// The walkable area that a text tells, as WKT: make_environment and its checks take it from there.
///
/// - WKT comes back as it is.
/// - GeoJSON (coordinates in metres of the world frame, not degrees): polygons are walkable, but
///   those of a feature with a property `obstacle` that is true, a `building`, or a `type`, `kind`,
///   `class` or `role` of obstacle, wall or building, are solid.
/// - Vadere's .scenario: the bounds of its topography, less their frame where it is bounded, less
///   the obstacles.
///
/// Surfaces may follow, with or without an area before them: a line each of `;ROAD`, `;WALK` (where
/// only people walk) or `;MARK` (on either), a blank and WKT polygons. They lie on the ground, have
/// no walls and may overlap; 400,000 points in all of a line.
/// InvalidArgument names what lacks or does not fit.
absl::StatusOr<std::string> walkable_area_of(const std::string& text);

/// The environment that a file holds: walls around what `walkable_area_of` takes from it, or a
/// glTF 2.0 mesh (.glb, .gltf), +Y up, in metres: triangles of its scene, animated and skinned ones
/// at rest, in their materials' base colours. A texture (PNG, JPEG) is shown as the mean colour of
/// pieces of a metre, 256 colours in all. Compressed meshes are not read. NotFound; InvalidArgument
/// names the file and what is wrong. Errors else as make_environment.
absl::StatusOr<std::shared_ptr<const Environment>> read_environment(
    const std::string& path, const glm::dvec3& origin_world,
    const EnvironmentOptions& options = {});

/// Ends soon, with an error, what make_environment does on any thread. For the end of a process:
/// also call it with false when nothing is built any more, or the next one may be ended too.
void interrupt_environments(bool is_on);

/// What make_environment refuses of a walkable area before it begins.
absl::Status check_environment(const std::string& wkt, const glm::dvec3& origin_world);

}  // namespace throng::render
