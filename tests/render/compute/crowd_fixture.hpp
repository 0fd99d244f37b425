#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "support/tiny_character.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/crowd.hpp"

namespace throng::test {

/// Two tiny characters of different size; the second is three times as frequent.
inline std::shared_ptr<const render::Cast> tiny_cast() {
  auto cast = std::make_shared<render::Cast>();
  TinyOptions tall;
  TinyOptions wide;
  wide.name = "wide";
  wide.height_m = 1.4F;
  wide.radius_m = 0.4F;
  cast->members.push_back({render::make_character(make_tiny_character(tall)).value(), 1.0F});
  cast->members.push_back({render::make_character(make_tiny_character(wide)).value(), 3.0F});
  return cast;
}

/// A cheap repeatable number in [0, 1).
inline double noise(std::uint64_t n) {
  n = (n ^ 0x5bf03635ULL) * 0x9e3779b97f4a7c15ULL;
  n = (n ^ (n >> 29)) * 0xbf58476d1ce4e5b9ULL;
  return static_cast<double>((n ^ (n >> 32)) >> 11) * 0x1p-53;
}

inline std::shared_ptr<const render::Membership> members(std::vector<std::uint64_t> ids,
                                                         std::uint64_t epoch = 1) {
  auto membership = std::make_shared<render::Membership>();
  membership->epoch = epoch;
  membership->ids = std::move(ids);
  return membership;
}

inline render::AgentFrame frame_at(std::int64_t time_us,
                                   std::shared_ptr<const render::Membership> membership,
                                   std::vector<glm::vec3> position_m,
                                   std::vector<float> heading_rad = {}) {
  render::AgentFrame frame;
  frame.time_us = time_us;
  frame.membership = std::move(membership);
  frame.position_m = std::move(position_m);
  frame.heading_rad = std::move(heading_rad);
  return frame;
}

/// `count` agents in a square of `side_m` around the origin, each walking straight on; frames every
/// 100 ms from 0.
inline std::unique_ptr<render::Crowd> walking_crowd(std::shared_ptr<const render::Cast> cast,
                                                    std::size_t count, double side_m,
                                                    int frames = 2) {
  auto crowd = std::make_unique<render::Crowd>(std::move(cast), render::CrowdSettings{});
  std::vector<std::uint64_t> ids(count);
  for (std::size_t i = 0; i < count; ++i) ids[i] = 1000 + i;
  const auto membership = members(ids);
  for (int f = 0; f < frames; ++f) {
    std::vector<glm::vec3> position_m(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double angle_rad = 6.28 * noise(3 * i);
      const double speed_mps = 3.0 * noise(3 * i + 7);
      position_m[i] = {static_cast<float>((noise(3 * i + 1) - 0.5) * side_m +
                                          0.1 * f * speed_mps * std::cos(angle_rad)),
                       static_cast<float>((noise(3 * i + 2) - 0.5) * side_m +
                                          0.1 * f * speed_mps * std::sin(angle_rad)),
                       0.0F};
    }
    if (!crowd->push(frame_at(100'000 * f, membership, std::move(position_m))).ok()) return nullptr;
  }
  return crowd;
}

}  // namespace throng::test
