#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/angle.hpp"
#include "render/compute/element/host_device.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/pose.hpp"

namespace throng::render::element {

/// A joint's matrix T * B^-1 of equation 2 by columns, the fourth row left out: x, y, z, unused.
/// One cache line, and one register of a wide processor.
struct alignas(64) JointMatrix {
  float m[16];  // column c, row r at 4 c + r
};

/// How a model stands in the world: turned by the heading and scaled, not moved.
struct Placement {
  float cosine_scale = 1.0F;  // scale * cos(heading)
  float sine_scale = 0.0F;
  float scale = 1.0F;
};

THRONG_HOST_DEVICE inline Placement place(float heading_rad, float scale) {
  const SinCos turned = sin_cos(heading_rad);
  return {scale * turned.cosine, scale * turned.sine, scale};
}

/// The bounding sphere (xyz, radius) of a placed model that stands at `position_m`.
THRONG_HOST_DEVICE inline glm::vec4 place_sphere(const Placement& placement,
                                                 const glm::vec3& position_m,
                                                 const glm::vec4& bounds) {
  const float x = fused(bounds.x, placement.cosine_scale, bounds.y * -placement.sine_scale);
  const float y = fused(bounds.y, placement.cosine_scale, bounds.x * placement.sine_scale);
  return glm::vec4(position_m.x + x, position_m.y + y,
                   fused(bounds.z, placement.scale, position_m.z), bounds.w * placement.scale);
}

/// One element of a pose's matrix: each clip between its two frames, then the clips mixed.
/// @param frames  the joint's matrix in the palette's first frame.
/// @param stride  matrices from one frame to the next.
THRONG_HOST_DEVICE inline float mix_pose(const Pose& pose, const JointMatrix* frames,
                                         std::uint32_t stride, int k) {
  const float a = frames[pose.a_frame0 * stride].m[k];
  float mixed = fused(pose.a_t, frames[pose.a_frame1 * stride].m[k] - a, a);
  if (pose.b_weight > 0.0F) {
    const float from = frames[pose.b_frame0 * stride].m[k];
    const float b = fused(pose.b_t, frames[pose.b_frame1 * stride].m[k] - from, from);
    mixed = fused(pose.b_weight, b - mixed, mixed);
  }
  if (pose.c_weight > 0.0F) {
    const float from = frames[pose.c_frame0 * stride].m[k];
    const float c = fused(pose.c_t, frames[pose.c_frame1 * stride].m[k] - from, from);
    mixed = fused(pose.c_weight, c - mixed, mixed);
  }
  return mixed;
}

/// Turns and scales a matrix into world axes.
THRONG_HOST_DEVICE inline void place_matrix(const Placement& placement, const float* m,
                                            float* result) {
  for (int k = 0; k < 16; k += 4) {
    result[k] = fused(m[k], placement.cosine_scale, m[k + 1] * -placement.sine_scale);
    result[k + 1] = fused(m[k + 1], placement.cosine_scale, m[k] * placement.sine_scale);
    result[k + 2] = m[k + 2] * placement.scale;
    result[k + 3] = 0.0F;
  }
}

/// A joint of a posed instance: the mixed matrix, turned and scaled into world axes.
/// @param frames  the joint's matrix in the palette's first frame.
/// @param stride  matrices from one frame to the next.
THRONG_HOST_DEVICE inline void pose_joint(const Pose& pose, const Placement& placement,
                                          const JointMatrix* frames, std::uint32_t stride,
                                          JointMatrix& result) {
  float m[16];
  for (int k = 0; k < 16; ++k) m[k] = mix_pose(pose, frames, stride, k);
  place_matrix(placement, m, result.m);
}

/// A vertex of the bind pose as skinning wants it. 32 bytes.
struct SourceVertex {
  glm::vec3 position_m;
  glm::vec3 normal;
  glm::u8vec4 joint_index;
  glm::u8vec4 joint_weight;  // sums to 255
};
static_assert(sizeof(SourceVertex) == 32);

THRONG_HOST_DEVICE inline glm::vec4 joint_weights(const glm::u8vec4& weight) {
  return glm::vec4(static_cast<float>(weight.x), static_cast<float>(weight.y),
                   static_cast<float>(weight.z), static_cast<float>(weight.w)) *
         (1.0F / 255.0F);
}

struct SkinnedVertex {
  glm::vec3 position_m;  // world axes, from the instance's feet
  glm::vec3 normal;      // world axes, not normalised
};

/// A blended matrix times a vertex.
THRONG_HOST_DEVICE inline SkinnedVertex transform(const float* m, const glm::vec3& p,
                                                  const glm::vec3& n) {
  SkinnedVertex result;
  for (int r = 0; r < 3; ++r) {
    result.position_m[r] = fused(m[r], p.x, fused(m[4 + r], p.y, fused(m[8 + r], p.z, m[12 + r])));
    result.normal[r] = fused(m[r], n.x, fused(m[4 + r], n.y, m[8 + r] * n.z));
  }
  return result;
}

/// Linear blend skinning (equation 2 of Dong & Peng 2019): the weighted sum of the joints'
/// matrices, which starts at zero, times the vertex.
THRONG_HOST_DEVICE inline SkinnedVertex skin(const SourceVertex& source,
                                             const JointMatrix* palette) {
  const glm::vec4 weight = joint_weights(source.joint_weight);
  const float* m0 = palette[source.joint_index.x].m;
  const float* m1 = palette[source.joint_index.y].m;
  const float* m2 = palette[source.joint_index.z].m;
  const float* m3 = palette[source.joint_index.w].m;
  float m[16];
  for (int k = 0; k < 16; ++k) {
    m[k] = fused(weight.w, m3[k], fused(weight.z, m2[k], fused(weight.y, m1[k], weight.x * m0[k])));
  }
  return transform(m, source.position_m, source.normal);
}

}  // namespace throng::render::element
