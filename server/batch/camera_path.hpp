#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "throng/render/camera.hpp"
#include "throng/render/crowd.hpp"

namespace throng::server {

/// What there is to see: the box that the crowd walks in (world, metres) and the picture's shape.
struct Site {
  glm::dvec3 low_world{0.0}, high_world{0.0};
  render::Viewport viewport;
};

/// A camera over scene time: one that stands still, key frames, an orbit, or one that follows an
/// agent. It depends on the scene time and the crowd alone, so every shard sees the same.
class CameraPath {
 public:
  /// "overview", "top" (orthographic, straight down), "orbit", "follow:AGENT", or a JSON file:
  ///
  ///     {"eye": [x, y, z], "target": [x, y, z], "up": [0, 0, 1], "fov_y_deg": 45}
  ///     {"eye": ..., "target": ..., "ortho_height_m": 30}
  ///     {"keys": [{"time_s": 0, "eye": ..., "target": ...}, {"time_s": 5, ...}]}
  ///     {"orbit": {"center": [x, y, z], "radius_m": 20, "height_m": 8, "period_s": 30,
  ///                "start_deg": 0}, "fov_y_deg": 45}
  ///     {"follow": {"agent": 17, "behind_m": 5, "height_m": 2.6}, "fov_y_deg": 45}
  ///
  /// World frame, metres. Between keys eye and target follow a Catmull-Rom spline in time; before
  /// the first and after the last key the camera stands. An orbit turns counter-clockwise; what it
  /// leaves out comes from the site. Who follows an agent that is not there sees the overview.
  /// NotFound; InvalidArgument with file, key, value and limit.
  static absl::StatusOr<CameraPath> parse(const std::string& text, const Site& site);

  /// "overview", "top", "orbit", "follow-AGENT" or the file's name without its ending.
  const std::string& name() const { return name_; }

  /// The agent that it follows.
  std::optional<std::uint64_t> followed() const {
    const Follow* follow = std::get_if<Follow>(&path_);
    return follow == nullptr ? std::nullopt : std::optional(follow->agent);
  }

  render::Camera at(double time_s, const render::Crowd& crowd) const;

 private:
  struct Key {
    double time_s = 0.0;
    render::Camera camera;
  };
  using Keys = std::vector<Key>;
  struct Orbit {
    glm::dvec3 center_world{0.0};
    double radius_m = 20.0, height_m = 8.0, period_s = 30.0, start_deg = -90.0;
    double fov_y_deg = 45.0;
  };
  struct Follow {
    std::uint64_t agent = 0;
    double behind_m = 5.0, height_m = 2.6, fov_y_deg = 45.0;
    render::Camera overview;
  };

  CameraPath() = default;
  static absl::StatusOr<std::variant<Keys, Orbit, Follow>> read(const std::string& file,
                                                                const Site& site);
  static render::Camera at(const Keys& keys, double time_s);
  static render::Camera at(const Orbit& orbit, double time_s);
  static render::Camera at(const Follow& follow, double time_s, const render::Crowd& crowd);
  static Orbit orbit_of(const Site& site);
  static Follow follow_of(const Site& site);

  std::string name_;
  std::variant<Keys, Orbit, Follow> path_;
};

}  // namespace throng::server
