#pragma once

#include <cstdint>
#include <glm/glm.hpp>

namespace throng::render {

/// A view of the world. World frame: right-handed, +Z up, metres, float64.
///
/// Everything behind this struct works relative to `eye_world` (subtracted in float64), so a crowd
/// may stand millions of metres from the origin.
struct Camera {
  glm::dvec3 eye_world{0.0, -10.0, 5.0};
  glm::dvec3 target_world{0.0, 0.0, 1.0};
  glm::dvec3 up_world{0.0, 0.0, 1.0};
  double fov_y_rad = 0.785398163397448;  // full vertical angle of the perspective camera
  double ortho_height_m = 0.0;           // > 0: orthographic, this many metres from top to bottom
  double near_m = 0.1;
  double far_m = 20000.0;  // orthographic only; perspective has no far plane
};

struct Viewport {
  std::uint32_t width_px = 1280;
  std::uint32_t height_px = 720;
};

/// Rotation (no translation) from world axes to view axes: +X right, +Y up, -Z forward.
/// Looking straight along `up_world` is allowed: north (+Y) is then up on the screen.
glm::mat4 view_from_relative(const Camera& camera);

/// Clip space of every backend: reversed depth (near plane = w, far or infinity = 0), z in [0, w].
/// Multiplies positions relative to the eye ("relative": position_world - eye_world).
glm::mat4 clip_from_relative(const Camera& camera, const Viewport& viewport);

/// A camera that shows the box [low, high] (world, metres) from the south and above; `pitch_rad` is
/// the angle below the horizon.
Camera overview_camera(const glm::dvec3& low_world, const glm::dvec3& high_world,
                       const Viewport& viewport, double pitch_rad = 0.6);

}  // namespace throng::render
