#pragma once

#include <cstdint>

// Plain data: .cu files include it.
namespace throng::render {

/// What a visible agent is drawn as in one frame.
enum class Representation : std::uint8_t {
  kNone = 0,      // smaller than a pixel, and chosen by its hash to be left out
  kMesh = 1,      // levels of detail of its mesh
  kImpostor = 2,  // relief impostor: a textured box for each joint (Beacco 2010)
  kPoints = 3,    // surface samples (Lyu et al.)
  kSpeck = 4,     // a few slabs with the mean colours of its surface samples, blended by coverage
};
inline constexpr std::uint32_t kRepresentations = 5;

/// Which agents of a view are drawn as what. kMixed: each in the cheapest form that looks right.
enum class FormRule : std::uint8_t { kMesh, kImpostor, kPoints, kMixed };

/// What kMixed goes by: every agent in the cheapest form that is off by at most `error_px`.
///
/// Costs are microseconds of one agent; the defaults were measured with the visibility rasterizer
/// on one core with AVX-512. With them specks win where they are near enough and meshes everywhere
/// else; on a GPU others may.
struct MixedForms {
  float error_px = 0.5F;  // over 0; meshes get no more vertices than the budget even so
  float mesh_us = 3.0F, mesh_vertex_us = 0.03F;
  float impostor_us = 30.0F, impostor_px2_us = 0.5F;  // px2: of the figure
  // what rigid boxes are off by, as a share of the figure's height (root mean square)
  float impostor_error = 0.012F;
  // The same of slabs. Their coverage is exact where that of other forms is sampled four times a
  // pixel, so that small figures look better in them than at full detail.
  bool specks = true;
  float speck_us = 0.1F, speck_px2_us = 0.005F;
  float speck_error = 0.05F;
  // of those that are less high some stand for all
  float least_px = 1.0F;
};

/// A visible instance of fused geometry. 24 bytes.
struct SharedInstance {
  static constexpr std::uint32_t kOwn = 0xffffffffU;
  std::uint32_t level;   // number within the cast (render/compute/cpu/levels.hpp), or kOwn
  std::uint32_t posed;   // first value in FrameGeometry::posed
  std::uint32_t stride;  // vertices from one column to the next
  float cosine_scale, sine_scale;
  std::uint32_t reserved;
};
static_assert(sizeof(SharedInstance) == 24);

inline constexpr std::uint32_t kPosedHeader = 16;  // values before a posed mesh's columns

/// An agent that is drawn from its joints, as an impostor or as points. 16 bytes.
struct JointedInstance {
  std::uint32_t first_joint;  // in FrameGeometry::joints
  float cosine_scale, sine_scale;
  std::uint32_t reserved;
};
static_assert(sizeof(JointedInstance) == 16);

}  // namespace throng::render
