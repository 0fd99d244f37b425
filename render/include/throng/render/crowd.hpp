#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <glm/glm.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::render {

struct Environment;
struct MotionGraph;

/// Who is in a frame: column i of every frame with this membership belongs to ids[i].
struct Membership {
  std::uint64_t epoch = 0;               // the producer's number for it
  std::vector<std::uint64_t> ids;        // unique
  std::vector<std::string> names;        // empty, or by column (string ids)
  std::vector<std::int32_t> characters;  // empty, or cast member by column; -1: chosen by id
};

/// One sample of all agents, as a producer sends it. Columns are by membership [A].
struct AgentFrame {
  std::int64_t time_us = 0;  // scene time
  std::shared_ptr<const Membership> membership;
  std::vector<glm::vec3> position_m;         // [A] offset from the crowd's origin
  std::vector<float> heading_rad;            // [A] or empty; NaN: unknown, derived from motion
  std::vector<std::vector<float>> channels;  // [channel][A], as CrowdSettings::channel_names
  // What agents do: [A] or empty; 0: stand, walk or run by speed; k: motion_names[k - 1].
  std::vector<std::uint8_t> motion;
  std::vector<std::string> motion_names;  // at most kMostMotionNames, of at most 64 bytes
};

inline constexpr std::size_t kMostMotionNames = 64;

struct CrowdSettings {
  glm::dvec3 origin_world{0.0};  // agents are float32 offsets from it
  std::uint64_t seed = 0;        // with the id, decides character, tint and size
  std::vector<std::string> channel_names;
  std::size_t history_limit_bytes = 256u << 20;  // oldest snapshots are dropped beyond it
  std::int64_t extrapolate_limit_us = 500'000;   // a gap is extrapolated this long, then held
};

/// Constants of the agents, by slot [I]; shared by snapshots until the membership changes.
/// A slot belongs to one agent while it lives and may be given to another later.
struct Roster {
  std::vector<std::uint64_t> id;
  std::vector<std::uint16_t> character;  // cast member
  std::vector<float> scale;              // of the model, about 1
  std::vector<std::uint32_t> seed;       // hash of id and crowd seed: tints, phases, thresholds
};

/// Index of the channel that every crowd has: how fast an agent walks, m/s.
inline constexpr int kSpeedChannel = 1'000'000;
inline constexpr char kSpeedChannelName[] = "speed";

/// The crowd at one moment. Immutable; columns are by slot [I]. What is derived from motion
/// (heading, speed, walked cycles) is computed once, here, so a pose is a function of (snapshots,
/// time, id).
struct Snapshot {
  /// Column of a channel [I], kSpeedChannel included; null: there is none of this index.
  const std::vector<float>* channel(int index) const {
    if (index == kSpeedChannel) return &speed_mps;
    const bool known = index >= 0 && static_cast<std::size_t>(index) < channels.size();
    return known ? &channels[static_cast<std::size_t>(index)] : nullptr;
  }

  std::int64_t time_us = 0;
  std::shared_ptr<const Roster> roster;
  std::vector<std::uint8_t> present;         // 0: the slot is empty
  std::vector<glm::vec3> position_m;         // offset from the crowd's origin
  std::vector<glm::vec3> velocity_mps;       // smoothed; how an agent goes on where samples end
  std::vector<float> heading_rad;            // counter-clockwise from +X; NaN: not known yet
  std::vector<float> speed_mps;              // smoothed, decides between idle, walk and run
  std::vector<float> turn_radps;             // smoothed, to the left: who stands and turns steps
  std::vector<double> walked_cycles;         // sum of step / stride: the phase of walk and run
  std::vector<std::vector<float>> channels;  // [channel][I]
  // What agents were told to do and since when (element::pack_motion); empty: nobody anything.
  std::vector<std::uint32_t> motion;
  glm::vec3 low_m{0.0F}, high_m{0.0F};  // box of the present agents
  std::uint32_t present_count = 0;
};

/// Two snapshots around a scene time. `newer` equals `older` at either end of the history.
struct Bracket {
  std::shared_ptr<const Snapshot> older, newer;
};

struct CrowdCounters {
  std::uint64_t frames = 0, late_frames = 0, duplicate_frames = 0, forgotten_frames = 0;
};

struct PackedSnapshots;

/// The history of one named crowd. Thread safe: one producer pushes, many viewers look.
///
/// The newest quarter of it (at least 1 MiB) is kept as it came; older snapshots are packed to
/// about a fifth (see render/crowd/packed.hpp for what they lose) and unpacked when looked at.
class Crowd {
 public:
  /// `cast` gives strides and weights; it must outlive the crowd.
  Crowd(std::shared_ptr<const Cast> cast, CrowdSettings settings);
  ~Crowd();

  /// Adds a frame. A frame not newer than the newest is counted (late, duplicate) and dropped: OK.
  /// InvalidArgument names the column, the row, the value and the limit: wrong length, a position
  /// that is not finite or beyond 1e7 m, an id twice, an unknown character. A motion that nobody
  /// in the cast has is no error: such agents go by their speed; see take_unknown_motions.
  absl::Status push(const AgentFrame& frame);

  /// The snapshots around `time_us`; both null while the crowd is empty.
  Bracket bracket(std::int64_t time_us) const;
  std::shared_ptr<const Snapshot> newest() const;
  std::int64_t oldest_time_us() const;  // 0 while empty
  std::size_t history_bytes() const {   // what the snapshots take, as far as the limit counts it
    const std::lock_guard lock(mutex_);
    return history_bytes_;
  }
  CrowdCounters counters() const;
  /// Names of motions that came and that nobody in the cast has, each once.
  std::vector<std::string> take_unknown_motions();

  /// What stands around the crowd; none unless it was set.
  void set_environment(std::shared_ptr<const Environment> environment);
  std::shared_ptr<const Environment> environment() const;

  const CrowdSettings& settings() const { return settings_; }
  const Cast& cast() const { return *cast_; }

  /// A producer starts again: history, slots and environment are forgotten, and the crowd is
  /// another one to who asks for its identity.
  void reset();

  /// What tells this crowd from all others, also from later ones at its address: it expires with
  /// the crowd.
  std::shared_ptr<const void> identity() const;

 private:
  struct Derive;
  using Snapshots = std::vector<std::shared_ptr<const Snapshot>>;
  void pack_oldest();
  std::shared_ptr<const Snapshots> unpacked(
      const std::shared_ptr<const PackedSnapshots>& packed) const;
  std::shared_ptr<const Cast> cast_;
  CrowdSettings settings_;
  std::unique_ptr<const MotionGraph> motions_;
  // columns are derived under push_mutex_ alone, so that viewers don't wait for a push
  std::mutex push_mutex_;
  // guards history_, history_bytes_, counters_, environment_ and identity_
  mutable std::mutex mutex_;
  std::shared_ptr<const Environment> environment_;
  std::shared_ptr<const void> identity_ = std::make_shared<char>();
  std::deque<std::shared_ptr<const Snapshot>> history_;
  std::deque<std::shared_ptr<const PackedSnapshots>> packed_;  // older than history_
  std::size_t raw_bytes_ = 0;  // of history_bytes_, those of history_
  // what was looked at last in packed_, newest first
  mutable std::mutex unpacked_mutex_;
  mutable std::deque<
      std::pair<std::shared_ptr<const PackedSnapshots>, std::shared_ptr<const Snapshots>>>
      unpacked_;
  std::size_t history_bytes_ = 0;
  CrowdCounters counters_;
  std::shared_ptr<const Membership> membership_;
  std::vector<std::uint32_t> slot_of_column_;
  std::unordered_map<std::uint64_t, std::uint32_t> slot_of_id_;
  std::vector<std::uint32_t> free_slots_;
  std::vector<std::uint8_t> moved_;  // by slot: the agent's motion is known (two samples or more)
  std::vector<glm::vec2> way_mps_;   // by slot: motion without sway, which decides the heading
  // by slot, or empty: when what an agent does has changed
  std::vector<std::int64_t> motion_since_us_;
  std::vector<std::string> unknown_motions_, told_motions_;
};

}  // namespace throng::render
