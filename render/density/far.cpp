#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "render/compute/cpu/work_pool.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/visible.hpp"
#include "render/compute/snapshot_columns.hpp"
#include "render/crowd/motion_graph.hpp"
#include "render/density/samples.hpp"
#include "render/raster/element/color.hpp"
#include "throng/render/density.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 1024;
/// Agents of a vertex are neighbours in the world, not in memory.
constexpr std::size_t kAhead = 16;

/// Which pose of FarFigures is nearest.
std::uint32_t figure_pose(const element::Pose& pose, const element::Gait& gait) {
  const auto is_within = [](const element::ClipRange& clip, std::uint32_t frame) {
    return frame >= clip.first_frame && frame - clip.first_frame < clip.frame_count;
  };
  const element::ClipRange& walk = gait.walk.frame_count != 0 ? gait.walk : gait.run;
  if (!is_within(walk, pose.a_frame0)) return 0;
  if (pose.b_weight > 0.5F && is_within(gait.idle, pose.b_frame0)) return 0;
  const float phase = (static_cast<float>(pose.a_frame0 - walk.first_frame) + pose.a_t) /
                      static_cast<float>(walk.frame_count);
  const auto nearest =
      static_cast<std::uint32_t>(phase * static_cast<float>(FarFigures::kPhases) + 0.5F);
  return 1 + nearest % FarFigures::kPhases;
}

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
      places[i] = {state.position_m, state.heading_rad, figure_pose(state.pose, gait), 1};
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
             const float cosine = std::cos(places[i].heading_rad);
             const float sine = std::sin(places[i].heading_rad);
             const float height_m = agents.height_m[share.agent];
             const std::uint32_t* colors = agents.colors.data() + std::size_t{4} * share.agent;
             for (std::uint32_t k = 0; k < share.points; ++k, ++out) {
               const glm::vec3& q = cloud.position[k];
               const glm::vec3& n = cloud.normal[k];
               out->position_relative = feet + height_m * glm::vec3(q.x * cosine - q.y * sine,
                                                                    q.x * sine + q.y * cosine, q.z);
               // the mean of many shapes has no clear sides: points always face the eye
               out->radius_m = -share.radius * height_m;
               const std::uint32_t code = element::pack_octahedral(n.x * cosine - n.y * sine,
                                                                   n.x * sine + n.y * cosine, n.z);
               std::memcpy(&out->normal, &code, sizeof code);
               out->base = colors[cloud.region[k]];
               out->regions = 0;
               out->visible = kNobody;
             }
           });
}

void generate_far(const FarPlan& plan, const FarAgents& agents, const FarFigures& figures,
                  std::span<const FarPlace> places, const FarView& view, WorkPool& pool,
                  std::vector<Splat>& splats) {
  const std::span<const FarShare> shares = plan.shares();
  generate(
      plan, places, view, pool, splats,
      [&](std::size_t i, std::size_t end, const glm::vec3& feet, Splat* out) {
        if (i + kAhead < end) {
          const std::uint32_t next = shares[i + kAhead].agent;
          __builtin_prefetch(agents.tints.data() + std::size_t{4} * next);
          __builtin_prefetch(agents.height_m.data() + next);
          __builtin_prefetch(agents.member.data() + next);
        }
        const FarShare& share = shares[i];
        const float cosine = std::cos(places[i].heading_rad);
        const float sine = std::sin(places[i].heading_rad);
        const float height_m = agents.height_m[share.agent];
        std::array<glm::vec3, 4> tint;
        for (std::size_t k = 0; k < 4; ++k) {
          tint[k] =
              2.0F * unpacked_color(agents.tints[std::size_t{4} * share.agent + k]);  // halves
        }
        const glm::vec3 to_eye = -glm::normalize(feet);
        const float level = 1.0F - to_eye.z * to_eye.z;  // squared cosine of the eye's elevation
        const FarFigures::Point* points = figures.level(agents.member[share.agent], places[i].pose,
                                                        FarFigures::level_of(share.points));
        for (std::uint32_t k = 0; k < share.points; ++k, ++out) {
          const FarFigures::Point& point = points[k];
          const glm::vec3& q = point.position;
          out->position_relative = feet + height_m * glm::vec3(q.x * cosine - q.y * sine,
                                                               q.x * sine + q.y * cosine, q.z);
          const float radius_m = point.radius * share.radius * height_m;
          out->radius_m = radius_m;
          out->regions = 0;
          if (radius_m < 0.0F && point.squeeze < 1.0F) {
            // of an upright body: the steeper it is looked at, the rounder it is
            const float seen = std::sqrt(point.squeeze * point.squeeze * (1.0F - level) + level);
            out->radius_m = radius_m * seen;
            out->regions = static_cast<std::uint32_t>(255.0F * point.squeeze / seen + 0.5F);
          }
          // what goes round an upright figure shows the eye its sides, the less the steeper it
          // looks
          const float length = glm::length(point.normal);
          const float round = radius_m < 0.0F ? 1.0F - std::min(length, 1.0F) : 0.0F;
          const glm::vec3 n(point.normal.x * cosine - point.normal.y * sine + round * to_eye.x,
                            point.normal.x * sine + point.normal.y * cosine + round * to_eye.y,
                            point.normal.z + round * point.squeeze * to_eye.z);
          const std::uint32_t code = element::pack_octahedral(n.x, n.y, n.z);
          std::memcpy(&out->normal, &code, sizeof code);
          float plain = 1.0F;
          glm::vec3 worn(0.0F);
          for (std::size_t r = 0; r < 4; ++r) {
            const float part = static_cast<float>(point.regions >> (8 * r) & 255U) / 255.0F;
            plain -= part;
            worn += part * tint[r];
          }
          out->base =
              element::pack_color(unpacked_color(point.base) * (std::max(plain, 0.0F) + worn));
          out->visible = kNobody;
        }
      });
}

}  // namespace throng::render
