#pragma once

#include <cstdint>
#include <deque>
#include <glm/glm.hpp>
#include <unordered_map>
#include <vector>

namespace throng::v1 {
class AgentColumns;
}

namespace throng::client {

/// An agent of a frame, for what is drawn over the picture.
struct Agent {
  std::uint64_t id = 0;
  glm::dvec3 position_world{0.0};
  float value = 0.0F;  // of the channel that is shown; NaN: none is
};

/// Unpacks a frame's columns; what a column is too short for is left out.
std::vector<Agent> unpack_agents(const v1::AgentColumns& columns);

/// Where each agent was in the last seconds, gathered from the frames that were seen.
class Trails {
 public:
  struct Point {
    std::int64_t time_us;
    glm::dvec3 position_world;
  };
  using Trail = std::deque<Point>;

  void clear() { trails_.clear(); }
  void add(std::int64_t time_us, const std::vector<Agent>& agents);
  const Trail* of(std::uint64_t id) const;

 private:
  std::unordered_map<std::uint64_t, Trail> trails_;
  std::int64_t last_us_ = 0;
};

}  // namespace throng::client
