#pragma once

#include <cstdint>

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

/// What an agent was told to do: codes of the cast's motion graph (0: stand, walk and run by its
/// speed) and how long ago it changed. Thirty-two bits of a snapshot, so that a blend needs no
/// memory.
struct Motion {
  std::uint32_t now = 0, before = 0;
  float age_s = 0.0F;
};

/// Blends are shorter than this; who changed longer ago is told from nobody.
inline constexpr std::uint32_t kMostAgeMs = 4095;

THRONG_HOST_DEVICE inline std::uint32_t pack_motion(std::uint32_t now, std::uint32_t before,
                                                    std::uint32_t age_ms) {
  return now | before << 8 | (age_ms < kMostAgeMs ? age_ms : kMostAgeMs) << 16;
}

/// @param since_s  from the snapshot to the moment that is shown.
THRONG_HOST_DEVICE inline Motion unpack_motion(std::uint32_t packed, float since_s) {
  const std::uint32_t age_ms = packed >> 16;
  Motion motion;
  motion.now = packed & 0xffU;
  motion.before = age_ms < kMostAgeMs ? packed >> 8 & 0xffU : motion.now;
  motion.age_s = static_cast<float>(age_ms) * 1e-3F + since_s;
  return motion;
}

}  // namespace throng::render::element
