#include <algorithm>

#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"

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

}  // namespace

void generate(CpuView& view, Machine machine, std::vector<WorkerScratch>& scratch) {
  const Kernels& kernels = machine.kernels;
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
  for (WorkerScratch& own : scratch) {
    own.palette.resize(cast.most_joints);
    own.corner.resize(cast.most_vertices);
  }
  machine.pool.run(chunks, [&](std::size_t chunk, unsigned worker) {
    element::JointMatrix* palette = scratch[worker].palette.data();
    const std::size_t end = first_instance(chunk + 1);
    for (std::size_t v = first_instance(chunk); v < end; ++v) {
      const VisibleInstance& instance = view.visible[v];
      const CharacterTable& table = cast.characters[instance.character];
      kernels.pose_palette(table, instances.state[instance.slot], instance.vertex_count, palette);
      kernels.skin(table, instance, static_cast<std::uint32_t>(v), palette,
                   view.vertices.data() + view.vertex_offset[v]);
      write_triangles(kernels, table, instance, view.vertex_offset[v],
                      scratch[worker].corner.data(),
                      view.indices.data() + std::size_t{3} * view.triangle_offset[v]);
    }
  });
}

}  // namespace throng::render
