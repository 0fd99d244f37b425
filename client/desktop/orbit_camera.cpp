#include "client/desktop/orbit_camera.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "throng/v1/common.pb.h"

namespace throng::client {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kLowestPitchRad = 0.02, kHighestPitchRad = kPi / 2;
constexpr double kNearestM = 0.6, kFarthestM = 20000.0, kNearM = 0.1;

double wrap(double angle_rad) { return std::remainder(angle_rad, 2 * kPi); }
double half_tangent(double fov_y_deg) { return std::tan(fov_y_deg * kPi / 360.0); }

glm::dvec3 point_of(const v1::Vec3& message) { return {message.x(), message.y(), message.z()}; }
void write_point(const glm::dvec3& point, v1::Vec3& message) {
  message.set_x(point.x);
  message.set_y(point.y);
  message.set_z(point.z);
}

}  // namespace

glm::dvec3 OrbitCamera::outward() const {
  const double flat = std::cos(pitch_rad);
  return {flat * std::cos(yaw_rad), flat * std::sin(yaw_rad), std::sin(pitch_rad)};
}

glm::dvec3 OrbitCamera::right() const { return {-std::sin(yaw_rad), std::cos(yaw_rad), 0.0}; }
glm::dvec3 OrbitCamera::up() const { return glm::cross(right(), -outward()); }

double OrbitCamera::height_at_target_m() const {
  return 2.0 * distance_m * half_tangent(fov_y_deg);
}

void OrbitCamera::orbit(double dx_rad, double dy_rad) {
  yaw_rad = wrap(yaw_rad - dx_rad);
  pitch_rad = std::clamp(pitch_rad + dy_rad, kLowestPitchRad, kHighestPitchRad);
}

void OrbitCamera::zoom(double factor, const glm::dvec3& fixed_world) {
  const double distance = std::clamp(distance_m * factor, kNearestM, kFarthestM);
  target_world = fixed_world + (target_world - fixed_world) * (distance / distance_m);
  distance_m = distance;
}

double OrbitCamera::zoom_height_m() const {
  return 1.45 * std::clamp((25.0 - distance_m) / 20.0, 0.0, 1.0);
}

double OrbitCamera::follow_height_m() const {
  return 1.0 + (ortho ? 0.0 : 0.45 * std::clamp((4.0 - distance_m) / 3.0, 0.0, 1.0));
}

void OrbitCamera::fit(const glm::dvec3& low_world, const glm::dvec3& high_world, double aspect) {
  const glm::dvec3 center = (low_world + high_world) * 0.5;
  const glm::dvec3 to_right = right(), to_top = up(), forward = -outward();
  const double tangent = half_tangent(fov_y_deg);
  double needed = 1.0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const glm::dvec3 p((corner & 1U) != 0 ? high_world.x : low_world.x,
                       (corner & 2U) != 0 ? high_world.y : low_world.y,
                       (corner & 4U) != 0 ? high_world.z : low_world.z);
    const glm::dvec3 d = p - center;
    const double across =
        std::max(std::abs(glm::dot(d, to_right)) / aspect, std::abs(glm::dot(d, to_top))) / tangent;
    needed = std::max(needed, ortho ? across : across - glm::dot(d, forward));
  }
  target_world = center;
  distance_m = std::min(kFarthestM, needed * 1.08);
}

Ray OrbitCamera::ray(const glm::dvec2& place_px, const glm::dvec2& size_px) const {
  const double u = 2.0 * place_px.x / size_px.x - 1.0, v = 1.0 - 2.0 * place_px.y / size_px.y;
  const double aspect = size_px.x / size_px.y;
  if (ortho) {
    const double half_m = height_at_target_m() / 2.0;
    return {eye_world() + right() * (u * half_m * aspect) + up() * (v * half_m), -outward()};
  }
  const double tangent = half_tangent(fov_y_deg);
  return {eye_world(),
          glm::normalize(-outward() + right() * (u * tangent * aspect) + up() * (v * tangent))};
}

glm::dvec3 OrbitCamera::ground_at(const glm::dvec2& place_px, const glm::dvec2& size_px,
                                  double ground_z_m) const {
  const Ray through = ray(place_px, size_px);
  if (through.direction.z < -1e-3) {
    const double t = (ground_z_m - through.origin_world.z) / through.direction.z;
    if (t > 0.0 && t < 6.0 * distance_m + 50.0) {
      return through.origin_world + through.direction * t;
    }
  }
  return through.origin_world + through.direction * distance_m;
}

void OrbitCamera::write(v1::Camera& message) const {
  write_point(eye_world(), *message.mutable_eye());
  write_point(target_world, *message.mutable_target());
  write_point(up(), *message.mutable_up());
  if (ortho) {
    message.set_ortho_height_m(height_at_target_m());
  } else {
    message.set_fov_y_deg(fov_y_deg);
  }
}

OrbitCamera OrbitCamera::read(const v1::Camera& message) {
  OrbitCamera camera;
  camera.target_world = point_of(message.target());
  const glm::dvec3 outward = point_of(message.eye()) - camera.target_world;
  camera.distance_m = std::max(1e-6, glm::length(outward));
  camera.pitch_rad = std::asin(std::clamp(outward.z / camera.distance_m, -1.0, 1.0));
  if (std::hypot(outward.x, outward.y) > 1e-6 * camera.distance_m) {
    camera.yaw_rad = std::atan2(outward.y, outward.x);
  } else {
    // straight down: what is up on the screen lies ahead
    const glm::dvec3 up = point_of(message.up());
    if (std::hypot(up.x, up.y) > 1e-6) camera.yaw_rad = std::atan2(-up.y, -up.x);
  }
  camera.ortho = message.projection_case() == v1::Camera::kOrthoHeightM;
  if (camera.ortho) {
    camera.distance_m = message.ortho_height_m() / (2.0 * half_tangent(camera.fov_y_deg));
  } else if (message.projection_case() == v1::Camera::kFovYDeg) {
    camera.fov_y_deg = message.fov_y_deg();
  }
  return camera;
}

OrbitCamera between(const OrbitCamera& from, const OrbitCamera& to, double t) {
  const double eased = t * t * (3.0 - 2.0 * t);
  OrbitCamera camera = to;
  camera.target_world = from.target_world + (to.target_world - from.target_world) * eased;
  camera.distance_m = from.distance_m * std::pow(to.distance_m / from.distance_m, eased);
  camera.yaw_rad = wrap(from.yaw_rad + wrap(to.yaw_rad - from.yaw_rad) * eased);
  camera.pitch_rad = from.pitch_rad + (to.pitch_rad - from.pitch_rad) * eased;
  if (t < 1.0) camera.ortho = from.ortho && to.ortho;
  return camera;
}

Projector::Projector(const OrbitCamera& camera, const glm::dvec2& size_px)
    : eye_world_(camera.eye_world()),
      right_(camera.right()),
      up_(camera.up()),
      forward_(-camera.outward()),
      half_px_(size_px * 0.5),
      focal_px_(camera.ortho ? size_px.y / camera.height_at_target_m()
                             : half_px_.y / half_tangent(camera.fov_y_deg)),
      ortho_(camera.ortho) {}

double Projector::depth_m(const glm::dvec3& point_world) const {
  return glm::dot(point_world - eye_world_, forward_);
}

std::optional<Projector::Place> Projector::project(const glm::dvec3& point_world) const {
  const double depth = depth_m(point_world);
  if (!(depth >= kNearM)) return std::nullopt;
  const glm::dvec3 d = point_world - eye_world_;
  const double px_per_m = ortho_ ? focal_px_ : focal_px_ / depth;
  return Place{
      {half_px_.x + glm::dot(d, right_) * px_per_m, half_px_.y - glm::dot(d, up_) * px_per_m},
      px_per_m};
}

std::optional<Projector::Line> Projector::line(glm::dvec3 a_world, glm::dvec3 b_world) const {
  const double a = depth_m(a_world) - kNearM, b = depth_m(b_world) - kNearM;
  if (a < 0.0 && b < 0.0) return std::nullopt;
  if (a < 0.0) a_world = b_world + (a_world - b_world) * (b / (b - a) * 0.999);
  if (b < 0.0) b_world = a_world + (b_world - a_world) * (a / (a - b) * 0.999);
  const auto from = project(a_world), to = project(b_world);
  if (!from || !to) return std::nullopt;
  return Line{from->px, to->px};
}

}  // namespace throng::client
