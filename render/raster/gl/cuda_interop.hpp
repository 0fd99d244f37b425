#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "throng/render/compute.hpp"

namespace throng::render::gl {

/// The chosen CUDA device's number, for the EGL device that goes with it. Unavailable without one.
absl::StatusOr<int> interop_device();

/// Vertices and indices from a CUDA device into buffers of OpenGL on the same device, without the
/// host: registered once, mapped for each frame. All calls, and the end, with the context current.
class CudaInterop {
 public:
  virtual ~CudaInterop() = default;

  /// Copies `geometry.vertices` and `indices`, which lie on the device.
  virtual absl::Status stage(const FrameGeometry& geometry) = 0;
  virtual unsigned vertices() const = 0;  // names of buffers
  virtual unsigned indices() const = 0;
};

/// Unavailable when the current context draws on another device, or on none that CUDA knows of.
absl::StatusOr<std::unique_ptr<CudaInterop>> make_cuda_interop(int device);

}  // namespace throng::render::gl
