#include "simplify/report/sampling.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "simplify/bake/levels.hpp"
#include "simplify/report/hausdorff.hpp"
#include "simplify/report/pose.hpp"

namespace throng::simplify {
namespace {

constexpr std::uint32_t kPlaces = 400;     // on each surface; all frames look at the same ones
constexpr std::uint32_t kLandmarks = 256;  // vertices that tell poses apart

/// Squared distances of a surface's places to another surface.
struct Squares {
  double mean = 0.0;
  float largest = 0.0F;
};

Squares squares(const SurfaceSamples& places, std::span<const glm::vec3> position,
                const TriangleTree& surface) {
  Squares result;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const float distance2 = surface.distance2(places.at(i, position));
    result.mean += static_cast<double>(distance2);
    result.largest = std::max(result.largest, distance2);
  }
  result.mean /= static_cast<double>(std::max<std::size_t>(1, places.size()));
  return result;
}

/// Squared distances over a number of frames.
struct Sum {
  double squares = 0.0;
  float largest2 = 0.0F;
  std::uint32_t frames = 0;
  void add(double mean2, float most2) {
    squares += mean2;
    largest2 = std::max(largest2, most2);
    ++frames;
  }
  SamplingCost::Distance distance() const {
    return {static_cast<float>(std::sqrt(squares / std::max(1U, frames))), std::sqrt(largest2)};
  }
};

struct Level {
  LevelMesh mesh;
  SurfaceSamples places;
  Sum sampled, usual, all;
  double worst2 = -1.0;
};

bool is_gait(const render::Clip& clip) {
  return clip.kind == render::ClipKind::kIdle || clip.kind == render::ClipKind::kWalk ||
         clip.kind == render::ClipKind::kRun;
}

float mean_distance(std::span<const glm::vec3> a, std::span<const glm::vec3> b) {
  float sum_m = 0.0F;
  for (std::size_t i = 0; i < a.size(); ++i) sum_m += glm::distance(a[i], b[i]);
  return sum_m / static_cast<float>(a.size());
}

}  // namespace

absl::StatusOr<SamplingCost> measure_sampling(const render::Character& character,
                                              std::span<const std::uint32_t> pose_frames) {
  const std::size_t palette_frames = character.palette.size() / character.joint_count();
  std::vector<bool> is_sampled(palette_frames);
  for (const std::uint32_t frame : pose_frames) {
    if (frame >= palette_frames) {
      return absl::InvalidArgumentError(absl::StrCat(character.name, ": sampled frame is ", frame,
                                                     ", must be below ", palette_frames,
                                                     "; its cast.json is of another bake"));
    }
    is_sampled[frame] = true;
  }

  SamplingCost cost;
  const LevelMesh full = level_mesh(character, character.vertex_count());
  const SurfaceSamples full_places(character.position, full.triangles, kPlaces, false);
  std::vector<Level> levels;
  for (std::uint32_t i = 1; i < kLevelSpecs.size(); ++i) {
    LevelMesh mesh = level_mesh(character, level_vertices(character, kLevelSpecs[i].share));
    SurfaceSamples places(character.position, mesh.triangles, kPlaces, false);
    levels.push_back({std::move(mesh), std::move(places), {}, {}, {}});
    cost.levels.emplace_back().level = i;
  }

  // Where the poses that levels were made in have the landmarks. Collapse order spreads its first
  // vertices over the whole figure.
  const std::size_t landmarks = std::min(kLandmarks, character.vertex_count());
  std::vector<glm::vec3> known(character.position.begin(),
                               character.position.begin() + static_cast<std::ptrdiff_t>(landmarks));
  for (const std::uint32_t frame : pose_frames) {
    known.resize(known.size() + landmarks);
    pose_positions(character, frame, std::span(known).last(landmarks));
  }

  std::vector<glm::vec3> position(character.position.begin(), character.position.end());
  const auto look = [&](const auto& tell) {
    const TriangleTree full_tree(position, full.triangles);
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const TriangleTree tree(position, levels[i].mesh.triangles);
      const Squares there = squares(full_places, position, tree);
      const Squares back = squares(levels[i].places, position, full_tree);
      tell(i, 0.5 * (there.mean + back.mean), std::max(there.largest, back.largest));
    }
  };
  if (pose_frames.empty())
    look([&](std::size_t i, double mean2, float most2) { levels[i].sampled.add(mean2, most2); });
  const bool has_gait = std::any_of(character.clips.begin(), character.clips.end(), is_gait);
  for (std::uint32_t c = 0; c < character.clips.size(); ++c) {
    const bool is_usual = !has_gait || is_gait(character.clips[c]);
    for (std::uint32_t f = 0; f < character.clips[c].frame_count; ++f) {
      const std::size_t frame = character.clips[c].first_frame + std::size_t{f};
      ++cost.frames;
      cost.usual += is_usual ? 1 : 0;
      pose_positions(character, frame, position);
      look([&](std::size_t i, double mean2, float most2) {
        Level& level = levels[i];
        level.all.add(mean2, most2);
        if (is_usual) level.usual.add(mean2, most2);
        if (is_sampled[frame]) {
          level.sampled.add(mean2, most2);
        } else if (mean2 > level.worst2) {
          level.worst2 = mean2;
          cost.levels[i].worst_left_out = pose_name(character, {c, f});
        }
      });
      if (is_sampled[frame]) {
        ++cost.sampled;
        continue;
      }
      float nearest_m = std::numeric_limits<float>::max();
      for (std::size_t k = 0; k < known.size(); k += landmarks) {
        nearest_m = std::min(nearest_m, mean_distance(std::span(position).first(landmarks),
                                                      std::span(known).subspan(k, landmarks)));
      }
      if (cost.farthest.empty() || nearest_m > cost.farthest_m) {
        cost.farthest_m = nearest_m;
        cost.farthest = pose_name(character, {c, f});
      }
    }
  }
  for (std::size_t i = 0; i < levels.size(); ++i) {
    cost.levels[i].sampled = levels[i].sampled.distance();
    cost.levels[i].usual = levels[i].usual.distance();
    cost.levels[i].all = levels[i].all.distance();
    cost.levels[i].worst_left_out_rms_m =
        static_cast<float>(std::sqrt(std::max(0.0, levels[i].worst2)));
  }
  return cost;
}

}  // namespace throng::simplify
