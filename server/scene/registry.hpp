#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/scene/environment_builder.hpp"
#include "server/scene/limits.hpp"
#include "server/scene/overview.hpp"
#include "server/scene/playout_clock.hpp"
#include "server/scene/recording.hpp"
#include "throng/render/crowd.hpp"

namespace throng::server {

struct ChannelInfo {
  std::string name;
  std::string unit;
};

/// What a producer says when it opens a crowd.
struct StartRequest {
  std::string crowd_name;
  std::string run_id;  // empty: a run of its own, that no reconnect can continue
  glm::dvec3 origin_world{0.0};
  std::vector<ChannelInfo> channels;
  std::uint64_t seed = 0;
  bool take_over = false;
  std::string producer;
  double expected_rate_hz = 0.0;
};

/// What there is to tell about a crowd.
struct CrowdReport {
  std::string name;
  std::string run_id;
  std::string producer;
  std::string walkable_area_wkt;  // empty in a list: it may be megabytes
  std::vector<ChannelInfo> channels;
  bool live = false;
  std::uint32_t agents = 0;
  std::uint32_t viewers = 0;
  std::int64_t oldest_time_us = 0;
  std::int64_t newest_time_us = 0;
  std::uint64_t frames = 0;
  std::uint64_t late_frames = 0;
  std::uint64_t incomplete_frames = 0;
  std::uint64_t history_bytes = 0;
  Recording::Counters recorded;
  WorldBox box;
};

/// The crowd as viewers see it now.
struct Moment {
  std::shared_ptr<const render::Crowd> crowd;  // of the current run, never null
  std::int64_t scene_time_us = 0;
  std::int64_t newest_time_us = 0;
  std::int64_t oldest_time_us = 0;
  bool live = false;  // a producer is connected
  WorldBox overview;  // what an overview camera shows
};

class Registry;

/// A crowd with a name. It outlives its producers; each run has its own render::Crowd. Thread safe.
class NamedCrowd {
 public:
  NamedCrowd(std::string name, PlayoutSettings playout) : name_(std::move(name)), clock_(playout) {}

  const std::string& name() const { return name_; }
  Moment moment(Clock::time_point now);
  CrowdReport report(bool with_area = true) const;
  /// Index of the channel in the current run, -1 if it has none of that name. "speed" is there
  /// even if the producer sends none.
  int channel_index(const std::string& channel) const;
  std::vector<ChannelInfo> channels() const;
  /// True once the crowd was deleted from its registry: its viewers must go.
  bool deleted() const { return deleted_.load(std::memory_order_acquire); }
  void add_viewer() { viewers_.fetch_add(1, std::memory_order_relaxed); }
  void remove_viewer() { viewers_.fetch_sub(1, std::memory_order_relaxed); }
  std::uint32_t viewers() const { return viewers_.load(std::memory_order_relaxed); }

 private:
  friend class Registry;
  friend class Publication;

  /// With mutex_ held, after a frame was pushed to crowd_.
  void see(const render::Snapshot& newest);

  const std::string name_;
  std::atomic<bool> deleted_{false};
  std::atomic<std::uint32_t> viewers_{0};
  mutable std::mutex mutex_;
  // All below are guarded by mutex_.
  StartRequest start_;
  std::shared_ptr<render::Crowd> crowd_;
  std::shared_ptr<Recording> recording_;  // of crowd_; null: not recorded
  PlayoutClock clock_;
  OverviewBox overview_;
  std::int64_t overview_time_us_ = 0;  // of the moment it was followed to
  std::optional<WorldBox> seen_;       // wherever somebody was in this run
  std::string walkable_area_wkt_;
  std::uint64_t incomplete_frames_ = 0;
  std::uint64_t late_frames_ = 0;  // that never reached crowd_
  std::uint64_t owner_ = 0;        // publication that feeds the crowd, 0: none
  std::function<void()> on_revoked_;
};

enum class PushOutcome { kApplied, kLate };

/// One producer's hold on a crowd; letting go of it leaves the crowd as it is. Used by one thread
/// at a time.
class Publication {
 public:
  ~Publication();
  Publication(const Publication&) = delete;
  Publication& operator=(const Publication&) = delete;

  /// Adds a frame to the crowd's history. Errors as render::Crowd::push; Aborted when another
  /// producer has taken over.
  absl::StatusOr<PushOutcome> push(const render::AgentFrame& frame);
  /// A frame that was late by its index and so was never pushed.
  void count_late();
  void count_incomplete();
  /// Raises walls around the area, soon. Errors as render::check_environment; ResourceExhausted for
  /// a text that is too long.
  absl::Status set_walkable_area(std::string wkt);
  std::uint32_t viewers() const { return crowd_->viewers(); }
  const std::string& crowd_name() const { return crowd_->name(); }

 private:
  friend class Registry;
  Publication(Now now, std::uint32_t max_environment_bytes,
              std::shared_ptr<EnvironmentBuilder> environments, std::shared_ptr<NamedCrowd> crowd,
              std::uint64_t id)
      : now_(std::move(now)),
        max_environment_bytes_(max_environment_bytes),
        environments_(std::move(environments)),
        crowd_(std::move(crowd)),
        id_(id) {}

  Now now_;
  std::uint32_t max_environment_bytes_;
  std::shared_ptr<EnvironmentBuilder> environments_;
  std::shared_ptr<NamedCrowd> crowd_;
  std::uint64_t id_;
};

/// All crowds of a server, by name. Thread safe.
class Registry {
 public:
  /// `cast` is what crowds choose characters from; it is shared with the renderer.
  Registry(
      std::shared_ptr<const render::Cast> cast, Limits limits, PlayoutSettings playout = {},
      Now now = [] { return Clock::now(); }, RecordSettings record = {});

  /// Opens a crowd for one producer and creates it if need be. The run that the crowd already
  /// shows is continued when `run_id` is the same (a producer that reconnects, which also ends its
  /// own stale stream); any other run_id forgets the history.
  /// @param on_revoked  called once, from any thread, when another producer takes over.
  /// InvalidArgument: a bad name, rate, origin or channel, or a continued run that differs in them.
  /// AlreadyExists: another producer feeds it. ResourceExhausted: too many crowds or channels.
  absl::StatusOr<std::unique_ptr<Publication>> start(StartRequest request,
                                                     std::function<void()> on_revoked);

  /// Brings back what was recorded last of each crowd, as much as its history holds: viewers can
  /// look at it, and a producer that comes back with its run_id goes on with the run and its
  /// recording. Called before anything else; what cannot be read is logged and left out.
  void resume();

  /// NotFound names the crowd.
  absl::StatusOr<std::shared_ptr<NamedCrowd>> find(const std::string& name) const;
  std::vector<CrowdReport> list() const;
  /// FailedPrecondition while a producer feeds it; NotFound.
  absl::Status remove(const std::string& name);
  const Limits& limits() const { return limits_; }

 private:
  void begin_run(NamedCrowd& named, StartRequest request);
  absl::Status resume_crowd(const std::string& name);

  std::shared_ptr<EnvironmentBuilder> environments_ = std::make_shared<EnvironmentBuilder>();
  std::shared_ptr<const render::Cast> cast_;
  Limits limits_;
  PlayoutSettings playout_;
  Now now_;
  RecordSettings record_;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<NamedCrowd>> crowds_;
  std::uint64_t last_publication_ = 0;
};

}  // namespace throng::server
