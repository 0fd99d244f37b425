#include "render/compute/cuda/block_sum.hpp"
#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/element/posed.hpp"

// What impostors and points are drawn from: joints and splats.
namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kFlat = kSumThreads;
constexpr std::uint32_t kThreads = 64;

__device__ std::uint32_t own_index() { return blockIdx.x * blockDim.x + threadIdx.x; }

/// Whose pose is taken from the shared ones, and which.
__device__ bool shared_number(const FormsJob& job, std::uint32_t i, std::uint32_t& number) {
  if (job.tier[i] == element::kOwnPose) return false;
  const VisibleInstance& instance = job.visible[i];
  number = instance.character * element::kSharedPoses +
           element::shared_pose_of(job.state[instance.slot].pose,
                                   job.cast.character[instance.character].gait, job.tier[i]);
  return true;
}

__global__ void clear_kernel(FormsJob job) {
  job.counters->joints = job.counters->splats = 0;
  job.counters->palettes = job.counters->pointed = 0;
}

__global__ void want_kernel(FormsJob job) {
  const std::uint32_t i = own_index();
  std::uint32_t splats = 0;
  if (i < job.counters->visible) {
    const VisibleInstance& instance = job.visible[i];
    const element::Placement& placement = job.state[instance.slot].placement;
    JointedInstance jointed{0, placement.cosine_scale, placement.sine_scale, 0};
    if (job.representation[i] == Representation::kImpostor) {
      std::uint32_t number = 0;
      const std::uint32_t palette = shared_number(job, i, number) ? job.slots + number : i;
      job.first_joint[palette] = job.cast.character[instance.character].joint_count;
      jointed.first_joint = palette;  // once they are counted, its place
    } else if (job.representation[i] == Representation::kPoints && instance.vertex_count != 0) {
      splats = instance.vertex_count;
      job.pointed[atomicAdd(&job.counters->pointed, 1U)] = i;
    }
    job.jointed[i] = jointed;
  }
  if (i <= job.slots) job.first_splat[i] = splats;
  add_up(splats, &job.counters->splats);
}

__global__ void number_kernel(FormsJob job) {
  const std::uint32_t k = own_index(), palettes = job.slots + job.poses;
  if (k < palettes && job.first_joint[k + 1] != job.first_joint[k]) {
    job.palettes[atomicAdd(&job.counters->palettes, 1U)] = k;
  }
  if (k == palettes) job.counters->joints = job.first_joint[k];
  if (k < job.counters->visible && job.representation[k] == Representation::kImpostor) {
    job.jointed[k].first_joint = job.first_joint[job.jointed[k].first_joint];
  }
}

/// A palette in the model frame, by a block of threads.
__global__ void __launch_bounds__(kThreads) joints_kernel(FormsJob job) {
  const std::uint32_t k = job.palettes[blockIdx.x];
  const bool shares = k >= job.slots;
  const std::uint32_t number =
      shares ? (k - job.slots) / element::kSharedPoses : job.visible[k].character;
  const DeviceCharacter& character = job.cast.character[number];
  const element::Pose pose =
      shares ? element::shared_pose(character.gait, (k - job.slots) % element::kSharedPoses)
             : job.state[job.visible[k].slot].pose;
  const element::Placement upright{1.0F, 0.0F, 1.0F};
  const element::JointMatrix* clips = job.cast.palette + character.first_matrix;
  element::JointMatrix* joints = job.joints + job.first_joint[k];
  for (std::uint32_t j = threadIdx.x; j < character.joint_count; j += kThreads) {
    element::pose_joint(pose, upright, clips + j, character.joint_count, joints[j]);
  }
}

/// An agent's points by a block of threads. Who shares a pose has it in the model frame first, as
/// on the processor, where agents take such points from a bank: the same bits.
__global__ void __launch_bounds__(kThreads) splats_kernel(FormsJob job) {
  THRONG_DYNAMIC_SHARED(element::JointMatrix, palette);
  const std::uint32_t i = job.pointed[blockIdx.x];
  const VisibleInstance& instance = job.visible[i];
  const DeviceCharacter& character = job.cast.character[instance.character];
  const element::InstanceState& state = job.state[instance.slot];
  std::uint32_t number = 0;
  const bool shares = shared_number(job, i, number);
  const element::Pose pose =
      shares ? element::shared_pose(character.gait, number % element::kSharedPoses) : state.pose;
  const element::Placement upright{1.0F, 0.0F, 1.0F};
  const element::JointMatrix* clips = job.cast.palette + character.first_matrix;
  for (std::uint32_t j = threadIdx.x; j < character.joint_count; j += kThreads) {
    element::pose_joint(pose, shares ? upright : state.placement, clips + j, character.joint_count,
                        palette[j]);
  }
  __syncthreads();
  const std::uint32_t count = instance.vertex_count;
  const float radius_m =
      job.cast.point_radius_m[character.first_point + count - 1] * instance.scale;
  const DevicePointTone* tones = job.cast.point_tone + character.first_tone +
                                 element::first_point_tone(character.point_count, count);
  Splat* splats = job.splats + job.first_splat[i];
  for (std::uint32_t p = threadIdx.x; p < count; p += kThreads) {
    const element::SkinnedVertex skinned =
        element::skin(job.cast.point[character.first_point + p], palette);
    const std::uint32_t code =
        element::pack_octahedral(skinned.normal.x, skinned.normal.y, skinned.normal.z);
    glm::i16vec2 normal;
    memcpy(&normal, &code, sizeof normal);
    const DevicePointTone tone = tones[p];
    if (shares) {
      splats[p] =
          element::shared_splat(instance.position_relative, state.placement, skinned.position_m,
                                normal, radius_m, tone.base, tone.regions, i);
    } else {
      splats[p] = {instance.position_relative + skinned.position_m,
                   radius_m,
                   normal,
                   tone.base,
                   tone.regions,
                   i};
    }
  }
}

std::uint32_t blocks_for(std::uint32_t count) { return (count + kFlat - 1) / kFlat; }

}  // namespace

cudaError_t launch_want_forms(const FormsJob& job, void* scratch, std::size_t scratch_bytes,
                              cudaStream_t stream) {
  if (job.representation == nullptr || job.slots == 0) return cudaSuccess;
  THRONG_LAUNCH_APART(clear_kernel, 1, 1, stream, job);
  const std::uint32_t palettes = job.slots + job.poses;
  if (const cudaError_t error = cudaMemsetAsync(
          job.first_joint, 0, (std::size_t{palettes} + 1) * sizeof *job.first_joint, stream);
      error != cudaSuccess) {
    return error;
  }
  THRONG_LAUNCH(want_kernel, blocks_for(job.slots + 1), kFlat, 0, stream, job);
  if (const cudaError_t error = launch_scan(job.first_joint, job.first_joint, palettes + 1, scratch,
                                            scratch_bytes, stream);
      error != cudaSuccess) {
    return error;
  }
  if (const cudaError_t error = launch_scan(job.first_splat, job.first_splat, job.slots + 1,
                                            scratch, scratch_bytes, stream);
      error != cudaSuccess) {
    return error;
  }
  THRONG_LAUNCH_APART(number_kernel, blocks_for(palettes + 1), kFlat, stream, job);
  return cudaGetLastError();
}

cudaError_t launch_make_forms(const FormsJob& job, cudaStream_t stream) {
  if (job.to_pose > 0) THRONG_LAUNCH_APART(joints_kernel, job.to_pose, kThreads, stream, job);
  if (job.to_point > 0) {
    const std::size_t shared_bytes = job.most_joints * sizeof(element::JointMatrix);
    THRONG_LAUNCH(splats_kernel, job.to_point, kThreads, shared_bytes, stream, job);
  }
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
