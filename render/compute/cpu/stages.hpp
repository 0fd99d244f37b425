#pragma once

#include <absl/status/status.h>

#include <algorithm>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <vector>

#include "render/compute/common.hpp"
#include "render/compute/cpu/buffer.hpp"
#include "render/compute/cpu/cast_table.hpp"
#include "render/compute/cpu/posed_bank.hpp"
#include "render/compute/cpu/work_pool.hpp"
#include "render/compute/element/advance.hpp"
#include "render/compute/element/held_pose.hpp"
#include "render/compute/element/pose.hpp"
#include "render/compute/element/selection.hpp"
#include "render/compute/element/shared_pose.hpp"
#include "render/compute/element/skinning.hpp"
#include "throng/render/compute.hpp"

namespace throng::render {

struct CpuSnapshot final : DeviceSnapshot {
  std::shared_ptr<const Snapshot> snapshot;
};

/// Only where everybody is. Heading and pose are a matter of whoever sees an agent: most of a large
/// crowd is out of sight, or a part of a pixel that others stand for.
struct CpuInstances final : Instances {
  std::shared_ptr<const CastTable> cast;
  std::shared_ptr<const Snapshot> older, newer;  // which `moment` looks into
  element::Bracketed moment;
  std::uint32_t first_surrounding = 0;  // member of the cast
  // [slots] x y z, offset from the crowd's origin, and the scale; -1: empty slot
  Buffer<glm::vec4> place_m;
};

struct CpuView final : ViewWork {
  ViewStage stage = ViewStage::kNew;
  std::shared_ptr<const CpuInstances> instances;
  element::Projection projection;
  glm::vec3 forward{0.0F, 1.0F, 0.0F};
  glm::dvec3 eye_offset_m{0.0};      // from the crowd's origin
  bool is_near = false;              // not orthographic: the eye is a place among agents
  std::uint32_t mask_count = 0;      // instances that the mask keeps
  std::uint32_t visible_agents = 0;  // of them
  glm::mat4 clip_from_relative{1.0F};
  GeometryKind geometry = GeometryKind::kBatched;
  Buffer<std::uint8_t> mask;             // [I]
  Buffer<VisibleInstance> visible;       // [V]
  Buffer<element::InstanceState> state;  // [V]
  Buffer<float> distance_m;              // [V] from the eye to the sphere's centre
  Buffer<std::uint32_t> share;           // [V] of the budget
  Buffer<std::uint8_t> tier;             // [V] of the shared pose, kOwnPose: its own
  Buffer<SharedInstance> shared;         // [V] of fused geometry
  Buffer<std::uint32_t> mesh;            // [V] number in the bank
  std::shared_ptr<const PosedBank::Block> posed;
  Buffer<Representation> representation;  // [V], empty: all are kMesh
  Buffer<JointedInstance> jointed;        // [V] where representation is not empty
  Buffer<element::JointMatrix> joints;
  Buffer<std::uint32_t> shared_joints;  // [characters * kSharedPoses] first joint
  Buffer<Speck> specks;
  std::vector<SpeckRun> speck_runs;  // by chunk of slots
  std::shared_ptr<const SpeckTable> speck_table;
  float speck_detail = 1.0F;
  FrameWork work;         // where a time was asked for
  float error_px = 0.0F;  // chosen then, and kept by the next frame as long as it fits
  std::uint32_t speck_count = 0, left_out = 0;  // agents that are not among the visible instances
  Buffer<Splat> splats;
  Buffer<std::uint32_t> splat_offset;     // [V+1]
  Buffer<std::uint32_t> vertex_offset;    // [V+1]
  Buffer<std::uint32_t> triangle_offset;  // [V+1]
  Buffer<BatchVertex> vertices;
  MotionUpdate motion;
  std::vector<element::HeldVertices> held;  // [I] of the frame before, empty: nothing is held
  Buffer<BatchVertex> held_vertices;
  std::vector<std::uint32_t> held_poses;  // by worker
  Buffer<std::uint32_t> indices;
  std::vector<std::uint32_t> chunk_count;  // visible instances by chunk of slots
  std::vector<std::uint64_t> chunk_sum, chunk_least, chunk_free;
  std::uint64_t effective_budget = 0;
  std::uint32_t posed_meshes = 0;  // made for this frame
  std::uint64_t posed_bytes = 0;   // of the bank

  bool is_mesh(std::size_t v) const {
    return representation.size() == 0 || representation[v] == Representation::kMesh;
  }

  std::uint64_t size_bytes() const {
    return mask.size_bytes() + visible.size_bytes() + state.size_bytes() + distance_m.size_bytes() +
           share.size_bytes() + tier.size_bytes() + shared.size_bytes() + mesh.size_bytes() +
           representation.size_bytes() + jointed.size_bytes() + joints.size_bytes() +
           splats.size_bytes() + specks.size_bytes() + splat_offset.size_bytes() +
           shared_joints.size_bytes() + vertex_offset.size_bytes() + triangle_offset.size_bytes() +
           vertices.size_bytes() + indices.size_bytes();
  }
};
using element::kOwnPose;

/// What one worker writes on the way; grows to the largest character.
struct WorkerScratch {
  Buffer<element::JointMatrix> palette;
  Buffer<std::uint32_t> corner;
  Buffer<BatchVertex> vertices;
  std::vector<PosedBank::Want> wanted;
};

struct Kernels;

/// What the stages run on.
struct Machine {
  WorkPool& pool;
  const Kernels& kernels;
};

void advance(std::shared_ptr<const Snapshot> older, std::shared_ptr<const Snapshot> newer,
             std::int64_t scene_time_us, const CrowdSettings& settings, int channel,
             Surroundings surroundings, Machine machine, CpuInstances& instances);

void cull(CpuView& view, const Camera& camera, const Viewport& viewport, Machine machine);

/// The visible list of the mask.
void list_visible(CpuView& view, WorkPool& pool, const Kernels& kernels);

/// The visible list without those that are drawn as specks or left out, and the specks.
/// `view.speck_table` is that of the cast.
void list_mixed(CpuView& view, const MixedForms& mixed, WorkPool& pool, const Kernels& kernels);

/// The error at which a frame takes MixedForms::budget_ms, by a sample of who is in view.
void fit_error(CpuView& view, const Kernels& kernels, Selection& selection);

/// What shared poses may be off by where everything else is off by `error_px`.
inline float pose_error_of(float error_px) { return std::min(0.5F * error_px, 0.5F); }

void select(CpuView& view, const Selection& selection, Machine machine);

/// Vertex counts by error instead of equation 1: what every mesh needs to be off by at most
/// MixedForms::error_px, or where that is more than the budget, by the least that it allows.
void deal_by_error(CpuView& view, const Selection& selection, WorkPool& pool);

/// What each visible agent is drawn as, once its pose's tier is chosen.
void choose_forms(CpuView& view, const Selection& selection, WorkPool& pool);

/// How many points each agent that is drawn so gets: so many that none is larger than `size_px`.
void choose_points(CpuView& view, float size_px, WorkPool& pool);

/// The points themselves. ResourceExhausted beyond kMostSplats or the bank's limit.
absl::Status make_splats(CpuView& view, Machine machine, PosedBank& bank,
                         std::vector<WorkerScratch>& scratch);

/// Joint matrices of all agents that are impostors or points.
void make_joints(CpuView& view, Machine machine);

/// ResourceExhausted when the batched buffer would need more than 2^32 - 1 vertices or indices.
absl::Status allocate(CpuView& view);

/// ResourceExhausted when the posed meshes need more than the bank's limit.
/// @param point_bank  posed points, which agents share as they share meshes.
absl::Status generate(CpuView& view, Machine machine, PosedBank& bank, PosedBank& point_bank,
                      std::vector<WorkerScratch>& scratch);

}  // namespace throng::render
