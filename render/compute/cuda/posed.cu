#include "render/compute/cuda/block_sum.hpp"
#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/posed.hpp"

namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kFlat = kSumThreads;
constexpr std::uint32_t kThreads = 128;

__device__ std::uint32_t own_index() { return blockIdx.x * blockDim.x + threadIdx.x; }

__device__ std::uint32_t stride_for(std::uint32_t vertices) {
  return (vertices + element::kPosedLanes - 1) / element::kPosedLanes * element::kPosedLanes;
}

__global__ void want_kernel(PosedJob job) {
  const std::uint32_t i = own_index();
  if (i >= job.counters->visible) return;
  job.mesh[i] = PosedJob::kNoMesh;
  if (job.tier[i] == element::kOwnPose) return;
  if (job.representation != nullptr && job.representation[i] != Representation::kMesh) return;
  const VisibleInstance& instance = job.visible[i];
  const std::uint32_t pose = element::shared_pose_of(
      job.state[instance.slot].pose, job.cast.character[instance.character].gait, job.tier[i]);
  const std::uint32_t mesh = instance.character * element::kSharedPoses + pose;
  job.mesh[i] = mesh;
  // most agents want what another one wants
  if (job.wanted[mesh] < instance.vertex_count) {
    atomicMax(&job.wanted[mesh], instance.vertex_count);
  }
}

__global__ void plan_kernel(PosedJob job) {
  const std::uint32_t m = own_index();
  std::uint64_t values = 0, is_new = 0, is_wanted = 0;
  if (m < job.meshes && job.wanted[m] != 0) {
    values = element::posed_values(stride_for(job.wanted[m]));
    is_wanted = 1;
    is_new = job.table[m].stride < job.wanted[m] ? 1 : 0;
  }
  add_up(values, &job.counters->all_values);
  add_up(values * is_new, &job.counters->new_values);
  add_up(is_wanted, &job.counters->all_meshes);
  add_up(is_new, &job.counters->new_meshes);
}

__global__ void clear_kernel(PosedJob job) {
  job.counters->all_values = job.counters->new_values = 0;
  job.counters->all_meshes = job.counters->new_meshes = 0;
}

__global__ void size_kernel(PosedJob job) {
  const std::uint32_t m = own_index();
  if (m >= job.meshes) return;
  const std::uint32_t wanted = job.wanted[m];
  const bool made = wanted != 0 && (job.from_scratch || job.table[m].stride < wanted);
  job.size[m] = made ? static_cast<std::uint32_t>(element::posed_values(stride_for(wanted))) : 0;
  job.is_made[m] = made ? 1 : 0;
}

__global__ void assign_kernel(PosedJob job) {
  const std::uint32_t m = own_index();
  if (m >= job.meshes) return;
  const std::uint32_t wanted = job.wanted[m];
  if (wanted != 0 && (job.from_scratch || job.table[m].stride < wanted)) {
    job.table[m] = {job.used + job.size[m], stride_for(wanted)};
    job.list[job.is_made[m]] = m;
  } else if (job.from_scratch) {
    job.table[m] = PosedMesh();
  }
}

/// A character's first vertices in its model frame, by columns behind their box: a block each.
__global__ void __launch_bounds__(kThreads) make_kernel(PosedJob job) {
  THRONG_DYNAMIC_SHARED(element::JointMatrix, palette);
  const std::uint32_t m = job.list[blockIdx.x];
  const DeviceCharacter& character = job.cast.character[m / element::kSharedPoses];
  const element::Pose pose = element::shared_pose(character.gait, m % element::kSharedPoses);
  const element::Placement upright{1.0F, 0.0F, 1.0F};
  const element::JointMatrix* clips = job.cast.palette + character.first_matrix;
  const std::uint32_t joints = character.joint_count;
  for (std::uint32_t j = threadIdx.x; j < joints; j += kThreads) {
    element::pose_joint(pose, upright, clips + j, joints, palette[j]);
  }
  __syncthreads();
  const PosedMesh mesh = job.table[m];
  float* values = job.posed + mesh.first;
  float* column = values + kPosedHeader;
  for (std::uint32_t i = threadIdx.x; i < mesh.stride; i += kThreads) {
    // beyond the last vertex it stands once more
    const std::uint32_t v = i < character.vertex_count ? i : character.vertex_count - 1;
    const element::SkinnedVertex skinned =
        element::skin(job.cast.vertex[character.first_vertex + v], palette);
    for (int k = 0; k < 3; ++k) column[k * mesh.stride + i] = skinned.position_m[k];
    const std::uint32_t code =
        element::pack_octahedral(skinned.normal.x, skinned.normal.y, skinned.normal.z);
    memcpy(column + 3 * mesh.stride + i, &code, sizeof code);
  }
  __syncthreads();
  // its box, for rasterizers on the processor
  if (threadIdx.x < 6) {
    const float* own = column + threadIdx.x % 3 * mesh.stride;
    float extreme = own[0];
    for (std::uint32_t i = 1; i < mesh.stride; ++i) {
      const float value = own[i];
      extreme = (threadIdx.x < 3 ? value < extreme : value > extreme) ? value : extreme;
    }
    values[threadIdx.x] = extreme;
  } else if (threadIdx.x < kPosedHeader) {
    values[threadIdx.x] = 0.0F;
  }
}

std::uint32_t blocks_for(std::uint32_t count) { return (count + kFlat - 1) / kFlat; }

}  // namespace

cudaError_t launch_want_poses(const PosedJob& job, cudaStream_t stream) {
  THRONG_LAUNCH_APART(clear_kernel, 1, 1, stream, job);
  if (job.slots == 0) return cudaGetLastError();
  if (job.meshes > 0) {
    const std::size_t wanted_bytes = job.meshes * sizeof(std::uint32_t);
    const cudaError_t error = cudaMemsetAsync(job.wanted, 0, wanted_bytes, stream);
    if (error != cudaSuccess) return error;
  }
  THRONG_LAUNCH_APART(want_kernel, blocks_for(job.slots), kFlat, stream, job);
  if (job.meshes == 0) return cudaGetLastError();
  THRONG_LAUNCH(plan_kernel, blocks_for(job.meshes), kFlat, 0, stream, job);
  return cudaGetLastError();
}

cudaError_t launch_make_posed(const PosedJob& job, void* scratch, std::size_t scratch_bytes,
                              cudaStream_t stream) {
  if (job.to_make == 0) return cudaSuccess;
  THRONG_LAUNCH_APART(size_kernel, blocks_for(job.meshes), kFlat, stream, job);
  for (std::uint32_t* column : {job.size, job.is_made}) {
    if (const cudaError_t error =
            launch_scan(column, column, job.meshes, scratch, scratch_bytes, stream);
        error != cudaSuccess) {
      return error;
    }
  }
  THRONG_LAUNCH_APART(assign_kernel, blocks_for(job.meshes), kFlat, stream, job);
  const std::size_t shared_bytes = job.most_joints * sizeof(element::JointMatrix);
  THRONG_LAUNCH(make_kernel, job.to_make, kThreads, shared_bytes, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
