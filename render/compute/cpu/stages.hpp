#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <vector>

#include "render/compute/common.hpp"
#include "render/compute/cpu/buffer.hpp"
#include "render/compute/cpu/cast_table.hpp"
#include "render/compute/cpu/work_pool.hpp"
#include "render/compute/element/advance.hpp"
#include "render/compute/element/pose.hpp"
#include "render/compute/element/selection.hpp"
#include "render/compute/element/skinning.hpp"
#include "throng/render/compute.hpp"

namespace throng::render {

struct CpuSnapshot final : DeviceSnapshot {
  std::shared_ptr<const Snapshot> snapshot;
};

struct CpuInstances final : Instances {
  std::shared_ptr<const CastTable> cast;
  Buffer<glm::vec4> sphere_m;  // [I] offset from the crowd's origin; radius -1: empty slot
  Buffer<element::InstanceState> state;  // [I] unspecified where the slot is empty
};

struct CpuView final : ViewWork {
  ViewStage stage = ViewStage::kNew;
  std::shared_ptr<const CpuInstances> instances;
  element::Projection projection;
  Buffer<std::uint8_t> mask;              // [I]
  Buffer<VisibleInstance> visible;        // [V]
  Buffer<float> distance_m;               // [V] from the eye to the sphere's centre
  Buffer<std::uint32_t> share;            // [V] of the budget
  Buffer<std::uint32_t> vertex_offset;    // [V+1]
  Buffer<std::uint32_t> triangle_offset;  // [V+1]
  Buffer<BatchVertex> vertices;
  Buffer<std::uint32_t> indices;
  std::vector<std::uint32_t> chunk_count;  // visible instances by chunk of slots
  std::vector<std::uint64_t> chunk_sum, chunk_fixed, chunk_free;
  std::uint64_t effective_budget = 0;
};

/// What one worker writes on the way; grows to the largest character.
struct WorkerScratch {
  Buffer<element::JointMatrix> palette;
  Buffer<std::uint32_t> corner;
};

struct Kernels;

/// What the stages run on.
struct Machine {
  WorkPool& pool;
  const Kernels& kernels;
};

void advance(const Snapshot& older, const Snapshot& newer, std::int64_t scene_time_us,
             const CrowdSettings& settings, int channel, Machine machine, CpuInstances& instances);

void cull(CpuView& view, const Camera& camera, const Viewport& viewport, Machine machine);

void select(CpuView& view, const Selection& selection, Machine machine);

/// ResourceExhausted when the batched buffer would need more than 2^32 - 1 vertices or indices.
absl::Status allocate(CpuView& view);

void generate(CpuView& view, Machine machine, std::vector<WorkerScratch>& scratch);

}  // namespace throng::render
