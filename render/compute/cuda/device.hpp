#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <vector>

namespace throng::render::cuda {

/// The chosen device, made the current one of this thread: a kernel has run there, and memory that
/// is given back is kept for the next frame. Unavailable with cause and remedy.
absl::StatusOr<int> open_device(const char* call);

/// "NVIDIA H200, compute 9.0".
std::string device_name(int device);

/// The chosen device and the driver.
std::string device_key();

absl::Status choose_device(const std::string& index_or_uuid);
std::vector<std::string> describe_devices();

}  // namespace throng::render::cuda
