#include <algorithm>

#include "render/compute/cpu/work_pool.hpp"
#include "render/compute/element/far_point.hpp"
#include "render/compute/element/visible.hpp"
#include "render/compute/snapshot_columns.hpp"
#include "render/crowd/motion_graph.hpp"
#include "throng/render/density.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 1024;
/// Agents of a vertex are neighbours in the world, not in memory.
constexpr std::size_t kAhead = 16;

/// Splats of all shares, each share's in one go: `write(share, place, feet_relative, out)`.
template <typename Write>
void generate(const FarPlan& plan, std::span<const FarPlace> places, const FarView& view,
              WorkPool& pool, std::vector<Splat>& splats, const Write& write) {
  const std::span<const FarShare> shares = plan.shares();
  const std::size_t chunks = (shares.size() + kChunk - 1) / kChunk;
  std::vector<std::uint64_t> first(chunks + 1, 0);
  for (std::size_t c = 0; c < chunks; ++c) {
    std::uint64_t sum = first[c];
    for (std::size_t i = c * kChunk; i < std::min(shares.size(), (c + 1) * kChunk); ++i) {
      if (places[i].visible != 0) sum += shares[i].points;
    }
    first[c + 1] = sum;
  }
  splats.resize(first[chunks]);
  const glm::dvec3 eye = view.eye_world - view.origin_world;
  pool.run(chunks, [&](std::size_t chunk, unsigned) {
    Splat* out = splats.data() + first[chunk];
    const std::size_t end = std::min(shares.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      const FarPlace& place = places[i];
      if (place.visible == 0) continue;
      write(i, end, glm::vec3(glm::dvec3(place.position_m) - eye), out);
      out += shares[i].points;
    }
  });
}

}  // namespace

void place_far(const FarPlan& plan, const Cast& cast, const Roster* roster, const Bracket& bracket,
               std::int64_t scene_time_us, const CrowdSettings& settings, const FarView& view,
               WorkPool& pool, std::vector<FarPlace>& places) {
  const std::span<const FarShare> shares = plan.shares();
  places.assign(shares.size(), {});
  element::Bracketed moment;
  moment.between = element::between(bracket.older->time_us, bracket.newer->time_us, scene_time_us,
                                    settings.extrapolate_limit_us);
  const Snapshot& shown_snapshot = moment.between.at_newer ? *bracket.newer : *bracket.older;
  moment.shown = columns_of(shown_snapshot, -1);
  moment.newer = columns_of(*bracket.newer, -1);
  moment.same_roster = bracket.older->roster == bracket.newer->roster;
  moment.scene_time_us = scene_time_us;
  const element::SnapshotColumns &shown = moment.shown, &newer = moment.newer;
  const bool same_agents = roster == nullptr || roster == shown_snapshot.roster.get();
  std::vector<element::Gait> gaits;
  for (const CastMember& member : cast.members) gaits.push_back(gait_of(member.character));
  const glm::dvec3 eye = view.eye_world - view.origin_world;
  pool.run((shares.size() + kChunk - 1) / kChunk, [&](std::size_t chunk, unsigned) {
    const std::size_t end = std::min(shares.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      if (i + kAhead < end) {
        const std::uint32_t next = shares[i + kAhead].agent;
        for (const void* line : {static_cast<const void*>(shown.position_m + next),
                                 static_cast<const void*>(shown.heading_rad + next),
                                 static_cast<const void*>(shown.seed + next),
                                 static_cast<const void*>(newer.position_m + next),
                                 static_cast<const void*>(newer.heading_rad + next)}) {
          __builtin_prefetch(line);
        }
      }
      const std::uint32_t slot = shares[i].agent;
      if (slot >= shown.slots || shown.present[slot] == 0) continue;
      if (!same_agents && roster->id[slot] != shown.id[slot]) continue;
      const element::Gait& gait = gaits[shown.character[slot]];
      const element::InstanceState state = element::advance_slot(moment, gait, slot);
      if (view.least_m > 0.0F && element::feet_distance(state.position_m, eye) < view.least_m)
        continue;
      places[i] = {state.position_m, state.heading_rad, element::far_pose(state.pose, gait), 1};
    }
  });
}

void generate_far(const FarPlan& plan, const FarAgents& agents, const CrowdCloud& cloud,
                  std::span<const FarPlace> places, const FarView& view, WorkPool& pool,
                  std::vector<Splat>& splats) {
  const std::span<const FarShare> shares = plan.shares();
  generate(plan, places, view, pool, splats,
           [&](std::size_t i, std::size_t end, const glm::vec3& feet, Splat* out) {
             if (i + kAhead < end) {
               const std::uint32_t next = shares[i + kAhead].agent;
               __builtin_prefetch(agents.colors.data() + std::size_t{4} * next);
               __builtin_prefetch(agents.height_m.data() + next);
             }
             const FarShare& share = shares[i];
             const element::FarFigure figure = element::far_figure(
                 feet, places[i].heading_rad, agents.height_m[share.agent], share.radius);
             const std::uint32_t* colors = agents.colors.data() + std::size_t{4} * share.agent;
             for (std::uint32_t k = 0; k < share.points; ++k) {
               out[k] = element::far_cloud_splat(figure, cloud.position[k], cloud.normal[k],
                                                 colors[cloud.region[k]]);
             }
           });
}

void generate_far(const FarPlan& plan, const FarAgents& agents, const FarFigures& figures,
                  std::span<const FarPlace> places, const FarView& view, WorkPool& pool,
                  std::vector<Splat>& splats) {
  const std::span<const FarShare> shares = plan.shares();
  generate(plan, places, view, pool, splats,
           [&](std::size_t i, std::size_t end, const glm::vec3& feet, Splat* out) {
             if (i + kAhead < end) {
               const std::uint32_t next = shares[i + kAhead].agent;
               __builtin_prefetch(agents.tints.data() + std::size_t{4} * next);
               __builtin_prefetch(agents.height_m.data() + next);
               __builtin_prefetch(agents.member.data() + next);
             }
             const FarShare& share = shares[i];
             const element::FarFigure figure = element::far_figure(
                 feet, places[i].heading_rad, agents.height_m[share.agent], share.radius);
             const element::FarLook look =
                 element::far_look(figure, agents.tints.data() + std::size_t{4} * share.agent);
             const FarFigures::Point* points =
                 figures.points.data() +
                 element::far_first_point(figures.block[agents.member[share.agent]], places[i].pose,
                                          share.points);
             for (std::uint32_t k = 0; k < share.points; ++k) {
               out[k] = element::far_figure_splat(figure, look, points[k]);
             }
           });
}

}  // namespace throng::render
