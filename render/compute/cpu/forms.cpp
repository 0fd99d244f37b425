#include <algorithm>
#include <limits>

#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/shared_pose.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 1024;

bool has_joints(Representation form) {
  return form == Representation::kImpostor || form == Representation::kPoints;
}

}  // namespace

void choose_forms(CpuView& view, const Selection& selection, WorkPool& pool) {
  const std::size_t count = view.visible.size();
  if (selection.form == FormRule::kMesh || selection.form == FormRule::kMixed) {
    view.representation.resize(0);
    view.jointed.resize(0);
    view.joints.resize(0);
    return;
  }
  const Representation form =
      selection.form == FormRule::kImpostor ? Representation::kImpostor : Representation::kPoints;
  view.representation.resize(count);
  const std::uint32_t agents = view.instances->count - view.instances->surrounding;
  pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      view.representation[v] = view.visible[v].slot < agents ? form : Representation::kMesh;
    }
  });
}

void make_joints(CpuView& view, Machine machine) {
  const std::size_t count = view.representation.size();
  if (count == 0) return;
  const CpuInstances& instances = *view.instances;
  const CastTable& cast = *instances.cast;
  constexpr std::uint32_t kNobody = std::numeric_limits<std::uint32_t>::max();
  view.jointed.resize(count);
  // agents in one pose have the same joints: who is first finds its place
  view.shared_joints.resize(cast.characters.size() * element::kSharedPoses);
  std::fill_n(view.shared_joints.data(), view.shared_joints.size(), kNobody);
  struct Palette {
    std::uint32_t first;
    std::uint32_t visible;
  };
  std::vector<Palette> palettes;
  std::uint32_t joints = 0;
  for (std::size_t v = 0; v < count; ++v) {
    const VisibleInstance& instance = view.visible[v];
    const element::Placement& placement = instances.state[instance.slot].placement;
    view.jointed[v] = {0, placement.cosine_scale, placement.sine_scale, 0};
    if (!has_joints(view.representation[v])) continue;
    const CharacterTable& table = cast.characters[instance.character];
    std::uint32_t own = kNobody;
    std::uint32_t* first = &own;
    if (view.tier[v] != kOwnPose) {
      first = &view.shared_joints[std::size_t{instance.character} * element::kSharedPoses +
                                  element::shared_pose_of(instances.state[instance.slot].pose,
                                                          table.gait, view.tier[v])];
    }
    if (*first == kNobody) {
      *first = joints;
      joints += table.character->joint_count();
      palettes.push_back({*first, static_cast<std::uint32_t>(v)});
    }
    view.jointed[v].first_joint = *first;
  }
  view.joints.resize(joints);
  machine.pool.run((palettes.size() + 15) / 16, [&](std::size_t chunk, unsigned) {
    const std::size_t end = std::min(palettes.size(), 16 * (chunk + 1));
    for (std::size_t k = 16 * chunk; k < end; ++k) {
      const std::size_t v = palettes[k].visible;
      const VisibleInstance& instance = view.visible[v];
      const CharacterTable& table = cast.characters[instance.character];
      element::InstanceState state = instances.state[instance.slot];
      state.placement = {1.0F, 0.0F, 1.0F};
      if (view.tier[v] != kOwnPose) {
        state.pose = element::shared_pose(
            table.gait, element::shared_pose_of(state.pose, table.gait, view.tier[v]));
      }
      // joints that no vertex needs are not posed, nor looked at
      machine.kernels.pose_palette(table, state, table.character->vertex_count(),
                                   view.joints.data() + palettes[k].first);
    }
  });
}

}  // namespace throng::render
