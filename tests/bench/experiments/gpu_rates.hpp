#pragma once

#include <string>

namespace throng::bench {

/// What a CUDA device does at most, by CUDA events, best of several runs.
struct GpuRates {
  double copy_gb_per_s = 0;           // read and written, device memory to device memory
  double spread_atomics_g_per_s = 0;  // 64-bit maxima, each on a word of its own (a 1080p picture)
  double near_atomics_g_per_s = 0;    // the same where 32 neighbours share each word
  double one_atomic_g_per_s = 0;      // all on one word
  double used_mib = 0;                // of device memory, by all that run there
  std::string error;                  // not empty: what went wrong
};
GpuRates measure_gpu_rates();

}  // namespace throng::bench
