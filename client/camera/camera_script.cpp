#include "client/camera/camera_script.hpp"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/gtc/constants.hpp>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "throng/trajectory/trajectory.hpp"

namespace throng::client {
namespace {

using nlohmann::json;
using Keys = CameraScript::Keys;
using Key = CameraScript::Key;

constexpr double kFarthestM = 1e8;
constexpr double kLeastFovDeg = 0.01, kMostFovDeg = 170.0;
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

absl::Status read_camera(const json& object, const std::string& where, ScriptedCamera& camera) {
  if (!object.is_object()) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": must be an object with eye and target"));
  }
  for (const absl::Status& status :
       {read_vector(object, "eye", where, true, camera.eye_world),
        read_vector(object, "target", where, true, camera.target_world),
        read_vector(object, "up", where, false, camera.up_world),
        read_number(object, "fov_y_deg", where, kLeastFovDeg, kMostFovDeg, camera.fov_y_deg),
        read_number(object, "ortho_height_m", where, 1e-3, 1e6, camera.ortho_height_m),
        read_number(object, "near_m", where, 0.0, 1e6, camera.near_m)}) {
    if (!status.ok()) return status;
  }
  if (glm::length(camera.target_world - camera.eye_world) < 1e-6) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": 'eye' and 'target' are the same point"));
  }
  if (glm::length(camera.up_world) < 1e-6) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": 'up' has no length"));
  }
  return absl::OkStatus();
}

/// As trajectory files give it: a number, or the hash of a name.
std::uint64_t agent_id(const std::string& text) {
  std::uint64_t id = 0;
  return absl::SimpleAtoi(text, &id) ? id : trajectory::hash_id(text);
}

/// "x,y,z:x,y,z"; none: it is something else.
std::optional<ScriptedCamera> eye_and_target(const std::string& text) {
  const std::vector<std::string> numbers = absl::StrSplit(text, absl::ByAnyChar(",:"));
  const std::size_t colon = text.find(':');
  if (numbers.size() != 6 || std::count(text.begin(), text.begin() + colon, ',') != 2) {
    return std::nullopt;
  }
  ScriptedCamera camera;
  for (int i = 0; i < 6; ++i) {
    double& value = i < 3 ? camera.eye_world[i] : camera.target_world[i - 3];
    const std::string& number = numbers[static_cast<std::size_t>(i)];
    if (!absl::SimpleAtod(number, &value) || !(std::abs(value) <= kFarthestM)) return std::nullopt;
  }
  return camera;
}

/// Catmull-Rom through b (u = 0) and c (u = 1) with tangents scaled to uneven key times.
template <typename T>
T spline(const T& b, const T& c, const T& tangent_b, const T& tangent_c, double u) {
  const double u2 = u * u, u3 = u2 * u;
  return b * (2 * u3 - 3 * u2 + 1) + tangent_b * (u3 - 2 * u2 + u) + c * (-2 * u3 + 3 * u2) +
         tangent_c * (u3 - u2);
}

ScriptedCamera at(const Keys& keys, double time_s) {
  if (time_s <= keys.front().time_s) return keys.front().camera;
  if (time_s >= keys.back().time_s) return keys.back().camera;
  std::size_t i = 0;
  while (keys[i + 1].time_s < time_s) ++i;
  const Key& b = keys[i];
  const Key& c = keys[i + 1];
  const Key& a = keys[i == 0 ? 0 : i - 1];
  const Key& d = keys[std::min(i + 2, keys.size() - 1)];
  const double span_s = c.time_s - b.time_s;
  const double u = (time_s - b.time_s) / span_s;
  const auto along = [&](auto member) {
    const auto tangent = [&](const Key& from, const Key& to) {
      return (to.camera.*member - from.camera.*member) * (span_s / (to.time_s - from.time_s));
    };
    return spline(b.camera.*member, c.camera.*member, tangent(a.time_s < c.time_s ? a : b, c),
                  tangent(b, d), u);
  };
  ScriptedCamera camera = b.camera;
  camera.eye_world = along(&ScriptedCamera::eye_world);
  camera.target_world = along(&ScriptedCamera::target_world);
  camera.up_world = glm::mix(b.camera.up_world, c.camera.up_world, u);
  camera.fov_y_deg = glm::mix(b.camera.fov_y_deg, c.camera.fov_y_deg, u);
  camera.ortho_height_m = glm::mix(b.camera.ortho_height_m, c.camera.ortho_height_m, u);
  return camera;
}

ScriptedCamera at(const CameraScript::Orbit& orbit, double time_s, const ScriptedSite& site) {
  const glm::dvec3 size_m = site.high_world - site.low_world;
  const glm::dvec3 center_world =
      orbit.center_world.value_or(0.5 * (site.low_world + site.high_world));
  const double around_m = std::max(6.0, 0.75 * std::hypot(size_m.x, size_m.y));
  const double radius_m = orbit.radius_m.value_or(around_m);
  const double angle_rad =
      glm::radians(orbit.start_deg) + 2.0 * glm::pi<double>() * time_s / orbit.period_s;
  ScriptedCamera camera;
  camera.target_world = center_world;
  camera.eye_world =
      center_world + glm::dvec3(radius_m * std::cos(angle_rad), radius_m * std::sin(angle_rad),
                                orbit.height_m.value_or(0.45 * around_m));
  camera.fov_y_deg = orbit.fov_y_deg;
  return camera;
}

ScriptedCamera top(const ScriptedSite& site) {
  const glm::dvec3 size_m = site.high_world - site.low_world;
  ScriptedCamera camera;
  camera.target_world = 0.5 * (site.low_world + site.high_world);
  camera.eye_world = camera.target_world + glm::dvec3(0.0, 0.0, 0.5 * size_m.z + 50.0);
  camera.ortho_height_m = 1.1 * std::max({size_m.y, size_m.x / site.aspect, 4.0});
  camera.far_m = size_m.z + 200.0;
  return camera;
}

}  // namespace

absl::StatusOr<CameraScript> CameraScript::parse(const std::string& text) {
  constexpr std::string_view kFollow = "follow:";
  CameraScript script;
  script.name_ = text;
  if (text == "overview") {
    script.path_ = Overview();
  } else if (text == "top") {
    script.path_ = Top();
  } else if (text == "orbit") {
    script.path_ = Orbit();
  } else if (text.starts_with(kFollow)) {
    const std::string agent = text.substr(kFollow.size());
    if (agent.empty()) {
      return absl::InvalidArgumentError("--camera: 'follow:' lacks the number or name of an agent");
    }
    Follow follow;
    follow.agent = agent_id(agent);
    script.name_ = absl::StrCat("follow-", agent);
    script.path_ = follow;
  } else if (text.find(':') != std::string::npos && eye_and_target(text).has_value()) {
    const ScriptedCamera camera = *eye_and_target(text);
    if (glm::length(camera.target_world - camera.eye_world) < 1e-6) {
      return absl::InvalidArgumentError(
          absl::StrCat("--camera: '", text, "': eye and target are the same point"));
    }
    script.name_ = "camera";
    script.path_ = Keys{{0.0, camera}};
  } else {
    if (absl::Status status = script.read(text); !status.ok()) return status;
    script.name_ = std::filesystem::path(text).stem().string();
  }
  return script;
}

void number_cameras(std::span<CameraScript> cameras) {
  const auto is_plain = [](const CameraScript& camera) { return camera.name_ == "camera"; };
  if (std::count_if(cameras.begin(), cameras.end(), is_plain) < 2) return;
  int number = 0;
  for (CameraScript& camera : cameras) {
    if (is_plain(camera)) camera.name_ = absl::StrCat("camera-", ++number);
  }
}

absl::Status CameraScript::read(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream)
    return absl::NotFoundError(
        absl::StrCat("--camera: '", file, "' can't be opened; it is none of ",
                     absl::string_view(kSpellings.data(), kSpellings.size())));
  std::stringstream text;
  text << stream.rdbuf();
  const json document = json::parse(text.str(), nullptr, /*allow_exceptions=*/false);
  if (document.is_discarded()) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": is not JSON"));
  }
  const auto part = [&](const char* key) {
    return document.is_object() && document.contains(key) ? &document[key] : nullptr;
  };
  if (const json* object = part("orbit")) {
    const std::string where = file + ": orbit";
    Orbit orbit;
    glm::dvec3 center_world(0.0);
    double radius_m = 0.0, height_m = 0.0;
    if (!object->is_object()) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": must be an object"));
    }
    for (const absl::Status& status :
         {read_vector(*object, "center", where, false, center_world),
          read_number(*object, "radius_m", where, 0.0, 1e6, radius_m),
          read_number(*object, "height_m", where, -1e6, 1e6, height_m),
          read_number(*object, "period_s", where, 0.0, 1e9, orbit.period_s),
          read_number(*object, "start_deg", where, -1e4, 1e4, orbit.start_deg),
          read_number(document, "fov_y_deg", file, kLeastFovDeg, kMostFovDeg, orbit.fov_y_deg)}) {
      if (!status.ok()) return status;
    }
    if (object->contains("radius_m")) orbit.radius_m = radius_m;
    if (object->contains("height_m")) orbit.height_m = height_m;
    if (object->contains("center")) orbit.center_world = center_world;
    path_ = orbit;
    return absl::OkStatus();
  }
  if (const json* object = part("follow")) {
    const std::string where = file + ": follow";
    Follow follow;
    const json* agent =
        object->is_object() && object->contains("agent") ? &(*object)["agent"] : nullptr;
    if (agent == nullptr || !(agent->is_number_unsigned() || agent->is_string())) {
      return absl::InvalidArgumentError(
          absl::StrCat(where, ": 'agent' is missing or neither the number nor the name of one"));
    }
    follow.agent =
        agent->is_string() ? agent_id(agent->get<std::string>()) : agent->get<std::uint64_t>();
    for (const absl::Status& status :
         {read_number(*object, "behind_m", where, 0.0, 1e4, follow.behind_m),
          read_number(*object, "height_m", where, -1e4, 1e4, follow.height_m),
          read_number(document, "fov_y_deg", file, kLeastFovDeg, kMostFovDeg, follow.fov_y_deg)}) {
      if (!status.ok()) return status;
    }
    path_ = follow;
    return absl::OkStatus();
  }
  if (part("keys") == nullptr) {
    Key key;
    if (absl::Status status = read_camera(document, file, key.camera); !status.ok()) return status;
    path_ = Keys{key};
    return absl::OkStatus();
  }
  Keys path;
  const json& keys = document["keys"];
  if (!keys.is_array() || keys.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": 'keys' must be a list of at least one"));
  }
  for (const json& object : keys) {
    const std::string where = absl::StrCat(file, ": keys[", path.size(), "]");
    Key key{0.0, path.empty() ? ScriptedCamera{} : path.back().camera};
    if (absl::Status status = read_camera(object, where, key.camera); !status.ok()) return status;
    if (!object.contains("time_s") || !object["time_s"].is_number()) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": 'time_s' is missing or no number"));
    }
    key.time_s = object["time_s"].get<double>();
    if (!(std::abs(key.time_s) <= kLatestS)) {
      return absl::InvalidArgumentError(
          absl::StrCat(where, ": 'time_s' is ", key.time_s, ", must be within ", kLatestS, " s"));
    }
    if (!path.empty() && !(key.time_s > path.back().time_s)) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": 'time_s' is ", key.time_s,
                                                     ", must be over the one before, ",
                                                     path.back().time_s));
    }
    if (!path.empty() &&
        (key.camera.ortho_height_m > 0.0) != (path.back().camera.ortho_height_m > 0.0)) {
      return absl::InvalidArgumentError(
          absl::StrCat(where, ": perspective and orthographic keys can't be mixed"));
    }
    path.push_back(key);
  }
  path_ = std::move(path);
  return absl::OkStatus();
}

bool CameraScript::moves() const {
  const auto* keys = std::get_if<Keys>(&path_);
  return std::holds_alternative<Orbit>(path_) || (keys != nullptr && keys->size() > 1);
}

bool CameraScript::needs_site() const {
  return std::holds_alternative<Orbit>(path_) || std::holds_alternative<Top>(path_);
}

ScriptedCamera CameraScript::at(double time_s, const ScriptedSite& site) const {
  if (const auto* orbit = std::get_if<Orbit>(&path_)) {
    return throng::client::at(*orbit, time_s, site);
  }
  if (const auto* keys = std::get_if<Keys>(&path_)) return throng::client::at(*keys, time_s);
  return top(site);
}

absl::StatusOr<std::pair<double, double>> parse_range(const std::string& text) {
  const std::vector<std::string> ends = absl::StrSplit(text, ':');
  double low = 0.0, high = 0.0;
  if (ends.size() == 2 && absl::SimpleAtod(ends[0], &low) && absl::SimpleAtod(ends[1], &high) &&
      std::isfinite(low) && std::isfinite(high) && low != high) {
    return std::pair(low, high);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--channel-range: '", text, "' must be LOW:HIGH with LOW != HIGH"));
}

}  // namespace throng::client
