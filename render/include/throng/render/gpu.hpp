#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>
#include <vector>

namespace throng::render {

/// Tells the CUDA runtime by its environment to load all kernels at once: one that is loaded when
/// it is first used may be so while a graph is recorded, which is no time for it. For `main`, as
/// long as there is one thread; what the environment says already stays.
void prepare_gpu();

/// Which CUDA device backends and rasterizers made from now on take: an index as CUDA counts
/// (CUDA_VISIBLE_DEVICES renumbers), or a UUID as `nvidia-smi -L` shows it or its beginning. Empty:
/// the first. Unavailable without a device, NotFound with those there are.
absl::Status choose_gpu(const std::string& index_or_uuid);

/// Device memory that this process may take, pictures and drivers' own needs apart. What needs more
/// is refused (ResourceExhausted, with need and limit), and all else goes on.
void limit_gpu_memory(std::uint64_t size_bytes);

/// Of it, what is taken.
std::uint64_t gpu_memory_held();

/// The chosen device and the driver; empty: none is built in.
std::string gpu_key();

/// The driver, and a line for each CUDA device: whether this program runs there, or why not. For
/// `throng doctor`.
std::vector<std::string> describe_cuda();

}  // namespace throng::render
