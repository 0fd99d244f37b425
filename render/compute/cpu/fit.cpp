#include <algorithm>
#include <cmath>

#include "render/compute/cpu/fit.hpp"
#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/slabs.hpp"
#include "render/compute/cpu/speck_table.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/forms.hpp"
#include "render/compute/element/shared_pose.hpp"

namespace throng::render {
namespace {

constexpr double kCalm = 0.02;  // of the time: what is left as it is, so that nothing shimmers

using Sample = WorkSample;

/// Every so many of the visible agents.
WorkSamples sample(const CpuView& view, const MixedForms& mixed, const Kernels& kernels) {
  const CpuInstances& instances = *view.instances;
  const CastTable& cast = *instances.cast;
  WorkSamples samples;
  samples.projection = view.projection;
  samples.every = element::work_step(view.visible_agents);
  samples.sample.reserve(view.visible_agents / samples.every + 1);
  const std::uint32_t agents = instances.count - instances.surrounding;
  std::uint32_t skip = 0;
  for (std::uint32_t slot = 0; slot < agents; ++slot) {
    if (view.mask[slot] == 0 || skip-- != 0) continue;
    skip = samples.every - 1;
    const PlacedInstance placed = kernels.place(instances, slot);
    const CharacterTable& table = cast.characters[placed.state.character];
    Sample one;
    static_cast<element::WorkSize&>(one) =
        element::work_size(view.projection, placed.state, placed.sphere_m,
                           table.character->height_m, view.eye_offset_m);
    one.error = &table.error;
    one.may_be_speck = mixed.specks && view.speck_table != nullptr &&
                       view.speck_table->has_images[one.character] != 0;
    one.may_share = cast.levels.is_listed[one.character];
    samples.sample.push_back(one);
  }
  return samples;
}

FrameWork work_of(const std::vector<Sample>& samples, std::uint32_t every, const WorkSamples& view,
                  const Selection& selection, float error_px) {
  MixedForms mixed = selection.mixed;
  mixed.error_px = error_px;
  const float speck_error_px = speck_error_of(mixed, view.projection);
  const float pose_error_px = pose_error_of(error_px);
  const float least_px = least_px_of(mixed, error_px);
  double sum[FrameWork::kParts] = {};
  for (const Sample& one : samples) {
    const float own_error_px = element::near_error_of(mixed, view.projection, one.height_px);
    const std::uint32_t step = ErrorTable::step_of(own_error_px / (one.px_per_m * one.limit));
    if (one.may_be_speck && one.height_px * one.limit * mixed.speck_error < speck_error_px &&
        mixed.speck_us + mixed.speck_px2_us * one.height_px * one.height_px <
            mixed.mesh_us +
                mixed.mesh_vertex_us * static_cast<float>(one.error->vertex_count[step])) {
      const float kept = std::min(one.height_px / least_px, 1.0F);
      const float height_px = std::max(one.height_px, least_px);
      sum[FrameWork::kSpecks] += kept * kept;
      sum[FrameWork::kSpeckRows] += kept * kept * height_px * 0.5F / slab_px(error_px);
      sum[FrameWork::kSpeckPixels] += kept * kept * (height_px + 1.0F) * (0.4F * height_px + 1.5F);
      continue;
    }
    bool shares = one.may_share && selection.pose_mode == PoseMode::kShared &&
                  one.height_px * element::tier_error(0) < pose_error_px &&
                  one.radius_px < element::kSharedRadiusPx;
    const std::uint32_t vertices = shares ? one.error->shared_count(step, LevelTable::kMostVertices)
                                          : one.error->vertex_count[step];
    shares = shares && vertices <= LevelTable::kMostVertices;
    sum[shares ? FrameWork::kShared : FrameWork::kOwn] += 1.0;
    sum[shares ? FrameWork::kSharedVertices : FrameWork::kOwnVertices] += vertices;
    const float pixels =
        std::min(0.2F * one.height_px * one.height_px, view.projection.viewport_px2);
    sum[FrameWork::kMeshPixels] += pixels;
    sum[FrameWork::kMeshEdges] += std::sqrt(pixels * static_cast<float>(vertices));
  }
  FrameWork work;
  work.known = true;
  constexpr double kUnits[FrameWork::kParts] = {1e-3, 1e-6, 1e-3, 1e-6, 1e-3,
                                                1e-6, 1e-6, 1e-6, 1e-6};
  for (int i = 0; i < FrameWork::kParts; ++i) work.part[i] = every * kUnits[i] * sum[i];
  // pixels behind others are not shaded
  const double viewport_mpx = 1e-6 * view.projection.viewport_px2;
  double& pixels = work.part[FrameWork::kMeshPixels];
  pixels = viewport_mpx * (1.0 - std::exp(-pixels / std::max(viewport_mpx, 1e-6)));
  const double vertices =
      1e6 * (work.part[FrameWork::kOwnVertices] + work.part[FrameWork::kSharedVertices]);
  const auto most = static_cast<double>(selection.vertex_budget);
  if (vertices > most && vertices > 0.0) {
    work.part[FrameWork::kOwnVertices] *= most / vertices;
    work.part[FrameWork::kSharedVertices] *= most / vertices;
    work.part[FrameWork::kMeshEdges] *= std::sqrt(most / vertices);
  }
  return work;
}

}  // namespace

float kept_error(const MixedForms& mixed, float error_px) {
  const float least = std::max(mixed.least_error_px, 1e-4F);
  return std::clamp(error_px, least, std::max(mixed.most_error_px, least));
}

void set_error(Selection& selection, float error_px) {
  selection.mixed.error_px = error_px;
  selection.pose_error_px = pose_error_of(error_px);
}

FrameWork fit_error(const WorkSamples& view, Selection& selection, float& error_px) {
  const MixedForms& mixed = selection.mixed;
  const auto work_at = [&](float at_px) {
    return work_of(view.sample, view.every, view, selection, at_px);
  };
  const float least = kept_error(mixed, 0.0F), most = kept_error(mixed, mixed.most_error_px);
  float chosen = kept_error(mixed, error_px);
  const double now_ms = error_px > 0.0F ? mixed.cost.of(work_at(chosen)) : 0.0;
  if (std::abs(now_ms - mixed.budget_ms) > kCalm * mixed.budget_ms) {
    // more error is never dearer
    float low = least, high = most;
    if (mixed.cost.of(work_at(least)) <= mixed.budget_ms) {
      high = least;
    } else {
      for (int step = 0; step < 14; ++step) {
        const float middle = std::sqrt(low * high);
        (mixed.cost.of(work_at(middle)) > mixed.budget_ms ? low : high) = middle;
      }
    }
    chosen = high;
  }
  set_error(selection, chosen);
  error_px = chosen;
  return work_at(chosen);
}

void fit_error(CpuView& view, const Kernels& kernels, Selection& selection) {
  view.work = fit_error(sample(view, selection.mixed, kernels), selection, view.error_px);
}

}  // namespace throng::render
