#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <expat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "support.hpp"
#include "text_source.hpp"
#include "throng/trajectory/trajectory.hpp"

/// SUMO's network: what of it is ground, as polygons.
namespace throng::trajectory {
namespace {

using detail::fault;
using detail::parse_number;
using detail::split_blanks;

constexpr double kLaneWidthM = 3.2;  // SUMO's, where a lane has none
constexpr double kStripeM = 0.5;     // of a crossing, and between two
constexpr double kLongestCrossingM = 1000.0;
constexpr double kLongestMiter = 2.0;  // half widths

struct Point {
  double x, y;
};
Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y}; }
Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
Point operator*(Point a, double s) { return {a.x * s, a.y * s}; }
double length(Point a) { return std::hypot(a.x, a.y); }

struct FreeParser {
  void operator()(XML_Parser parser) const { XML_ParserFree(parser); }
};

class NetReader {
 public:
  explicit NetReader(const std::string& path) : path_(path), parser_(XML_ParserCreate(nullptr)) {}

  absl::StatusOr<std::string> read() {
    if (parser_ == nullptr) return absl::ResourceExhaustedError(absl::StrCat(path_, ": no memory"));
    absl::StatusOr<std::unique_ptr<detail::ByteSource>> bytes = detail::ByteSource::open(path_);
    if (!bytes.ok()) return bytes.status();
    XML_SetUserData(parser_.get(), this);
    XML_SetElementHandler(parser_.get(), &NetReader::on_start, nullptr);
    XML_SetEntityDeclHandler(parser_.get(), &NetReader::on_entity);
    std::array<char, 1 << 16> block;
    for (bool at_end = false; !at_end;) {
      const absl::StatusOr<std::size_t> got = (*bytes)->read(block.data(), block.size());
      if (!got.ok()) return got.status();
      at_end = *got == 0;
      const XML_Status parsed =
          XML_Parse(parser_.get(), block.data(), static_cast<int>(*got), at_end ? 1 : 0);
      if (!status_.ok()) return status_;
      if (parsed == XML_STATUS_ERROR) {
        fail(absl::StrCat("the XML is not well-formed (",
                          XML_ErrorString(XML_GetErrorCode(parser_.get())), ")"));
        return status_;
      }
    }
    std::string text;
    const std::pair<const char*, const std::string*> surfaces[] = {
        {"ROAD", &road_}, {"WALK", &walk_}, {"MARK", &mark_}};
    for (const auto& [name, polygons] : surfaces) {
      if (!polygons->empty()) {
        absl::StrAppend(&text, "\n;", name, " MULTIPOLYGON (", *polygons, ")");
      }
    }
    if (text.empty()) return fault(path_, "the network has no lane or junction with a shape");
    return text;
  }

 private:
  static void XMLCALL on_entity(void* self, const XML_Char*, int, const XML_Char*, int,
                                const XML_Char*, const XML_Char*, const XML_Char*,
                                const XML_Char*) {
    static_cast<NetReader*>(self)->fail("the file declares XML entities, which are not read");
  }
  static void XMLCALL on_start(void* self, const XML_Char* name, const XML_Char** attributes) {
    static_cast<NetReader*>(self)->start(name, attributes);
  }

  static std::string_view attribute(const XML_Char** attributes, const char* name) {
    for (; attributes[0] != nullptr; attributes += 2) {
      if (std::strcmp(attributes[0], name) == 0) return attributes[1];
    }
    return {};
  }

  void fail(std::string_view message) {
    if (!status_.ok()) return;
    status_ = fault(path_, XML_GetCurrentLineNumber(parser_.get()), message);
    XML_StopParser(parser_.get(), XML_FALSE);
  }

  void start(std::string_view name, const XML_Char** attributes) {
    if (!status_.ok()) return;
    if (is_first_) {
      is_first_ = false;
      if (name != "net") {
        return fail(absl::StrCat("the root element is ", detail::quoted(name),
                                 ", must be 'net': SUMO's network (.net.xml)"));
      }
    }
    if (name == "edge") {
      function_ = attribute(attributes, "function");
    } else if (name == "junction" && attribute(attributes, "type") != "internal") {
      add(road_, points_of(attribute(attributes, "shape")));
    } else if (name == "lane") {
      add_lane(attributes);
    }
  }

  void add_lane(const XML_Char** attributes) {
    if (function_ == "internal" || function_ == "connector") return;  // junctions cover them
    const std::vector<Point> shape = points_of(attribute(attributes, "shape"));
    double width_m = kLaneWidthM;
    const std::string_view width = attribute(attributes, "width");
    if (!width.empty() && !(parse_number(width, width_m) && width_m > 0.0 && width_m < 1e3)) {
      return fail(absl::StrCat("a lane's width is ", detail::quoted(width), ", must be metres"));
    }
    const std::string_view allow = attribute(attributes, "allow");
    if (function_ == "walkingarea") return add(walk_, shape);
    if (function_ == "crossing") return add_stripes(shape, width_m);
    if (allow.substr(0, 4) == "rail" || allow.substr(0, 4) == "ship" || allow == "subway") return;
    add(allow == "pedestrian" ? walk_ : road_, strip(shape, width_m));
  }

  /// "x,y x,y" or "x,y,z ..."; empty where there is none.
  std::vector<Point> points_of(std::string_view shape) {
    std::vector<std::string_view> words;
    split_blanks(shape, words);
    std::vector<Point> points;
    for (const std::string_view word : words) {
      const std::size_t comma = word.find(',');
      Point point{};
      std::string_view y =
          comma == std::string_view::npos ? std::string_view() : word.substr(comma + 1);
      y = y.substr(0, y.find(','));
      if (!parse_number(word.substr(0, comma), point.x) || !parse_number(y, point.y) ||
          !(std::abs(point.x) <= detail::kMaxPositionM &&
            std::abs(point.y) <= detail::kMaxPositionM)) {
        fail(absl::StrCat("a shape has ", detail::quoted(word), ", must be x,y in metres"));
        return {};
      }
      if (points.empty() || length(point - points.back()) > 1e-3) points.push_back(point);
    }
    return points;
  }

  /// A line's outline: `width_m` wide, with mitres where it bends.
  static std::vector<Point> strip(const std::vector<Point>& line, double width_m) {
    if (line.size() < 2) return {};
    std::vector<Point> left, right;
    const auto aside = [](Point a, Point b) {
      const Point along = (b - a) * (1.0 / length(b - a));
      return Point{-along.y, along.x};
    };
    for (std::size_t i = 0; i < line.size(); ++i) {
      const Point before = aside(line[i == 0 ? 0 : i - 1], line[i == 0 ? 1 : i]);
      const Point after = i + 1 < line.size() ? aside(line[i], line[i + 1]) : before;
      const Point sum = before + after;
      // 1 over the cosine of half the bend, along the half-way normal
      const double square = sum.x * sum.x + sum.y * sum.y;
      Point out = square > 1e-6 ? sum * (2.0 / square) : after;
      if (length(out) > kLongestMiter) out = out * (kLongestMiter / length(out));
      left.push_back(line[i] + out * (0.5 * width_m));
      right.push_back(line[i] - out * (0.5 * width_m));
    }
    left.insert(left.end(), right.rbegin(), right.rend());
    return left;
  }

  void add_stripes(const std::vector<Point>& line, double width_m) {
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
      const Point along = line[i + 1] - line[i];
      const double way_m = length(along);
      if (!(way_m <= kLongestCrossingM)) {
        return fail(absl::StrFormat("a crossing is %g m long, at most %g m is read", way_m,
                                    kLongestCrossingM));
      }
      for (double at = 0.5 * kStripeM; at + kStripeM <= way_m; at += 2.0 * kStripeM) {
        add(mark_,
            strip({line[i] + along * (at / way_m), line[i] + along * ((at + kStripeM) / way_m)},
                  width_m));
      }
    }
  }

  static void add(std::string& polygons, const std::vector<Point>& ring) {
    if (ring.size() < 3) return;
    absl::StrAppend(&polygons, polygons.empty() ? "((" : ", ((");
    // to the centimetre, and closed
    for (const Point& point : ring)
      absl::StrAppendFormat(&polygons, "%.2f %.2f,", point.x, point.y);
    absl::StrAppendFormat(&polygons, "%.2f %.2f))", ring[0].x, ring[0].y);
  }

  const std::string& path_;
  const std::unique_ptr<XML_ParserStruct, FreeParser> parser_;
  absl::Status status_;
  bool is_first_ = true;
  std::string function_, road_, walk_, mark_;
};

}  // namespace

absl::StatusOr<std::string> read_sumo_net(const std::string& path) {
  return NetReader(path).read();
}

}  // namespace throng::trajectory
