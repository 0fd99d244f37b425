#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace throng::client {

/// A view of the world: right-handed, +Z up, metres.
struct ScriptedCamera {
  glm::dvec3 eye_world{0.0, -10.0, 5.0};
  glm::dvec3 target_world{0.0, 0.0, 1.0};
  glm::dvec3 up_world{0.0, 0.0, 1.0};
  double fov_y_deg = 45.0;      // full vertical angle
  double ortho_height_m = 0.0;  // > 0: orthographic, metres from top to bottom
  double near_m = 0.1;
  double far_m = 20000.0;  // orthographic only
};

/// What there is to see: the box that the crowd walks in, and width by height of the picture.
struct ScriptedSite {
  glm::dvec3 low_world{0.0}, high_world{0.0};
  double aspect = 16.0 / 9.0;
};

/// What --camera says, spelled alike in all programs.
class CameraScript {
 public:
  struct Overview {};
  struct Top {};
  struct Key {
    double time_s = 0.0;
    ScriptedCamera camera;
  };
  using Keys = std::vector<Key>;
  struct Orbit {
    std::optional<glm::dvec3> center_world;  // what is left out comes from the site
    std::optional<double> radius_m, height_m;
    double period_s = 30.0, start_deg = -90.0, fov_y_deg = 45.0;
  };
  struct Follow {
    std::uint64_t agent = 0;
    double behind_m = 5.0, height_m = 2.6, fov_y_deg = 45.0;
  };

  static constexpr std::string_view kSpellings =
      "overview, top, orbit, follow:AGENT, x,y,z:x,y,z (eye and target) or a JSON file";
  /// What a JSON file holds, for --help.
  static constexpr std::string_view kFileHelp =
      R"(A camera file holds one of these, in metres and seconds:
  {"eye": [x, y, z], "target": [x, y, z], "up": [0, 0, 1], "fov_y_deg": 45}
  {"eye": [x, y, z], "target": [x, y, z], "ortho_height_m": 30}
  {"keys": [{"time_s": 0, "eye": [...], "target": [...]}, {"time_s": 5, ...}]}
  {"orbit": {"center": [x, y, z], "radius_m": 20, "height_m": 8, "period_s": 30, "start_deg": 0}}
  {"follow": {"agent": 17, "behind_m": 5, "height_m": 2.6}, "fov_y_deg": 45})";

  /// Between keys eye and target follow a Catmull-Rom spline in time; before the first and after
  /// the last key the camera stands. An orbit turns counter-clockwise.
  /// NotFound; InvalidArgument with file, key, value and limit.
  static absl::StatusOr<CameraScript> parse(const std::string& text);

  /// "overview", "top", "orbit", "follow-AGENT", "camera" or the file's name without its ending;
  /// see number_cameras.
  const std::string& name() const { return name_; }
  bool is_overview() const { return std::holds_alternative<Overview>(path_); }
  const Follow* follow() const { return std::get_if<Follow>(&path_); }
  /// `at` depends on the time, or on the site.
  bool moves() const;
  bool needs_site() const;
  /// Neither of an overview nor of one that follows: who draws knows where those look.
  ScriptedCamera at(double time_s, const ScriptedSite& site) const;

 private:
  friend void number_cameras(std::span<CameraScript> cameras);
  absl::Status read(const std::string& file);

  std::string name_;
  std::variant<Overview, Top, Keys, Orbit, Follow> path_;
};

/// Where several are called "camera" (eye and target), they become "camera-1", "camera-2" ...
void number_cameras(std::span<CameraScript> cameras);

/// "LOW:HIGH", two numbers that differ, as --channel-range has them. InvalidArgument.
absl::StatusOr<std::pair<double, double>> parse_range(const std::string& text);

}  // namespace throng::client
