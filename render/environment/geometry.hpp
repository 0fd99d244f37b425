#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <atomic>
#include <glm/glm.hpp>
#include <string>
#include <vector>

namespace throng::render {

/// A solid's outline on the ground, ready to be raised: its top in triangles (counter-clockwise)
/// and its sides as edges with the solid on their left. Metres.
struct Footprint {
  std::vector<std::array<glm::dvec2, 3>> triangles;
  std::vector<std::array<glm::dvec2, 2>> edges;
  std::vector<std::vector<glm::dvec2>> rings;  // of the area that it stands around
};

inline constexpr int kMostAreaPoints = 50'000, kMostSurfacePoints = 400'000;

/// Reads the polygons and checks what is quickly checked. Errors as of make_environment.
absl::Status check_area(const std::string& wkt, const glm::dvec2& origin_m, int most_points);

/// Polygons in triangles (counter-clockwise), each for itself: those that overlap stay so.
/// Errors as of make_environment; Cancelled soon after `cancelled` is set.
absl::StatusOr<std::vector<std::array<glm::dvec2, 3>>> triangles_of(
    const std::string& wkt, const glm::dvec2& origin_m,
    const std::atomic<bool>* cancelled = nullptr);

/// What is solid around a walkable area: a band of `thickness_m` outside of it, and its holes.
/// Errors as of make_environment; Cancelled soon after `cancelled` is set.
absl::StatusOr<Footprint> solids_around(const std::string& wkt, const glm::dvec2& origin_m,
                                        double thickness_m,
                                        const std::atomic<bool>* cancelled = nullptr);

}  // namespace throng::render
