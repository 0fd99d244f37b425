#include <algorithm>
#include <limits>

#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/forms.hpp"
#include "render/compute/element/shared_pose.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 1024;

bool has_joints(Representation form) {
  return form == Representation::kImpostor || form == Representation::kPoints;
}

/// Vertices that keep agent v within a step of the table; where it shares its pose, of the levels
/// that are listed the next finer one.
std::uint32_t vertices_for(const CpuView& view, std::size_t v, std::uint32_t step) {
  const CastTable& cast = *view.instances->cast;
  const std::uint32_t character = view.visible[v].character;
  const ErrorTable& error = cast.characters[character].error;
  if (view.tier[v] == kOwnPose) return error.vertex_count[step];
  const std::uint32_t wanted = error.shared_count(step, LevelTable::kMostVertices);
  if (wanted > LevelTable::kMostVertices) return wanted;
  const std::vector<std::uint32_t>& level_at = cast.levels.level_at[character];
  // coarsest first: the finest with at most so many, or the next one
  std::uint32_t level = level_at[wanted];
  const std::vector<Level>& levels = cast.levels.levels;
  if (levels[level].vertex_count < wanted && level + 1 < levels.size() &&
      levels[level + 1].character == character) {
    ++level;
  }
  return levels[level].vertex_count;
}

void mix_forms(CpuView& view, const Selection& selection, WorkPool& pool) {
  const std::size_t count = view.visible.size();
  const MixedForms& mixed = selection.mixed;
  const CastTable& cast = *view.instances->cast;
  const std::uint32_t agents = view.instances->count - view.instances->surrounding;
  view.representation.resize(count);
  pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      VisibleInstance& instance = view.visible[v];
      const Character& character = *cast.characters[instance.character].character;
      const float own = element::unit_from_seed(instance.seed, element::kSeedForm);
      const float px_per_m =
          element::form_px_per_m(view.projection, view.distance_m[v], instance.radius_m, own);
      const float height_px = px_per_m * instance.scale * character.height_m;
      const float error_px = element::near_error_of(mixed, view.projection, height_px);
      const std::uint32_t step = ErrorTable::step_of(error_px / px_per_m);
      view.share[v] = step;
      view.representation[v] = Representation::kMesh;
      if (instance.slot >= agents) continue;
      const std::uint32_t vertices = height_px < 1.0F ? 0 : vertices_for(view, v, step);
      view.representation[v] = element::mixed_form(
          mixed, own, height_px, character.relief != nullptr, vertices, instance.scale);
    }
  });
}

}  // namespace

void deal_by_error(CpuView& view, const Selection& selection, WorkPool& pool) {
  const std::size_t count = view.visible.size();
  const std::size_t chunks = (count + kChunk - 1) / kChunk;
  view.chunk_sum.resize(chunks);
  view.chunk_least.resize(chunks);
  const auto count_of = [&](std::size_t v, std::uint32_t coarser) {
    return vertices_for(view, v, std::min(view.share[v] + coarser, ErrorTable::kSteps - 1));
  };
  const auto sum_with = [&](std::uint32_t coarser) {
    pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
      std::uint64_t sum = 0;
      for (std::size_t v = begin; v < end; ++v) {
        if (view.is_mesh(v)) sum += count_of(v, coarser);
      }
      view.chunk_sum[begin / kChunk] = sum;
    });
    std::uint64_t total = 0;
    for (const std::uint64_t each : view.chunk_sum) total += each;
    return total;
  };
  element::ErrorSearch search;
  while (!search.done) {
    element::search_on(search, sum_with(search.coarser), selection.vertex_budget);
  }
  const std::uint32_t low = search.coarser;
  // where a time was asked for, the error that keeps it is the budget
  const std::uint64_t asked = sum_with(low);
  view.effective_budget =
      selection.mixed.budget_ms > 0.0 ? asked : std::max(selection.vertex_budget, asked);
  pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      VisibleInstance& instance = view.visible[v];
      instance.vertex_count = instance.triangle_count = 0;
      if (!view.is_mesh(v)) continue;
      const Character& character = *view.instances->cast->characters[instance.character].character;
      instance.vertex_count = count_of(v, low);
      instance.triangle_count = character.triangle_count_at[instance.vertex_count];
      // finer levels are not listed: too many vertices for others to have the same
      if (instance.vertex_count > LevelTable::kMostVertices) view.tier[v] = kOwnPose;
    }
  });
}

void choose_forms(CpuView& view, const Selection& selection, WorkPool& pool) {
  const std::size_t count = view.visible.size();
  if (selection.form == FormRule::kMixed) {
    mix_forms(view, selection, pool);
    return;
  }
  if (selection.form == FormRule::kMesh) {
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
      const VisibleInstance& instance = view.visible[v];
      const CharacterTable& table = view.instances->cast->characters[instance.character];
      bool has_form = instance.slot < agents;
      // a character that was baked without has its mesh
      if (form == Representation::kImpostor) has_form &= table.character->relief != nullptr;
      if (form == Representation::kPoints) has_form &= !table.point.empty();
      view.representation[v] = has_form ? form : Representation::kMesh;
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
    const element::Placement& placement = view.state[v].placement;
    view.jointed[v] = {0, placement.cosine_scale, placement.sine_scale, 0};
    if (!has_joints(view.representation[v])) continue;
    const CharacterTable& table = cast.characters[instance.character];
    std::uint32_t own = kNobody;
    std::uint32_t* first = &own;
    if (view.tier[v] != kOwnPose) {
      first = &view.shared_joints[std::size_t{instance.character} * element::kSharedPoses +
                                  element::shared_pose_of(view.state[v].pose, table.gait,
                                                          view.tier[v])];
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
      element::InstanceState state = view.state[v];
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
