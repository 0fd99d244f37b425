#pragma once

#include <cstdint>
#include <memory>

#include "throng/trajectory/trajectory.hpp"

namespace throng::server {

/// A walking crowd without a file: a square with lanes of people in both directions, each lane at
/// its own pace, some joggers, some groups that stand and talk. A pure function of agent number,
/// seed and time; 10 frames a second, about 0.35 agents per square metre, `seconds` long.
std::unique_ptr<trajectory::Reader> make_synthetic(std::uint32_t agents, std::uint64_t seed,
                                                   double seconds);

}  // namespace throng::server
