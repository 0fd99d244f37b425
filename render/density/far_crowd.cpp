#include "throng/render/far_crowd.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "render/compute/cpu/work_pool.hpp"

namespace throng::render {
namespace {

constexpr std::int64_t kIntervalUs = 500'000;
constexpr float kWalkMps = 2.0F, kLeastWalkedM = 1.0F;
constexpr float kFigureM = 1.75F;
constexpr std::size_t kCrowds = 4;  // that are remembered

/// Of what is copied to devices, which several far crowds may share.
std::uint64_t next_version() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

}  // namespace

struct FarCrowd::Entry {
  std::weak_ptr<const void> crowd;  // Crowd::identity
  std::unique_ptr<TriangulationWorker> worker;
  std::shared_ptr<const Snapshot> asked;   // last one that the worker was given
  std::shared_ptr<const Snapshot> waited;  // last one that was waited for
  std::shared_ptr<const Triangulation> at_waited;
  std::shared_ptr<const Roster> roster;
  FarAgents agents;
  std::uint64_t agents_version = 0;
  bool has_figures = false;  // of all of these
};

FarCrowd::FarCrowd(std::shared_ptr<const Cast> cast, CrowdCloud cloud, FarFigures figures,
                   unsigned threads)
    : cast_(std::move(cast)),
      cloud_(std::move(cloud)),
      figures_(std::move(figures)),
      pool_(std::make_unique<WorkPool>(threads)),
      cloud_version_(next_version()) {}

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

absl::StatusOr<std::shared_ptr<const Triangulation>> FarCrowd::make_plan(
    const Crowd& crowd, const Bracket& bracket, std::int64_t scene_time_us, FarView& view,
    const FarSettings& settings) {
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
  auto triangulation = triangulation_of(entry, crowd, bracket, scene_time_us, settings.wait);
  if (triangulation->roster == nullptr) return std::shared_ptr<const Triangulation>();
  if (entry.roster != triangulation->roster) {
    entry.agents = make_far_agents(*cast_, cloud_, *triangulation->roster);
    entry.agents_version = next_version();
    entry.roster = triangulation->roster;
    entry.has_figures = false;
  }
  if (!settings.published && !entry.has_figures) {
    const std::vector<std::uint32_t> before = figures_.block;
    add_far_figures(*cast_, entry.agents.member, figures_);
    if (figures_.block != before || shape_version_ == 0) shape_version_ = next_version();
    entry.has_figures = true;
  }
  const double age_s = 1e-6 * static_cast<double>(std::abs(scene_time_us - triangulation->time_us));
  // in whole steps, so that a plan holds for more than a frame
  view.walked_m = kLeastWalkedM + std::ceil(kWalkMps * static_cast<float>(std::min(age_s, 60.0)));
  Planned wanted{triangulation, view, settings.points, settings.published};
  if (wanted == planned_) return triangulation;
  FarRule rule{PointShare::kVisible, true};
  if (settings.published) rule = {};
  planned_ = {};
  if (absl::Status status =
          plan_.make(*triangulation, entry.agents, cloud_, view, settings.points, rule);
      !status.ok()) {
    return status;
  }
  planned_ = std::move(wanted);
  plan_version_ = next_version();
  return triangulation;
}

absl::StatusOr<const FarPoints*> FarCrowd::plan(const Crowd& crowd, std::int64_t scene_time_us,
                                                FarView view, const FarSettings& settings,
                                                FarCounters& counters) {
  counters = {};
  points_ = {};
  const Bracket bracket = crowd.bracket(scene_time_us);
  if (bracket.older == nullptr) return &points_;
  const auto triangulation = make_plan(crowd, bracket, scene_time_us, view, settings);
  if (!triangulation.ok()) return triangulation.status();
  if (*triangulation == nullptr) return &points_;
  const Entry& entry = *entries_.front();
  points_.shares = plan_.shares();
  points_.most_points = plan_.points();
  points_.shares_version = plan_version_;
  // an even number is the figures' and an odd one the cloud's
  points_.agents_version = 2 * entry.agents_version + (settings.published ? 1 : 0);
  points_.colors = settings.published ? entry.agents.colors : entry.agents.tints;
  if (settings.published) {
    points_.cloud_position = cloud_.position;
    points_.cloud_normal = cloud_.normal;
    points_.cloud_region = cloud_.region;
    points_.shape_version = cloud_version_;
  } else {
    points_.figure = figures_.points;
    points_.block = figures_.block;
    points_.shape_version = shape_version_;
  }
  points_.roster = entry.roster;
  points_.height_m = entry.agents.height_m;
  points_.member = entry.agents.member;
  points_.least_m = view.least_m;
  counters.visible = plan_.visible();
  return &points_;
}

absl::Status FarCrowd::generate(const Crowd& crowd, std::int64_t scene_time_us, FarView view,
                                const FarSettings& settings, std::vector<Splat>& splats,
                                std::vector<Speck>& shadows, FarCounters& counters) {
  splats.clear();
  shadows.clear();
  counters = {};
  const Bracket bracket = crowd.bracket(scene_time_us);
  if (bracket.older == nullptr) return absl::OkStatus();
  const auto triangulation = make_plan(crowd, bracket, scene_time_us, view, settings);
  if (!triangulation.ok()) return triangulation.status();
  if (*triangulation == nullptr) return absl::OkStatus();
  const Entry& entry = *entries_.front();
  place_far(plan_, *cast_, (*triangulation)->roster.get(), bracket, scene_time_us, crowd.settings(),
            view, *pool_, places_);
  if (settings.published) {
    generate_far(plan_, entry.agents, cloud_, places_, view, *pool_, splats);
  } else {
    generate_far(plan_, entry.agents, figures_, places_, view, *pool_, splats);
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
