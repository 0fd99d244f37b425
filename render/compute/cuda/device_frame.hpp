#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "render/compute/cuda/device_types.hpp"
#include "throng/render/compute.hpp"

namespace throng::render::cuda {

/// A view's geometry where it was made. It is there for whoever waits for `stream`, until
/// the next call on the view. Offsets have more elements than instances: V + 1 count.
struct DeviceFrame final : DeviceGeometry {
  cudaStream_t stream = nullptr;
  // to be recorded by who draws it, after its last look: the view's next frame waits for that
  cudaEvent_t drawn = nullptr;
  std::uint32_t instance_count = 0;  // V
  std::uint64_t vertex_count = 0, triangle_count = 0;
  const VisibleInstance* instances = nullptr;
  const std::uint32_t* vertex_offset = nullptr;
  const std::uint32_t* triangle_offset = nullptr;
  const BatchVertex* vertices = nullptr;
  const std::uint32_t* indices = nullptr;
  const DrawCommand* command = nullptr;    // [1] that draws all indices
  std::uint64_t triangles_drawn = 0;       // of all instances, those of posed meshes too
  const SharedInstance* shared = nullptr;  // [V]; null: batched
  const float* posed = nullptr;
};

}  // namespace throng::render::cuda
