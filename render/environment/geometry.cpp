#include "render/environment/geometry.hpp"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "render/environment/geos.hpp"
#include "throng/render/environment.hpp"

namespace throng::render {
namespace {

constexpr double kFarthestM = 1e7;
// GEOS clips ears, which takes the square of the points and worse where holes are: 2,000 points
// take a second, 16,000 minutes. Larger polygons are cut in two until they have so many.
constexpr int kMostTogether = 200;
constexpr int kDeepest = 64;  // GEOS reads collections within collections by recursion

/// Calls `visit` with every polygon of a geometry, however deep its collections are nested.
void each_polygon(const Geos& geos, const GEOSGeometry* geometry,
                  const std::function<void(const GEOSGeometry*)>& visit) {
  if (GEOSGeomTypeId_r(geos.get(), geometry) == GEOS_POLYGON) {
    if (GEOSisEmpty_r(geos.get(), geometry) == 0) visit(geometry);
    return;
  }
  const int parts = GEOSGetNumGeometries_r(geos.get(), geometry);
  for (int i = 0; i < parts; ++i) {
    const GEOSGeometry* part = GEOSGetGeometryN_r(geos.get(), geometry, i);
    if (part != geometry) each_polygon(geos, part, visit);
  }
}

std::vector<glm::dvec2> points_of(const Geos& geos, const GEOSGeometry* ring) {
  const GEOSCoordSequence* sequence = GEOSGeom_getCoordSeq_r(geos.get(), ring);
  unsigned size = 0;
  GEOSCoordSeq_getSize_r(geos.get(), sequence, &size);
  std::vector<glm::dvec2> points(size);
  for (unsigned i = 0; i < size; ++i) {
    GEOSCoordSeq_getXY_r(geos.get(), sequence, i, &points[i].x, &points[i].y);
  }
  return points;  // the last is the first
}

double signed_area(const std::vector<glm::dvec2>& ring) {
  double area = 0.0;
  for (std::size_t i = 0; i + 1 < ring.size(); ++i) {
    area += ring[i].x * ring[i + 1].y - ring[i + 1].x * ring[i].y;
  }
  return 0.5 * area;
}

/// The area without its holes.
Geometry filled(const Geos& geos, const GEOSGeometry* area) {
  std::vector<GEOSGeometry*> shells;
  each_polygon(geos, area, [&](const GEOSGeometry* polygon) {
    const GEOSGeometry* ring = GEOSGetExteriorRing_r(geos.get(), polygon);
    shells.push_back(
        GEOSGeom_createPolygon_r(geos.get(), GEOSGeom_clone_r(geos.get(), ring), nullptr, 0));
  });
  Geometry all = own(geos, GEOSGeom_createCollection_r(geos.get(), GEOS_MULTIPOLYGON, shells.data(),
                                                       static_cast<unsigned>(shells.size())));
  if (all == nullptr) return all;
  return own(geos, GEOSUnaryUnion_r(geos.get(), all.get()));
}

/// Where a polygon was cut in two: what lies on it is no side of a solid.
struct Cut {
  int axis;
  double at;
};

bool is_on(const Cut& cut, const glm::dvec2& point) {
  return std::abs(point[cut.axis] - cut.at) <= 1e-9 * std::max(1.0, std::abs(cut.at));
}

void add_edges(const Geos& geos, const GEOSGeometry* ring, bool is_hole,
               const std::vector<Cut>& cuts, const glm::dvec2& origin, Footprint& footprint) {
  const std::vector<glm::dvec2> points = points_of(geos, ring);
  // shells counter-clockwise and holes clockwise: the solid is on the left
  const bool is_turned = (signed_area(points) > 0.0) == is_hole;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const glm::dvec2 a = points[i] - origin, b = points[i + 1] - origin;
    if (a == b) continue;
    const bool is_cut = std::any_of(cuts.begin(), cuts.end(), [&](const Cut& cut) {
      return is_on(cut, points[i]) && is_on(cut, points[i + 1]);
    });
    if (is_cut) continue;
    footprint.edges.push_back(is_turned ? std::array{b, a} : std::array{a, b});
  }
}

/// A solid's sides and its top in triangles.
absl::Status add_solid(const Geos& geos, const GEOSGeometry* polygon, std::vector<Cut>& cuts,
                       const glm::dvec2& origin_m, const std::atomic<bool>* cancelled,
                       Footprint& footprint) {
  if (cancelled != nullptr && cancelled->load()) {
    return absl::CancelledError("walkable area: nobody waits for it");
  }
  const int holes = GEOSGetNumInteriorRings_r(geos.get(), polygon);
  if (GEOSGetNumCoordinates_r(geos.get(), polygon) > kMostTogether && cuts.size() < 40) {
    std::vector<glm::dvec2> points = points_of(geos, GEOSGetExteriorRing_r(geos.get(), polygon));
    glm::dvec2 low = points[0], high = low;
    for (const glm::dvec2& point : points) {
      low = glm::min(low, point);
      high = glm::max(high, point);
    }
    for (int i = 0; i < holes; ++i) {
      const auto more = points_of(geos, GEOSGetInteriorRingN_r(geos.get(), polygon, i));
      points.insert(points.end(), more.begin(), more.end());
    }
    const int axis = high.x - low.x >= high.y - low.y ? 0 : 1;
    const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
    std::nth_element(points.begin(), middle, points.end(),
                     [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
    // A little beside the point in the middle, or walls along an axis would lie on the cut.
    const double at = (*middle)[axis] + 1.2345e-3 * (high[axis] - low[axis]) / (cuts.size() + 1.0);
    if (at > low[axis] && at < high[axis] && high[axis] - low[axis] > 0.1) {
      cuts.push_back({axis, at});
      for (const bool is_upper : {false, true}) {
        glm::dvec2 from = low - 1.0, to = high + 1.0;
        (is_upper ? from : to)[axis] = at;
        const Geometry box =
            own(geos, GEOSGeom_createRectangle_r(geos.get(), from.x, from.y, to.x, to.y));
        const Geometry half = own(
            geos, box == nullptr ? nullptr : GEOSIntersection_r(geos.get(), polygon, box.get()));
        if (half == nullptr) return geos.error("its walls can't be cut in two");
        absl::Status status;
        each_polygon(geos, half.get(), [&](const GEOSGeometry* part) {
          if (status.ok()) status = add_solid(geos, part, cuts, origin_m, cancelled, footprint);
        });
        if (!status.ok()) return status;
      }
      cuts.pop_back();
      return absl::OkStatus();
    }
  }

  add_edges(geos, GEOSGetExteriorRing_r(geos.get(), polygon), false, cuts, origin_m, footprint);
  for (int i = 0; i < holes; ++i) {
    add_edges(geos, GEOSGetInteriorRingN_r(geos.get(), polygon, i), true, cuts, origin_m,
              footprint);
  }
  const Geometry top = own(geos, GEOSConstrainedDelaunayTriangulation_r(geos.get(), polygon));
  if (top == nullptr) return geos.error("its walls can't be triangulated");
  each_polygon(geos, top.get(), [&](const GEOSGeometry* triangle) {
    std::vector<glm::dvec2> corners = points_of(geos, GEOSGetExteriorRing_r(geos.get(), triangle));
    if (corners.size() < 4) return;
    if (signed_area(corners) < 0.0) std::swap(corners[1], corners[2]);
    footprint.triangles.push_back(
        {corners[0] - origin_m, corners[1] - origin_m, corners[2] - origin_m});
  });
  return absl::OkStatus();
}

/// Reads polygons and checks all that is quickly checked.
absl::StatusOr<Geometry> read_area(const Geos& geos, const std::string& wkt,
                                   const glm::dvec2& origin_m, int most_points) {
  int depth = 0;
  for (const char c : wkt) {
    depth += c == '(' ? 1 : c == ')' ? -1 : 0;
    if (depth <= kDeepest) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "walkable area: its parentheses are nested deeper than ", kDeepest, " levels"));
  }
  const std::unique_ptr<GEOSWKTReader, std::function<void(GEOSWKTReader*)>> reader(
      GEOSWKTReader_create_r(geos.get()),
      [&geos](GEOSWKTReader* r) { GEOSWKTReader_destroy_r(geos.get(), r); });
  Geometry read = own(geos, GEOSWKTReader_read_r(geos.get(), reader.get(), wkt.c_str()));
  if (read == nullptr) return geos.error("is not WKT");

  // limits before anything that takes time
  const int points = GEOSGetNumCoordinates_r(geos.get(), read.get());
  if (points > most_points) {
    return absl::InvalidArgumentError(
        absl::StrCat("walkable area: has ", points, " points, must have at most ", most_points));
  }
  absl::Status inside;
  int polygons = 0;
  each_polygon(geos, read.get(), [&](const GEOSGeometry* polygon) {
    ++polygons;
    const auto check = [&](const GEOSGeometry* ring) {
      for (const glm::dvec2& point : points_of(geos, ring)) {
        if (std::abs(point.x - origin_m.x) <= kFarthestM &&
            std::abs(point.y - origin_m.y) <= kFarthestM) {
          continue;
        }
        inside = absl::InvalidArgumentError(absl::StrCat(
            "walkable area: the point (", point.x, ", ", point.y, ") must be within ", kFarthestM,
            " m of the crowd's origin (", origin_m.x, ", ", origin_m.y, ")"));
        return;
      }
    };
    check(GEOSGetExteriorRing_r(geos.get(), polygon));
    const int holes = GEOSGetNumInteriorRings_r(geos.get(), polygon);
    for (int i = 0; i < holes; ++i) check(GEOSGetInteriorRingN_r(geos.get(), polygon, i));
  });
  if (!inside.ok()) return inside;
  if (polygons == 0) return geos.error("has no polygon");
  return read;
}

}  // namespace

absl::Status check_area(const std::string& wkt, const glm::dvec2& origin_m, int most_points) {
  Geos geos;
  return read_area(geos, wkt, origin_m, most_points).status();
}

absl::StatusOr<std::vector<std::array<glm::dvec2, 3>>> triangles_of(
    const std::string& wkt, const glm::dvec2& origin_m, const std::atomic<bool>* cancelled) {
  Geos geos;
  const auto read = read_area(geos, wkt, origin_m, kMostSurfacePoints);
  if (!read.ok()) return read.status();
  Footprint footprint;
  absl::Status status;
  const auto add = [&](const GEOSGeometry* polygon) {
    std::vector<Cut> cuts;
    if (status.ok()) status = add_solid(geos, polygon, cuts, origin_m, cancelled, footprint);
  };
  each_polygon(geos, read->get(), [&](const GEOSGeometry* polygon) {
    if (GEOSisValid_r(geos.get(), polygon) == 1) return add(polygon);
    // a lane that bends sharply overlaps itself
    const Geometry valid = own(geos, GEOSMakeValid_r(geos.get(), polygon));
    if (valid != nullptr) each_polygon(geos, valid.get(), add);
  });
  if (!status.ok()) return status;
  return std::move(footprint.triangles);
}

absl::StatusOr<Footprint> solids_around(const std::string& wkt, const glm::dvec2& origin_m,
                                        double thickness_m, const std::atomic<bool>* cancelled) {
  Geos geos;
  const auto read = read_area(geos, wkt, origin_m, kMostAreaPoints);
  if (!read.ok()) return read.status();

  // polygons that overlap or touch are one area
  Geometry valid = own(geos, GEOSisValid_r(geos.get(), read->get()) == 1
                                 ? GEOSGeom_clone_r(geos.get(), read->get())
                                 : GEOSMakeValid_r(geos.get(), read->get()));
  if (valid == nullptr) return geos.error("can't be repaired");
  const Geometry area = own(geos, GEOSUnaryUnion_r(geos.get(), valid.get()));
  double area_m2 = 0.0;
  if (area == nullptr || GEOSArea_r(geos.get(), area.get(), &area_m2) == 0 || !(area_m2 > 0.0)) {
    return geos.error("has no area");
  }

  const Geometry whole = filled(geos, area.get());
  if (whole == nullptr) return geos.error("its outline is broken");
  constexpr int kQuadrantSegments = 4;
  constexpr double kMitre = 3.0;
  const Geometry grown =
      own(geos, GEOSBufferWithStyle_r(geos.get(), whole.get(), thickness_m, kQuadrantSegments,
                                      GEOSBUF_CAP_FLAT, GEOSBUF_JOIN_MITRE, kMitre));
  if (grown == nullptr) return geos.error("its outline is broken");
  const Geometry solid = own(geos, GEOSDifference_r(geos.get(), grown.get(), area.get()));
  if (solid == nullptr) return geos.error("its walls can't be cut out");

  Footprint footprint;
  each_polygon(geos, area.get(), [&](const GEOSGeometry* polygon) {
    const auto add = [&](const GEOSGeometry* ring) {
      std::vector<glm::dvec2>& points = footprint.rings.emplace_back(points_of(geos, ring));
      for (glm::dvec2& point : points) point -= origin_m;
    };
    add(GEOSGetExteriorRing_r(geos.get(), polygon));
    const int holes = GEOSGetNumInteriorRings_r(geos.get(), polygon);
    for (int i = 0; i < holes; ++i) add(GEOSGetInteriorRingN_r(geos.get(), polygon, i));
  });
  absl::Status status;
  each_polygon(geos, solid.get(), [&](const GEOSGeometry* polygon) {
    std::vector<Cut> cuts;
    if (status.ok()) status = add_solid(geos, polygon, cuts, origin_m, cancelled, footprint);
  });
  if (!status.ok()) return status;
  return footprint;
}

void interrupt_environments(bool is_on) {
  if (is_on) {
    GEOS_interruptRequest();
  } else {
    GEOS_interruptCancel();
  }
}

}  // namespace throng::render
