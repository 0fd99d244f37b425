#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "render/compute/cuda/device_types.hpp"

// Every launch is asynchronous on `stream` and returns what the runtime said of it.
namespace throng::render::cuda {

cudaError_t launch_advance(const AdvanceJob& job, cudaStream_t stream);

/// Mask, prefix sum and compaction: the visible list keeps the order of slots.
/// @param scratch  scratch_bytes(slots) bytes of device memory.
cudaError_t launch_cull(const CullJob& job, void* scratch, std::size_t scratch_bytes,
                        cudaStream_t stream);

/// Only the mask, and the sizes of some agents in it where they are asked for.
cudaError_t launch_mask(const CullJob& job, void* scratch, std::size_t scratch_bytes,
                        cudaStream_t stream);

/// After launch_mask: the visible list without specks, and the specks, both in the order of slots.
cudaError_t launch_split(const SplitJob& job, void* scratch, std::size_t scratch_bytes,
                         cudaStream_t stream);

/// Exclusive prefix sum of `count` numbers.
cudaError_t launch_scan(const std::uint32_t* from, std::uint32_t* to, std::uint32_t count,
                        void* scratch, std::size_t scratch_bytes, cudaStream_t stream);

/// Equation 1's shares, the rate that fits the budget, counts and their prefix sums.
cudaError_t launch_select(const SelectJob& job, cudaStream_t stream);

/// The mixed frame's: forms, and vertex counts by error.
cudaError_t launch_mix(const SelectJob& job, cudaStream_t stream);

/// Which palettes and points the other forms want, and where they go. `counters` then tells the
/// host.
cudaError_t launch_want_forms(const FormsJob& job, void* scratch, std::size_t scratch_bytes,
                              cudaStream_t stream);

/// Joints and points themselves.
cudaError_t launch_make_forms(const FormsJob& job, cudaStream_t stream);

/// Where the far crowd's agents are, who of them is drawn, and how many points they have.
/// `counters` then tells the host.
cudaError_t launch_place_far(const FarJob& job, void* scratch, std::size_t scratch_bytes,
                             cudaStream_t stream);

/// Their points and shadows.
cudaError_t launch_make_far(const FarJob& job, cudaStream_t stream);

/// Exclusive prefix sums of vertex and triangle counts [V+1] and their totals.
cudaError_t launch_allocate(const AllocateJob& job, void* scratch, std::size_t scratch_bytes,
                            cudaStream_t stream);

/// The shared pose of each visible agent that has one, and how much room the meshes of those poses
/// need. `counters` then tells the host.
cudaError_t launch_want_poses(const PosedJob& job, cudaStream_t stream);

/// Gives each mesh that is to be made its place, and makes it.
cudaError_t launch_make_posed(const PosedJob& job, void* scratch, std::size_t scratch_bytes,
                              cudaStream_t stream);

/// LOD mesh generation and skinning: a block for each instance that has vertices of its own; in
/// fused geometry the others are listed.
cudaError_t launch_generate(const GenerateJob& job, cudaStream_t stream);

/// Where this frame's vertices are, for the next one (MotionUpdate). After launch_generate.
cudaError_t launch_remember(const GenerateJob& job, cudaStream_t stream);

/// Runs an empty kernel: fails where the device can't run what was built.
cudaError_t probe_kernels(cudaStream_t stream);

/// Bytes of scratch memory that prefix sums over `count` elements want.
cudaError_t scan_scratch_bytes(std::uint32_t count, std::size_t& bytes);

}  // namespace throng::render::cuda
