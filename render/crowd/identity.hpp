#pragma once

#include <cstdint>
#include <vector>

#include "render/compute/element/hash.hpp"

namespace throng::render {

/// What an agent gets from its id: the same on every machine and in every run.
struct Identity {
  std::uint32_t seed = 0;
  float scale = 1.0F;  // 0.92 to 1.08
  double draw = 0.0;   // in [0, 1), picks the character by weight
};

inline Identity identity_of(std::uint64_t id, std::uint64_t crowd_seed) {
  const std::uint64_t first = element::mix64(id ^ element::mix64(crowd_seed));
  const std::uint64_t second = element::mix64(first);
  const std::uint64_t third = element::mix64(second);
  Identity identity;
  identity.seed = static_cast<std::uint32_t>(first >> 32);
  identity.scale = 0.92F + 0.16F * (static_cast<float>(second >> 40) * (1.0F / 16777216.0F));
  identity.draw = static_cast<double>(third >> 11) * (1.0 / 9007199254740992.0);
  return identity;
}

/// The member whose share of the weights `draw` falls into. Weights that are not positive and
/// finite count as 0; when all do, all members are equally likely.
inline std::uint16_t draw_member(const std::vector<double>& cumulative_weight, double draw) {
  const double at = draw * cumulative_weight.back();
  for (std::size_t member = 0; member < cumulative_weight.size(); ++member) {
    if (at < cumulative_weight[member]) return static_cast<std::uint16_t>(member);
  }
  return static_cast<std::uint16_t>(cumulative_weight.size() - 1);
}

}  // namespace throng::render
