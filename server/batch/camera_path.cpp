#include "server/batch/camera_path.hpp"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

namespace throng::server {
namespace {

using nlohmann::json;

constexpr double kFarthestM = 1e8;
constexpr double kLatestS = 1e9;  // differences of times stay finite and exact to microseconds

absl::Status read_vector(const json& object, const char* key, const std::string& where, bool wanted,
                         glm::dvec3& vector) {
  const auto found = object.find(key);
  if (found == object.end()) {
    if (!wanted) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(where, ": '", key, "' is missing"));
  }
  if (!found->is_array() || found->size() != 3) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": '", key, "' must be three numbers [x, y, z] in metres"));
  }
  for (int i = 0; i < 3; ++i) {
    const json& number = (*found)[static_cast<std::size_t>(i)];
    if (!number.is_number() || !(std::abs(number.get<double>()) <= kFarthestM)) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": '", key, "'[", i, "] is ",
                                                     number.dump(), ", must be a number within ",
                                                     kFarthestM, " m"));
    }
    vector[i] = number.get<double>();
  }
  return absl::OkStatus();
}

absl::Status read_number(const json& object, const char* key, const std::string& where,
                         double above, double below, double& value) {
  const auto found = object.find(key);
  if (found == object.end()) return absl::OkStatus();
  if (!found->is_number() || !(found->get<double>() > above && found->get<double>() < below)) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": '", key, "' is ", found->dump(),
                                                   ", must be over ", above, " and under ", below));
  }
  value = found->get<double>();
  return absl::OkStatus();
}

absl::Status read_camera(const json& object, const std::string& where, render::Camera& camera) {
  if (!object.is_object()) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": must be an object with eye and target"));
  }
  double fov_y_deg = glm::degrees(camera.fov_y_rad);
  for (const absl::Status& status :
       {read_vector(object, "eye", where, true, camera.eye_world),
        read_vector(object, "target", where, true, camera.target_world),
        read_vector(object, "up", where, false, camera.up_world),
        read_number(object, "fov_y_deg", where, 0.0, 170.0, fov_y_deg),
        read_number(object, "ortho_height_m", where, 0.0, 1e6, camera.ortho_height_m),
        read_number(object, "near_m", where, 0.0, 1e6, camera.near_m)}) {
    if (!status.ok()) return status;
  }
  camera.fov_y_rad = glm::radians(fov_y_deg);
  if (glm::length(camera.target_world - camera.eye_world) < 1e-6) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": 'eye' and 'target' are the same point"));
  }
  if (glm::length(camera.up_world) < 1e-6) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": 'up' has no length"));
  }
  return absl::OkStatus();
}

/// Catmull-Rom through b (u = 0) and c (u = 1) with tangents scaled to uneven key times.
template <typename T>
T spline(const T& b, const T& c, const T& tangent_b, const T& tangent_c, double u) {
  const double u2 = u * u, u3 = u2 * u;
  return b * (2 * u3 - 3 * u2 + 1) + tangent_b * (u3 - 2 * u2 + u) + c * (-2 * u3 + 3 * u2) +
         tangent_c * (u3 - u2);
}

}  // namespace

absl::StatusOr<CameraPath> CameraPath::read(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return absl::NotFoundError(absl::StrCat(file, ": can't be opened"));
  std::stringstream text;
  text << stream.rdbuf();
  const json document = json::parse(text.str(), nullptr, /*allow_exceptions=*/false);
  if (document.is_discarded()) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": is not JSON"));
  }
  CameraPath path;
  if (!document.is_object() || !document.contains("keys")) {
    Key key{0.0, {}};
    if (absl::Status status = read_camera(document, file, key.camera); !status.ok()) return status;
    path.keys_.push_back(key);
    return path;
  }
  const json& keys = document["keys"];
  if (!keys.is_array() || keys.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": 'keys' must be a list of at least one"));
  }
  for (const json& object : keys) {
    const std::string where = absl::StrCat(file, ": keys[", path.keys_.size(), "]");
    Key key{0.0, path.keys_.empty() ? render::Camera{} : path.keys_.back().camera};
    if (absl::Status status = read_camera(object, where, key.camera); !status.ok()) return status;
    if (!object.contains("time_s") || !object["time_s"].is_number()) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": 'time_s' is missing or no number"));
    }
    key.time_s = object["time_s"].get<double>();
    if (!(std::abs(key.time_s) <= kLatestS)) {
      return absl::InvalidArgumentError(
          absl::StrCat(where, ": 'time_s' is ", key.time_s, ", must be within ", kLatestS, " s"));
    }
    if (!path.keys_.empty() && !(key.time_s > path.keys_.back().time_s)) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": 'time_s' is ", key.time_s,
                                                     ", must be over the one before, ",
                                                     path.keys_.back().time_s));
    }
    if (!path.keys_.empty() &&
        (key.camera.ortho_height_m > 0.0) != (path.keys_.back().camera.ortho_height_m > 0.0)) {
      return absl::InvalidArgumentError(
          absl::StrCat(where, ": perspective and orthographic keys can't be mixed"));
    }
    path.keys_.push_back(key);
  }
  return path;
}

render::Camera CameraPath::at(double time_s) const {
  if (time_s <= keys_.front().time_s) return keys_.front().camera;
  if (time_s >= keys_.back().time_s) return keys_.back().camera;
  std::size_t i = 0;
  while (keys_[i + 1].time_s < time_s) ++i;
  const Key& b = keys_[i];
  const Key& c = keys_[i + 1];
  const Key& a = keys_[i == 0 ? 0 : i - 1];
  const Key& d = keys_[std::min(i + 2, keys_.size() - 1)];
  const double span_s = c.time_s - b.time_s;
  const double u = (time_s - b.time_s) / span_s;
  const auto along = [&](auto member) {
    const auto tangent = [&](const Key& from, const Key& to) {
      return (to.camera.*member - from.camera.*member) * (span_s / (to.time_s - from.time_s));
    };
    return spline(b.camera.*member, c.camera.*member, tangent(a.time_s < c.time_s ? a : b, c),
                  tangent(b, d), u);
  };
  render::Camera camera = b.camera;
  camera.eye_world = along(&render::Camera::eye_world);
  camera.target_world = along(&render::Camera::target_world);
  camera.up_world = glm::mix(b.camera.up_world, c.camera.up_world, u);
  camera.fov_y_rad = glm::mix(b.camera.fov_y_rad, c.camera.fov_y_rad, u);
  camera.ortho_height_m = glm::mix(b.camera.ortho_height_m, c.camera.ortho_height_m, u);
  return camera;
}

}  // namespace throng::server
