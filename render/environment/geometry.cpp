#include "render/environment/geometry.hpp"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <geos_c.h>

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <functional>
#include <memory>

namespace throng::render {
namespace {

constexpr double kFarthestM = 1e7;
constexpr int kMostPoints = 50'000;
constexpr int kDeepest = 64;  // GEOS reads collections within collections by recursion

/// A GEOS context that keeps what it complains about.
class Geos {
 public:
  Geos() : context_(GEOS_init_r()) {
    GEOSContext_setErrorMessageHandler_r(
        context_,
        [](const char* message, void* self) { static_cast<Geos*>(self)->complaint_ = message; },
        this);
  }
  ~Geos() { GEOS_finish_r(context_); }
  Geos(const Geos&) = delete;
  Geos& operator=(const Geos&) = delete;

  GEOSContextHandle_t get() const { return context_; }
  absl::Status error(const char* what) const {
    return absl::InvalidArgumentError(
        absl::StrCat("walkable area: ", what, complaint_.empty() ? "" : ": ", complaint_));
  }

 private:
  GEOSContextHandle_t context_;
  std::string complaint_;
};

using Geometry = std::unique_ptr<GEOSGeometry, std::function<void(GEOSGeometry*)>>;

Geometry own(const Geos& geos, GEOSGeometry* geometry) {
  return Geometry(geometry, [&geos](GEOSGeometry* g) { GEOSGeom_destroy_r(geos.get(), g); });
}

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

void add_edges(const Geos& geos, const GEOSGeometry* ring, bool is_hole, const glm::dvec2& origin,
               Footprint& footprint) {
  const std::vector<glm::dvec2> points = points_of(geos, ring);
  // shells counter-clockwise and holes clockwise: the solid is on the left
  const bool is_turned = (signed_area(points) > 0.0) == is_hole;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const glm::dvec2 a = points[i] - origin, b = points[i + 1] - origin;
    if (a == b) continue;
    footprint.edges.push_back(is_turned ? std::array{b, a} : std::array{a, b});
  }
}

/// Reads polygons and checks all that is quickly checked.
absl::StatusOr<Geometry> read_area(const Geos& geos, const std::string& wkt,
                                   const glm::dvec2& origin_m) {
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
  if (points > kMostPoints) {
    return absl::InvalidArgumentError(
        absl::StrCat("walkable area: has ", points, " points, must have at most ", kMostPoints));
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

absl::Status check_area(const std::string& wkt, const glm::dvec2& origin_m) {
  Geos geos;
  return read_area(geos, wkt, origin_m).status();
}

absl::StatusOr<Footprint> solids_around(const std::string& wkt, const glm::dvec2& origin_m,
                                        double thickness_m) {
  Geos geos;
  const auto read = read_area(geos, wkt, origin_m);
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
  absl::Status triangulated;
  each_polygon(geos, solid.get(), [&](const GEOSGeometry* polygon) {
    add_edges(geos, GEOSGetExteriorRing_r(geos.get(), polygon), false, origin_m, footprint);
    const int holes = GEOSGetNumInteriorRings_r(geos.get(), polygon);
    for (int i = 0; i < holes; ++i) {
      add_edges(geos, GEOSGetInteriorRingN_r(geos.get(), polygon, i), true, origin_m, footprint);
    }
    const Geometry top = own(geos, GEOSConstrainedDelaunayTriangulation_r(geos.get(), polygon));
    if (top == nullptr) {
      triangulated = geos.error("its walls can't be triangulated");
      return;
    }
    each_polygon(geos, top.get(), [&](const GEOSGeometry* triangle) {
      std::vector<glm::dvec2> corners =
          points_of(geos, GEOSGetExteriorRing_r(geos.get(), triangle));
      if (corners.size() < 4) return;
      if (signed_area(corners) < 0.0) std::swap(corners[1], corners[2]);
      footprint.triangles.push_back(
          {corners[0] - origin_m, corners[1] - origin_m, corners[2] - origin_m});
    });
  });
  if (!triangulated.ok()) return triangulated;
  return footprint;
}

}  // namespace throng::render
