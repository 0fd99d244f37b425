#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/element/octahedral.hpp"

namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kThreads = 128;

/// One block an instance. Its palette is mixed once, in shared memory (a joint index is 8 bits);
/// then the threads take its vertices and its triangles.
__global__ void generate_kernel(GenerateJob job) {
  THRONG_DYNAMIC_SHARED(element::JointMatrix, palette);
  const std::uint32_t visible = blockIdx.x;
  const VisibleInstance& instance = job.instance[visible];
  const DeviceCharacter& character = job.cast.character[instance.character];
  const element::InstanceState& state = job.state[instance.slot];

  const element::JointMatrix* clips = job.cast.palette + character.first_matrix;
  const std::uint32_t joints = character.joint_count;
  for (std::uint32_t j = threadIdx.x; j < joints; j += kThreads) {
    const element::Pose& pose = state.pose;
    element::pose_joint(pose, state.placement, clips[pose.a_frame0 * joints + j],
                        clips[pose.a_frame1 * joints + j], clips[pose.b_frame0 * joints + j],
                        clips[pose.b_frame1 * joints + j], palette[j]);
  }
  __syncthreads();

  const std::uint32_t count = instance.vertex_count;
  const std::uint32_t first_vertex = job.vertex_offset[visible];
  for (std::uint32_t i = threadIdx.x; i < count; i += kThreads) {
    const std::uint32_t source = character.first_vertex + i;
    const element::SkinnedVertex skinned = element::skin(job.cast.vertex[source], palette);
    BatchVertex& vertex = job.vertices[first_vertex + i];
    vertex.position_relative = instance.position_relative + skinned.position_m;
    const std::uint32_t code =
        element::pack_octahedral(skinned.normal.x, skinned.normal.y, skinned.normal.z);
    vertex.normal = glm::i16vec2(static_cast<std::int16_t>(code & 0xffffU),
                                 static_cast<std::int16_t>(code >> 16));
    vertex.uv = job.cast.uv[source];
    vertex.visible = visible;
  }

  // Corners follow their collapse targets until they are among the vertices left.
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

}  // namespace

cudaError_t launch_generate(const GenerateJob& job, cudaStream_t stream) {
  if (job.visible == 0) return cudaSuccess;
  const std::size_t shared_bytes = job.most_joints * sizeof(element::JointMatrix);
  THRONG_LAUNCH(generate_kernel, job.visible, kThreads, shared_bytes, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
