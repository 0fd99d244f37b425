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
  // As near as all corners are inside all four sides, with a margin of 6 %. A corner at (x, z) from
  // the centre is inside for an eye at (e, -d) where |x - e| <= t (z + d), so d is at least half
  // the sum of what both sides ask for. What is near takes more of the picture than what is far, so
  // e is not the centre: it leaves as much on either side.
  const double tan_side[2] = {tan_y * aspect / 1.06, tan_y / 1.06};
  glm::dvec3 corners[8];  // right, up and forward
  double distance_m = 3.0;
  for (int c = 0; c < 8; ++c) {
    const glm::dvec3 p = glm::dvec3((c & 1) != 0 ? high.x : low.x, (c & 2) != 0 ? high.y : low.y,
                                    (c & 4) != 0 ? high.z : low.z) -
                         center;
    corners[c] = {glm::dot(p, right), glm::dot(p, up), glm::dot(p, forward)};
    distance_m = std::max(distance_m, 2.0 * camera.near_m - corners[c].z);
  }
  for (int axis = 0; axis < 2; ++axis) {
    double beyond = -1e300, before = -1e300;
    for (const glm::dvec3& p : corners) {
      beyond = std::max(beyond, p[axis] - tan_side[axis] * p.z);
      before = std::max(before, -p[axis] - tan_side[axis] * p.z);
    }
    distance_m = std::max(distance_m, 0.5 * (beyond + before) / tan_side[axis]);
  }
  double shift_m[2];
  for (int axis = 0; axis < 2; ++axis) {
    double least = -1e300, most = 1e300;  // of e: where one side has all that is left
    for (const glm::dvec3& p : corners) {
      least = std::max(least, p[axis] - tan_side[axis] * (p.z + distance_m));
      most = std::min(most, p[axis] + tan_side[axis] * (p.z + distance_m));
    }
    for (int i = 0; i < 40; ++i) {
      shift_m[axis] = 0.5 * (least + most);
      double low_side = 0.0, high_side = 0.0;  // of the picture, as far as corners reach
      for (const glm::dvec3& p : corners) {
        const double at = (p[axis] - shift_m[axis]) / (p.z + distance_m);
        low_side = std::min(low_side, at);
        high_side = std::max(high_side, at);
      }
      (high_side + low_side > 0.0 ? least : most) = shift_m[axis];
    }
  }
  camera.eye_world = center + right * shift_m[0] + up * shift_m[1] - forward * distance_m;
  // what one turns around lies as high as the box's middle
  const double along_m = (camera.eye_world.z - center.z) / std::max(std::sin(pitch_rad), 1e-3);
  camera.target_world = camera.eye_world + forward * (along_m > 1.0 ? along_m : distance_m);
  return camera;
}

}  // namespace throng::render
