#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

namespace throng::render {

/// Which CUDA device backends and rasterizers made from now on take: an index as CUDA counts
/// (CUDA_VISIBLE_DEVICES renumbers), or a UUID as `nvidia-smi -L` shows it or its beginning. Empty:
/// the first. Unavailable without a device, NotFound with those there are.
absl::Status choose_gpu(const std::string& index_or_uuid);

/// The driver, and a line for each CUDA device: whether this program runs there, or why not. For
/// `throng doctor`.
std::vector<std::string> describe_cuda();

}  // namespace throng::render
