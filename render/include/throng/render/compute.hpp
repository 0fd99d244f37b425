#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <string>

#include "throng/render/asset.hpp"
#include "throng/render/camera.hpp"
#include "throng/render/crowd.hpp"
#include "throng/render/representation.hpp"
#include "throng/render/vertex.hpp"

namespace throng::render {

class WorkPool;    // render/compute/cpu/work_pool.hpp
struct FarPoints;  // far_points.hpp

enum class BackendKind { kCpu, kCuda };
enum class LodRule { kBudget, kDong2019 };

/// kExact: every agent has its own pose and the vertex count that LOD selection gave it, collapse
/// by collapse; what the other one is compared with. kShared: agents whose pose would be off by
/// less than a quarter of a pixel take the nearest of a cast's fixed poses and the next coarser of
/// its levels of detail; near ones are as in kExact.
enum class PoseMode { kShared, kExact };

/// kBatched: all vertices in one array and all indices in another (the published method). kFused:
/// agents that share a pose are only listed, and the rasterizer makes their vertices in cache.
enum class GeometryKind { kBatched, kFused };

/// What stands around the crowd: members of the cast that are drawn once each, at the crowd's
/// origin (CastMember::environment).
struct Surroundings {
  std::uint32_t first_member = 0, member_count = 0;
};

/// Device copies; each backend derives its own.
struct DeviceSnapshot {
  virtual ~DeviceSnapshot() = default;
};

/// The crowd at one scene time: position, heading, pose, character of every slot [I].
struct Instances {
  virtual ~Instances() = default;
  std::int64_t scene_time_us = 0;
  std::uint32_t count = 0;        // I, slots and then surroundings; an empty slot is never visible
  std::uint32_t present = 0;      // agents there
  std::uint32_t surrounding = 0;  // of I, the last ones
  glm::dvec3 origin_world{0.0};
};

/// One camera's working set: visible list, counts, offsets, buffers. Used by one thread at a time.
struct ViewWork {
  virtual ~ViewWork() = default;
  // agents whose feet are farther from the eye are culled, as the far crowd is drawn otherwise; 0:
  // nobody is
  float far_m = 0.0F;
  // who these are, for a backend that makes their points (makes_far_points): read from `allocate`
  // to `generate`, which put the points before all others; null: nobody
  const FarPoints* far = nullptr;
};

/// LOD selection by equation 1 of Dong & Peng 2019 with w_i = A_i / D_i, alpha = 3.
struct Selection {
  std::uint64_t vertex_budget = 1'000'000;  // N
  float alpha = 3.0F;                       // only 3 is supported: cube roots decide, no pow
  LodRule rule = LodRule::kBudget;          // kBudget deals out again what full instances leave
  PoseMode pose_mode = PoseMode::kExact;
  GeometryKind geometry = GeometryKind::kBatched;
  FormRule form = FormRule::kMesh;  // what the agents are drawn as
  MixedForms mixed{};
  // diameter of the points of who is drawn so; as many points as need not be larger
  float point_size_px = 1.25F;
  // who would be off by more in a shared pose has one of its own
  float pose_error_px = 0.25F;
  MotionUpdate motion = {};     // of agents with vertices of their own
  bool on_device = false;       // leave geometry where it was made; of cuda only
  bool read_instances = false;  // of what is left there, the visible instances are read back
};

struct SpeckTable;  // render/compute/cpu/speck_table.hpp

/// Geometry in the memory of a device; each backend derives its own.
struct DeviceGeometry {
  virtual ~DeviceGeometry() = default;
};

/// What a rasterizer draws: the visible instances [V] and, in batched form, one vertex and one
/// index array for all of them (the single batched buffer). Offsets are exclusive prefix sums in
/// instance order [V+1]. The spans stay valid until the next call on the view they came from.
///
/// In fused form `shared` has an entry for each instance [V]. One whose level is kOwn is in the
/// arrays as above; the others have no vertices there but those of a posed mesh: at `posed` its box
/// (least and largest x y z, and 10 values unused), then columns of `stride` vertices: x, y, z in
/// metres, model frame, and octahedral normals.
///
/// Where `representation` is given, an instance that is not kMesh has nothing in any of these; one
/// that is kImpostor or kPoints has its joints instead: at `first_joint` a matrix for each joint of
/// its character, T * B^-1 of equation 2 in the model frame (column c, row r at 16 joint + 4 c + r;
/// agents that share a pose share them), which cosine_scale and sine_scale turn into world axes.
struct FrameGeometry {
  std::span<const VisibleInstance> instances;      // [V]
  std::span<const std::uint32_t> vertex_offset;    // [V+1]
  std::span<const std::uint32_t> triangle_offset;  // [V+1]
  std::span<const BatchVertex> vertices;           // [vertex_offset[V]]
  std::span<const std::uint32_t> indices;          // [3 * triangle_offset[V]], into vertices
  std::span<const SharedInstance> shared = {};     // [V], empty: batched
  const float* posed = nullptr;
  std::span<const Representation> representation = {};  // [V], empty: all are kMesh
  std::span<const JointedInstance> jointed = {};        // [V] where representation is not empty
  std::span<const float> joints = {};
  std::span<const Splat> splats = {};  // points, of agents and of crowds too far to be listed
  // agents that are not among the instances; those of the runs count, in order
  std::span<const Speck> specks = {};
  std::span<const SpeckRun> speck_runs = {};
  const SpeckTable* speck_table = nullptr;
  float speck_detail = 1.0F;  // rows of slabs, of those that leave nothing to be seen
  // who throws a shadow on the ground and is none of the above: feet and height, image 0
  std::span<const Speck> shadows = {};
  const DeviceGeometry* on_device = nullptr;  // else the spans are empty
};

/// Milliseconds on a device by its own clock, 0 where none is.
struct DeviceTimes {
  double cull_ms = 0, select_ms = 0, allocate_ms = 0;
  double generate_ms = 0;  // of the frame before, as nobody waits for this one's
};

/// Counters of the last frame of a view.
struct ComputeCounters {
  std::uint32_t agents = 0, visible = 0;          // without what stands around
  std::uint32_t drawn_as[kRepresentations] = {};  // visible agents by Representation
  std::uint64_t vertices = 0, triangles = 0;
  std::uint64_t effective_budget = 0;  // max(N, sum of n_min)
  // agents moved as they were (MotionUpdate); of the cuda backend in the frame before
  std::uint32_t held_poses = 0;
  std::uint32_t shared_poses = 0;  // agents that share theirs
  std::uint32_t posed_meshes = 0;  // made for this frame; the rest were there
  FrameWork work{};                // where MixedForms::budget_ms was asked for: an estimate
  float error_px = 0.0F;           // and what was chosen for it
  float farthest_m = 0.0F;         // visible agent that is no speck
  std::uint32_t far_agents = 0;    // of ViewWork::far, in none of the numbers above
  std::uint64_t far_points = 0;    // and their points
  std::uint64_t view_bytes = 0;    // memory of the view
  std::uint64_t posed_bytes = 0;   // of posed meshes, shared by all views
  DeviceTimes device;
};

/// The data-parallel steps of one frame, on the processor or on the GPU.
///
/// World frame: right-handed, +Z up, metres. Matrices are named `to_from_source` and multiply
/// column vectors. Shapes are in brackets: I counts all instances, V the visible ones. What is
/// uploaded is immutable and shared by all views; a ViewWork is one camera's working set and is
/// used by one thread at a time.
///
/// Errors: InvalidArgument for a shape or range the caller broke, FailedPrecondition for a call
/// out of order, ResourceExhausted when memory runs out, Internal for a failed driver call.
/// After an error the ViewWork's results are unspecified; everything else can still be used.
class ComputeBackend {
 public:
  virtual ~ComputeBackend() = default;

  /// Once, before anything else: the characters all snapshots refer to.
  virtual absl::Status upload(std::shared_ptr<const Cast> cast) = 0;

  /// Copies an agent frame to the device, once for all views. Columns are by slot [I].
  virtual absl::StatusOr<std::shared_ptr<const DeviceSnapshot>> upload(
      std::shared_ptr<const Snapshot> snapshot) = 0;

  /// Instances at `scene_time_us`, which lies between the two snapshots or shortly after the newer.
  /// @param channel  index of the channel that colours the agents, -1: none.
  /// @param surroundings  what is drawn beside the agents.
  virtual absl::StatusOr<std::shared_ptr<const Instances>> advance(
      const DeviceSnapshot& older, const DeviceSnapshot& newer, std::int64_t scene_time_us,
      const CrowdSettings& settings, int channel, Surroundings surroundings) = 0;

  virtual absl::StatusOr<std::unique_ptr<ViewWork>> make_view() = 0;

  /// True where the backend takes ViewWork::far.
  virtual bool makes_far_points() const { return false; }

  /// View frustum culling: keeps each instance whose sphere touches all half-spaces (planes are
  /// row sums of the matrix, Gribb & Hartmann 2001). May keep one too many, never one too few.
  virtual absl::Status cull(ViewWork& view, std::shared_ptr<const Instances> instances,
                            const Camera& camera, const Viewport& viewport) = 0;

  /// LOD selection: splits the vertex budget over the visible instances.
  ///
  ///     n_i = clamp(floor(N * w_i^(1/a) / sum_j w_j^(1/a)), n_min, C_i)   (Dong & Peng 2019, eq.
  ///     1)
  ///
  /// snapped down to a legal count. kBudget deals out again what full instances leave (at most 4
  /// rounds) and never exceeds max(N, sum of n_min); kDong2019 stops after the first pass.
  virtual absl::Status select(ViewWork& view, const Selection& selection) = 0;

  /// Exclusive prefix sums of the counts: offsets into the single batched buffer.
  virtual absl::Status allocate(ViewWork& view) = 0;

  /// LOD mesh generation and linear blend skinning (equation 2, the sum starts at zero) into the
  /// batched buffer.
  virtual absl::Status generate(ViewWork& view) = 0;

  virtual FrameGeometry geometry(const ViewWork& view) const = 0;
  virtual ComputeCounters counters(const ViewWork& view) const = 0;

  /// Copies the mask of the last `cull` to `visible` [I]: 1 kept, 0 culled. For tests and tools.
  virtual absl::Status read_visible(const ViewWork& view, std::span<std::uint8_t> visible) = 0;
};

/// kCuda where a device runs it, else kCpu; `why` says what was tried.
BackendKind best_backend(std::string& why);

/// Unavailable when the kind was not built or this machine has no such device.
/// @param threads  of the processor's backend; 0: one for each core.
absl::StatusOr<std::unique_ptr<ComputeBackend>> make_backend(BackendKind kind,
                                                             unsigned threads = 0);

}  // namespace throng::render
