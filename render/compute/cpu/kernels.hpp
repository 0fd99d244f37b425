#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>

#include "render/compute/cpu/cast_table.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/advance.hpp"
#include "render/compute/element/frustum.hpp"
#include "render/compute/element/speck.hpp"
#include "render/compute/element/visible.hpp"
#include "throng/render/compute.hpp"

namespace throng::render {

/// Instruction sets the inner loops are compiled for. All give the same bits; without the fused
/// multiply-add of kAvx2 each one is a call into the C library, and slow.
enum class KernelLevel { kPlain, kAvx2, kAvx512 };

struct CullJob {
  element::Frustum frustum;
  glm::dvec3 eye_offset_m;
  float far_m;         // 0: nobody is too far
  bool is_near;        // the eye is a place among agents: who stands there is left out
  std::size_t agents;  // slots before the surroundings, which never are
  const CpuInstances* instances;
  std::uint8_t* mask;
  VisibleInstance* visible;
  element::InstanceState* state;
  float* distance_m;
};

struct SplitJob {
  CullJob cull;
  element::SpeckRule rule;
  const std::uint8_t* has_images;  // by character
  Speck* specks;
};
struct PlacedInstance {
  element::InstanceState state;
  glm::vec4 sphere_m;  // offset from the crowd's origin
};
struct Split {
  std::uint32_t listed = 0, specks = 0, left_out = 0;
};

/// The loops that take the time. Ranges are of slots or of visible instances.
struct Kernels {
  /// Writes CpuInstances::place_m.
  void (*advance)(const element::Bracketed& moment, glm::vec4* place_m, std::size_t begin,
                  std::size_t end);

  /// An agent or a piece of the surroundings, and its bounding sphere.
  PlacedInstance (*place)(const CpuInstances& instances, std::size_t slot);

  /// Writes the mask; returns how many are visible.
  std::uint32_t (*cull)(const CullJob& job, std::size_t begin, std::size_t end);

  /// Writes the visible instances of a range of slots from `next` on.
  void (*compact)(const CullJob& job, std::size_t begin, std::size_t end, std::uint32_t next);

  /// The same where some are specks: both lists start at `next` and may end before the next
  /// range's.
  Split (*split)(const SplitJob& job, std::size_t begin, std::size_t end, std::uint32_t next);

  void (*share)(const element::Projection& projection, const VisibleInstance* visible,
                const float* distance_m, std::uint32_t* share, std::size_t begin, std::size_t end);

  /// Matrices of the joints that the first `vertex_count` vertices need.
  void (*pose_palette)(const CharacterTable& table, const element::InstanceState& state,
                       std::uint32_t vertex_count, element::JointMatrix* palette);

  void (*skin)(const TableVertex* vertices, const VisibleInstance& instance, std::uint32_t visible,
               const element::JointMatrix* palette, BatchVertex* out);

  /// Corners `corner[0, count)` of a ladder level with `level_count` vertices, moved to the first
  /// `vertex_count` vertices and counted from `first_vertex`.
  /// @param scratch  [level_count]
  void (*corners)(const std::uint32_t* corner, std::size_t count, const std::uint32_t* target,
                  std::uint32_t level_count, std::uint32_t vertex_count, std::uint32_t first_vertex,
                  std::uint32_t* scratch, std::uint32_t* out);
};

/// The best level this processor has.
KernelLevel best_kernel_level();

/// A level above the best one is replaced by the best one.
const Kernels& kernels(KernelLevel level);

}  // namespace throng::render
