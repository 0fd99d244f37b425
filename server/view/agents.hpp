#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "server/scene/registry.hpp"
#include "throng/render/camera.hpp"
#include "throng/render/crowd.hpp"
#include "throng/render/environment.hpp"

namespace throng::server {

/// The agents of a crowd at one scene time, as its pictures show them. Holds two snapshots, not the
/// history.
struct AgentsAt {
  render::Bracket bracket;  // both null: nobody
  std::shared_ptr<const render::Environment> environment;
  std::int64_t scene_time_us = 0;
  glm::dvec3 origin_world{0.0};
  std::int64_t extrapolate_limit_us = 0;
};

/// The agents of `moment.crowd` at `scene_time_us`.
AgentsAt agents_at(const Moment& moment, std::int64_t scene_time_us);

/// The box of their positions and of what stands near them, world frame, metres; none when nobody
/// is there.
std::optional<WorldBox> box_of(const AgentsAt& agents);

/// What an overview of them shows to somebody who has not looked before.
WorldBox overview_of(const Moment& moment, const AgentsAt& agents);

/// One agent. World frame: +Z up, metres, radians counter-clockwise from +X.
struct ShownAgent {
  std::uint64_t id = 0;
  std::uint32_t slot = 0;
  glm::dvec3 position_world{0.0};  // on the ground between its feet
  double heading_rad = 0.0;        // NaN: not known
  double speed_mps = 0.0;
  double scale = 1.0;
};

/// The agent with this id; none when it is not there at this time.
std::optional<ShownAgent> find_agent(const AgentsAt& agents, std::uint64_t id);

/// Moves a camera, without turning it, so that it looks at an agent standing there.
void follow(const glm::dvec3& position_world, render::Camera& camera);

/// Agents in view for drawing over a picture. Columns [A]; when more than `most` are in view those
/// nearest to the eye are taken.
struct AgentList {
  std::vector<std::uint64_t> ids;
  std::vector<glm::vec3> position_m;  // offset from the crowd's origin
  std::vector<float> values;          // of the channel; empty without one
  std::uint32_t left_out = 0;
};
AgentList list_agents(const AgentsAt& agents, const render::Camera& camera,
                      const render::Viewport& viewport, std::uint32_t most, int channel);

/// The agent whose body covers the pixel (x from the left, y from the top), nearest first; else the
/// one whose body comes closest to it within `slack_px`. A body is a capsule about its walking
/// stance, so a hit does not depend on how an agent is drawn.
std::optional<ShownAgent> pick_agent(const AgentsAt& agents, const render::Camera& camera,
                                     const render::Viewport& viewport, double x_px, double y_px,
                                     double slack_px = 6.0);

/// Agents per square metre on a grid over the crowd [row][column], each agent spread as a Gaussian
/// of `kDensitySigmaM`, and none outside of a walkable area that is known. Rows go north, at most
/// 96 cells a side.
struct DensityMap {
  glm::dvec3 low_world{0.0};  // centre of the first cell
  double cell_m = 1.0;
  std::uint32_t columns = 0, rows = 0;
  std::vector<float> density;
  float highest = 0.0F;
};
inline constexpr double kDensitySigmaM = 0.7;
DensityMap density_map(const AgentsAt& agents);

}  // namespace throng::server
