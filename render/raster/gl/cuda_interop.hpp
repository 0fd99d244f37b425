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

  /// Copies a frame's vertices and indices on the device, and its lists to the host. In what it
  /// returns, vertices and indices are on the device: only their number is for the caller. Valid
  /// until the next call.
  virtual absl::StatusOr<FrameGeometry> stage(const DeviceGeometry& geometry) = 0;
  virtual unsigned vertices() const = 0;  // names of buffers
  virtual unsigned indices() const = 0;
  virtual unsigned command() const = 0;  // for glDrawElementsIndirect
};

/// Unavailable when the current context draws on another device, or on none that CUDA knows of.
absl::StatusOr<std::unique_ptr<CudaInterop>> make_cuda_interop(int device);

}  // namespace throng::render::gl
