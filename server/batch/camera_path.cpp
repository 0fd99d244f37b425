#include "server/batch/camera_path.hpp"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/gtc/constants.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "render/compute/element/angle.hpp"
#include "throng/trajectory/trajectory.hpp"

namespace throng::server {
namespace {

using nlohmann::json;

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
        read_number(object, "fov_y_deg", where, kLeastFovDeg, kMostFovDeg, fov_y_deg),
        read_number(object, "ortho_height_m", where, 1e-3, 1e6, camera.ortho_height_m),
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

render::Camera top_camera(const Site& site) {
  const glm::dvec3 size_m = site.high_world - site.low_world;
  const double aspect = static_cast<double>(site.viewport.width_px) / site.viewport.height_px;
  render::Camera camera;
  camera.target_world = 0.5 * (site.low_world + site.high_world);
  camera.eye_world = camera.target_world + glm::dvec3(0.0, 0.0, 0.5 * size_m.z + 50.0);
  camera.ortho_height_m = 1.1 * std::max({size_m.y, size_m.x / aspect, 4.0});
  camera.far_m = size_m.z + 200.0;
  return camera;
}

/// As trajectory files give it: a number, or the hash of a name.
std::uint64_t agent_id(const std::string& text) {
  std::uint64_t id = 0;
  return absl::SimpleAtoi(text, &id) ? id : trajectory::hash_id(text);
}

struct AgentState {
  glm::dvec3 position_world;
  double heading_rad;
};

/// Where an agent is, between the snapshots around a time; none when it is in neither.
std::optional<AgentState> agent_at(const render::Crowd& crowd, std::uint64_t agent, double time_s) {
  const auto time_us = std::llround(time_s * 1e6);
  const render::Bracket bracket = crowd.bracket(time_us);
  const auto state_in = [&](const render::Snapshot* snapshot) -> std::optional<AgentState> {
    if (snapshot == nullptr || snapshot->roster == nullptr)
      return std::nullopt;  // nobody ever came
    const std::vector<std::uint64_t>& ids = snapshot->roster->id;
    for (std::size_t slot = 0; slot < snapshot->present.size(); ++slot) {
      if (ids[slot] != agent || snapshot->present[slot] == 0) continue;
      const double heading_rad = snapshot->heading_rad[slot];
      return AgentState{glm::dvec3(snapshot->position_m[slot]) + crowd.settings().origin_world,
                        std::isnan(heading_rad) ? 0.0 : heading_rad};
    }
    return std::nullopt;
  };
  const auto older = state_in(bracket.older.get());
  if (!older.has_value() || bracket.newer == bracket.older) return older;
  const auto newer = state_in(bracket.newer.get());
  if (!newer.has_value()) return older;
  const double span_us = static_cast<double>(bracket.newer->time_us - bracket.older->time_us);
  const double t =
      std::clamp(static_cast<double>(time_us - bracket.older->time_us) / span_us, 0.0, 1.0);
  return AgentState{
      glm::mix(older->position_world, newer->position_world, t),
      render::element::lerp_angle(static_cast<float>(older->heading_rad),
                                  static_cast<float>(newer->heading_rad), static_cast<float>(t))};
}

/// Catmull-Rom through b (u = 0) and c (u = 1) with tangents scaled to uneven key times.
template <typename T>
T spline(const T& b, const T& c, const T& tangent_b, const T& tangent_c, double u) {
  const double u2 = u * u, u3 = u2 * u;
  return b * (2 * u3 - 3 * u2 + 1) + tangent_b * (u3 - 2 * u2 + u) + c * (-2 * u3 + 3 * u2) +
         tangent_c * (u3 - u2);
}

}  // namespace

absl::StatusOr<CameraPath> CameraPath::parse(const std::string& text, const Site& site) {
  constexpr std::string_view kFollow = "follow:";
  CameraPath path;
  path.name_ = text;
  if (text == "overview") {
    path.path_ =
        Keys{{0.0, render::overview_camera(site.low_world, site.high_world, site.viewport)}};
  } else if (text == "top") {
    path.path_ = Keys{{0.0, top_camera(site)}};
  } else if (text == "orbit") {
    path.path_ = orbit_of(site);
  } else if (text.starts_with(kFollow)) {
    Follow follow = follow_of(site);
    const std::string agent = text.substr(kFollow.size());
    if (agent.empty()) {
      return absl::InvalidArgumentError("--camera: 'follow:' lacks the number or name of an agent");
    }
    follow.agent = agent_id(agent);
    path.name_ = absl::StrCat("follow-", agent);
    path.path_ = follow;
  } else {
    auto read = CameraPath::read(text, site);
    if (!read.ok()) return read.status();
    path.name_ = std::filesystem::path(text).stem().string();
    path.path_ = *std::move(read);
  }
  return path;
}

absl::StatusOr<std::variant<CameraPath::Keys, CameraPath::Orbit, CameraPath::Follow>>
CameraPath::read(const std::string& file, const Site& site) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return absl::NotFoundError(absl::StrCat(file, ": can't be opened"));
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
    Orbit orbit = orbit_of(site);
    if (!object->is_object()) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": must be an object"));
    }
    for (const absl::Status& status :
         {read_vector(*object, "center", where, false, orbit.center_world),
          read_number(*object, "radius_m", where, 0.0, 1e6, orbit.radius_m),
          read_number(*object, "height_m", where, -1e6, 1e6, orbit.height_m),
          read_number(*object, "period_s", where, 0.0, 1e9, orbit.period_s),
          read_number(*object, "start_deg", where, -1e4, 1e4, orbit.start_deg),
          read_number(document, "fov_y_deg", file, kLeastFovDeg, kMostFovDeg, orbit.fov_y_deg)}) {
      if (!status.ok()) return status;
    }
    return orbit;
  }
  if (const json* object = part("follow")) {
    const std::string where = file + ": follow";
    Follow follow = follow_of(site);
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
    return follow;
  }
  if (part("keys") == nullptr) {
    Key key;
    if (absl::Status status = read_camera(document, file, key.camera); !status.ok()) return status;
    return Keys{key};
  }
  Keys path;
  const json& keys = document["keys"];
  if (!keys.is_array() || keys.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": 'keys' must be a list of at least one"));
  }
  for (const json& object : keys) {
    const std::string where = absl::StrCat(file, ": keys[", path.size(), "]");
    Key key{0.0, path.empty() ? render::Camera{} : path.back().camera};
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
  return path;
}

CameraPath::Orbit CameraPath::orbit_of(const Site& site) {
  const glm::dvec3 size_m = site.high_world - site.low_world;
  Orbit orbit;
  orbit.center_world = 0.5 * (site.low_world + site.high_world);
  orbit.radius_m = std::max(6.0, 0.75 * std::hypot(size_m.x, size_m.y));
  orbit.height_m = 0.45 * orbit.radius_m;
  return orbit;
}

CameraPath::Follow CameraPath::follow_of(const Site& site) {
  Follow follow;
  follow.overview = render::overview_camera(site.low_world, site.high_world, site.viewport);
  return follow;
}

render::Camera CameraPath::at(double time_s, const render::Crowd& crowd) const {
  if (const auto* orbit = std::get_if<Orbit>(&path_)) return at(*orbit, time_s);
  if (const auto* follow = std::get_if<Follow>(&path_)) return at(*follow, time_s, crowd);
  return at(std::get<Keys>(path_), time_s);
}

render::Camera CameraPath::at(const Orbit& orbit, double time_s) {
  const double angle_rad =
      glm::radians(orbit.start_deg) + 2.0 * glm::pi<double>() * time_s / orbit.period_s;
  render::Camera camera;
  camera.target_world = orbit.center_world;
  camera.eye_world =
      orbit.center_world + glm::dvec3(orbit.radius_m * std::cos(angle_rad),
                                      orbit.radius_m * std::sin(angle_rad), orbit.height_m);
  camera.fov_y_rad = glm::radians(orbit.fov_y_deg);
  return camera;
}

render::Camera CameraPath::at(const Follow& follow, double time_s, const render::Crowd& crowd) {
  const auto now = agent_at(crowd, follow.agent, time_s);
  if (!now.has_value()) return follow.overview;
  // Where the agent came from, over a time in which steps and swerves even out; who stands is seen
  // from behind its heading.
  constexpr double kWayS = 1.5, kStandsM = 0.3;
  glm::dvec2 way_m(0.0);
  int samples = 0;
  for (double ago_s = 0.25; ago_s <= kWayS; ago_s += 0.25) {
    const auto before = agent_at(crowd, follow.agent, time_s - ago_s);
    if (!before.has_value()) break;
    way_m += glm::dvec2(now->position_world - before->position_world) / ago_s;
    ++samples;
  }
  if (samples > 0) way_m *= kWayS / samples;
  const glm::dvec2 heading(std::cos(now->heading_rad), std::sin(now->heading_rad));
  const double walks = std::min(1.0, glm::length(way_m) / kStandsM);
  glm::dvec2 ahead = glm::mix(heading, way_m / std::max(glm::length(way_m), 1e-9), walks);
  ahead = glm::length(ahead) > 1e-3 ? glm::normalize(ahead) : heading;
  render::Camera camera;
  camera.target_world = now->position_world + glm::dvec3(0.0, 0.0, 1.2);
  camera.eye_world = now->position_world + glm::dvec3(-follow.behind_m * ahead, follow.height_m);
  camera.fov_y_rad = glm::radians(follow.fov_y_deg);
  return camera;
}

render::Camera CameraPath::at(const Keys& keys, double time_s) {
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
  render::Camera camera = b.camera;
  camera.eye_world = along(&render::Camera::eye_world);
  camera.target_world = along(&render::Camera::target_world);
  camera.up_world = glm::mix(b.camera.up_world, c.camera.up_world, u);
  camera.fov_y_rad = glm::mix(b.camera.fov_y_rad, c.camera.fov_y_rad, u);
  camera.ortho_height_m = glm::mix(b.camera.ortho_height_m, c.camera.ortho_height_m, u);
  return camera;
}

}  // namespace throng::server
