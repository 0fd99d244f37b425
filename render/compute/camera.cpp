#include "throng/render/camera.hpp"

#include <algorithm>
#include <cmath>

namespace throng::render {
namespace {

struct Axes {
  glm::dvec3 right, up, forward;
};

Axes view_axes(const Camera& camera) {
  glm::dvec3 forward = camera.target_world - camera.eye_world;
  const double distance = glm::length(forward);
  forward = distance > 0.0 ? forward / distance : glm::dvec3(0.0, 1.0, 0.0);
  glm::dvec3 up = camera.up_world;
  const double up_length = glm::length(up);
  up = up_length > 0.0 ? up / up_length : glm::dvec3(0.0, 0.0, 1.0);
  glm::dvec3 right = glm::cross(forward, up);
  if (glm::length(right) < 1e-9) {
    // straight along up: north is up on the screen, or east where north is where we look
    right = glm::cross(forward, glm::dvec3(0.0, 1.0, 0.0));
    if (glm::length(right) < 1e-9) right = glm::cross(forward, glm::dvec3(1.0, 0.0, 0.0));
  }
  right = glm::normalize(right);
  return {right, glm::cross(right, forward), forward};
}

}  // namespace

glm::mat4 view_from_relative(const Camera& camera) {
  const Axes axes = view_axes(camera);
  glm::mat4 view(1.0F);
  for (int c = 0; c < 3; ++c) {
    view[c][0] = static_cast<float>(axes.right[c]);
    view[c][1] = static_cast<float>(axes.up[c]);
    view[c][2] = static_cast<float>(-axes.forward[c]);
  }
  return view;
}

glm::mat4 clip_from_relative(const Camera& camera, const Viewport& viewport) {
  const double aspect = static_cast<double>(viewport.width_px) / std::max(1U, viewport.height_px);
  const Axes axes = view_axes(camera);
  // rows of clip_from_view in terms of view x, y, z (forward is -z)
  glm::dmat4 clip_from_view(0.0);
  if (camera.ortho_height_m > 0.0) {
    const double half_height_m = 0.5 * camera.ortho_height_m;
    const double depth_m = camera.far_m - camera.near_m;
    clip_from_view[0][0] = 1.0 / (half_height_m * aspect);
    clip_from_view[1][1] = 1.0 / half_height_m;
    clip_from_view[2][2] = 1.0 / depth_m;  // z = (far - distance) / depth: 1 at near, 0 at far
    clip_from_view[3][2] = camera.far_m / depth_m;
    clip_from_view[3][3] = 1.0;
  } else {
    const double focal = 1.0 / std::tan(0.5 * camera.fov_y_rad);
    clip_from_view[0][0] = focal / aspect;
    clip_from_view[1][1] = focal;
    clip_from_view[2][3] = -1.0;  // w = distance
    clip_from_view[3][2] = camera.near_m;
  }
  glm::dmat4 view(1.0);
  for (int c = 0; c < 3; ++c) {
    view[c][0] = axes.right[c];
    view[c][1] = axes.up[c];
    view[c][2] = -axes.forward[c];
  }
  return glm::mat4(clip_from_view * view);
}

Camera overview_camera(const glm::dvec3& low_world, const glm::dvec3& high_world,
                       const Viewport& viewport, double pitch_rad) {
  Camera camera;
  const glm::dvec3 low = glm::min(low_world, high_world);
  const glm::dvec3 high = glm::max(low_world, high_world);
  const glm::dvec3 center = 0.5 * (low + high);
  const double aspect = static_cast<double>(viewport.width_px) / std::max(1U, viewport.height_px);
  const double tan_y = std::tan(0.5 * camera.fov_y_rad);
  const glm::dvec3 forward(0.0, std::cos(pitch_rad), -std::sin(pitch_rad));
  const glm::dvec3 right(1.0, 0.0, 0.0);
  const glm::dvec3 up = glm::cross(right, forward);
  // far enough for each of the box's corners to be inside all four sides, with a margin of 6 %
  double distance_m = 1.0;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 p =
        glm::dvec3((corner & 1) != 0 ? high.x : low.x, (corner & 2) != 0 ? high.y : low.y,
                   (corner & 4) != 0 ? high.z : low.z) -
        center;
    const double toward_m = glm::dot(p, forward);
    const double need_y = 1.06 * std::abs(glm::dot(p, up)) / tan_y - toward_m;
    const double need_x = 1.06 * std::abs(glm::dot(p, right)) / (tan_y * aspect) - toward_m;
    distance_m = std::max({distance_m, need_x, need_y, camera.near_m * 2.0 - toward_m});
  }
  distance_m = std::max(distance_m, 3.0);
  camera.target_world = center;
  camera.eye_world = center - forward * distance_m;
  return camera;
}

}  // namespace throng::render
