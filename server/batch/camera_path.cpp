#include "server/batch/camera_path.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "render/compute/element/angle.hpp"

namespace throng::server {
namespace {

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

}  // namespace

absl::StatusOr<CameraPath> CameraPath::parse(const std::string& text, const Site& site) {
  absl::StatusOr<client::CameraScript> script = client::CameraScript::parse(text);
  if (!script.ok()) return script.status();
  return CameraPath(*std::move(script), site);
}

render::Camera CameraPath::overview() const {
  return render::overview_camera(site_.low_world, site_.high_world, site_.viewport);
}

render::Camera CameraPath::at(double time_s, const render::Crowd& crowd) const {
  if (script_.is_overview()) return overview();
  if (const auto* follow = script_.follow()) return following(*follow, time_s, crowd);
  const double aspect = static_cast<double>(site_.viewport.width_px) / site_.viewport.height_px;
  const client::ScriptedCamera scripted =
      script_.at(time_s, {site_.low_world, site_.high_world, aspect});
  render::Camera camera;
  camera.eye_world = scripted.eye_world;
  camera.target_world = scripted.target_world;
  camera.up_world = scripted.up_world;
  camera.fov_y_rad = glm::radians(scripted.fov_y_deg);
  camera.ortho_height_m = scripted.ortho_height_m;
  camera.near_m = scripted.near_m;
  camera.far_m = scripted.far_m;
  return camera;
}

render::Camera CameraPath::following(const client::CameraScript::Follow& follow, double time_s,
                                     const render::Crowd& crowd) const {
  const auto now = agent_at(crowd, follow.agent, time_s);
  if (!now.has_value()) return overview();
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

}  // namespace throng::server
