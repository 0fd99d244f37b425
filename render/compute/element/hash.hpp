#pragma once

#include <cstdint>

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

/// A stable 64-bit mix (the finaliser of SplitMix64, Steele et al. 2014): the same on every
/// machine.
THRONG_HOST_DEVICE inline std::uint64_t mix64(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// A number in [0, 1) with 24 bits, different for each `stream` of one agent's seed.
THRONG_HOST_DEVICE inline float unit_from_seed(std::uint32_t seed, std::uint32_t stream) {
  const std::uint64_t bits = mix64((static_cast<std::uint64_t>(stream) << 32) | seed);
  return static_cast<float>(bits >> 40) * (1.0F / 16777216.0F);
}

/// What the numbers of `unit_from_seed` decide.
enum SeedStream : std::uint32_t {
  kSeedPhase = 1,
  kSeedIdleOffset = 2,
  kSeedWalkThreshold = 3,
  kSeedRunThreshold = 4,
  kSeedHeading = 5,
  kSeedTier = 6,
  kSeedFlat = 7,
  kSeedForm = 8,
  kSeedPace = 9,
};

}  // namespace throng::render::element
