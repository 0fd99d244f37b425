#include "throng/render/crowd.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "render/compute/element/angle.hpp"
#include "render/compute/element/instance.hpp"
#include "render/crowd/derive.hpp"
#include "render/crowd/motion_graph.hpp"
#include "render/crowd/packed.hpp"

namespace throng::render {
namespace {

constexpr float kFarthestM = 1e7F;
constexpr std::int64_t kLatestUs = std::int64_t{1} << 53;  // 285 years; differences can't overflow
// Snapshots are packed a few megabytes at a time, so that no push waits long for it.
constexpr std::size_t kLeastRawBytes = 1U << 20;
constexpr std::size_t kPackBytes = 4U << 20;
constexpr std::size_t kMostPacked = 32;
constexpr std::size_t kMostUnpacked = 4;
constexpr std::size_t kMostAgents = 1U << 24;
constexpr std::size_t kLongestMotionName = 64;

// Velocity is averaged over about this long, so that the noise of a dense recording turns nobody;
// samples farther apart than this are taken as they are.
constexpr float kSmoothingS = 0.3F;
// The heading follows the mean motion over this way, so that people who sway in a queue keep facing
// forward and people who walk turn at once; between the two times.
constexpr float kWayM = 0.4F;
constexpr float kWayLeastS = 0.3F;
constexpr float kWayMostS = 1.5F;
// Slower than this on the mean keeps the heading; above the second it follows the motion fully.
constexpr float kTurnFromMps = 0.04F;
constexpr float kTurnFullMps = 0.15F;
constexpr float kFastestTurnRadps = 4.5F;
// The heading lags behind the motion that it is averaged from; who turns steadily is turned ahead
// by that. Who hardly goes is not: there the mean is to keep sway out.
constexpr float kLagOfWay = 0.85F;
constexpr float kLeadFromMps = 0.4F;
constexpr float kLeadFullMps = 0.9F;
// Nor is who turns round or goes round a corner: that is over before it is known.
constexpr float kSteadyTurnRadps = 0.7F;
constexpr float kSharpTurnRadps = 1.6F;
// A heading that is given may turn faster, but nobody turns round between two frames.
constexpr float kFastestGivenTurnRadps = 9.0F;
// The rate of turning is averaged over about this long.
constexpr float kTurnSmoothingS = 0.2F;
// A heading that the producer gives may point against the motion: such an agent walks backwards.
constexpr float kBackwardsCosine = -0.5F;

/// Over how long the motion is averaged that decides the heading.
float way_s(float speed_mps) {
  return std::clamp(kWayM / std::max(speed_mps, 1e-3F), kWayLeastS, kWayMostS);
}

/// @param way_mps  the motion that decides the heading: small while it turns round.
float lead_rad(float turn_radps, const glm::vec2& way_mps) {
  const float speed_mps = glm::length(way_mps);
  return turn_radps * kLagOfWay * way_s(speed_mps) *
         element::smoothstep(kLeadFromMps, kLeadFullMps, speed_mps) *
         (1.0F - element::smoothstep(kSteadyTurnRadps, kSharpTurnRadps, std::fabs(turn_radps)));
}

std::size_t size_bytes(const Snapshot& snapshot) {
  const std::size_t slots = snapshot.present.size();
  std::size_t bytes = sizeof(Snapshot) + slots * (sizeof(std::uint8_t) + 2 * sizeof(glm::vec3) +
                                                  3 * sizeof(float) + sizeof(double));
  for (const std::vector<float>& channel : snapshot.channels)
    bytes += channel.size() * sizeof(float);
  bytes += snapshot.motion.size() * sizeof(std::uint32_t);
  return bytes;
}

std::size_t size_bytes(const Roster& roster) {
  return sizeof(Roster) + roster.id.size() * (sizeof(std::uint64_t) + sizeof(std::uint16_t) +
                                              sizeof(float) + sizeof(std::uint32_t));
}

/// Of a snapshot's roster, when the next one has another.
std::size_t roster_bytes(const std::shared_ptr<const Snapshot>& snapshot,
                         const std::shared_ptr<const Snapshot>& next) {
  return next->roster != snapshot->roster ? size_bytes(*snapshot->roster) : 0;
}

absl::Status wrong_length(const char* column, std::size_t length, std::size_t agents) {
  return absl::InvalidArgumentError(absl::StrCat("push: ", column, " has ", length,
                                                 " rows, must have ", agents,
                                                 " (one for each id of the membership)"));
}

}  // namespace

absl::Status Crowd::Derive::check(const Crowd& crowd, const AgentFrame& frame) {
  if (frame.membership == nullptr) {
    return absl::InvalidArgumentError("push: membership is missing");
  }
  const Membership& membership = *frame.membership;
  const std::size_t agents = membership.ids.size();
  if (frame.time_us < -kLatestUs || frame.time_us > kLatestUs) {
    return absl::InvalidArgumentError(
        absl::StrCat("push: time_us is ", frame.time_us, ", must be within +-", kLatestUs));
  }
  if (agents > kMostAgents) {
    return absl::InvalidArgumentError(
        absl::StrCat("push: ", agents, " agents, must be at most ", kMostAgents));
  }
  if (frame.position_m.size() != agents) {
    return wrong_length("position_m", frame.position_m.size(), agents);
  }
  if (!frame.heading_rad.empty() && frame.heading_rad.size() != agents) {
    return wrong_length("heading_rad", frame.heading_rad.size(), agents);
  }
  const std::size_t channels = crowd.settings_.channel_names.size();
  if (!frame.channels.empty() && frame.channels.size() != channels) {
    return absl::InvalidArgumentError(absl::StrCat(
        "push: ", frame.channels.size(), " channels, the crowd was made with ", channels));
  }
  for (std::size_t i = 0; i < frame.channels.size(); ++i) {
    if (frame.channels[i].size() != agents) {
      return wrong_length(absl::StrCat("channel '", crowd.settings_.channel_names[i], "'").c_str(),
                          frame.channels[i].size(), agents);
    }
  }
  if (!frame.motion.empty() && frame.motion.size() != agents) {
    return wrong_length("motion", frame.motion.size(), agents);
  }
  if (frame.motion_names.size() > kMostMotionNames) {
    return absl::InvalidArgumentError(absl::StrCat("push: ", frame.motion_names.size(),
                                                   " motion_names, at most ", kMostMotionNames));
  }
  for (const std::string& name : frame.motion_names) {
    if (name.size() <= kLongestMotionName) continue;
    return absl::InvalidArgumentError(absl::StrCat("push: a motion's name has ", name.size(),
                                                   " bytes, at most ", kLongestMotionName));
  }
  for (std::size_t c = 0; c < frame.motion.size(); ++c) {
    if (frame.motion[c] <= frame.motion_names.size()) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("push: motion[", c, "] (id ", membership.ids[c], ") is ", int{frame.motion[c]},
                     ", must be at most ", frame.motion_names.size()));
  }
  if (agents > 0 && crowd.cast_->members.empty()) {
    return absl::InvalidArgumentError("push: the cast has no characters");
  }

  // first without a branch for each agent; a bad one is looked for only when there is one
  bool is_bad = false;
  for (const glm::vec3& p : frame.position_m) {
    is_bad |= !((std::fabs(p.x) <= kFarthestM) & (std::fabs(p.y) <= kFarthestM) &
                (std::fabs(p.z) <= kFarthestM));
  }
  if (is_bad) {
    for (std::size_t c = 0; c < agents; ++c) {
      for (int axis = 0; axis < 3; ++axis) {
        const float value = frame.position_m[c][axis];
        if (std::fabs(value) <= kFarthestM) continue;
        return absl::InvalidArgumentError(
            absl::StrCat("push: position_m[", c, "].", std::string(1, "xyz"[axis]), " (id ",
                         membership.ids[c], ") is ", value, ", must be a number within +-1e7"));
      }
    }
  }

  // the rest belongs to the membership and was checked when it came
  if (frame.membership == crowd.membership_) return absl::OkStatus();
  if (!membership.names.empty() && membership.names.size() != agents) {
    return wrong_length("membership.names", membership.names.size(), agents);
  }
  if (!membership.characters.empty()) {
    if (membership.characters.size() != agents) {
      return wrong_length("membership.characters", membership.characters.size(), agents);
    }
    const auto limit = static_cast<std::int32_t>(crowd.cast_->members.size());
    for (std::size_t c = 0; c < agents; ++c) {
      const std::int32_t character = membership.characters[c];
      if (character >= -1 && character < limit) continue;
      return absl::InvalidArgumentError(absl::StrCat("push: membership.characters[", c, "] (id ",
                                                     membership.ids[c], ") is ", character,
                                                     ", must be -1 or less than ", limit));
    }
  }
  return absl::OkStatus();
}

std::shared_ptr<const Snapshot> Crowd::Derive::snapshot(Crowd& crowd, const AgentFrame& frame,
                                                        std::shared_ptr<const Roster> roster,
                                                        const Snapshot* before) {
  const std::size_t slots = roster->id.size();
  const std::size_t agents = frame.position_m.size();
  auto result = std::make_shared<Snapshot>();
  result->time_us = frame.time_us;
  result->present_count = static_cast<std::uint32_t>(agents);
  result->present.resize(slots);
  result->position_m.resize(slots);
  result->velocity_mps.resize(slots);
  result->heading_rad.resize(slots);
  result->speed_mps.resize(slots);
  result->turn_radps.resize(slots);
  result->walked_cycles.resize(slots);
  for (const std::vector<float>& channel : frame.channels) {
    std::vector<float>& column =
        result->channels.emplace_back(slots, std::numeric_limits<float>::quiet_NaN());
    for (std::size_t c = 0; c < agents; ++c) column[crowd.slot_of_column_[c]] = channel[c];
  }

  result->motion = motion(crowd, frame, *roster, before);
  std::vector<element::Gait> gaits;
  for (const CastMember& member : crowd.cast_->members) gaits.push_back(gait_of(member.character));
  const float interval_s =
      before != nullptr
          ? static_cast<float>(static_cast<double>(frame.time_us - before->time_us) * 1e-6)
          : 0.0F;
  const float blend = std::min(1.0F, interval_s / kSmoothingS);
  const std::size_t slots_before = before != nullptr ? before->present.size() : 0;
  const bool is_same_roster = before != nullptr && before->roster == roster;
  glm::vec3 low(std::numeric_limits<float>::max()), high(std::numeric_limits<float>::lowest());

  for (std::size_t c = 0; c < agents; ++c) {
    const std::uint32_t slot = crowd.slot_of_column_[c];
    const glm::vec3 position_m = frame.position_m[c];
    const std::uint32_t seed = roster->seed[slot];
    const float given_rad =
        frame.heading_rad.empty() ? std::numeric_limits<float>::quiet_NaN() : frame.heading_rad[c];
    const bool is_given = std::isfinite(given_rad);
    // a producer may count turns; wrapped in float64, or a large angle loses its direction
    const float wrapped_rad =
        is_given
            ? static_cast<float>(std::remainder(static_cast<double>(given_rad), 6.283185307179586))
            : given_rad;
    low = glm::min(low, position_m);
    high = glm::max(high, position_m);
    result->present[slot] = 1;
    result->position_m[slot] = position_m;

    const bool is_known = is_same_roster || (slot < slots_before && before->present[slot] != 0 &&
                                             before->roster->id[slot] == roster->id[slot]);
    if (!is_known) {
      crowd.moved_[slot] = 0;
      result->heading_rad[slot] = is_given ? wrapped_rad : std::numeric_limits<float>::quiet_NaN();
      result->walked_cycles[slot] = element::unit_from_seed(seed, element::kSeedPhase);
      continue;
    }

    const glm::vec3 step_m = position_m - before->position_m[slot];
    const float heading_before_rad = element::known_heading(before->heading_rad[slot], seed);
    if (element::is_teleport(step_m, interval_s)) {
      // no steps are taken on the way, and the agent goes on as it did
      result->velocity_mps[slot] = before->velocity_mps[slot];
      result->speed_mps[slot] = before->speed_mps[slot];
      result->walked_cycles[slot] = before->walked_cycles[slot];
      result->heading_rad[slot] = is_given ? wrapped_rad : heading_before_rad;
      continue;
    }
    const bool is_first_motion = crowd.moved_[slot] == 0;
    crowd.moved_[slot] = 1;
    const glm::vec3 raw_mps = step_m / interval_s;
    glm::vec3 velocity_mps = is_first_motion ? raw_mps
                                             : before->velocity_mps[slot] +
                                                   blend * (raw_mps - before->velocity_mps[slot]);
    float speed_mps = std::sqrt(velocity_mps.x * velocity_mps.x + velocity_mps.y * velocity_mps.y);
    if (speed_mps > element::kTeleportSpeedMps) {
      // two samples with nearly the same time stamp: within the slack, but nobody is that fast
      velocity_mps *= element::kTeleportSpeedMps / speed_mps;
      speed_mps = element::kTeleportSpeedMps;
    }
    result->velocity_mps[slot] = velocity_mps;
    result->speed_mps[slot] = speed_mps;

    glm::vec2& way_mps = crowd.way_mps_[slot];
    // of the motion, without the lead; a given heading has none
    const float turn_before_radps = before->turn_radps[slot];
    const float base_before_rad =
        is_given ? heading_before_rad
                 : element::wrap_angle(heading_before_rad - lead_rad(turn_before_radps, way_mps));

    way_mps = is_first_motion ? glm::vec2(velocity_mps)
                              : way_mps + std::min(1.0F, interval_s / way_s(speed_mps)) *
                                              (glm::vec2(raw_mps) - way_mps);

    float heading_rad = wrapped_rad;
    if (is_given && before->heading_rad[slot] == before->heading_rad[slot]) {
      const float most_rad = kFastestGivenTurnRadps * interval_s;
      const float turn_rad = element::wrap_angle(wrapped_rad - heading_before_rad);
      if (std::fabs(turn_rad) > most_rad) {
        heading_rad =
            element::wrap_angle(heading_before_rad + std::clamp(turn_rad, -most_rad, most_rad));
      }
    }
    if (!is_given) {
      // float64: the last bit of atan2 differs between libraries, and rarely survives rounding
      const float motion_rad = static_cast<float>(
          std::atan2(static_cast<double>(way_mps.y), static_cast<double>(way_mps.x)));
      const float gain = element::smoothstep(
          kTurnFromMps, kTurnFullMps, std::sqrt(way_mps.x * way_mps.x + way_mps.y * way_mps.y));
      if (is_first_motion && before->heading_rad[slot] != before->heading_rad[slot]) {
        heading_rad = gain > 0.0F ? motion_rad : base_before_rad;
      } else {
        const float most_rad = kFastestTurnRadps * interval_s;
        const float turn_rad = std::clamp(gain * element::wrap_angle(motion_rad - base_before_rad),
                                          -most_rad, most_rad);
        heading_rad = element::wrap_angle(base_before_rad + turn_rad);
      }
    }
    const float turned_rad = before->heading_rad[slot] == before->heading_rad[slot]
                                 ? element::wrap_angle(heading_rad - base_before_rad)
                                 : 0.0F;
    const float turn_radps = turn_before_radps + std::min(1.0F, interval_s / kTurnSmoothingS) *
                                                     (turned_rad / interval_s - turn_before_radps);
    result->turn_radps[slot] = turn_radps;
    result->heading_rad[slot] =
        is_given ? heading_rad : element::wrap_angle(heading_rad + lead_rad(turn_radps, way_mps));

    // steps: the way along the smoothed motion, so that the noise of a standing agent walks nowhere
    double cycles = before->walked_cycles[slot];
    const element::Gait& gait = gaits[roster->character[slot]];
    const float middle_mps =
        is_first_motion ? speed_mps : 0.5F * (before->speed_mps[slot] + speed_mps);
    const element::GaitWeights weights = element::gait_weights(gait, seed, middle_mps);
    // who stands steps round; who walks has its feet turned by the walk
    cycles += static_cast<double>(
        weights.idle * weights.idle *
        element::turn_cycles(gait, turned_rad, 0.5F * (turn_before_radps + turn_radps)));
    if (speed_mps > 0.0F) {
      const float along_m =
          std::max(0.0F, (step_m.x * velocity_mps.x + step_m.y * velocity_mps.y) / speed_mps);
      const float stride_m = roster->scale[slot] * element::stride_m(gait, weights);
      bool is_backwards = false;
      if (is_given) {
        const element::SinCos facing = element::sin_cos(heading_rad);
        is_backwards = velocity_mps.x * facing.cosine + velocity_mps.y * facing.sine <
                       kBackwardsCosine * speed_mps;
      }
      const double walked = static_cast<double>(along_m) / static_cast<double>(stride_m);
      cycles += is_backwards ? -walked : walked;
    }
    result->walked_cycles[slot] = cycles;
  }
  if (agents > 0) {
    result->low_m = low;
    result->high_m = high;
  }
  result->roster = std::move(roster);
  return result;
}

Crowd::Crowd(std::shared_ptr<const Cast> cast, CrowdSettings settings)
    : cast_(std::move(cast)),
      settings_(std::move(settings)),
      motions_(std::make_unique<MotionGraph>(motion_graph_of(*cast_))) {}

Crowd::~Crowd() = default;

absl::Status Crowd::push(const AgentFrame& frame) {
  const std::lock_guard push_lock(push_mutex_);
  if (absl::Status status = Derive::check(*this, frame); !status.ok()) return status;

  // only push and reset change the history, and both hold push_mutex_
  std::shared_ptr<const Snapshot> before;
  {
    const std::lock_guard lock(mutex_);
    if (!history_.empty()) before = history_.back();
    if (before != nullptr && frame.time_us <= before->time_us) {
      ++(frame.time_us == before->time_us ? counters_.duplicate_frames : counters_.late_frames);
      return absl::OkStatus();
    }
  }

  std::shared_ptr<const Roster> roster = before != nullptr ? before->roster : nullptr;
  std::size_t added_bytes = 0;
  if (frame.membership != membership_ || roster == nullptr) {
    if (absl::Status status = Derive::apply_membership(*this, frame.membership, roster);
        !status.ok()) {
      return status;
    }
  }
  const bool is_new_roster = before == nullptr || before->roster != roster;
  std::shared_ptr<const Snapshot> snapshot =
      Derive::snapshot(*this, frame, std::move(roster), before.get());
  added_bytes = size_bytes(*snapshot) + (is_new_roster ? size_bytes(*snapshot->roster) : 0);

  // what falls out of the history is freed after the lock
  std::vector<std::shared_ptr<const Snapshot>> forgotten;
  std::vector<std::shared_ptr<const PackedSnapshots>> forgotten_packed;
  {
    const std::lock_guard lock(mutex_);
    history_.push_back(std::move(snapshot));
    history_bytes_ += added_bytes;
    raw_bytes_ += added_bytes;
    ++counters_.frames;
  }
  pack_oldest();
  const std::lock_guard lock(mutex_);
  while (history_bytes_ > settings_.history_limit_bytes && !packed_.empty()) {
    history_bytes_ -= packed_.front()->size_bytes();
    counters_.forgotten_frames += packed_.front()->count;
    forgotten_packed.push_back(std::move(packed_.front()));
    packed_.pop_front();
  }
  while (history_bytes_ > settings_.history_limit_bytes && history_.size() > 2) {
    const std::shared_ptr<const Snapshot>& oldest = history_[0];
    const std::size_t bytes = size_bytes(*oldest) + roster_bytes(oldest, history_[1]);
    history_bytes_ -= bytes;
    raw_bytes_ -= bytes;
    forgotten.push_back(std::move(history_.front()));
    history_.pop_front();
    ++counters_.forgotten_frames;
  }
  return absl::OkStatus();
}

/// Packs the oldest snapshots when those that are not packed have outgrown their share. Runs under
/// push_mutex_, so history_ only changes here; viewers look on meanwhile.
void Crowd::pack_oldest() {
  const std::size_t share = std::max(settings_.history_limit_bytes / 4, kLeastRawBytes);
  if (raw_bytes_ <= share) return;
  Snapshots oldest;
  std::size_t bytes = 0;
  {
    const std::lock_guard lock(mutex_);
    // Two stay, to interpolate between.
    while (oldest.size() < kMostPacked && oldest.size() + 2 < history_.size() &&
           (oldest.empty() || bytes < kPackBytes)) {
      oldest.push_back(history_[oldest.size()]);
      bytes += size_bytes(*oldest.back()) + roster_bytes(oldest.back(), history_[oldest.size()]);
    }
  }
  // A few large frames wait for others, for the differences between them are what is small.
  if (oldest.size() < 2) return;
  auto packed = std::make_shared<const PackedSnapshots>(pack(oldest));
  const std::lock_guard lock(mutex_);
  history_.erase(history_.begin(), history_.begin() + static_cast<std::ptrdiff_t>(oldest.size()));
  raw_bytes_ -= bytes;
  history_bytes_ = history_bytes_ - bytes + packed->size_bytes();
  packed_.push_back(std::move(packed));
}

std::shared_ptr<const Crowd::Snapshots> Crowd::unpacked(
    const std::shared_ptr<const PackedSnapshots>& packed) const {
  // Two viewers of one moment wait for one unpacking.
  const std::lock_guard lock(unpacked_mutex_);
  for (auto entry = unpacked_.begin(); entry != unpacked_.end(); ++entry) {
    if (entry->first != packed) continue;
    std::rotate(unpacked_.begin(), entry, std::next(entry));
    return unpacked_.front().second;
  }
  auto snapshots = std::make_shared<const Snapshots>(unpack(*packed));
  unpacked_.emplace_front(packed, snapshots);
  if (unpacked_.size() > kMostUnpacked) unpacked_.pop_back();
  return snapshots;
}

Bracket Crowd::bracket(std::int64_t time_us) const {
  std::shared_ptr<const PackedSnapshots> around, next;
  std::shared_ptr<const Snapshot> next_raw;
  {
    const std::lock_guard lock(mutex_);
    if (!packed_.empty() && !history_.empty() && time_us < history_.front()->time_us) {
      auto after = std::upper_bound(
          packed_.begin(), packed_.end(), time_us,
          [](std::int64_t time, const auto& packed) { return time < packed->first_time_us; });
      if (after != packed_.begin()) --after;
      around = *after++;
      if (after != packed_.end()) next = *after;
      if (next == nullptr) next_raw = history_.front();
    }
  }
  if (around != nullptr) {
    const std::shared_ptr<const Snapshots> snapshots = unpacked(around);
    const auto after =
        std::upper_bound(snapshots->begin(), snapshots->end(), time_us,
                         [](std::int64_t time, const std::shared_ptr<const Snapshot>& s) {
                           return time < s->time_us;
                         });
    if (after == snapshots->begin()) return {snapshots->front(), snapshots->front()};
    if (after != snapshots->end()) return {*(after - 1), *after};
    return {snapshots->back(), next != nullptr ? unpacked(next)->front() : next_raw};
  }

  const std::lock_guard lock(mutex_);
  if (history_.empty()) return {};
  const auto after =
      std::upper_bound(history_.begin(), history_.end(), time_us,
                       [](std::int64_t time, const std::shared_ptr<const Snapshot>& s) {
                         return time < s->time_us;
                       });
  if (after == history_.begin()) return {history_.front(), history_.front()};
  if (after == history_.end()) return {history_.back(), history_.back()};
  return {*(after - 1), *after};
}

std::shared_ptr<const Snapshot> Crowd::newest() const {
  const std::lock_guard lock(mutex_);
  return history_.empty() ? nullptr : history_.back();
}

std::int64_t Crowd::oldest_time_us() const {
  const std::lock_guard lock(mutex_);
  if (!packed_.empty()) return packed_.front()->first_time_us;
  return history_.empty() ? 0 : history_.front()->time_us;
}

CrowdCounters Crowd::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

std::vector<std::string> Crowd::take_unknown_motions() {
  const std::lock_guard push_lock(push_mutex_);
  return std::exchange(unknown_motions_, {});
}

void Crowd::set_environment(std::shared_ptr<const Environment> environment) {
  const std::lock_guard lock(mutex_);
  environment_.swap(environment);
}

std::shared_ptr<const Environment> Crowd::environment() const {
  const std::lock_guard lock(mutex_);
  return environment_;
}

void Crowd::reset() {
  std::deque<std::shared_ptr<const Snapshot>> forgotten;
  const std::lock_guard push_lock(push_mutex_);
  const std::lock_guard lock(mutex_);
  forgotten.swap(history_);
  packed_.clear();
  history_bytes_ = raw_bytes_ = 0;
  environment_.reset();
  identity_ = std::make_shared<char>();
  membership_.reset();
  slot_of_column_.clear();
  slot_of_id_.clear();
  free_slots_.clear();
  moved_.clear();
  way_mps_.clear();
  motion_since_us_.clear();
}

std::shared_ptr<const void> Crowd::identity() const {
  const std::lock_guard lock(mutex_);
  return identity_;
}

}  // namespace throng::render
