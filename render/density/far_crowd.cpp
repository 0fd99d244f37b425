#include "throng/render/far_crowd.hpp"

#include <algorithm>
#include <utility>

#include "render/compute/cpu/work_pool.hpp"

namespace throng::render {
namespace {

constexpr std::int64_t kIntervalUs = 500'000;
constexpr float kWalkMps = 2.0F, kLeastWalkedM = 1.0F;
constexpr float kFigureM = 1.75F;
constexpr std::size_t kCrowds = 4;  // that are remembered

}  // namespace

struct FarCrowd::Entry {
  std::weak_ptr<const void> crowd;  // Crowd::identity
  std::unique_ptr<TriangulationWorker> worker;
  std::shared_ptr<const Snapshot> asked;   // last one that the worker was given
  std::shared_ptr<const Snapshot> waited;  // last one that was waited for
  std::shared_ptr<const Triangulation> at_waited;
  std::shared_ptr<const Roster> roster;
  FarAgents agents;
  bool has_figures = false;  // of all of these
};

FarCrowd::FarCrowd(std::shared_ptr<const Cast> cast, CrowdCloud cloud, FarFigures figures,
                   unsigned threads)
    : cast_(std::move(cast)),
      cloud_(std::move(cloud)),
      figures_(std::move(figures)),
      pool_(std::make_unique<WorkPool>(threads)) {}

FarCrowd::~FarCrowd() = default;

absl::StatusOr<std::unique_ptr<FarCrowd>> FarCrowd::make(std::shared_ptr<const Cast> cast,
                                                         unsigned threads) {
  auto cloud = make_crowd_cloud(*cast);
  if (!cloud.ok()) return cloud.status();
  auto figures = begin_far_figures(*cast);
  if (!figures.ok()) return figures.status();
  return std::unique_ptr<FarCrowd>(
      new FarCrowd(std::move(cast), *std::move(cloud), *std::move(figures), threads));
}

float FarCrowd::distance_m(const FarSettings& settings, float px_per_tangent) {
  if (settings.distance_m > 0.0F) return settings.distance_m;
  return kFigureM * px_per_tangent / std::max(settings.least_px, 0.1F);
}

std::shared_ptr<const Triangulation> FarCrowd::triangulation_of(Entry& entry, const Crowd& crowd,
                                                                const Bracket& bracket,
                                                                std::int64_t scene_time_us,
                                                                bool wait) {
  if (wait) {
    const std::int64_t moment = scene_time_us / kIntervalUs * kIntervalUs;
    const std::shared_ptr<const Snapshot> snapshot = crowd.bracket(moment).older;
    if (snapshot != entry.waited || entry.at_waited == nullptr) {
      auto made =
          std::make_shared<Triangulation>(triangulate(snapshot->position_m, snapshot->present));
      made->roster = snapshot->roster;
      made->time_us = snapshot->time_us;
      entry.waited = snapshot;
      entry.at_waited = std::move(made);
    }
    return entry.at_waited;
  }
  if (entry.worker == nullptr) {
    entry.worker =
        std::make_unique<TriangulationWorker>(std::chrono::milliseconds(kIntervalUs / 1000));
  }
  if (entry.asked != bracket.newer) {
    entry.asked = bracket.newer;
    entry.worker->request(bracket.newer);
  }
  auto newest = entry.worker->newest();
  if (newest == nullptr) {  // the first picture of a crowd
    entry.worker->wait();
    newest = entry.worker->newest();
  }
  return newest;
}

absl::Status FarCrowd::generate(const Crowd& crowd, std::int64_t scene_time_us, FarView view,
                                const FarSettings& settings, std::vector<Splat>& splats,
                                std::vector<Speck>& shadows, FarCounters& counters) {
  splats.clear();
  shadows.clear();
  counters = {};
  const Bracket bracket = crowd.bracket(scene_time_us);
  if (bracket.older == nullptr) return absl::OkStatus();
  const std::shared_ptr<const void> identity = crowd.identity();
  std::erase_if(entries_, [](const auto& entry) { return entry->crowd.expired(); });
  auto found = std::find_if(entries_.begin(), entries_.end(),
                            [&](const auto& entry) { return entry->crowd.lock() == identity; });
  if (found == entries_.end()) {
    if (entries_.size() >= kCrowds) entries_.pop_back();
    entries_.push_back(std::make_unique<Entry>());
    found = entries_.end() - 1;
    (*found)->crowd = identity;
  }
  std::rotate(entries_.begin(), found, found + 1);
  Entry& entry = *entries_.front();
  const auto triangulation = triangulation_of(entry, crowd, bracket, scene_time_us, settings.wait);
  if (triangulation->roster == nullptr) return absl::OkStatus();
  if (entry.roster != triangulation->roster) {
    entry.agents = make_far_agents(*cast_, cloud_, *triangulation->roster);
    entry.roster = triangulation->roster;
    entry.has_figures = false;
  }
  if (!settings.published && !entry.has_figures) {
    add_far_figures(*cast_, entry.agents.member, figures_);
    entry.has_figures = true;
  }
  const double age_s = 1e-6 * static_cast<double>(std::abs(scene_time_us - triangulation->time_us));
  view.walked_m = kLeastWalkedM + kWalkMps * static_cast<float>(std::min(age_s, 60.0));
  FarRule rule{PointShare::kVisible, true};
  if (settings.published) rule = {};
  if (absl::Status status =
          plan_.make(*triangulation, entry.agents, cloud_, view, settings.points, rule);
      !status.ok()) {
    return status;
  }
  place_far(plan_, *cast_, triangulation->roster.get(), bracket, scene_time_us, crowd.settings(),
            view, *pool_, places_);
  if (rule.figures) {
    generate_far(plan_, entry.agents, figures_, places_, view, *pool_, splats);
  } else {
    generate_far(plan_, entry.agents, cloud_, places_, view, *pool_, splats);
  }
  counters.visible = plan_.visible();
  const glm::dvec3 eye_m = view.eye_world - view.origin_world;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (places_[i].visible == 0) continue;
    ++counters.drawn;
    Speck shadow{};
    shadow.position_relative = glm::vec3(glm::dvec3(places_[i].position_m) - eye_m);
    shadow.height_m = entry.agents.height_m[plan_.shares()[i].agent];
    shadows.push_back(shadow);
  }
  return absl::OkStatus();
}

}  // namespace throng::render
