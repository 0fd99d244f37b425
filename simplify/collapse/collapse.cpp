#include "simplify/collapse/collapse.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <numeric>

#include "simplify/collapse/decimate.hpp"
#include "simplify/collapse/wedges.hpp"

namespace throng::simplify {
namespace {

/// Turns the record into Dong & Peng's arrays: what stays comes first, then the steps from last to
/// first, so that any prefix of the vertices is a level.
CollapseOrder order_of(const WedgeMesh& mesh) {
  const auto& steps = mesh.steps();
  const auto& removals = mesh.removals();
  const auto vertices = static_cast<std::uint32_t>(mesh.surface().wedge_count());
  const auto triangles = static_cast<std::uint32_t>(mesh.surface().triangles.size());

  CollapseOrder order;
  std::vector<bool> is_removed(vertices, false);
  for (const WedgeMesh::Removal& removal : removals) is_removed[removal.wedge] = true;
  for (std::uint32_t w = 0; w < vertices; ++w) {
    if (!is_removed[w]) order.wedge.push_back(w);
  }
  order.coarsest_count = static_cast<std::uint32_t>(order.wedge.size());
  order.error_m.assign(order.coarsest_count, steps.empty() ? 0.0F : steps.back().error_m);
  std::vector<std::uint32_t> old_target(order.coarsest_count, order.wedge[0]);
  std::vector<bool> is_legal(vertices + 1, false);
  is_legal[order.coarsest_count] = true;
  for (std::size_t s = steps.size(); s-- > 0;) {
    const std::size_t end = s + 1 < steps.size() ? steps[s + 1].first_removal : removals.size();
    for (std::size_t r = steps[s].first_removal; r < end; ++r) {
      order.wedge.push_back(removals[r].wedge);
      old_target.push_back(removals[r].target);
      order.error_m.push_back(steps[s].error_m);
    }
    is_legal[order.wedge.size()] = true;
  }
  std::vector<std::uint32_t> new_index(vertices);
  for (std::uint32_t i = 0; i < vertices; ++i) new_index[order.wedge[i]] = i;
  order.target.resize(vertices);
  for (std::uint32_t i = 0; i < vertices; ++i) {
    order.target[i] = i < order.coarsest_count ? 0 : new_index[old_target[i]];
  }

  // triangles: those that stay, then by death from last to first
  order.triangle.resize(triangles);
  std::iota(order.triangle.begin(), order.triangle.end(), 0U);
  const auto& death = mesh.death();
  std::stable_sort(order.triangle.begin(), order.triangle.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return death[a] > death[b]; });
  order.triangle_count_at.assign(vertices + 1, 0);
  order.legal_count.assign(vertices + 1, 0);
  std::uint32_t count = 0;
  std::size_t step = steps.size();  // steps [0, step) are done at the level
  for (std::uint32_t n = order.coarsest_count; n <= vertices; ++n) {
    if (is_legal[n]) {
      if (n > order.coarsest_count) --step;
      while (count < triangles && death[order.triangle[count]] >= step) ++count;
    }
    order.triangle_count_at[n] = count;
    order.legal_count[n] = is_legal[n] ? n : order.legal_count[n - 1];
  }
  return order;
}

}  // namespace

absl::StatusOr<CollapseOrder> collapse(const Surface& surface, const PoseSet& poses,
                                       const CollapseOptions& options) {
  if (poses.count == 0 ||
      poses.position.size() != std::size_t{poses.count} * surface.points.size() ||
      poses.weight.size() != poses.count) {
    return absl::InvalidArgumentError(
        absl::StrCat("collapse: ", poses.position.size(), " positions in ", poses.count,
                     " poses, must be ", surface.points.size(), " in each"));
  }
  WedgeMesh mesh(surface);
  std::vector<std::string> notes;
  const auto prefers_tones = [&] {
    return !options.prefers_tones || options.prefers_tones(order_of(mesh));
  };
  std::uint32_t toned_count = 0;
  if (auto status = decimate(poses, options, prefers_tones, mesh, toned_count, notes); !status.ok())
    return status;
  CollapseOrder order = order_of(mesh);
  order.toned_count = toned_count;
  order.notes = std::move(notes);
  return order;
}

}  // namespace throng::simplify
