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
  // forms other than meshes
  const Representation* representation = nullptr;  // [V]; null: all are meshes
  const JointedInstance* jointed = nullptr;        // [V] where representation is not null
  const float* joints = nullptr;
  const Splat* splats = nullptr;
  std::uint32_t splat_count = 0;
  const Speck* shadows = nullptr;  // as FrameGeometry's
  std::uint32_t shadow_count = 0;
  const Speck* specks = nullptr;
  std::uint32_t speck_count = 0;
  float speck_detail = 1.0F;                // as FrameGeometry's
  const SpeckImage* speck_image = nullptr;  // of the cast
  const SpeckSlab* speck_slab = nullptr;    // [SpeckLevels::kSlabs] of each image
};

}  // namespace throng::render::cuda
