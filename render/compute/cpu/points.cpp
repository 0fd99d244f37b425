#include <algorithm>
#include <cstring>

#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/cpu/want_poses.hpp"
#include "render/compute/element/forms.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/posed.hpp"
#include "render/compute/element/shared_pose.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 256;

/// Poses a character's first points in its model frame, by columns: x, y, z, normal.
void make_posed_points(const Kernels& kernels, const CharacterTable& table, std::uint32_t pose,
                       std::uint32_t stride, WorkerScratch& scratch, float* out) {
  const auto count = std::min(stride, static_cast<std::uint32_t>(table.point.size()));
  element::InstanceState state{};
  state.placement = {1.0F, 0.0F, 1.0F};
  state.pose = element::shared_pose(table.gait, pose);
  VisibleInstance instance{};
  instance.vertex_count = count;
  scratch.vertices.resize(count);
  kernels.pose_palette(table, state, table.character->vertex_count(), scratch.palette.data());
  kernels.skin(table.point.data(), instance, 0, scratch.palette.data(), scratch.vertices.data());
  float* column = out + kPosedHeader;
  std::fill_n(out, kPosedHeader, 0.0F);
  for (std::uint32_t i = 0; i < stride; ++i) {
    const BatchVertex& vertex = scratch.vertices[std::min(i, count - 1)];
    for (std::uint32_t k = 0; k < 3; ++k) {
      column[k * stride + i] = vertex.position_relative[static_cast<int>(k)];
    }
    std::memcpy(column + 3 * stride + i, &vertex.normal, 4);
  }
}

}  // namespace

void choose_points(CpuView& view, float size_px, WorkPool& pool) {
  const std::size_t count = view.representation.size();
  pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      if (view.representation[v] != Representation::kPoints) continue;
      VisibleInstance& instance = view.visible[v];
      const SurfacePoints& points =
          view.instances->cast->characters[instance.character].character->points;
      instance.vertex_count =
          element::points_for(view.projection, view.distance_m[v], instance.radius_m,
                              instance.scale, size_px, points.radius_m.data(), points.count());
      instance.triangle_count = 0;
    }
  });
}

absl::Status make_splats(CpuView& view, Machine machine, PosedBank& bank,
                         std::vector<WorkerScratch>& scratch) {
  const std::size_t count = view.representation.size();
  view.splats.resize(0);
  if (count == 0) return absl::OkStatus();
  const CpuInstances& instances = *view.instances;
  const CastTable& cast = *instances.cast;

  view.splat_offset.resize(count + 1);
  std::uint64_t splats = 0;
  for (std::size_t v = 0; v < count; ++v) {
    view.splat_offset[v] = static_cast<std::uint32_t>(splats);
    if (view.representation[v] == Representation::kPoints) splats += view.visible[v].vertex_count;
    if (splats > kMostSplats) {
      return absl::ResourceExhaustedError("generate: over " + std::to_string(kMostSplats) +
                                          " points; make them larger");
    }
  }
  view.splat_offset[count] = static_cast<std::uint32_t>(splats);
  if (splats == 0) return absl::OkStatus();
  view.splats.resize(splats);
  for (WorkerScratch& own : scratch) own.palette.resize(cast.most_joints);

  // poses that several agents share are made once, and kept
  view.mesh.resize(std::max(count, view.mesh.size()));
  const auto wants = want_poses(view, machine, bank, scratch, count, [&](std::size_t v) {
    return view.representation[v] == Representation::kPoints && view.tier[v] != kOwnPose &&
           view.visible[v].vertex_count != 0;
  });
  if (!wants.ok()) return wants.status();
  const std::vector<PosedBank::Want>& wanted = *wants;
  machine.pool.run((wanted.size() + 15) / 16, [&](std::size_t chunk, unsigned worker) {
    const std::size_t end = std::min(wanted.size(), 16 * (chunk + 1));
    for (std::size_t k = 16 * chunk; k < end; ++k) {
      const std::uint32_t number = wanted[k].mesh;
      const PosedBank::Mesh& mesh = bank.mesh(number);
      make_posed_points(machine.kernels, cast.characters[number / element::kSharedPoses],
                        number % element::kSharedPoses, mesh.stride, scratch[worker],
                        bank.data() + mesh.first);
    }
  });

  machine.pool.run((count + kChunk - 1) / kChunk, [&](std::size_t chunk, unsigned worker) {
    const std::size_t end = std::min(count, (chunk + 1) * kChunk);
    for (std::size_t v = chunk * kChunk; v < end; ++v) {
      if (view.representation[v] != Representation::kPoints) continue;
      const VisibleInstance& instance = view.visible[v];
      const CharacterTable& table = cast.characters[instance.character];
      const SurfacePoints& points = table.character->points;
      const element::InstanceState& state = view.state[v];
      const std::uint32_t n = instance.vertex_count;
      if (n == 0) continue;  // baked without points
      const float radius_m = points.radius_m[n - 1] * instance.scale;
      const PointTone* tone = points.tone.data() + element::first_point_tone(points.count(), n);
      Splat* out = view.splats.data() + view.splat_offset[v];
      if (view.tier[v] == kOwnPose) {
        BatchVertex* vertices =
            (scratch[worker].vertices.resize(n), scratch[worker].vertices.data());
        element::JointMatrix* palette = scratch[worker].palette.data();
        machine.kernels.pose_palette(table, state, table.character->vertex_count(), palette);
        machine.kernels.skin(table.point.data(), instance, static_cast<std::uint32_t>(v), palette,
                             vertices);
        for (std::uint32_t i = 0; i < n; ++i) {
          out[i] = {vertices[i].position_relative,
                    radius_m,
                    vertices[i].normal,
                    tone[i].base,
                    tone[i].regions,
                    static_cast<std::uint32_t>(v)};
        }
        continue;
      }
      const PosedBank::Mesh& mesh = bank.mesh(view.mesh[v]);
      const float* x = bank.data() + mesh.first + kPosedHeader;
      const float *y = x + mesh.stride, *z = y + mesh.stride, *normal = z + mesh.stride;
      for (std::uint32_t i = 0; i < n; ++i) {
        glm::i16vec2 packed;
        std::memcpy(&packed, normal + i, 4);
        out[i] = element::shared_splat(instance.position_relative, state.placement,
                                       glm::vec3(x[i], y[i], z[i]), packed, radius_m, tone[i].base,
                                       tone[i].regions, static_cast<std::uint32_t>(v));
      }
    }
  });
  return absl::OkStatus();
}

}  // namespace throng::render
