#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "throng/render/compute.hpp"

namespace throng::render {

/// The stages on the first CUDA device (CUDA_VISIBLE_DEVICES chooses). Unavailable with the reason:
/// no driver, no device, or one that the built kernels do not run on.
absl::StatusOr<std::unique_ptr<ComputeBackend>> make_cuda_backend();

}  // namespace throng::render
