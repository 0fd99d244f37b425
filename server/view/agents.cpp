#include "server/view/agents.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "render/compute/element/instance.hpp"

namespace throng::server {
namespace {

using render::Snapshot;
namespace element = render::element;

constexpr double kBodyHeightM = 1.75;
constexpr double kBodyRadiusM = 0.25;
// What a camera that follows an agent looks at: its middle, from near its face.
constexpr double kMiddleM = 1.0, kFaceM = 1.45, kNearM = 1.0, kFarM = 4.0;
constexpr std::uint32_t kMostCells = 96;

/// Calls `visit(slot, sample)` for each agent that is there, placed as `advance` places it.
template <typename Visit>
void for_each(const AgentsAt& agents, const Visit& visit) {
  if (agents.bracket.older == nullptr) return;
  const Snapshot& older = *agents.bracket.older;
  const Snapshot& newer = *agents.bracket.newer;
  const element::Between between = element::between(
      older.time_us, newer.time_us, agents.scene_time_us, agents.extrapolate_limit_us);
  const Snapshot& from = between.at_newer ? newer : older;
  const auto sample_of = [](const Snapshot& snapshot, std::size_t slot) {
    return element::Sample{snapshot.position_m[slot], snapshot.velocity_mps[slot],
                           snapshot.heading_rad[slot], snapshot.speed_mps[slot], 0.0};
  };
  for (std::size_t slot = 0; slot < from.present.size(); ++slot) {
    if (from.present[slot] == 0) continue;
    element::Sample sample = sample_of(from, slot);
    const bool goes_on = !between.at_newer && slot < newer.present.size() &&
                         newer.present[slot] != 0 &&
                         newer.roster->id[slot] == from.roster->id[slot];
    if (goes_on) {
      sample =
          element::interpolate(sample, sample_of(newer, slot), between, from.roster->seed[slot]);
    } else if (between.ahead_s > 0.0F) {
      sample.position_m += sample.velocity_mps * between.ahead_s;
      sample.speed_mps *= between.pace;
    }
    visit(static_cast<std::uint32_t>(slot), sample, from);
  }
}

ShownAgent shown(const AgentsAt& agents, std::uint32_t slot, const element::Sample& sample,
                 const Snapshot& from) {
  ShownAgent agent;
  agent.id = from.roster->id[slot];
  agent.slot = slot;
  agent.position_world = agents.origin_world + glm::dvec3(sample.position_m);
  agent.heading_rad = sample.heading_rad;
  agent.speed_mps = sample.speed_mps;
  agent.scale = from.roster->scale[slot];
  return agent;
}

/// Where a point falls on the picture.
struct Projector {
  Projector(const AgentsAt& agents, const render::Camera& camera, const render::Viewport& viewport)
      : clip_from_relative(render::clip_from_relative(camera, viewport)),
        origin_relative(agents.origin_world - camera.eye_world),
        half_px(0.5 * viewport.width_px, 0.5 * viewport.height_px),
        px_at_one_m(camera.ortho_height_m > 0.0 ? viewport.height_px / camera.ortho_height_m
                                                : half_px.y / std::tan(0.5 * camera.fov_y_rad)),
        is_ortho(camera.ortho_height_m > 0.0) {}

  glm::vec4 clip(const glm::vec3& position_m) const {
    return clip_from_relative *
           glm::vec4(glm::vec3(origin_relative + glm::dvec3(position_m)), 1.0F);
  }
  glm::dvec2 pixel(const glm::vec4& clip) const {
    return {half_px.x * (1.0 + clip.x / clip.w), half_px.y * (1.0 - clip.y / clip.w)};
  }
  double px_per_m(const glm::vec4& clip) const {
    return is_ortho ? px_at_one_m : px_at_one_m / clip.w;
  }
  /// Grows towards the eye.
  static double nearness(const glm::vec4& clip) { return clip.z / clip.w; }

  glm::mat4 clip_from_relative;
  glm::dvec3 origin_relative;
  glm::dvec2 half_px;
  double px_at_one_m;
  bool is_ortho;
};

double distance_to_segment(const glm::dvec2& point, const glm::dvec2& a, const glm::dvec2& b) {
  const glm::dvec2 along = b - a;
  const double square = glm::dot(along, along);
  const double t = square > 0.0 ? std::clamp(glm::dot(point - a, along) / square, 0.0, 1.0) : 0.0;
  return glm::length(point - (a + t * along));
}

}  // namespace

AgentsAt agents_at(const Moment& moment, std::int64_t scene_time_us) {
  const render::CrowdSettings& settings = moment.crowd->settings();
  return {moment.crowd->bracket(scene_time_us), moment.crowd->environment(), scene_time_us,
          settings.origin_world, settings.extrapolate_limit_us};
}

std::optional<WorldBox> box_of(const AgentsAt& agents) {
  std::optional<WorldBox> box;
  for (const Snapshot* snapshot : {agents.bracket.older.get(), agents.bracket.newer.get()}) {
    if (snapshot == nullptr || snapshot->present_count == 0) continue;
    const WorldBox one{agents.origin_world + glm::dvec3(snapshot->low_m),
                       agents.origin_world + glm::dvec3(snapshot->high_m)};
    box = !box.has_value() ? one
                           : WorldBox{glm::min(box->low, one.low), glm::max(box->high, one.high)};
  }
  if (box.has_value()) {
    render::include_environment(agents.environment.get(), agents.origin_world, box->low, box->high);
  }
  return box;
}

WorldBox overview_of(const Moment& moment, const AgentsAt& agents) {
  if (agents.scene_time_us == moment.scene_time_us) return moment.overview;
  const std::optional<WorldBox> box = box_of(agents);
  return box.has_value() ? OverviewBox::around(*box) : moment.overview;
}

std::optional<ShownAgent> find_agent(const AgentsAt& agents, std::uint64_t id) {
  std::optional<ShownAgent> found;
  for_each(agents, [&](std::uint32_t slot, const element::Sample& sample, const Snapshot& from) {
    if (from.roster->id[slot] == id) found = shown(agents, slot, sample, from);
  });
  return found;
}

void follow(const glm::dvec3& position_world, render::Camera& camera) {
  double height_m = kMiddleM;
  if (camera.ortho_height_m <= 0.0) {
    const double away_m = glm::distance(camera.eye_world, camera.target_world);
    height_m += (kFaceM - kMiddleM) * std::clamp((kFarM - away_m) / (kFarM - kNearM), 0.0, 1.0);
  }
  const glm::dvec3 shift = position_world + glm::dvec3(0.0, 0.0, height_m) - camera.target_world;
  camera.target_world += shift;
  camera.eye_world += shift;
}

AgentList list_agents(const AgentsAt& agents, const render::Camera& camera,
                      const render::Viewport& viewport, std::uint32_t most, int channel) {
  AgentList list;
  if (most == 0) return list;
  const Projector projector(agents, camera, viewport);
  struct Seen {
    double nearness;
    std::uint32_t slot;
    glm::vec3 position_m;
  };
  std::vector<Seen> seen;
  const Snapshot* shown_from = nullptr;
  for_each(agents, [&](std::uint32_t slot, const element::Sample& sample, const Snapshot& from) {
    shown_from = &from;
    const glm::vec4 clip = projector.clip(sample.position_m);
    // a little beyond the edges: heads reach in from below
    if (clip.w <= 0.0F || std::abs(clip.x) > 1.2F * clip.w || std::abs(clip.y) > 1.3F * clip.w) {
      return;
    }
    seen.push_back({Projector::nearness(clip), slot, sample.position_m});
  });
  if (seen.size() > most) {
    list.left_out = static_cast<std::uint32_t>(seen.size() - most);
    std::nth_element(seen.begin(), seen.begin() + most, seen.end(),
                     [](const Seen& a, const Seen& b) { return a.nearness > b.nearness; });
    seen.resize(most);
  }
  const std::vector<float>* values = shown_from != nullptr ? shown_from->channel(channel) : nullptr;
  for (const Seen& one : seen) {
    list.ids.push_back(shown_from->roster->id[one.slot]);
    list.position_m.push_back(one.position_m);
    if (values != nullptr) list.values.push_back((*values)[one.slot]);
  }
  return list;
}

std::optional<ShownAgent> pick_agent(const AgentsAt& agents, const render::Camera& camera,
                                     const render::Viewport& viewport, double x_px, double y_px,
                                     double slack_px) {
  const Projector projector(agents, camera, viewport);
  const glm::dvec2 point(x_px, y_px);
  std::optional<ShownAgent> best;
  double best_outside_px = slack_px;  // how far the point is from the best body, 0: on it
  double best_nearness = -1.0;
  for_each(agents, [&](std::uint32_t slot, const element::Sample& sample, const Snapshot& from) {
    const double scale = from.roster->scale[slot];
    const auto height_m = [&](double up_m) {
      return sample.position_m + glm::vec3(0.0F, 0.0F, static_cast<float>(up_m * scale));
    };
    const glm::vec4 low = projector.clip(height_m(kBodyRadiusM));
    const glm::vec4 high = projector.clip(height_m(kBodyHeightM - kBodyRadiusM));
    if (low.w <= 0.0F || high.w <= 0.0F) return;
    const double radius_px = kBodyRadiusM * scale * projector.px_per_m(low);
    const double outside_px = std::max(
        0.0, distance_to_segment(point, projector.pixel(low), projector.pixel(high)) - radius_px);
    const double nearness = Projector::nearness(low);
    const bool better =
        outside_px < best_outside_px ||
        (outside_px == best_outside_px && outside_px < slack_px && nearness > best_nearness);
    if (!better) return;
    best = shown(agents, slot, sample, from);
    best_outside_px = outside_px;
    best_nearness = nearness;
  });
  return best;
}

/// Nothing where the walkable area is known and a cell's middle is not in it.
/// @param corner_m  centre of the first cell, from the crowd's origin.
static void keep_within(const std::vector<std::vector<glm::dvec2>>& rings,
                        const glm::dvec2& corner_m, DensityMap& map) {
  if (rings.empty()) return;
  // in cells; where the rings' sides cross the middle of each row
  std::vector<std::vector<double>> crossings(map.rows);
  for (const std::vector<glm::dvec2>& ring : rings) {
    for (std::size_t i = 0; i + 1 < ring.size(); ++i) {
      glm::dvec2 a = (ring[i] - corner_m) / map.cell_m, b = (ring[i + 1] - corner_m) / map.cell_m;
      if (a.y > b.y) std::swap(a, b);
      const double first = std::max(0.0, std::ceil(a.y)),
                   end = std::min(static_cast<double>(map.rows), std::ceil(b.y));
      for (double row = first; row < end; row += 1.0) {
        crossings[static_cast<std::size_t>(row)].push_back(a.x +
                                                           (b.x - a.x) * (row - a.y) / (b.y - a.y));
      }
    }
  }
  for (std::uint32_t row = 0; row < map.rows; ++row) {
    std::vector<double>& at = crossings[row];
    std::sort(at.begin(), at.end());
    std::size_t before = 0;
    for (std::uint32_t column = 0; column < map.columns; ++column) {
      while (before < at.size() && at[before] <= column) ++before;
      if (before % 2 == 0) map.density[std::size_t{row} * map.columns + column] = 0.0F;
    }
  }
}

DensityMap density_map(const AgentsAt& agents) {
  DensityMap map;
  std::vector<glm::dvec2> points;
  glm::dvec2 low(std::numeric_limits<double>::max()), high(std::numeric_limits<double>::lowest());
  double ground_m = std::numeric_limits<double>::max();
  for_each(agents, [&](std::uint32_t, const element::Sample& sample, const Snapshot&) {
    const glm::dvec2 point(sample.position_m);
    points.push_back(point);
    low = glm::min(low, point);
    high = glm::max(high, point);
    ground_m = std::min(ground_m, static_cast<double>(sample.position_m.z));
  });
  if (points.empty()) return map;

  // The grid stands still while people move a little: it begins and ends on whole cells.
  const double margin_m = 3.0 * kDensitySigmaM;
  const double widest_m = std::max(high.x - low.x, high.y - low.y) + 2.0 * margin_m;
  map.cell_m = 0.5;
  while (widest_m / map.cell_m > kMostCells - 2) map.cell_m *= 2.0;
  const glm::dvec2 first = glm::floor((low - margin_m) / map.cell_m);
  const glm::dvec2 last = glm::ceil((high + margin_m) / map.cell_m);
  map.columns = static_cast<std::uint32_t>(last.x - first.x) + 1;
  map.rows = static_cast<std::uint32_t>(last.y - first.y) + 1;
  const glm::dvec2 corner_m = first * map.cell_m;
  map.low_world = agents.origin_world + glm::dvec3(corner_m, ground_m);
  map.density.assign(std::size_t{map.columns} * map.rows, 0.0F);

  // Each agent adds 1 in all: bilinear counts on the grid, then the Gaussian along both axes.
  for (const glm::dvec2& point : points) {
    const glm::dvec2 at = (point - corner_m) / map.cell_m;
    const auto column = static_cast<std::uint32_t>(at.x), row = static_cast<std::uint32_t>(at.y);
    const double u = at.x - column, v = at.y - row;
    float* cell = &map.density[std::size_t{row} * map.columns + column];
    cell[0] += static_cast<float>((1.0 - u) * (1.0 - v));
    cell[1] += static_cast<float>(u * (1.0 - v));
    cell[map.columns] += static_cast<float>((1.0 - u) * v);
    cell[map.columns + 1] += static_cast<float>(u * v);
  }
  const double sigma_cells = kDensitySigmaM / map.cell_m;
  const int reach = static_cast<int>(std::ceil(3.0 * sigma_cells));
  std::vector<double> weight;
  double sum = 0.0;
  for (int i = -reach; i <= reach; ++i) {
    weight.push_back(std::exp(-0.5 * i * i / (sigma_cells * sigma_cells)));
    sum += weight.back();
  }
  const auto blur = [&](std::size_t lines, std::size_t length, std::size_t line_step,
                        std::size_t step) {
    std::vector<float> line(length);
    for (std::size_t l = 0; l < lines; ++l) {
      float* start = &map.density[l * line_step];
      for (std::size_t i = 0; i < length; ++i) {
        double value = 0.0;
        for (int k = -reach; k <= reach; ++k) {
          const auto at = static_cast<std::ptrdiff_t>(i) + k;
          if (at < 0 || at >= static_cast<std::ptrdiff_t>(length)) continue;
          value += weight[static_cast<std::size_t>(k + reach)] *
                   start[static_cast<std::size_t>(at) * step];
        }
        line[i] = static_cast<float>(value / sum);
      }
      for (std::size_t i = 0; i < length; ++i) start[i * step] = line[i];
    }
  };
  blur(map.rows, map.columns, map.columns, 1);
  blur(map.columns, map.rows, 1, map.columns);
  if (agents.environment != nullptr) {
    keep_within(agents.environment->rings, corner_m, map);
  }
  for (float& density : map.density) {
    density /= static_cast<float>(map.cell_m * map.cell_m);
    map.highest = std::max(map.highest, density);
  }
  return map;
}

}  // namespace throng::server
