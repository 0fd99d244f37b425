#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <nlohmann/json.hpp>

#include "bench/experiments/options.hpp"

namespace throng::bench {

/// Whole frames of the walkthrough on a CUDA device, by both rasterizers: stages by the device's
/// clock, table 2's budgets and crowds up to a million agents, and what the two pictures differ in.
/// Prints its tables and returns their JSON.
/// @param frames  of the walkthrough, evenly spread
/// @param options  the walkthrough's camera file; trajectory files: they are measured instead
absl::StatusOr<nlohmann::ordered_json> measure_gpu_frames(const Common& common,
                                                          std::uint32_t frames,
                                                          const GpuOptions& options);

}  // namespace throng::bench
