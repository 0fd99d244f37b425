#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "throng/render/camera.hpp"

namespace throng::server {

/// A camera over scene time: one that stands still, or key frames.
class CameraPath {
 public:
  explicit CameraPath(const render::Camera& camera) : keys_{{0.0, camera}} {}

  /// Reads a JSON file:
  ///
  ///     {"eye": [x, y, z], "target": [x, y, z], "up": [0, 0, 1], "fov_y_deg": 45}
  ///     {"eye": ..., "target": ..., "ortho_height_m": 30}
  ///     {"keys": [{"time_s": 0, "eye": ..., "target": ...}, {"time_s": 5, ...}]}
  ///
  /// World frame, metres. Between keys eye and target follow a Catmull-Rom spline in time; before
  /// the first and after the last key the camera stands. NotFound; InvalidArgument with file, key,
  /// value and limit.
  static absl::StatusOr<CameraPath> read(const std::string& file);

  render::Camera at(double time_s) const;

 private:
  struct Key {
    double time_s;
    render::Camera camera;
  };
  CameraPath() = default;
  std::vector<Key> keys_;
};

}  // namespace throng::server
