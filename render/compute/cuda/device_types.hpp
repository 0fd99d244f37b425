#pragma once

#include <cstdint>
#include <glm/glm.hpp>

#include "render/compute/element/advance.hpp"
#include "render/compute/element/far_point.hpp"
#include "render/compute/element/forms.hpp"
#include "render/compute/element/frustum.hpp"
#include "render/compute/element/gait.hpp"
#include "render/compute/element/held_pose.hpp"
#include "render/compute/element/rate_search.hpp"
#include "render/compute/element/selection.hpp"
#include "render/compute/element/shared_pose.hpp"
#include "render/compute/element/skinning.hpp"
#include "render/compute/element/speck.hpp"
#include "render/compute/element/speck_slab.hpp"
#include "render/compute/element/work_sample.hpp"
#include "throng/render/representation.hpp"
#include "throng/render/vertex.hpp"

// What lies in device memory and what the kernels are given. GLM and elements only.
namespace throng::render::cuda {

/// A character's place in the concatenated arrays of the cast.
struct DeviceCharacter {
  element::Gait gait;
  glm::vec4 bounds, gait_bounds;
  std::uint32_t vertex_count = 0;    // C
  std::uint32_t coarsest_count = 0;  // n_min
  std::uint32_t joint_count = 0;
  std::uint32_t first_vertex = 0;    // of vertex, uv, collapse_target
  std::uint32_t first_triangle = 0;  // of triangle
  std::uint32_t first_count = 0;     // of triangle_count_at and legal_count, C + 1 each
  std::uint32_t first_matrix = 0;    // of palette: frame 0, joint 0
  std::uint32_t first_level = 0;     // of level_at, kMostLevelVertices + 1; or kNeverShares
  float height_m = 0.0F;
  std::uint32_t first_point = 0, point_count = 0;  // of point, point_radius_m; 0: baked without
  std::uint32_t first_tone = 0;                    // of point_tone
  std::uint32_t has_relief = 0;
  static constexpr std::uint32_t kNeverShares = 0xffffffffU;
};
inline constexpr std::uint32_t kMostLevelVertices = 1024;

/// A level of detail that agents with shared poses are drawn with (LevelTable).
struct DeviceLevel {
  std::uint32_t vertex_count = 0, triangle_count = 0, first_triangle = 0;
};

/// What a point shows, as PointTone.
struct DevicePointTone {
  std::uint32_t base = 0, regions = 0;
};

/// All characters' sections, one array a kind.
struct DeviceCast {
  const DeviceCharacter* character = nullptr;
  const element::SourceVertex* vertex = nullptr;
  const glm::u16vec2* uv = nullptr;
  const std::uint32_t* collapse_target = nullptr;
  const glm::uvec3* triangle = nullptr;
  const std::uint32_t* triangle_count_at = nullptr;
  const std::uint32_t* legal_count = nullptr;
  const element::JointMatrix* palette = nullptr;
  const DeviceLevel* level = nullptr;
  const std::uint32_t* level_corners = nullptr;  // three vertices in bits 0, 10 and 20
  const std::uint32_t* level_at = nullptr;       // finest level within so many vertices
  const std::uint32_t* error_count = nullptr;    // [characters][element::kErrorSteps] ErrorTable
  const element::SourceVertex* point = nullptr;
  const float* point_radius_m = nullptr;
  const DevicePointTone* point_tone = nullptr;
};

/// What glDrawElementsIndirect takes.
struct DrawCommand {
  std::uint32_t index_count = 0, instance_count = 1, first_index = 0;
  std::int32_t base_vertex = 0;
  std::uint32_t base_instance = 0;
};

/// What the host reads back once a frame.
struct DeviceCounters {
  std::uint32_t visible = 0;      // V, without specks and who is left out
  std::uint32_t surrounding = 0;  // of them no agents
  std::uint64_t vertices = 0, triangles = 0;
  std::uint64_t effective_budget = 0;
  // of them in the batched arrays, by how many instances
  std::uint64_t own_vertices = 0, own_triangles = 0;
  std::uint32_t own = 0, shared = 0;
  std::uint32_t held = 0, held_before = 0;  // poses that were kept, in this frame and the last
  // posed meshes that are wanted, and of them those that are not there
  std::uint64_t all_values = 0, new_values = 0;
  std::uint64_t all_meshes = 0, new_meshes = 0;
  // forms other than meshes
  std::uint32_t specks = 0;
  std::uint64_t left_out = 0;
  std::uint64_t drawn_as[kRepresentations] = {};  // listed agents
  std::uint32_t farthest = 0;                     // of those, the distance's bits
  std::uint32_t palettes = 0;                     // joints to be posed, by how many figures
  std::uint64_t joints = 0, splats = 0;
  std::uint32_t pointed = 0;  // agents drawn as points
  // of the far crowd
  std::uint32_t far_agents = 0, far_points = 0;
  std::uint32_t in_view = 0;  // agents, of whom CullJob::work_size has some
};

struct AdvanceJob {
  DeviceCast cast;
  std::uint32_t first_surrounding = 0, surrounding = 0;  // members of the cast
  element::Bracketed moment;
  glm::vec4* sphere_m = nullptr;            // [I]
  element::InstanceState* state = nullptr;  // [I]
};

struct CullJob {
  element::Frustum frustum;
  glm::dvec3 eye_offset_m{0.0};
  std::uint32_t slots = 0;
  std::uint32_t agents = 0;  // slots from here on are surroundings
  float far_m = 0.0F;        // agents from here on are culled; 0: nobody is too far
  bool is_near = false;      // the eye is a place among agents: who stands there is culled
  const glm::vec4* sphere_m = nullptr;
  const element::InstanceState* state = nullptr;
  std::uint8_t* mask = nullptr;        // [I]
  std::uint32_t* order = nullptr;      // [I] place in the visible list: prefix sum of the mask
  VisibleInstance* visible = nullptr;  // [I], the first V are written
  float* distance_m = nullptr;         // [I]
  DeviceCounters* counters = nullptr;  // [1] visible is written
  // of a frame that is to take some time; null: none is asked for
  element::WorkSize* work_size = nullptr;  // [element::kWorkSamples]
  element::Projection projection;
  const DeviceCharacter* character = nullptr;
};

/// The mixed frame's split of who is seen: the list, specks, and those that others stand for.
struct SplitJob {
  CullJob cull;
  DeviceCast cast;
  element::SpeckRule rule;
  element::Bracketed moment;
  const std::uint8_t* has_images = nullptr;  // by character
  std::uint8_t* fate = nullptr;              // [I] 0: not seen, else 1 + element::SpeckFate
  std::uint32_t* speck_order = nullptr;      // [I] place among the specks
  Speck* specks = nullptr;                   // [I], the first DeviceCounters::specks are written
};

/// On the device from the first deal to the last; nothing of it is read back.
struct SelectSums {
  std::uint64_t shares = 0, least = 0, most = 0;
  element::Deal deal;
  element::RateSearch search;
  element::ErrorSearch error_search;  // of the mixed frame
  std::uint64_t error_vertices = 0;
};

struct SelectJob {
  DeviceCast cast;
  element::Projection projection;
  std::uint64_t vertex_budget = 0;  // N
  bool deal_again = true;           // LodRule::kBudget
  std::uint32_t slots = 0;          // V is at most this
  element::Frustum frustum;
  bool share_poses = false;
  bool fused = false;  // who shares a pose has nothing in the batched arrays
  float pose_error_px = element::kSharedErrorPx;
  FormRule form = FormRule::kMesh;
  MixedForms mixed{};
  float point_size_px = 1.0F;
  std::uint32_t agents = 0;                       // slots from here on are surroundings
  Representation* representation = nullptr;       // [I]; null: all are meshes
  const element::InstanceState* state = nullptr;  // [I]
  VisibleInstance* visible = nullptr;
  const float* distance_m = nullptr;
  std::uint32_t* share = nullptr;           // [I]
  std::uint8_t* tier = nullptr;             // [I] of the shared pose, or kOwnPose
  std::uint32_t* own = nullptr;             // [I] instances in the batched arrays, in any order
  std::uint32_t* vertex_count = nullptr;    // [I+1] 0 from V on
  std::uint32_t* triangle_count = nullptr;  // [I+1]
  SelectSums* sums = nullptr;               // [1]
  DeviceCounters* counters = nullptr;       // [1] visible is known
};

struct AllocateJob {
  std::uint32_t slots = 0;
  const std::uint32_t* vertex_count = nullptr;    // [I+1]
  const std::uint32_t* triangle_count = nullptr;  // [I+1]
  std::uint32_t* vertex_offset = nullptr;         // [I+1]
  std::uint32_t* triangle_offset = nullptr;       // [I+1]
  DrawCommand* command = nullptr;                 // [1] that draws all of them
};

/// A posed mesh; stride 0: it is not there.
struct PosedMesh {
  std::uint32_t first = 0;   // value
  std::uint32_t stride = 0;  // vertices from column to column
};

/// Posed meshes that agents share, M = characters * kSharedPoses of them. They stay from frame to
/// frame; when the room is used up, those of the present frame are made anew.
struct PosedJob {
  DeviceCast cast;
  std::uint32_t slots = 0;
  std::uint32_t meshes = 0;  // M
  std::uint32_t most_joints = 0;
  const VisibleInstance* visible = nullptr;
  const element::InstanceState* state = nullptr;
  const std::uint8_t* tier = nullptr;
  const Representation* representation = nullptr;  // [V]; null: all are meshes
  std::uint32_t* mesh = nullptr;                   // [I] number of the mesh, or kNoMesh
  std::uint32_t* wanted = nullptr;                 // [M] vertices at least
  PosedMesh* table = nullptr;                      // [M]
  std::uint32_t* size = nullptr;                   // [M] values to be made, then where they begin
  std::uint32_t* is_made = nullptr;                // [M] 1, then place in `list`
  std::uint32_t* list = nullptr;                   // [M] meshes to be made
  float* posed = nullptr;                          // values
  DeviceCounters* counters = nullptr;              // [1]
  bool from_scratch = false;                       // forget what is there
  std::uint32_t used = 0, to_make = 0;             // values there before; meshes
  static constexpr std::uint32_t kNoMesh = 0xffffffffU;
};

/// Joints of impostors and the points of who is drawn so. Agents in one pose share their joints:
/// palettes are numbered by agent, then by M = characters * kSharedPoses shared poses.
struct FormsJob {
  DeviceCast cast;
  std::uint32_t slots = 0;
  std::uint32_t poses = 0;  // M; 0: no pose is shared
  std::uint32_t most_joints = 0;
  const VisibleInstance* visible = nullptr;
  const element::InstanceState* state = nullptr;
  const std::uint8_t* tier = nullptr;
  const Representation* representation = nullptr;  // [V]
  JointedInstance* jointed = nullptr;              // [I]
  std::uint32_t* first_joint = nullptr;  // [I+M+1] joints of each palette, then where they begin
  std::uint32_t* palettes = nullptr;     // [I+M] those that are wanted, in any order
  std::uint32_t* first_splat = nullptr;  // [I+1] points of each agent, then where they begin
  std::uint32_t* pointed = nullptr;      // [I] agents with points, in any order
  element::JointMatrix* joints = nullptr;
  Splat* splats = nullptr;
  DeviceCounters* counters = nullptr;       // [1]
  std::uint32_t to_pose = 0, to_point = 0;  // how many there are in the two lists
};

/// Where an agent of the far crowd is and which points are its own.
struct FarPlaced {
  element::FarFigure figure;
  std::uint32_t first_point;  // of a figure's
};

/// The far crowd's points (FarPoints): S shares, A agents.
struct FarJob {
  DeviceCast cast;
  element::Bracketed moment;
  const element::InstanceState* state = nullptr;  // by slot
  glm::dvec3 eye_offset_m{0.0};
  float least_m = 0.0F;
  std::uint32_t shares = 0;           // S; 0: nobody is far
  const FarShare* share = nullptr;    // [S]
  const std::uint64_t* id = nullptr;  // [A] of who was triangulated; null: slots are theirs still
  const float* height_m = nullptr;    // [A]
  const std::uint32_t* colors = nullptr;   // [4 A]
  const std::uint16_t* member = nullptr;   // [A]
  const FarFigurePoint* figure = nullptr;  // null: all have the cloud
  const std::uint32_t* block = nullptr;
  const glm::vec3 *cloud_position = nullptr, *cloud_normal = nullptr;
  const std::uint8_t* cloud_region = nullptr;
  FarPlaced* place = nullptr;      // [S]
  std::uint32_t* first = nullptr;  // [S+1] points of each that is there, then their prefix sum
  std::uint32_t* order = nullptr;  // [S+1] 1 of each that is there, then its place among them
  std::uint32_t agents = 0, points = 0;  // that are there, once that is known
  Splat* splats = nullptr;               // [points]
  Speck* shadows = nullptr;              // [agents]
  DeviceCounters* counters = nullptr;    // [1]
};

struct GenerateJob {
  DeviceCast cast;
  std::uint32_t visible = 0;            // V
  std::uint32_t own = 0;                // blocks: of instances in the batched arrays
  const std::uint32_t* list = nullptr;  // [own] which; null: all visible ones
  const std::uint32_t* mesh = nullptr;  // [V]
  const PosedMesh* table = nullptr;
  const float* posed = nullptr;
  SharedInstance* shared = nullptr;  // [V] of fused geometry; null: batched
  std::uint32_t most_joints = 0;     // of a character, at most 256
  const VisibleInstance* instance = nullptr;
  const element::InstanceState* state = nullptr;
  const std::uint32_t* vertex_offset = nullptr;    // [V+1]
  const std::uint32_t* triangle_offset = nullptr;  // [V+1]
  BatchVertex* vertices = nullptr;
  std::uint32_t* indices = nullptr;
  // MotionUpdate; null: every pose is due
  element::HeldVertices* held = nullptr;  // [I] of the frame before, then of this one
  std::uint32_t slots = 0;                // of `held`
  const BatchVertex* held_vertices = nullptr;
  std::uint64_t held_total = 0;  // of them
  MotionUpdate motion{};
  const float* distance_m = nullptr;   // [V]
  DeviceCounters* counters = nullptr;  // [1] held is written
};

}  // namespace throng::render::cuda
