#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/cpu/want_poses.hpp"
#include "render/compute/element/held_pose.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/posed.hpp"
#include "render/compute/element/shared_pose.hpp"

namespace throng::render {
namespace {

void write_triangles(const Kernels& kernels, const CharacterTable& table,
                     const VisibleInstance& instance, std::uint32_t first_vertex,
                     std::uint32_t* scratch, std::uint32_t* out) {
  const auto level = std::lower_bound(
      table.ladder.begin(), table.ladder.end(), instance.vertex_count,
      [](const LadderLevel& l, std::uint32_t count) { return l.vertex_count < count; });
  kernels.corners(level->corner.data(), std::size_t{3} * instance.triangle_count,
                  table.character->collapse_target.data(), level->vertex_count,
                  instance.vertex_count, first_vertex, scratch, out);
}

/// Poses a character's first vertices in its model frame, by columns behind their box.
void make_posed(const Kernels& kernels, const CharacterTable& table, std::uint32_t pose,
                std::uint32_t stride, WorkerScratch& scratch, float* out) {
  const std::uint32_t count = std::min(stride, table.character->vertex_count());
  element::InstanceState state{};
  state.placement = {1.0F, 0.0F, 1.0F};
  state.pose = element::shared_pose(table.gait, pose);
  VisibleInstance instance{};
  instance.vertex_count = count;
  scratch.vertices.resize(stride);
  kernels.pose_palette(table, state, count, scratch.palette.data());
  kernels.skin(table.vertex.data(), instance, 0, scratch.palette.data(), scratch.vertices.data());
  glm::vec3 low(std::numeric_limits<float>::max()), high(-low);
  float* column = out + kPosedHeader;
  for (std::uint32_t i = 0; i < stride; ++i) {
    // beyond the last vertex it stands once more
    const BatchVertex& vertex = scratch.vertices[std::min(i, count - 1)];
    const glm::vec3& p = vertex.position_relative;
    low = glm::min(low, p);
    high = glm::max(high, p);
    for (int k = 0; k < 3; ++k) column[k * stride + i] = p[k];
    std::memcpy(column + 3 * stride + i, &vertex.normal, 4);
  }
  std::fill_n(out, kPosedHeader, 0.0F);
  for (int k = 0; k < 3; ++k) {
    out[k] = low[k];
    out[3 + k] = high[k];
  }
}

/// Sees to it that the bank has every shared agent's mesh.
absl::Status find_meshes(CpuView& view, Machine machine, PosedBank& bank,
                         std::vector<WorkerScratch>& scratch) {
  const std::size_t count = view.visible.size();
  const CpuInstances& instances = *view.instances;
  const CastTable& cast = *instances.cast;
  view.mesh.resize(count);
  const auto wants = want_poses(view, machine, bank, scratch, count, [&](std::size_t v) {
    return view.tier[v] != kOwnPose && view.is_mesh(v);
  });
  if (!wants.ok()) return wants.status();
  const std::vector<PosedBank::Want>& wanted = *wants;
  view.posed = bank.block();
  view.posed_bytes = bank.used_bytes();
  view.posed_meshes = static_cast<std::uint32_t>(wanted.size());
  machine.pool.run((wanted.size() + 15) / 16, [&](std::size_t chunk, unsigned worker) {
    const std::size_t end = std::min(wanted.size(), 16 * (chunk + 1));
    for (std::size_t k = 16 * chunk; k < end; ++k) {
      const std::uint32_t number = wanted[k].mesh;
      const PosedBank::Mesh& mesh = bank.mesh(number);
      make_posed(machine.kernels, cast.characters[number / element::kSharedPoses],
                 number % element::kSharedPoses, mesh.stride, scratch[worker],
                 bank.data() + mesh.first);
    }
  });
  return absl::OkStatus();
}

/// A shared agent in batched form.
void place_posed(const float* posed, std::uint32_t stride, const CharacterTable& table,
                 const element::Placement& placement, const VisibleInstance& instance,
                 std::uint32_t visible, BatchVertex* out) {
  const float* column = posed + kPosedHeader;
  for (std::uint32_t i = 0; i < instance.vertex_count; ++i) {
    const glm::vec3 p(column[i], column[stride + i], column[2 * stride + i]);
    out[i].position_relative =
        element::place_posed(instance.position_relative, placement.cosine_scale,
                             placement.sine_scale, placement.scale, p);
    glm::i16vec2 packed;
    std::memcpy(&packed, column + 3 * stride + i, 4);
    const glm::vec3 n = element::turn_posed(placement.cosine_scale, placement.sine_scale,
                                            placement.scale, element::unpack_octahedral(packed));
    const std::uint32_t code = element::pack_octahedral(n.x, n.y, n.z);
    std::memcpy(&out[i].normal, &code, sizeof code);
    out[i].uv = table.vertex[i].uv;
    out[i].visible = visible;
  }
}

/// Moves the vertices of the frame before, where the pose is not due.
bool move_held(const CpuView& view, std::size_t v, std::uint32_t first_vertex, BatchVertex* out) {
  const VisibleInstance& instance = view.visible[v];
  const element::HeldVertices& held = view.held[instance.slot];
  if (!element::keeps_pose(view.motion, view.distance_m[v], instance, held,
                           view.held_vertices.size())) {
    return false;
  }
  const BatchVertex* from = view.held_vertices.data() + held.first;
  for (std::uint32_t i = 0; i < held.count; ++i) {
    out[first_vertex + i] =
        element::moved_vertex(from[i], instance, held, static_cast<std::uint32_t>(v));
  }
  return true;
}

/// Tells the next frame where this one's vertices are.
void remember_vertices(CpuView& view) {
  if (view.held.empty()) return;
  std::fill(view.held.begin(), view.held.end(), element::HeldVertices{});
  for (std::size_t v = 0; v < view.visible.size(); ++v) {
    const VisibleInstance& instance = view.visible[v];
    const std::uint32_t first = view.vertex_offset[v];
    const std::uint32_t count = view.vertex_offset[v + 1] - first;
    if (count == 0) continue;
    view.held[instance.slot] = {first, count, instance.character, instance.seed,
                                instance.position_relative};
  }
}

}  // namespace

absl::Status generate(CpuView& view, Machine machine, PosedBank& bank, PosedBank& point_bank,
                      std::vector<WorkerScratch>& scratch) {
  const Kernels& kernels = machine.kernels;
  const std::size_t count = view.visible.size();
  const CpuInstances& instances = *view.instances;
  const CastTable& cast = *instances.cast;
  view.shared.resize(view.geometry == GeometryKind::kFused ? count : 0);
  view.posed_meshes = 0;
  view.held_poses.assign(scratch.size(), 0);
  view.splats.resize(0);
  if (count == 0) return absl::OkStatus();

  // chunks of about equal work: vertices, and a share for each instance's palette
  constexpr std::uint64_t kInstanceCost = 24;  // in vertices
  constexpr std::uint64_t kChunkCost = 8192;
  const std::uint64_t cost = view.vertex_offset[count] + kInstanceCost * count;
  const std::size_t chunks = static_cast<std::size_t>(cost / kChunkCost + 1);
  const auto first_instance = [&](std::size_t chunk) {
    const std::uint64_t wanted = cost * chunk / chunks;
    std::size_t low = 0, high = count;
    while (low < high) {
      const std::size_t middle = (low + high) / 2;
      if (view.vertex_offset[middle] + kInstanceCost * middle < wanted) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low;
  };
  for (WorkerScratch& own : scratch) {
    own.palette.resize(cast.most_joints);
    own.corner.resize(cast.most_vertices);
  }
  if (absl::Status status = find_meshes(view, machine, bank, scratch); !status.ok()) return status;
  make_joints(view, machine);
  if (absl::Status status = make_splats(view, machine, point_bank, scratch); !status.ok())
    return status;
  const LevelTable& levels = cast.levels;
  machine.pool.run(chunks, [&](std::size_t chunk, unsigned worker) {
    element::JointMatrix* palette = scratch[worker].palette.data();
    const std::size_t end = first_instance(chunk + 1);
    for (std::size_t v = first_instance(chunk); v < end; ++v) {
      const VisibleInstance& instance = view.visible[v];
      const CharacterTable& table = cast.characters[instance.character];
      if (!view.is_mesh(v)) {
        if (view.geometry == GeometryKind::kFused)
          view.shared[v] = {SharedInstance::kOwn, 0, 0, 0, 0, 0};
        continue;
      }
      if (view.tier[v] != kOwnPose) {
        const PosedBank::Mesh& mesh = bank.mesh(view.mesh[v]);
        // one that stands for several is larger (choose_forms)
        const element::Placement placement =
            element::shared_placement(view.state[v].placement, instance.scale);
        const std::uint32_t level = levels.level_at[instance.character][instance.vertex_count];
        if (view.geometry == GeometryKind::kFused) {
          view.shared[v] = {
              level, mesh.first, mesh.stride, placement.cosine_scale, placement.sine_scale, 0};
          continue;
        }
        place_posed(bank.data() + mesh.first, mesh.stride, table, placement, instance,
                    static_cast<std::uint32_t>(v), view.vertices.data() + view.vertex_offset[v]);
        const Level& lod = levels.levels[level];
        std::uint32_t* index = view.indices.data() + std::size_t{3} * view.triangle_offset[v];
        for (std::uint32_t t = 0; t < lod.triangle_count; ++t) {
          const std::uint32_t corners = levels.corners[lod.first_triangle + t];
          for (int k = 0; k < 3; ++k) *index++ = view.vertex_offset[v] + corner_of(corners, k);
        }
        continue;
      }
      if (view.geometry == GeometryKind::kFused)
        view.shared[v] = {SharedInstance::kOwn, 0, 0, 0, 0, 0};
      if (!view.held.empty() && move_held(view, v, view.vertex_offset[v], view.vertices.data())) {
        ++view.held_poses[worker];
      } else {
        kernels.pose_palette(table, view.state[v], instance.vertex_count, palette);
        kernels.skin(table.vertex.data(), instance, static_cast<std::uint32_t>(v), palette,
                     view.vertices.data() + view.vertex_offset[v]);
      }
      write_triangles(kernels, table, instance, view.vertex_offset[v],
                      scratch[worker].corner.data(),
                      view.indices.data() + std::size_t{3} * view.triangle_offset[v]);
    }
  });
  remember_vertices(view);
  return absl::OkStatus();
}

}  // namespace throng::render
