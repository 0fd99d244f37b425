#pragma once

#include <glm/glm.hpp>
#include <optional>

namespace throng::v1 {
class Camera;
}

namespace throng::client {

/// A ray of a view; the direction has unit length.
struct Ray {
  glm::dvec3 origin_world, direction;
};

/// A camera on an orbit about a point, as the browser's page has it. World frame, metres. The
/// arithmetic is that of render/compute/camera.cpp, so that what is drawn over a picture lies where
/// the picture has it.
struct OrbitCamera {
  glm::dvec3 target_world{0.0, 0.0, 1.0};
  double distance_m = 20.0;
  double yaw_rad = -1.5707963267948966;  // of the eye as seen from the target, from +X
  double pitch_rad = 0.6;                // of the eye above the target's horizon
  double fov_y_deg = 45.0;
  bool ortho = false;

  /// From the target to the eye, unit length.
  glm::dvec3 outward() const;
  glm::dvec3 eye_world() const { return target_world + outward() * distance_m; }
  glm::dvec3 right() const;
  glm::dvec3 up() const;
  /// Metres from top to bottom at the target.
  double height_at_target_m() const;

  void orbit(double dx_rad, double dy_rad);
  /// Goes nearer to (factor under 1) or away from a point, which stays where it is on the screen.
  void zoom(double factor, const glm::dvec3& fixed_world);
  /// Above the ground, what zooming goes to: faces where people are near, else the ground.
  double zoom_height_m() const;
  /// Above an agent's feet, what a camera looks at that follows it, as the server has it: the
  /// middle, from near the face.
  double follow_height_m() const;
  /// The camera that shows a box from here's direction.
  void fit(const glm::dvec3& low_world, const glm::dvec3& high_world, double aspect);

  /// @param place_px  from the picture's left top.
  Ray ray(const glm::dvec2& place_px, const glm::dvec2& size_px) const;
  /// What of the ground lies under a pixel; where that is the sky or too far, the point at the
  /// target's distance.
  glm::dvec3 ground_at(const glm::dvec2& place_px, const glm::dvec2& size_px,
                       double ground_z_m) const;

  void write(v1::Camera& message) const;
  /// Takes over a camera that a frame was drawn with.
  static OrbitCamera read(const v1::Camera& message);
};

/// On the way from one camera to another; `t` from 0 to 1.
OrbitCamera between(const OrbitCamera& from, const OrbitCamera& to, double t);

/// Turns world points into pixels of a picture.
class Projector {
 public:
  Projector(const OrbitCamera& camera, const glm::dvec2& size_px);

  struct Place {
    glm::dvec2 px;
    double px_per_m;
  };
  /// None: behind the eye.
  std::optional<Place> project(const glm::dvec3& point_world) const;

  struct Line {
    glm::dvec2 from_px, to_px;
  };
  /// A line, cut off where it is behind the eye.
  std::optional<Line> line(glm::dvec3 a_world, glm::dvec3 b_world) const;

 private:
  double depth_m(const glm::dvec3& point_world) const;
  glm::dvec3 eye_world_, right_, up_, forward_;
  glm::dvec2 half_px_;
  double focal_px_;  // of a metre at one metre's distance, or anywhere when orthographic
  bool ortho_;
};

}  // namespace throng::client
