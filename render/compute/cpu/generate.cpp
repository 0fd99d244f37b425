#include <algorithm>
#include <cstring>

#include "render/compute/cpu/stages.hpp"

namespace throng::render {
namespace {

/// Matrices of the joints that the first `vertex_count` vertices need.
void pose_palette(const CharacterTable& table, const InstanceState& state,
                  std::uint32_t vertex_count, element::JointMatrix* palette) {
  const std::size_t joints = table.character->joint_count();
  const element::Pose& pose = state.pose;
  const element::JointMatrix* a0 = &table.palette[pose.a_frame0 * joints];
  const element::JointMatrix* a1 = &table.palette[pose.a_frame1 * joints];
  const bool is_mixed = pose.b_weight > 0.0F;
  const element::JointMatrix* b0 = is_mixed ? &table.palette[pose.b_frame0 * joints] : a0;
  const element::JointMatrix* b1 = is_mixed ? &table.palette[pose.b_frame1 * joints] : a1;
  const std::uint32_t count = table.joint_count_at[vertex_count];
  for (std::uint32_t k = 0; k < count; ++k) {
    const std::uint32_t j = table.joint_order[k];
    element::pose_joint(pose, state.placement, a0[j], a1[j], b0[j], b1[j], palette[j]);
  }
}

void skin_vertices(const CharacterTable& table, const VisibleInstance& instance,
                   std::uint32_t visible, const element::JointMatrix* palette, BatchVertex* out) {
  const glm::vec3 feet = instance.position_relative;
  for (std::uint32_t i = 0; i < instance.vertex_count; ++i) {
    const element::SkinnedVertex skinned = element::skin(table.vertex[i], palette);
    BatchVertex& vertex = out[i];
    vertex.position_relative = feet + skinned.position_m;
    const std::uint32_t code =
        element::pack_octahedral(skinned.normal.x, skinned.normal.y, skinned.normal.z);
    std::memcpy(&vertex.normal, &code, sizeof code);
    vertex.uv = table.character->uv[i];
    vertex.visible = visible;
  }
}

void write_triangles(const CharacterTable& table, const VisibleInstance& instance,
                     std::uint32_t first_vertex, std::uint32_t* out) {
  const std::uint32_t n = instance.vertex_count;
  const std::span<const std::uint32_t> target = table.character->collapse_target;
  const auto level = std::lower_bound(
      table.ladder.begin(), table.ladder.end(), n,
      [](const LadderLevel& l, std::uint32_t count) { return l.vertex_count < count; });
  const std::size_t corners = std::size_t{3} * instance.triangle_count;
  for (std::size_t k = 0; k < corners; ++k) {
    std::uint32_t corner = level->corner[k];
    while (corner >= n) corner = target[corner];
    out[k] = first_vertex + corner;
  }
}

}  // namespace

void generate(CpuView& view, WorkPool& pool, std::vector<WorkerScratch>& scratch) {
  const std::size_t count = view.visible.size();
  const CpuInstances& instances = *view.instances;
  const CastTable& cast = *instances.cast;
  if (count == 0) return;

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
  for (WorkerScratch& own : scratch) own.palette.resize(cast.most_joints);
  pool.run(chunks, [&](std::size_t chunk, unsigned worker) {
    element::JointMatrix* palette = scratch[worker].palette.data();
    const std::size_t end = first_instance(chunk + 1);
    for (std::size_t v = first_instance(chunk); v < end; ++v) {
      const VisibleInstance& instance = view.visible[v];
      const CharacterTable& table = cast.characters[instance.character];
      pose_palette(table, instances.state[instance.slot], instance.vertex_count, palette);
      skin_vertices(table, instance, static_cast<std::uint32_t>(v), palette,
                    view.vertices.data() + view.vertex_offset[v]);
      write_triangles(table, instance, view.vertex_offset[v],
                      view.indices.data() + std::size_t{3} * view.triangle_offset[v]);
    }
  });
}

}  // namespace throng::render
