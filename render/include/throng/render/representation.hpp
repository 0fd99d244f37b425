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

/// What a frame's time goes by.
struct FrameWork {
  enum Part {
    kOwn,             // thousands of agents in a pose of their own
    kOwnVertices,     // millions of vertices of those
    kShared,          // thousands of agents that share one
    kSharedVertices,  // millions
    kSpecks,          // thousands
    kSpeckRows,       // millions: pixels of their heights
    kSpeckPixels,     // millions
    kMeshPixels,      // millions, of all figures but specks
    kMeshEdges,       // millions of pixels along the edges of their triangles
    kParts
  };
  bool known = false;  // false: the backend did not say
  double part[kParts] = {};
};

/// Milliseconds of a frame: fixed_ms, and for each unit of its work. The defaults are of one core
/// with AVX-512, from frames near, middle, far and from above at a fifth to all of full detail's
/// time: edges tell what near figures of few triangles cost beside far ones of many.
struct WorkCost {
  double fixed_ms = 5.0;
  double ms[FrameWork::kParts] = {9.0, 8.0, 0.4, 0.8, 0.1, 150.0, 18.0, 10.0, 80.0};
  double of(const FrameWork& work) const {
    double sum = fixed_ms;
    for (int i = 0; i < FrameWork::kParts; ++i) sum += ms[i] * work.part[i];
    return sum;
  }
};

/// What kMixed goes by: every agent in the cheapest form that is off by at most `error_px`.
///
/// Costs are microseconds of one agent; the defaults were measured with the visibility rasterizer
/// on one core with AVX-512, but for speck_px2_us, which follows from how many slabs there are.
/// With them specks win where they are near enough and meshes everywhere else; on a GPU others may.
struct MixedForms {
  float error_px = 0.5F;  // over 0; meshes get no more vertices than the budget even so
  float mesh_us = 3.0F, mesh_vertex_us = 0.03F;
  float impostor_us = 30.0F, impostor_px2_us = 0.5F;  // px2: of the figure
  // what rigid boxes are off by, as a share of the figure's height (root mean square)
  float impostor_error = 0.012F;
  // The same of slabs. Their coverage is exact where that of other forms is sampled four times a
  // pixel, so that small figures look better in them than at full detail.
  bool specks = true;
  float speck_us = 0.1F, speck_px2_us = 0.02F;
  float speck_error = 0.05F;
  // of those that are less high some stand for all
  float least_px = 1.0F;
  // over 0: error_px is chosen for each frame so that it takes this time by `cost`. Beyond 3 pixels
  // specks get fewer slabs, and more of them stand for others (`coarse_px`).
  double budget_ms = 0.0;
  float least_error_px = 0.05F, most_error_px = 32.0F;
  // with budget_ms, what who is near may be off by at most (near_error_of): no time is won there
  float near_error_px = 1.5F;
  WorkCost cost{};
};

/// Pixels. At an error, the height of a speck's slabs (half a pixel of error and more), and beyond
/// 3 pixels that under which specks stand for others: where a frame's time forces the error to be
/// large, what is blurred by less is not worth drawing.
inline float coarse_px(float error_px) { return error_px > 3.0F ? error_px / 6.0F : 0.5F; }

/// Variable-frequency motion update (Lyu et al., 3.1): who is farther than `distance_m` is posed
/// only every f-th frame and moved as it is in between,
///
///     f = 1 + floor(k (D - distance_m))
///
/// evenly spread over the frames by slot. The paper's own formula is not in our copy; this one is
/// reconstructed from its text. Pictures then depend on the frames before, so it is off by default.
struct MotionUpdate {
  float distance_m = 0.0F;  // 0: every agent in every frame
  float k_per_m = 0.075F;   // 0.05 to 0.1
  std::uint64_t frame = 0;  // rises by one from frame to frame of a view
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

/// Who is so far away that a crowd is drawn as one, in one draw (FarCrowd; Larkin et al.).
struct FarSettings {
  bool enabled = false;
  float distance_m = 0.0F;  // from the eye; 0: where figures are `least_px` high
  float least_px = 16.0F;
  std::uint64_t points = 100'000;  // of all of them together, at least 1
  bool published = false;          // one average shape and sharing by density, as in the paper
  bool wait = true;  // for the triangulation of the moment; else the newest one there is is taken
};

/// An agent that is drawn from its joints, as an impostor or as points. 16 bytes.
struct JointedInstance {
  std::uint32_t first_joint;  // in FrameGeometry::joints
  float cosine_scale, sine_scale;
  std::uint32_t reserved;
};
static_assert(sizeof(JointedInstance) == 16);

}  // namespace throng::render
