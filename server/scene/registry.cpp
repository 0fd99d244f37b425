#include "server/scene/registry.hpp"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "throng/render/environment.hpp"

namespace throng::server {
namespace {

constexpr std::size_t kLongestText = 200;  // run_id, producer, channel names and units
constexpr double kFarthestOriginM = 1e9;
constexpr double kHighestRateHz = 10'000.0;

absl::Status check_text(const char* field, const std::string& text) {
  if (text.size() > kLongestText) {
    return absl::InvalidArgumentError(
        absl::StrCat("start.", field, ": it has ", text.size(), " bytes, at most ", kLongestText));
  }
  // It is shown in logs and terminals, where a line break or an escape would forge lines.
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte != 0x7f) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "start.", field, ": byte 0x", absl::Hex(byte, absl::kZeroPad2), " is a control character"));
  }
  return absl::OkStatus();
}

absl::Status check(const StartRequest& request, const Limits& limits) {
  if (absl::Status status = check_crowd_name(request.crowd_name); !status.ok()) return status;
  if (absl::Status status = check_text("run_id", request.run_id); !status.ok()) return status;
  if (absl::Status status = check_text("producer", request.producer); !status.ok()) return status;
  for (int axis = 0; axis < 3; ++axis) {
    const double value = request.origin_world[axis];
    if (!std::isfinite(value) || std::abs(value) > kFarthestOriginM) {
      return absl::InvalidArgumentError(
          absl::StrCat("start.origin: ", value, " m, must be within +-", kFarthestOriginM));
    }
  }
  if (!(request.expected_rate_hz >= 0.0 && request.expected_rate_hz <= kHighestRateHz)) {
    return absl::InvalidArgumentError(absl::StrCat("start.expected_rate_hz: it is ",
                                                   request.expected_rate_hz, ", must be 0 to ",
                                                   kHighestRateHz));
  }
  if (request.channels.size() > limits.max_channels) {
    return absl::ResourceExhaustedError(absl::StrCat("start.channels: ", request.channels.size(),
                                                     ", at most ", limits.max_channels));
  }
  std::set<std::string> names;
  for (const ChannelInfo& channel : request.channels) {
    if (absl::Status status = check_text("channels.name", channel.name); !status.ok())
      return status;
    if (absl::Status status = check_text("channels.unit", channel.unit); !status.ok())
      return status;
    if (channel.name.empty() || !names.insert(channel.name).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("start.channels: '", channel.name, "' is empty or there twice"));
    }
  }
  return absl::OkStatus();
}

absl::Status check_continues(const StartRequest& request, const StartRequest& before) {
  bool same = request.origin_world == before.origin_world && request.seed == before.seed &&
              request.channels.size() == before.channels.size();
  for (std::size_t i = 0; same && i < request.channels.size(); ++i) {
    same = request.channels[i].name == before.channels[i].name;
  }
  if (same) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "start: run '", request.run_id, "' is continued with another origin, seed or channels"));
}

}  // namespace

Moment NamedCrowd::moment(Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  Moment moment;
  moment.crowd = crowd_;
  moment.scene_time_us = clock_.at(now);
  moment.live = owner_ != 0;
  moment.oldest_time_us = crowd_->oldest_time_us();
  WorldBox agents{start_.origin_world, start_.origin_world};
  const std::shared_ptr<const render::Environment> site = crowd_->environment();
  const std::shared_ptr<const render::Snapshot> newest = crowd_->newest();
  if (newest != nullptr) moment.newest_time_us = newest->time_us;
  if (newest != nullptr && newest->present_count > 0) {
    agents.low += glm::dvec3(newest->low_m);
    agents.high += glm::dvec3(newest->high_m);
  } else if (seen_.has_value()) {  // nobody there: wherever somebody was
    agents = *seen_;
  } else if (site != nullptr && !site->pieces.empty()) {  // or will be
    agents = {start_.origin_world + site->low_m, start_.origin_world + site->high_m};
    agents.high.z = agents.low.z;
  }
  render::include_environment(site.get(), start_.origin_world, agents.low, agents.high);
  const bool moves = overview_time_us_ != moment.scene_time_us;
  overview_time_us_ = moment.scene_time_us;
  moment.overview = overview_.follow(agents, now, moves);
  return moment;
}

void NamedCrowd::see(const render::Snapshot& newest) {
  if (newest.present_count == 0) return;
  const WorldBox now{start_.origin_world + glm::dvec3(newest.low_m),
                     start_.origin_world + glm::dvec3(newest.high_m)};
  seen_ = seen_.has_value()
              ? WorldBox{glm::min(seen_->low, now.low), glm::max(seen_->high, now.high)}
              : now;
}

CrowdReport NamedCrowd::report(bool with_area) const {
  CrowdReport report;
  report.name = name_;
  report.viewers = viewers();
  const std::lock_guard lock(mutex_);
  report.run_id = start_.run_id;
  report.producer = start_.producer;
  if (with_area) report.walkable_area_wkt = walkable_area_wkt_;
  report.channels = start_.channels;
  if (std::none_of(report.channels.begin(), report.channels.end(),
                   [](const ChannelInfo& one) { return one.name == render::kSpeedChannelName; })) {
    report.channels.push_back({render::kSpeedChannelName, "m/s"});
  }
  report.live = owner_ != 0;
  report.incomplete_frames = incomplete_frames_;
  if (recording_ != nullptr) report.recorded = recording_->counters();
  const render::CrowdCounters counters = crowd_->counters();
  report.frames = counters.frames;
  report.late_frames = late_frames_ + counters.late_frames + counters.duplicate_frames;
  report.oldest_time_us = crowd_->oldest_time_us();
  report.history_bytes = crowd_->history_bytes();
  report.box = seen_.value_or(WorldBox{start_.origin_world, start_.origin_world});
  if (const std::shared_ptr<const render::Snapshot> newest = crowd_->newest()) {
    report.newest_time_us = newest->time_us;
    report.agents = newest->present_count;
    if (newest->present_count > 0) {
      report.box = {start_.origin_world + glm::dvec3(newest->low_m),
                    start_.origin_world + glm::dvec3(newest->high_m)};
    }
  }
  return report;
}

int NamedCrowd::channel_index(const std::string& channel) const {
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < start_.channels.size(); ++i) {
    if (start_.channels[i].name == channel) return static_cast<int>(i);
  }
  return channel == render::kSpeedChannelName ? render::kSpeedChannel : -1;
}

std::vector<ChannelInfo> NamedCrowd::channels() const {
  const std::lock_guard lock(mutex_);
  return start_.channels;
}

Publication::~Publication() {
  const std::lock_guard lock(crowd_->mutex_);
  if (crowd_->owner_ != id_) return;
  crowd_->owner_ = 0;
  crowd_->on_revoked_ = nullptr;
}

absl::StatusOr<PushOutcome> Publication::push(const render::AgentFrame& frame) {
  std::shared_ptr<render::Crowd> crowd;
  std::shared_ptr<Recording> recording;
  {
    const std::lock_guard lock(crowd_->mutex_);
    if (crowd_->owner_ != id_) return absl::AbortedError("another producer has taken over");
    crowd = crowd_->crowd_;
    recording = crowd_->recording_;
  }
  // The derived columns are computed outside the lock: viewers go on looking meanwhile.
  const std::int64_t time_us = frame.time_us;
  const std::shared_ptr<const render::Snapshot> newest = crowd->newest();
  const bool late = newest != nullptr && time_us <= newest->time_us;
  if (absl::Status status = crowd->push(frame); !status.ok()) return status;
  if (late) return PushOutcome::kLate;
  for (const std::string& name : crowd->take_unknown_motions()) {
    // a producer's words: nothing of them may look like a line of the log
    spdlog::warn("event=unknown_motion crowd={} motion=\"{}\" instead=by_speed", crowd_->name_,
                 absl::CEscape(name));
  }
  if (recording != nullptr) recording->write(frame);
  const std::lock_guard lock(crowd_->mutex_);
  if (crowd_->owner_ == id_) {
    crowd_->clock_.on_frame(time_us, now_());
    crowd_->see(*crowd->newest());
  }
  return PushOutcome::kApplied;
}

void Publication::count_late() {
  const std::lock_guard lock(crowd_->mutex_);
  if (crowd_->owner_ == id_) ++crowd_->late_frames_;
}

void Publication::count_incomplete() {
  const std::lock_guard lock(crowd_->mutex_);
  if (crowd_->owner_ == id_) ++crowd_->incomplete_frames_;
}

absl::Status Publication::set_walkable_area(std::string wkt) {
  if (wkt.size() > max_environment_bytes_) {
    return absl::ResourceExhaustedError(absl::StrCat("environment.walkable_area_wkt: ", wkt.size(),
                                                     " bytes, at most ", max_environment_bytes_));
  }
  absl::StatusOr<std::string> area = render::walkable_area_of(wkt);
  if (!area.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("environment.walkable_area_wkt: ", area.status().message()));
  }
  wkt = *std::move(area);
  std::shared_ptr<render::Crowd> crowd;
  std::shared_ptr<Recording> recording;
  {
    const std::lock_guard lock(crowd_->mutex_);
    if (crowd_->owner_ != id_) return absl::OkStatus();
    crowd = crowd_->crowd_;
    recording = crowd_->recording_;
  }
  if (absl::Status status = environments_->build(crowd_->name(), crowd, wkt); !status.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("environment.walkable_area_wkt: ", status.message()));
  }
  if (recording != nullptr) recording->set_walkable_area(wkt);
  const std::lock_guard lock(crowd_->mutex_);
  if (crowd_->owner_ == id_) crowd_->walkable_area_wkt_ = std::move(wkt);
  return absl::OkStatus();
}

Registry::Registry(std::shared_ptr<const render::Cast> cast, Limits limits, PlayoutSettings playout,
                   Now now, RecordSettings record)
    : cast_(std::move(cast)),
      limits_(limits),
      playout_(playout),
      now_(std::move(now)),
      record_(std::move(record)) {}

absl::StatusOr<std::unique_ptr<Publication>> Registry::start(StartRequest request,
                                                             std::function<void()> on_revoked) {
  if (absl::Status status = check(request, limits_); !status.ok()) return status;
  std::function<void()> revoked;
  std::unique_ptr<Publication> publication;
  std::shared_ptr<Recording> ended;  // let go of outside the locks: it writes what waits
  {
    const std::lock_guard lock(mutex_);
    const auto found = crowds_.find(request.crowd_name);
    if (found != crowds_.end() && found->second->deleted()) {
      // its recording, which is still written, would be given up with that crowd's
      return absl::UnavailableError(
          absl::StrCat("start.crowd_name: '", request.crowd_name, "' is being removed; try again"));
    }
    std::shared_ptr<NamedCrowd> named;
    if (found != crowds_.end()) {
      named = found->second;
    } else if (crowds_.size() >= limits_.max_crowds) {
      return absl::ResourceExhaustedError(absl::StrCat(
          "start.crowd_name: there are ", crowds_.size(), " crowds, at most ", limits_.max_crowds));
    } else {
      named = std::make_shared<NamedCrowd>(request.crowd_name, playout_);
    }

    const std::lock_guard crowd_lock(named->mutex_);
    const bool continues = named->crowd_ != nullptr && !request.run_id.empty() &&
                           named->start_.run_id == request.run_id;
    if (continues) {
      if (absl::Status status = check_continues(request, named->start_); !status.ok()) {
        return status;
      }
    }
    if (named->owner_ != 0 && !request.take_over && !continues) {
      return absl::AlreadyExistsError(absl::StrCat(
          "start.crowd_name: '", request.crowd_name, "' is fed by '", named->start_.producer,
          "'; a producer that takes over (--take-over) ends it"));
    }
    revoked = std::move(named->on_revoked_);
    named->on_revoked_ = std::move(on_revoked);
    named->owner_ = ++last_publication_;
    if (continues) {
      named->start_ = std::move(request);
    } else {
      ended = std::move(named->recording_);
      begin_run(*named, std::move(request));
    }
    publication.reset(
        new Publication(now_, limits_.max_environment_bytes, environments_, named, named->owner_));
    crowds_[named->name()] = named;
  }
  // Outside the locks: it ends a stream, which may let go of that stream's publication.
  if (revoked) revoked();
  return publication;
}

void Registry::begin_run(NamedCrowd& named, StartRequest request) {
  render::CrowdSettings settings;
  settings.origin_world = request.origin_world;
  settings.seed = request.seed;
  settings.history_limit_bytes = limits_.max_history_bytes_per_crowd;
  trajectory::RecordingSpec spec{
      request.crowd_name,
      request.run_id,
      request.producer,
      {request.origin_world.x, request.origin_world.y, request.origin_world.z},
      request.seed,
      request.expected_rate_hz,
      {},
      {}};
  for (const ChannelInfo& channel : request.channels) {
    settings.channel_names.push_back(channel.name);
    spec.channel_names.push_back(channel.name);
    spec.channel_units.push_back(channel.unit);
  }
  named.recording_ = nullptr;
  if (!record_.folder.empty()) {
    named.recording_ = std::make_shared<Recording>(record_, std::move(spec));
  }
  // A Crowd of its own for each run: a frame that is being drawn keeps the old one alive.
  named.crowd_ = std::make_shared<render::Crowd>(cast_, std::move(settings));
  named.clock_.start(request.expected_rate_hz);
  named.overview_.forget();
  named.seen_.reset();
  named.walkable_area_wkt_.clear();
  named.incomplete_frames_ = 0;
  named.late_frames_ = 0;
  named.start_ = std::move(request);
}

void Registry::resume() {
  for (const std::string& name : trajectory::recorded_crowds(record_.folder)) {
    const std::lock_guard lock(mutex_);
    if (crowds_.count(name) != 0 || !check_crowd_name(name).ok()) continue;
    if (crowds_.size() >= limits_.max_crowds) {
      spdlog::warn("event=not_resumed crowd={} why=\"{} crowds, which is the limit\"", name,
                   crowds_.size());
      continue;
    }
    absl::Status status = resume_crowd(name);
    if (!status.ok()) {
      spdlog::warn("event=not_resumed crowd={} why=\"{}\"", name, std::string(status.message()));
    }
  }
}

absl::Status Registry::resume_crowd(const std::string& name) {
  auto named = std::make_shared<NamedCrowd>(name, playout_);
  const std::lock_guard lock(named->mutex_);
  std::shared_ptr<render::Membership> membership;
  render::AgentFrame pushed;
  const auto take = [&](const trajectory::RecordingSpec& spec, const trajectory::Frame& frame,
                        const trajectory::Reader& reader) -> absl::Status {
    if (named->crowd_ == nullptr) {
      StartRequest request;
      request.crowd_name = name;
      request.run_id = spec.run_id;
      request.producer = spec.producer;
      request.origin_world = {spec.origin_m[0], spec.origin_m[1], spec.origin_m[2]};
      request.seed = spec.seed;
      request.expected_rate_hz = spec.rate_hz;
      for (std::size_t i = 0; i < spec.channel_names.size(); ++i) {
        request.channels.push_back(
            {spec.channel_names[i], i < spec.channel_units.size() ? spec.channel_units[i] : ""});
      }
      if (absl::Status status = check(request, limits_); !status.ok()) return status;
      begin_run(*named, std::move(request));
    }
    const std::size_t agents = frame.ids.size();
    if (membership == nullptr || membership->ids != frame.ids) {
      membership = std::make_shared<render::Membership>();
      membership->ids = frame.ids;
      bool has_names = false;
      for (const std::uint64_t id : frame.ids) {
        membership->names.push_back(reader.agent_name(id));
        has_names = has_names || !membership->names.back().empty();
      }
      if (!has_names) membership->names.clear();
      membership->characters = trajectory::chosen_characters(reader, frame, cast_->members.size());
      pushed.membership = membership;
    }
    pushed.time_us = frame.time_us;
    pushed.position_m.resize(agents);
    const glm::dvec3& origin = named->start_.origin_world;
    for (std::size_t i = 0; i < agents; ++i) {
      const double z = frame.z_m.empty() ? 0.0 : frame.z_m[i];
      pushed.position_m[i] = glm::vec3(glm::dvec3(frame.x_m[i], frame.y_m[i], z) - origin);
    }
    pushed.heading_rad = frame.heading_rad;
    pushed.channels = frame.channels;
    pushed.motion = frame.motion;
    pushed.motion_names = reader.info().motion_names;
    absl::Status status = named->crowd_->push(pushed);
    if (status.ok()) named->see(*named->crowd_->newest());
    return status;
  };
  const absl::StatusOr<trajectory::RecordedRun> run =
      trajectory::read_last_run(record_.folder, name, limits_.max_history_bytes_per_crowd, take);
  if (!run.ok()) return run.status();
  for (const std::string& note : run->notes) {
    spdlog::warn("event=resumed_without crowd={} what=\"{}\"", name, note);
  }
  // Now that its end is known.
  if (named->recording_ != nullptr) {
    named->recording_ = std::make_shared<Recording>(record_, run->spec, run->end);
    if (!run->walkable_area_wkt.empty()) {
      named->recording_->set_walkable_area(run->walkable_area_wkt);
    }
  }
  named->clock_.on_frame(pushed.time_us, now_());
  if (!run->walkable_area_wkt.empty()) {
    absl::Status status = environments_->build(name, named->crowd_, run->walkable_area_wkt);
    if (status.ok()) {
      named->walkable_area_wkt_ = run->walkable_area_wkt;
    } else {
      spdlog::warn("event=resumed_without crowd={} what=\"{}\"", name,
                   std::string(status.message()));
    }
  }
  spdlog::info("event=resumed crowd={} frames={} newest_s={:.3f} run_id={}", name, run->frames,
               1e-6 * static_cast<double>(pushed.time_us), run->spec.run_id);
  crowds_[name] = named;
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<NamedCrowd>> Registry::find(const std::string& name) const {
  if (absl::Status status = check_crowd_name(name); !status.ok()) return status;
  const std::lock_guard lock(mutex_);
  const auto found = crowds_.find(name);
  if (found == crowds_.end() || found->second->deleted()) {
    return absl::NotFoundError(absl::StrCat("there is no crowd '", name, "'"));
  }
  return found->second;
}

std::vector<CrowdReport> Registry::list() const {
  std::vector<std::shared_ptr<NamedCrowd>> crowds;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [name, crowd] : crowds_) {
      if (!crowd->deleted()) crowds.push_back(crowd);
    }
  }
  std::vector<CrowdReport> reports;
  reports.reserve(crowds.size());
  for (const std::shared_ptr<NamedCrowd>& crowd : crowds) reports.push_back(crowd->report(false));
  return reports;
}

absl::Status Registry::remove(const std::string& name) {
  if (absl::Status status = check_crowd_name(name); !status.ok()) return status;
  std::shared_ptr<NamedCrowd> removed;
  std::shared_ptr<Recording> recording;
  {
    const std::lock_guard lock(mutex_);
    const auto found = crowds_.find(name);
    if (found == crowds_.end() || found->second->deleted()) {
      return absl::NotFoundError(absl::StrCat("there is no crowd '", name, "'"));
    }
    const std::lock_guard crowd_lock(found->second->mutex_);
    if (found->second->owner_ != 0) {
      return absl::FailedPreconditionError(absl::StrCat("crowd_name: '", name, "' is fed by '",
                                                        found->second->start_.producer,
                                                        "'; end that first"));
    }
    removed = found->second;
    removed->deleted_.store(true, std::memory_order_release);
    recording = std::move(removed->recording_);
    if (recording == nullptr) {
      crowds_.erase(found);
      return absl::OkStatus();
    }
  }
  // Outside the locks: it writes what waits. Its name is free again after that.
  recording.reset();
  const absl::Status status = trajectory::give_up_recordings(record_.folder, name);
  {
    const std::lock_guard lock(mutex_);
    crowds_.erase(name);
  }
  if (status.ok()) return status;
  return absl::InternalError(absl::StrCat("'", name, "' is gone, but comes back when the server ",
                                          "starts again: ", status.message()));
}

}  // namespace throng::server
