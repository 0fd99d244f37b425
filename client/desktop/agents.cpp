#include "client/desktop/agents.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "throng/v1/view.pb.h"

namespace throng::client {
namespace {

static_assert(std::endian::native == std::endian::little, "columns are little-endian");

constexpr std::int64_t kTrailUs = 6'000'000, kSpacingUs = kTrailUs / 60, kOtherMomentUs = 2'000'000;

template <typename T>
T value_at(const std::string& bytes, std::size_t index) {
  T value;
  std::memcpy(&value, bytes.data() + index * sizeof(T), sizeof(T));
  return value;
}

}  // namespace

std::vector<Agent> unpack_agents(const v1::AgentColumns& columns) {
  const std::size_t count = std::min(columns.ids().size() / 8, columns.positions().size() / 12);
  const bool has_values = columns.values().size() >= 4 * count;
  const glm::dvec3 origin(columns.origin().x(), columns.origin().y(), columns.origin().z());
  std::vector<Agent> agents(count);
  for (std::size_t i = 0; i < count; ++i) {
    Agent& agent = agents[i];
    agent.id = value_at<std::uint64_t>(columns.ids(), i);
    for (glm::length_t axis = 0; axis < 3; ++axis) {
      agent.position_world[axis] =
          origin[axis] +
          double{value_at<float>(columns.positions(), 3 * i + static_cast<std::size_t>(axis))};
    }
    agent.value =
        has_values ? value_at<float>(columns.values(), i) : std::numeric_limits<float>::quiet_NaN();
  }
  return agents;
}

void Trails::add(std::int64_t time_us, const std::vector<Agent>& agents) {
  // another moment: what was seen there belongs to another way here
  if (std::abs(time_us - last_us_) > kOtherMomentUs) clear();
  last_us_ = time_us;
  for (const Agent& agent : agents) {
    Trail& trail = trails_[agent.id];
    while (!trail.empty() && trail.back().time_us > time_us) trail.pop_back();  // played backwards
    if (trail.empty() || time_us - trail.back().time_us >= kSpacingUs) {
      trail.push_back({time_us, agent.position_world});
    }
  }
  for (auto entry = trails_.begin(); entry != trails_.end();) {
    Trail& trail = entry->second;
    while (!trail.empty() && time_us - trail.front().time_us > kTrailUs) trail.pop_front();
    entry = trail.empty() ? trails_.erase(entry) : std::next(entry);
  }
}

const Trails::Trail* Trails::of(std::uint64_t id) const {
  const auto found = trails_.find(id);
  return found == trails_.end() ? nullptr : &found->second;
}

}  // namespace throng::client
