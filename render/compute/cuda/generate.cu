#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/posed.hpp"

namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kThreads = 128;

__device__ glm::i16vec2 unpacked(std::uint32_t code) {
  return glm::i16vec2(static_cast<std::int16_t>(code & 0xffffU),
                      static_cast<std::int16_t>(code >> 16));
}

/// The draw list of fused geometry.
__global__ void list_kernel(GenerateJob job) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= job.visible) return;
  SharedInstance shared{SharedInstance::kOwn, 0, 0, 0.0F, 0.0F, 0};
  if (job.mesh[i] != PosedJob::kNoMesh) {
    const VisibleInstance& instance = job.instance[i];
    const PosedMesh mesh = job.table[job.mesh[i]];
    const element::Placement placement =
        element::shared_placement(job.state[instance.slot].placement, instance.scale);
    const std::uint32_t first = job.cast.character[instance.character].first_level;
    shared = {job.cast.level_at[first + instance.vertex_count],
              mesh.first,
              mesh.stride,
              placement.cosine_scale,
              placement.sine_scale,
              0};
  }
  job.shared[i] = shared;
}

/// An agent that shares its pose, in batched form.
__device__ void place_shared(const GenerateJob& job, std::uint32_t visible,
                             const VisibleInstance& instance, const DeviceCharacter& character) {
  const PosedMesh mesh = job.table[job.mesh[visible]];
  const element::Placement placement =
      element::shared_placement(job.state[instance.slot].placement, instance.scale);
  const float* column = job.posed + mesh.first + kPosedHeader;
  const std::uint32_t first_vertex = job.vertex_offset[visible];
  for (std::uint32_t i = threadIdx.x; i < instance.vertex_count; i += kThreads) {
    BatchVertex& vertex = job.vertices[first_vertex + i];
    vertex.position_relative = element::place_posed(
        instance.position_relative, placement.cosine_scale, placement.sine_scale, placement.scale,
        glm::vec3(column[i], column[mesh.stride + i], column[2 * mesh.stride + i]));
    glm::i16vec2 packed;
    memcpy(&packed, column + 3 * mesh.stride + i, sizeof packed);
    const glm::vec3 n = element::turn_posed(placement.cosine_scale, placement.sine_scale,
                                            placement.scale, element::unpack_octahedral(packed));
    vertex.normal = unpacked(element::pack_octahedral(n.x, n.y, n.z));
    vertex.uv = job.cast.uv[character.first_vertex + i];
    vertex.visible = visible;
  }
  const DeviceLevel& level =
      job.cast.level[job.cast.level_at[character.first_level + instance.vertex_count]];
  std::uint32_t* index = job.indices + std::size_t{3} * job.triangle_offset[visible];
  for (std::uint32_t t = threadIdx.x; t < instance.triangle_count; t += kThreads) {
    const std::uint32_t corners = job.cast.level_corners[level.first_triangle + t];
    for (int k = 0; k < 3; ++k) index[3 * t + k] = first_vertex + ((corners >> (10 * k)) & 1023U);
  }
}

/// Corners follow their collapse targets until they are among the vertices left.
__device__ void make_triangles(const GenerateJob& job, std::uint32_t visible,
                               const VisibleInstance& instance, const DeviceCharacter& character) {
  const std::uint32_t count = instance.vertex_count, first_vertex = job.vertex_offset[visible];
  const std::uint32_t* target = job.cast.collapse_target + character.first_vertex;
  const glm::uvec3* triangle = job.cast.triangle + character.first_triangle;
  std::uint32_t* index = job.indices + std::size_t{3} * job.triangle_offset[visible];
  for (std::uint32_t t = threadIdx.x; t < instance.triangle_count; t += kThreads) {
    const glm::uvec3 corners = triangle[t];
    for (int k = 0; k < 3; ++k) {
      std::uint32_t corner = corners[k];
      while (corner >= count) corner = target[corner];
      index[3 * t + k] = first_vertex + corner;
    }
  }
}

/// Moves the vertices of the frame before, where the pose is not due.
__device__ bool move_held(const GenerateJob& job, std::uint32_t visible,
                          const VisibleInstance& instance) {
  const element::HeldVertices held = job.held[instance.slot];
  if (!element::keeps_pose(job.motion, job.distance_m[visible], instance, held, job.held_total)) {
    return false;
  }
  const BatchVertex* from = job.held_vertices + held.first;
  BatchVertex* to = job.vertices + job.vertex_offset[visible];
  for (std::uint32_t i = threadIdx.x; i < held.count; i += kThreads) {
    to[i] = element::moved_vertex(from[i], instance, held, visible);
  }
  if (threadIdx.x == 0) atomicAdd(&job.counters->held, 1U);
  return true;
}

/// Tells the next frame where this one's vertices are.
__global__ void remember_kernel(GenerateJob job) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= job.visible) return;
  const VisibleInstance& instance = job.instance[i];
  const std::uint32_t first = job.vertex_offset[i], count = job.vertex_offset[i + 1] - first;
  if (count == 0) return;
  job.held[instance.slot] = {first, count, instance.character, instance.seed,
                             instance.position_relative};
}

/// One block an instance. Its palette is mixed once, in shared memory (a joint index is 8 bits);
/// then the threads take its vertices and its triangles.
__global__ void generate_kernel(GenerateJob job) {
  THRONG_DYNAMIC_SHARED(element::JointMatrix, palette);
  const std::uint32_t visible = job.list != nullptr ? job.list[blockIdx.x] : blockIdx.x;
  const VisibleInstance& instance = job.instance[visible];
  const DeviceCharacter& character = job.cast.character[instance.character];
  if (job.mesh[visible] != PosedJob::kNoMesh) {  // the same for all threads
    place_shared(job, visible, instance, character);
    return;
  }
  if (job.held != nullptr && move_held(job, visible, instance)) {  // the same for all threads
    make_triangles(job, visible, instance, character);
    return;
  }
  const element::InstanceState& state = job.state[instance.slot];

  const element::JointMatrix* clips = job.cast.palette + character.first_matrix;
  const std::uint32_t joints = character.joint_count;
  for (std::uint32_t j = threadIdx.x; j < joints; j += kThreads) {
    const element::Pose& pose = state.pose;
    element::pose_joint(pose, state.placement, clips + j, joints, palette[j]);
  }
  __syncthreads();

  const std::uint32_t count = instance.vertex_count;
  const std::uint32_t first_vertex = job.vertex_offset[visible];
  for (std::uint32_t i = threadIdx.x; i < count; i += kThreads) {
    const std::uint32_t source = character.first_vertex + i;
    const element::SkinnedVertex skinned = element::skin(job.cast.vertex[source], palette);
    BatchVertex& vertex = job.vertices[first_vertex + i];
    vertex.position_relative = instance.position_relative + skinned.position_m;
    vertex.normal =
        unpacked(element::pack_octahedral(skinned.normal.x, skinned.normal.y, skinned.normal.z));
    vertex.uv = job.cast.uv[source];
    vertex.visible = visible;
  }

  make_triangles(job, visible, instance, character);
}

}  // namespace

cudaError_t launch_generate(const GenerateJob& job, cudaStream_t stream) {
  if (job.visible == 0) return cudaSuccess;
  if (job.shared != nullptr) {
    constexpr std::uint32_t kFlat = 256;
    THRONG_LAUNCH_APART(list_kernel, (job.visible + kFlat - 1) / kFlat, kFlat, stream, job);
  }
  if (job.own > 0) {
    const std::size_t shared_bytes = job.most_joints * sizeof(element::JointMatrix);
    THRONG_LAUNCH(generate_kernel, job.own, kThreads, shared_bytes, stream, job);
  }
  return cudaGetLastError();
}

cudaError_t launch_remember(const GenerateJob& job, cudaStream_t stream) {
  if (job.held == nullptr) return cudaSuccess;
  if (const cudaError_t error =
          cudaMemsetAsync(job.held, 0xff, job.slots * sizeof *job.held, stream);
      error != cudaSuccess || job.visible == 0) {
    return error;
  }
  constexpr std::uint32_t kFlat = 256;
  THRONG_LAUNCH_APART(remember_kernel, (job.visible + kFlat - 1) / kFlat, kFlat, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
