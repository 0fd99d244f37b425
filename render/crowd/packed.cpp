#include "render/crowd/packed.hpp"

#include <zstd.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>

namespace throng::render {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kZstdLevel = 1;  // 3 is a fifth smaller here and takes twice as long
constexpr double kVelocityStepMps = 1e-3;
constexpr double kCycleStep = 1.0 / 4096.0;
constexpr std::int32_t kHeadingSteps = 65'535;  // of a turn
constexpr std::int32_t kHeadingUnknown = 65'535;

std::uint32_t zigzag(std::uint32_t difference) {
  return (difference << 1) ^ (0U - (difference >> 31));
}
std::uint32_t unzigzag(std::uint32_t value) { return (value >> 1) ^ (0U - (value & 1U)); }

std::uint32_t bits_of(float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}
float float_of(std::uint32_t bits) {
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

/// Columns of 32-bit words on their way to bytes.
class Packer {
 public:
  template <typename T>
  void value(const T& value) {
    raw_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void words(std::span<const std::uint32_t> words) {
    // One plane for each byte of the words: the upper ones are nearly all zero.
    const std::size_t begin = raw_.size(), count = words.size();
    raw_.resize(begin + 4 * count);
    char* const out = raw_.data() + begin;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t word = words[i];
      out[i] = static_cast<char>(word);
      out[count + i] = static_cast<char>(word >> 8);
      out[2 * count + i] = static_cast<char>(word >> 16);
      out[3 * count + i] = static_cast<char>(word >> 24);
    }
  }
  std::string finish() const {
    std::string bytes(sizeof(std::uint64_t) + ZSTD_compressBound(raw_.size()), '\0');
    const std::uint64_t size = raw_.size();
    std::memcpy(bytes.data(), &size, sizeof size);
    const std::size_t written =
        ZSTD_compress(bytes.data() + sizeof size, bytes.size() - sizeof size, raw_.data(),
                      raw_.size(), kZstdLevel);
    assert(ZSTD_isError(written) == 0);
    bytes.resize(sizeof size + written);
    bytes.shrink_to_fit();
    return bytes;
  }

 private:
  std::string raw_;
};

/// The way back. The bytes are our own, so nothing is checked.
class Unpacker {
 public:
  explicit Unpacker(const std::string& bytes) {
    std::uint64_t size = 0;
    std::memcpy(&size, bytes.data(), sizeof size);
    raw_.resize(size);
    [[maybe_unused]] const std::size_t got = ZSTD_decompress(
        raw_.data(), raw_.size(), bytes.data() + sizeof size, bytes.size() - sizeof size);
    assert(got == size);
  }
  template <typename T>
  T value() {
    T result{};
    std::memcpy(&result, raw_.data() + at_, sizeof result);
    at_ += sizeof result;
    return result;
  }
  void words(std::span<std::uint32_t> words) {
    const std::size_t count = words.size();
    const auto* in = reinterpret_cast<const unsigned char*>(raw_.data() + at_);
    for (std::size_t i = 0; i < count; ++i) {
      words[i] = static_cast<std::uint32_t>(in[i]) |
                 static_cast<std::uint32_t>(in[count + i]) << 8 |
                 static_cast<std::uint32_t>(in[2 * count + i]) << 16 |
                 static_cast<std::uint32_t>(in[3 * count + i]) << 24;
    }
    at_ += 4 * count;
  }

 private:
  std::string raw_;
  std::size_t at_ = 0;
};

/// Differences in time of one number an agent, of first or second order: `before` and `change`
/// hold the number and its last difference by slot. Unsigned, so that they wrap and come back.
struct Differences {
  explicit Differences(std::size_t slots, bool second_order)
      : before(slots), change(slots), is_second(second_order) {}
  std::uint32_t encode(std::size_t slot, std::int32_t value) {
    const std::uint32_t now = static_cast<std::uint32_t>(value);
    const std::uint32_t difference = now - before[slot];
    const std::uint32_t coded = zigzag(difference - change[slot]);
    before[slot] = now;
    if (is_second) change[slot] = difference;
    return coded;
  }
  std::int32_t decode(std::size_t slot, std::uint32_t coded) {
    const std::uint32_t difference = unzigzag(coded) + change[slot];
    before[slot] += difference;
    if (is_second) change[slot] = difference;
    return static_cast<std::int32_t>(before[slot]);
  }
  std::vector<std::uint32_t> before, change;
  bool is_second;
};

std::int32_t rounded(double value) {
  return static_cast<std::int32_t>(std::lround(std::clamp(value, -2.1e9, 2.1e9)));
}

/// The columns in the order in which they are packed: position x y z, velocity x y z, heading,
/// walked cycles, turning rate.
constexpr int kColumns = 9;
constexpr bool kSecondOrder[kColumns] = {true, true, true, false, false, false, false, true, false};
constexpr double kTurnStepRadps = 1e-2;

struct Steps {
  double position_m = 1e-3;
  double first_cycle = 0.0;  // walked cycles are counted from here
};

std::int32_t quantized(const Snapshot& snapshot, std::size_t slot, int column, const Steps& steps) {
  if (column < 3) return rounded(snapshot.position_m[slot][column] / steps.position_m);
  if (column < 6) return rounded(snapshot.velocity_mps[slot][column - 3] / kVelocityStepMps);
  if (column == 6) {
    const double heading = snapshot.heading_rad[slot];
    if (!std::isfinite(heading)) return kHeadingUnknown;
    const double turns = heading / (2.0 * kPi) + 0.5;
    return rounded((turns - std::floor(turns)) * kHeadingSteps) % kHeadingSteps;
  }
  if (column == 8) return rounded(snapshot.turn_radps[slot] / kTurnStepRadps);
  return rounded((snapshot.walked_cycles[slot] - steps.first_cycle) / kCycleStep);
}

void restore(Snapshot& snapshot, std::size_t slot, int column, std::int32_t value,
             const Steps& steps) {
  if (column < 3) {
    snapshot.position_m[slot][column] = static_cast<float>(value * steps.position_m);
  } else if (column < 6) {
    snapshot.velocity_mps[slot][column - 3] = static_cast<float>(value * kVelocityStepMps);
  } else if (column == 6) {
    snapshot.heading_rad[slot] =
        value == kHeadingUnknown
            ? std::numeric_limits<float>::quiet_NaN()
            : static_cast<float>((static_cast<double>(value) / kHeadingSteps - 0.5) * 2.0 * kPi);
  } else if (column == 8) {
    snapshot.turn_radps[slot] = static_cast<float>(value * kTurnStepRadps);
  } else {
    snapshot.walked_cycles[slot] = steps.first_cycle + value * kCycleStep;
  }
}

/// A roster as what differs from the one before it.
struct RosterWords {
  std::vector<std::uint32_t> words;  // id low, id high, character, scale, seed, each by slot
  explicit RosterWords(std::size_t slots) : words(5 * slots) {}
  explicit RosterWords(const Roster& roster, std::size_t slots) : words(5 * slots) {
    for (std::size_t i = 0; i < roster.id.size(); ++i) {
      words[i] = static_cast<std::uint32_t>(roster.id[i]);
      words[slots + i] = static_cast<std::uint32_t>(roster.id[i] >> 32);
      words[2 * slots + i] = roster.character[i];
      words[3 * slots + i] = bits_of(roster.scale[i]);
      words[4 * slots + i] = roster.seed[i];
    }
  }
  std::shared_ptr<const Roster> roster(std::size_t count) const {
    const std::size_t slots = words.size() / 5;
    auto result = std::make_shared<Roster>();
    for (std::size_t i = 0; i < count; ++i) {
      result->id.push_back(words[i] | static_cast<std::uint64_t>(words[slots + i]) << 32);
      result->character.push_back(static_cast<std::uint16_t>(words[2 * slots + i]));
      result->scale.push_back(float_of(words[3 * slots + i]));
      result->seed.push_back(words[4 * slots + i]);
    }
    return result;
  }
};

}  // namespace

PackedSnapshots pack(std::span<const std::shared_ptr<const Snapshot>> snapshots) {
  assert(!snapshots.empty());
  std::size_t slots = 0, channels = 0;
  bool has_motion = false;
  double farthest_m = 0.0;
  Steps steps;
  for (const auto& snapshot : snapshots) {
    slots = std::max(slots, snapshot->present.size());
    channels = std::max(channels, snapshot->channels.size());
    has_motion = has_motion || !snapshot->motion.empty();
    for (int axis = 0; axis < 3; ++axis) {
      farthest_m = std::max({farthest_m, std::abs(static_cast<double>(snapshot->low_m[axis])),
                             std::abs(static_cast<double>(snapshot->high_m[axis]))});
    }
  }
  while (farthest_m / steps.position_m > 2e9) steps.position_m *= 2.0;
  // Near the middle, so that a long history's counts fit.
  const Snapshot& middle = *snapshots[snapshots.size() / 2];
  for (std::size_t slot = 0; slot < middle.present.size(); ++slot) {
    if (middle.present[slot] != 0) steps.first_cycle = std::floor(middle.walked_cycles[slot]);
    if (middle.present[slot] != 0) break;
  }

  Packer out;
  out.value(static_cast<std::uint32_t>(snapshots.size()));
  out.value(static_cast<std::uint32_t>(slots));
  out.value(static_cast<std::uint32_t>(channels));
  out.value(static_cast<std::uint8_t>(has_motion));
  out.value(steps);
  const Roster* roster = nullptr;
  RosterWords before(slots);
  for (const auto& snapshot : snapshots) {
    out.value(snapshot->time_us);
    out.value(static_cast<std::uint32_t>(snapshot->present.size()));
    out.value(static_cast<std::uint32_t>(snapshot->channels.size()));
    out.value(static_cast<std::uint8_t>(!snapshot->motion.empty()));
    const bool is_new = snapshot->roster.get() != roster;
    out.value(static_cast<std::uint8_t>(is_new));
    if (!is_new) continue;
    roster = snapshot->roster.get();
    RosterWords now(*roster, slots);
    RosterWords changed = now;
    for (std::size_t i = 0; i < now.words.size(); ++i) changed.words[i] ^= before.words[i];
    out.words(changed.words);
    before = std::move(now);
  }

  // By column, then time, then slot: the planes of a column hold numbers of one kind.
  std::vector<std::uint32_t> words(snapshots.size() * slots);
  const auto each = [&](const auto& word_of) {
    std::fill(words.begin(), words.end(), 0U);
    for (std::size_t frame = 0; frame < snapshots.size(); ++frame) {
      const Snapshot& snapshot = *snapshots[frame];
      for (std::size_t slot = 0; slot < snapshot.present.size(); ++slot) {
        words[frame * slots + slot] = word_of(snapshot, slot);
      }
    }
    out.words(words);
  };
  std::vector<std::uint32_t> bits(slots);
  each([&](const Snapshot& snapshot, std::size_t slot) {
    const std::uint32_t changed = bits[slot] ^ snapshot.present[slot];
    bits[slot] = snapshot.present[slot];
    return changed;
  });
  for (int column = 0; column < kColumns; ++column) {
    Differences differences(slots, kSecondOrder[column]);
    each([&](const Snapshot& snapshot, std::size_t slot) {
      // An empty slot's numbers are left as they were.
      if (snapshot.present[slot] == 0) return 0U;
      return differences.encode(slot, quantized(snapshot, slot, column, steps));
    });
  }
  for (std::size_t channel = 0; channel < channels; ++channel) {
    std::fill(bits.begin(), bits.end(), 0U);
    each([&](const Snapshot& snapshot, std::size_t slot) {
      if (channel >= snapshot.channels.size()) return 0U;
      const std::uint32_t now = bits_of(snapshot.channels[channel][slot]);
      const std::uint32_t changed = now ^ bits[slot];
      bits[slot] = now;
      return changed;
    });
  }
  if (has_motion) {
    std::fill(bits.begin(), bits.end(), 0U);
    each([&](const Snapshot& snapshot, std::size_t slot) {
      const std::uint32_t now = slot < snapshot.motion.size() ? snapshot.motion[slot] : 0U;
      const std::uint32_t changed = now ^ bits[slot];
      bits[slot] = now;
      return changed;
    });
  }
  return {snapshots.front()->time_us, snapshots.back()->time_us, snapshots.size(), out.finish()};
}

std::vector<std::shared_ptr<const Snapshot>> unpack(const PackedSnapshots& packed) {
  Unpacker in(packed.bytes);
  const auto frames = in.value<std::uint32_t>();
  const auto slots = in.value<std::uint32_t>();
  const auto channels = in.value<std::uint32_t>();
  const bool has_motion = in.value<std::uint8_t>() != 0;
  const auto steps = in.value<Steps>();
  std::vector<std::shared_ptr<Snapshot>> snapshots;
  RosterWords roster_words(slots);
  std::vector<std::uint32_t> changed(roster_words.words.size());
  std::shared_ptr<const Roster> roster;
  for (std::uint32_t frame = 0; frame < frames; ++frame) {
    auto snapshot = std::make_shared<Snapshot>();
    snapshot->time_us = in.value<std::int64_t>();
    const auto count = in.value<std::uint32_t>();
    const auto with_channels = in.value<std::uint32_t>();
    const bool with_motion = in.value<std::uint8_t>() != 0;
    if (in.value<std::uint8_t>() != 0) {
      in.words(changed);
      for (std::size_t i = 0; i < changed.size(); ++i) roster_words.words[i] ^= changed[i];
      roster = roster_words.roster(count);
    }
    snapshot->roster = roster;
    snapshot->present.resize(count);
    snapshot->position_m.resize(count);
    snapshot->velocity_mps.resize(count);
    snapshot->heading_rad.resize(count);
    snapshot->speed_mps.resize(count);
    snapshot->turn_radps.resize(count);
    snapshot->walked_cycles.resize(count);
    snapshot->channels.assign(with_channels, std::vector<float>(count));
    if (with_motion) snapshot->motion.resize(count);
    snapshots.push_back(std::move(snapshot));
  }

  std::vector<std::uint32_t> words(std::size_t{frames} * slots);
  const auto each = [&](const auto& take) {
    in.words(words);
    for (std::size_t frame = 0; frame < frames; ++frame) {
      Snapshot& snapshot = *snapshots[frame];
      for (std::size_t slot = 0; slot < snapshot.present.size(); ++slot) {
        take(snapshot, slot, words[frame * slots + slot]);
      }
    }
  };
  std::vector<std::uint32_t> bits(slots);
  each([&](Snapshot& snapshot, std::size_t slot, std::uint32_t word) {
    bits[slot] ^= word;
    snapshot.present[slot] = static_cast<std::uint8_t>(bits[slot]);
  });
  for (int column = 0; column < kColumns; ++column) {
    Differences differences(slots, kSecondOrder[column]);
    each([&](Snapshot& snapshot, std::size_t slot, std::uint32_t word) {
      if (snapshot.present[slot] == 0) return;
      restore(snapshot, slot, column, differences.decode(slot, word), steps);
    });
  }
  for (std::size_t channel = 0; channel < channels; ++channel) {
    std::fill(bits.begin(), bits.end(), 0U);
    each([&](Snapshot& snapshot, std::size_t slot, std::uint32_t word) {
      if (channel >= snapshot.channels.size()) return;
      bits[slot] ^= word;
      snapshot.channels[channel][slot] = float_of(bits[slot]);
    });
  }
  if (has_motion) {
    std::fill(bits.begin(), bits.end(), 0U);
    each([&](Snapshot& snapshot, std::size_t slot, std::uint32_t word) {
      bits[slot] ^= word;
      if (slot < snapshot.motion.size()) snapshot.motion[slot] = bits[slot];
    });
  }

  for (const auto& snapshot : snapshots) {
    glm::vec3 low(std::numeric_limits<float>::max()), high(std::numeric_limits<float>::lowest());
    for (std::size_t slot = 0; slot < snapshot->present.size(); ++slot) {
      if (snapshot->present[slot] == 0) continue;
      const glm::vec3& velocity = snapshot->velocity_mps[slot];
      snapshot->speed_mps[slot] = std::sqrt(velocity.x * velocity.x + velocity.y * velocity.y);
      low = glm::min(low, snapshot->position_m[slot]);
      high = glm::max(high, snapshot->position_m[slot]);
      ++snapshot->present_count;
    }
    if (snapshot->present_count > 0) {
      snapshot->low_m = low;
      snapshot->high_m = high;
    }
  }
  return {snapshots.begin(), snapshots.end()};
}

}  // namespace throng::render
