#include <algorithm>
#include <limits>

#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/slabs.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/rate_search.hpp"
#include "render/compute/element/shared_pose.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 4096;

class Dealer {
 public:
  Dealer(CpuView& view, WorkPool& pool) : view_(view), pool_(pool) {
    const std::size_t chunks = (view.visible.size() + kChunk - 1) / kChunk;
    view.chunk_sum.resize(chunks);
    view.chunk_least.resize(chunks);
    view.chunk_free.resize(chunks);
  }

  /// Sums over the instances as if dealt with `rate`. Integers, so any order gives the same.
  element::Deal deal(std::uint64_t rate) {
    pool_.for_chunks(view_.visible.size(), kChunk, [&](std::size_t begin, std::size_t end) {
      element::Deal sum;
      for (std::size_t i = begin; i < end; ++i) {
        const VisibleInstance& instance = view_.visible[i];
        const Character& character = character_of(instance);
        const std::uint32_t most = character.vertex_count();
        const std::uint32_t least = character.coarsest_count;
        if (!view_.is_mesh(i)) continue;
        const std::uint32_t dealt = element::deal(rate, view_.share[i], least, most);
        sum.vertices += snapped(i, character, dealt);
        if (dealt != least && dealt != most) sum.free_shares += view_.share[i];
      }
      const std::size_t chunk = begin / kChunk;
      view_.chunk_sum[chunk] = sum.vertices;
      view_.chunk_free[chunk] = sum.free_shares;
    });
    element::Deal total;
    for (std::size_t chunk = 0; chunk < view_.chunk_sum.size(); ++chunk) {
      total.vertices += view_.chunk_sum[chunk];
      total.free_shares += view_.chunk_free[chunk];
    }
    return total;
  }

  void assign(std::uint64_t rate) {
    pool_.for_chunks(view_.visible.size(), kChunk, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        VisibleInstance& instance = view_.visible[i];
        if (!view_.is_mesh(i)) {
          instance.vertex_count = instance.triangle_count = 0;
          continue;
        }
        const Character& character = character_of(instance);
        const std::uint32_t dealt =
            element::deal(rate, view_.share[i], character.coarsest_count, character.vertex_count());
        instance.vertex_count = snapped(i, character, dealt);
        // finer levels are not listed: too many vertices for others to have the same
        if (dealt > LevelTable::kMostVertices) view_.tier[i] = kOwnPose;
        instance.triangle_count = character.triangle_count_at[instance.vertex_count];
      }
    });
  }

  const Character& character_of(const VisibleInstance& instance) const {
    return *view_.instances->cast->characters[instance.character].character;
  }

 private:
  std::uint32_t snapped(std::size_t i, const Character& character, std::uint32_t dealt) const {
    if (view_.tier[i] == kOwnPose || dealt > LevelTable::kMostVertices) {
      return character.legal_count[dealt];
    }
    const LevelTable& table = view_.instances->cast->levels;
    return table.levels[table.level_at[view_.visible[i].character][dealt]].vertex_count;
  }

  CpuView& view_;
  WorkPool& pool_;
};

/// Who shares a pose, and how coarse it may be.
void choose_tiers(CpuView& view, const Selection& selection, WorkPool& pool) {
  const std::size_t count = view.visible.size();
  view.tier.resize(count);
  if (selection.pose_mode == PoseMode::kExact) {
    std::fill_n(view.tier.data(), count, kOwnPose);
    return;
  }
  const element::Frustum frustum = element::frustum_from(view.clip_from_relative);
  const CastTable& cast = *view.instances->cast;
  pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const VisibleInstance& instance = view.visible[i];
      view.tier[i] =
          cast.levels.is_listed[instance.character]
              ? element::shared_tier(instance, view.state[i].pose, view.distance_m[i],
                                     cast.characters[instance.character].character->height_m,
                                     view.projection, frustum, selection.pose_error_px)
              : kOwnPose;
    }
  });
}

}  // namespace

void select(CpuView& view, const Selection& asked, Machine machine) {
  Selection selection = asked;
  view.work = {};
  if (selection.form == FormRule::kMixed && selection.mixed.budget_ms > 0.0) {
    fit_error(view, machine.kernels, selection);
  } else {
    view.error_px = 0.0F;
  }
  selection.mixed.least_px = least_px_of(selection.mixed, selection.mixed.error_px);
  view.speck_detail = 0.5F / slab_px(selection.mixed.error_px);
  if (selection.form == FormRule::kMixed && selection.mixed.specks) {
    MixedForms specks = selection.mixed;
    specks.error_px = speck_error_of(specks, view.projection);
    list_mixed(view, specks, machine.pool, machine.kernels);
  } else {
    list_visible(view, machine.pool, machine.kernels);
  }
  const std::size_t count = view.visible.size();
  view.share.resize(count);
  view.geometry = selection.geometry;
  view.motion = selection.motion;
  choose_tiers(view, selection, machine.pool);
  choose_forms(view, selection, machine.pool);
  if (selection.form == FormRule::kMixed) {
    deal_by_error(view, selection, machine.pool);
    return;
  }
  Dealer dealer(view, machine.pool);

  // equation 1's weights as integers, and the sums that bound the budget
  std::vector<std::uint64_t>& shares = view.chunk_sum;
  std::vector<std::uint64_t>& least = view.chunk_least;
  std::vector<std::uint64_t>& most = view.chunk_free;
  machine.pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    std::uint64_t share_sum = 0, least_sum = 0, most_sum = 0;
    machine.kernels.share(view.projection, view.visible.data(), view.distance_m.data(),
                          view.share.data(), begin, end);
    for (std::size_t i = begin; i < end; ++i) {
      if (!view.is_mesh(i)) continue;
      const Character& character = dealer.character_of(view.visible[i]);
      share_sum += view.share[i];
      least_sum += character.coarsest_count;
      most_sum += character.vertex_count();
    }
    const std::size_t chunk = begin / kChunk;
    shares[chunk] = share_sum;
    least[chunk] = least_sum;
    most[chunk] = most_sum;
  });
  std::uint64_t share_sum = 0, least_sum = 0, most_sum = 0;
  for (std::size_t chunk = 0; chunk < shares.size(); ++chunk) {
    share_sum += shares[chunk];
    least_sum += least[chunk];
    most_sum += most[chunk];
  }

  // a budget beyond the crowd's full detail changes nothing, and this keeps the products in 64 bits
  const std::uint64_t budget =
      std::min<std::uint64_t>(selection.vertex_budget, std::numeric_limits<std::uint32_t>::max());
  view.effective_budget = std::max(selection.vertex_budget, least_sum);
  std::uint64_t rate = element::rate_of(budget, share_sum);
  if (selection.rule == LodRule::kBudget && count > 0) {
    element::RateSearch search =
        element::begin_search(std::max(budget, least_sum), rate, least_sum, most_sum);
    while (!search.done) element::search_on(search, dealer.deal(search.rate));
    rate = search.low;
  }
  dealer.assign(rate);
  choose_points(view, selection.point_size_px, machine.pool);
}

namespace {

/// The vertices of the frame before, for who is moved as it was.
void keep_vertices(CpuView& view) {
  if (!(view.motion.distance_m > 0.0F)) {
    view.held.clear();
    view.held_vertices.resize(0);
    return;
  }
  std::swap(view.vertices, view.held_vertices);
  view.held.resize(view.instances->count);
}

}  // namespace

absl::Status allocate(CpuView& view) {
  const std::size_t count = view.visible.size();
  view.vertex_offset.resize(count + 1);
  view.triangle_offset.resize(count + 1);
  std::uint64_t vertices = 0, triangles = 0;
  for (std::size_t i = 0; i < count; ++i) {
    view.vertex_offset[i] = static_cast<std::uint32_t>(vertices);
    view.triangle_offset[i] = static_cast<std::uint32_t>(triangles);
    if (view.geometry == GeometryKind::kFused && view.tier[i] != kOwnPose) continue;
    if (!view.is_mesh(i)) continue;
    vertices += view.visible[i].vertex_count;
    triangles += view.visible[i].triangle_count;
  }
  if (absl::Status status = check_batch(vertices, triangles); !status.ok()) return status;
  view.vertex_offset[count] = static_cast<std::uint32_t>(vertices);
  view.triangle_offset[count] = static_cast<std::uint32_t>(triangles);
  keep_vertices(view);
  view.vertices.resize(vertices);
  view.indices.resize(3 * triangles);
  return absl::OkStatus();
}

}  // namespace throng::render
