#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/environment/geos.hpp"
#include "throng/render/environment.hpp"

/// What simulators and maps say of a site, as one walkable area.
namespace throng::render {
namespace {

using nlohmann::json;

constexpr std::size_t kMostPoints = 50'000;
constexpr int kDeepest = 64;
constexpr int kCircleCorners = 32;

absl::Status wrong(std::string_view message) {
  return absl::InvalidArgumentError(
      absl::StrCat("environment: ", absl::string_view(message.data(), message.size())));
}

/// A member that is there, else null.
const json* find(const json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(key);
  return found != object.end() ? &*found : nullptr;
}

std::optional<double> number(const json& object, const char* key) {
  const json* value = find(object, key);
  if (value == nullptr || !value->is_number()) return std::nullopt;
  return value->get<double>();
}

/// Polygons on their way to WKT: what is walked on, and what stands on it.
class Polygons {
 public:
  /// A ring of points; closed if it is not.
  using Ring = std::vector<std::array<double, 2>>;

  absl::Status add(const std::vector<Ring>& rings, bool is_solid) {
    std::string text;
    for (const Ring& ring : rings) {
      if (ring.size() < 3) return wrong("a ring has less than 3 points");
      points_ += ring.size();
      if (points_ > kMostPoints) {
        return wrong(absl::StrCat("it has over ", kMostPoints, " points"));
      }
      absl::StrAppend(&text, text.empty() ? "((" : ", (");
      for (const auto& [x, y] : ring) absl::StrAppendFormat(&text, "%.17g %.17g, ", x, y);
      absl::StrAppendFormat(&text, "%.17g %.17g)", ring.front()[0], ring.front()[1]);
    }
    if (text.empty()) return absl::OkStatus();
    std::string& all = is_solid ? solid_ : walkable_;
    absl::StrAppend(&all, all.empty() ? "" : ", ", text, ")");
    return absl::OkStatus();
  }

  bool has_walkable() const { return !walkable_.empty(); }

  /// Everything walkable but what is solid.
  absl::StatusOr<std::string> wkt() const {
    if (solid_.empty()) return absl::StrCat("MULTIPOLYGON (", walkable_, ")");
    Geos geos;
    const Geometry walkable = united(geos, walkable_), solid = united(geos, solid_);
    if (walkable == nullptr || solid == nullptr) return geos.error("its polygons can't be joined");
    const Geometry area = own(geos, GEOSDifference_r(geos.get(), walkable.get(), solid.get()));
    if (area == nullptr) return geos.error("its obstacles can't be cut out");
    const std::unique_ptr<GEOSWKTWriter, std::function<void(GEOSWKTWriter*)>> writer(
        GEOSWKTWriter_create_r(geos.get()),
        [&geos](GEOSWKTWriter* w) { GEOSWKTWriter_destroy_r(geos.get(), w); });
    GEOSWKTWriter_setTrim_r(geos.get(), writer.get(), 1);
    const std::unique_ptr<char, std::function<void(char*)>> text(
        GEOSWKTWriter_write_r(geos.get(), writer.get(), area.get()),
        [&geos](char* t) { GEOSFree_r(geos.get(), t); });
    if (text == nullptr) return geos.error("its area can't be written");
    return std::string(text.get());
  }

 private:
  static Geometry united(const Geos& geos, const std::string& polygons) {
    const std::unique_ptr<GEOSWKTReader, std::function<void(GEOSWKTReader*)>> reader(
        GEOSWKTReader_create_r(geos.get()),
        [&geos](GEOSWKTReader* r) { GEOSWKTReader_destroy_r(geos.get(), r); });
    const Geometry read =
        own(geos, GEOSWKTReader_read_r(geos.get(), reader.get(),
                                       absl::StrCat("MULTIPOLYGON (", polygons, ")").c_str()));
    if (read == nullptr) return own(geos, nullptr);
    // One by one: obstacles that overlap are one, where an invalid multipolygon would make a gap.
    std::vector<GEOSGeometry*> valid;
    const int parts = GEOSGetNumGeometries_r(geos.get(), read.get());
    for (int i = 0; i < parts; ++i) {
      GEOSGeometry* part =
          GEOSMakeValid_r(geos.get(), GEOSGetGeometryN_r(geos.get(), read.get(), i));
      if (part != nullptr) valid.push_back(part);
    }
    const Geometry all =
        own(geos, GEOSGeom_createCollection_r(geos.get(), GEOS_GEOMETRYCOLLECTION, valid.data(),
                                              static_cast<unsigned>(valid.size())));
    return own(geos, all == nullptr ? nullptr : GEOSUnaryUnion_r(geos.get(), all.get()));
  }

  std::string walkable_, solid_;
  std::size_t points_ = 0;
};

// --- GeoJSON

/// Whether a feature's properties say that nobody walks there.
bool is_obstacle(const json& feature) {
  const json* properties = find(feature, "properties");
  if (properties == nullptr) return false;
  for (const char* key : {"obstacle", "building"}) {
    const json* value = find(*properties, key);
    if (value == nullptr || value->is_null()) continue;
    if (value->is_boolean()) return value->get<bool>();
    if (value->is_string() && value->get_ref<const std::string&>() != "no") return true;
  }
  for (const char* key : {"type", "kind", "class", "role"}) {
    const json* value = find(*properties, key);
    if (value == nullptr || !value->is_string()) continue;
    const std::string text = absl::AsciiStrToLower(value->get_ref<const std::string&>());
    if (text == "obstacle" || text == "wall" || text == "building") return true;
  }
  return false;
}

absl::Status add_rings(const json& coordinates, bool is_solid, Polygons& polygons) {
  if (!coordinates.is_array()) return wrong("GeoJSON: coordinates of a polygon are no list");
  std::vector<Polygons::Ring> rings;
  for (const json& ring : coordinates) {
    if (!ring.is_array()) return wrong("GeoJSON: a ring is no list");
    Polygons::Ring& points = rings.emplace_back();
    for (const json& point : ring) {
      if (!point.is_array() || point.size() < 2 || !point[0].is_number() || !point[1].is_number()) {
        return wrong("GeoJSON: a point is not a list of two numbers");
      }
      points.push_back({point[0].get<double>(), point[1].get<double>()});
    }
  }
  return polygons.add(rings, is_solid);
}

absl::Status add_geojson(const json& object, bool is_solid, int depth, Polygons& polygons) {
  if (depth > kDeepest) return wrong("GeoJSON: it is nested too deep");
  const json* type = find(object, "type");
  if (type == nullptr || !type->is_string()) return wrong("GeoJSON: an object has no type");
  const std::string& name = type->get_ref<const std::string&>();
  const auto each = [&](const char* key) -> absl::Status {
    const json* list = find(object, key);
    if (list == nullptr || !list->is_array()) {
      return wrong(absl::StrCat("GeoJSON: ", name, " has no list of ", key));
    }
    for (const json& part : *list) {
      if (absl::Status s = add_geojson(part, is_solid, depth + 1, polygons); !s.ok()) return s;
    }
    return absl::OkStatus();
  };
  if (name == "FeatureCollection") return each("features");
  if (name == "GeometryCollection") return each("geometries");
  if (name == "Feature") {
    const json* geometry = find(object, "geometry");
    if (geometry == nullptr || geometry->is_null()) return absl::OkStatus();
    return add_geojson(*geometry, is_solid || is_obstacle(object), depth + 1, polygons);
  }
  const json* coordinates = find(object, "coordinates");
  if (name == "Polygon" || name == "MultiPolygon") {
    if (coordinates == nullptr)
      return wrong(absl::StrCat("GeoJSON: ", name, " has no coordinates"));
    if (name == "Polygon") return add_rings(*coordinates, is_solid, polygons);
    if (!coordinates->is_array()) return wrong("GeoJSON: coordinates are no list");
    for (const json& polygon : *coordinates) {
      if (absl::Status s = add_rings(polygon, is_solid, polygons); !s.ok()) return s;
    }
  }
  return absl::OkStatus();  // points and lines are nothing to walk on
}

absl::Status check_crs(const json& object) {
  const json* crs = find(object, "crs");
  if (crs == nullptr || crs->is_null()) return absl::OkStatus();
  const json* properties = find(*crs, "properties");
  const json* name = properties != nullptr ? find(*properties, "name") : nullptr;
  const std::string text = name != nullptr && name->is_string() ? name->get<std::string>() : "";
  for (const char* degrees : {"CRS84", "4326", "4258", "4269"}) {
    if (text.find(degrees) != std::string::npos) {
      return wrong(absl::StrCat("GeoJSON: its crs (", degrees,
                                ") is in degrees; project it to metres, as ogr2ogr -t_srs does"));
    }
  }
  return absl::OkStatus();
}

// --- Vadere

absl::StatusOr<Polygons::Ring> ring_of(const json& shape) {
  const json* type = find(shape, "type");
  const std::string name = type != nullptr && type->is_string() ? type->get<std::string>() : "";
  if (name == "RECTANGLE") {
    const auto x = number(shape, "x"), y = number(shape, "y"), width = number(shape, "width"),
               height = number(shape, "height");
    if (x && y && width && height) {
      return Polygons::Ring{
          {*x, *y}, {*x + *width, *y}, {*x + *width, *y + *height}, {*x, *y + *height}};
    }
  } else if (name == "CIRCLE") {
    const json* center = find(shape, "center");
    const auto radius = number(shape, "radius");
    const auto x = center != nullptr ? number(*center, "x") : std::nullopt;
    const auto y = center != nullptr ? number(*center, "y") : std::nullopt;
    if (x && y && radius && *radius > 0.0) {
      Polygons::Ring ring;
      for (int i = 0; i < kCircleCorners; ++i) {
        const double angle = 2.0 * M_PI * i / kCircleCorners;
        ring.push_back({*x + *radius * std::cos(angle), *y + *radius * std::sin(angle)});
      }
      return ring;
    }
  } else if (name == "POLYGON") {
    if (const json* points = find(shape, "points"); points != nullptr && points->is_array()) {
      Polygons::Ring ring;
      for (const json& point : *points) {
        const auto x = number(point, "x"), y = number(point, "y");
        if (!x || !y) return wrong("Vadere scenario: a point of a POLYGON lacks x or y");
        ring.push_back({*x, *y});
      }
      return ring;
    }
  } else {
    return wrong(absl::StrCat("Vadere scenario: a shape of type '", name.substr(0, 40),
                              "', must be RECTANGLE, POLYGON or CIRCLE"));
  }
  return wrong(absl::StrCat("Vadere scenario: a ", name, " lacks numbers"));
}

absl::Status add_vadere(const json& topography, Polygons& polygons) {
  const json* attributes = find(topography, "attributes");
  const json* bounds = attributes != nullptr ? find(*attributes, "bounds") : nullptr;
  if (bounds == nullptr) return wrong("Vadere scenario: topography.attributes.bounds is missing");
  const auto x = number(*bounds, "x"), y = number(*bounds, "y"), width = number(*bounds, "width"),
             height = number(*bounds, "height");
  if (!x || !y || !width || !height) {
    return wrong("Vadere scenario: bounds lack x, y, width or height");
  }
  const json* bounded = find(*attributes, "bounded");
  const bool has_frame = bounded == nullptr || !bounded->is_boolean() || bounded->get<bool>();
  const double frame = has_frame ? number(*attributes, "boundingBoxWidth").value_or(0.0) : 0.0;
  if (!(frame >= 0.0 && *width > 2.0 * frame && *height > 2.0 * frame)) {
    return wrong(absl::StrCat("Vadere scenario: bounds of ", *width, " x ", *height,
                              " m with a frame of ", frame, " m leave nothing"));
  }
  const double right = *x + *width - frame, top = *y + *height - frame;
  const Polygons::Ring outline{
      {*x + frame, *y + frame}, {right, *y + frame}, {right, top}, {*x + frame, top}};
  if (absl::Status s = polygons.add({outline}, false); !s.ok()) return s;
  const json* obstacles = find(topography, "obstacles");
  if (obstacles == nullptr || !obstacles->is_array()) return absl::OkStatus();
  for (const json& obstacle : *obstacles) {
    const json* shape = find(obstacle, "shape");
    if (shape == nullptr) return wrong("Vadere scenario: an obstacle has no shape");
    const auto ring = ring_of(*shape);
    if (!ring.ok()) return ring.status();
    if (absl::Status s = polygons.add({*ring}, true); !s.ok()) return s;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> walkable_area_of(const std::string& text) {
  if (const std::size_t end = text.find("\n;"); end != std::string::npos && end > 0) {
    absl::StatusOr<std::string> area = walkable_area_of(text.substr(0, end));  // surfaces follow
    return area.ok() ? *area + text.substr(end) : area;
  }
  const absl::string_view body = absl::StripAsciiWhitespace(text);
  const absl::string_view mark = "\xEF\xBB\xBF";
  const bool has_mark = body.substr(0, mark.size()) == mark;
  if (body.substr(has_mark ? mark.size() : 0).substr(0, 1) != "{") return text;
  const json document = json::parse(body.begin(), body.end(), nullptr, false);
  if (document.is_discarded()) return wrong("it begins like JSON but is none");
  Polygons polygons;
  const json* scenario = find(document, "scenario");
  const json* topography = find(scenario != nullptr ? *scenario : document, "topography");
  if (topography != nullptr) {
    if (absl::Status s = add_vadere(*topography, polygons); !s.ok()) return s;
  } else if (find(document, "type") != nullptr) {
    if (absl::Status s = check_crs(document); !s.ok()) return s;
    if (absl::Status s = add_geojson(document, false, 0, polygons); !s.ok()) return s;
    if (!polygons.has_walkable()) {
      return wrong("GeoJSON: no polygon is walkable; add the outline of the site");
    }
  } else {
    return wrong("JSON that is neither GeoJSON (type) nor a Vadere scenario (topography)");
  }
  return polygons.wkt();
}

}  // namespace throng::render
