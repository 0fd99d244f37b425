#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

/// What writer and reader of recordings share: the layout and the differences in time.
///
/// FILE   = magic, record...           all numbers little-endian
/// RECORD = type (4 bytes), payload length u32, crc32 u32 of type, length and payload, payload
///   STRT  JSON of the RecordingSpec, with "part"
///   AREA  walkable area, WKT
///   MEMB  agents u32, raw length u32, zstd of (ids u64[A], then names as length u16 and bytes)
///   CHAR  agents u32, raw length u32, zstd of cast members i32[A]; after MEMB, or none: by id
///   HINT  agents u32, raw length u32, zstd of (names u8, each as length u8 and bytes, then codes
///         u8[A], 0: by speed, k: the k-th name); holds until the next one, or MEMB
///   FRAM  time i64, step u8, flags u8, zstd of columns: x y z [heading] [channels], each u32[A] as
///         four planes of bytes
///   NEXT  name of the file that goes on
namespace throng::trajectory::detail {

inline constexpr std::string_view kRecordingMagic{"THRONGR1", 8};
inline constexpr std::size_t kRecordHead = 12;
inline constexpr std::size_t kMostPayload = 1u << 30;
inline constexpr std::size_t kFrameHead = 10;
inline constexpr std::uint8_t kHasHeading = 1, kHasChannels = 2, kIsKey = 4;
inline constexpr int kMostStep = 20;
inline constexpr std::size_t kMostHints = 64, kLongestHint = 64;  // what the wire takes

/// Metres of one step of position.
inline double step_m(int step) { return 1e-4 * static_cast<double>(1u << step); }

inline constexpr std::int32_t kHeadingSteps = 65'535;  // of a turn
inline constexpr std::uint32_t kHeadingUnknown = 65'535;

inline std::uint32_t zigzag(std::uint32_t difference) {
  return (difference << 1) ^ (0U - (difference >> 31));
}
inline std::uint32_t unzigzag(std::uint32_t value) { return (value >> 1) ^ (0U - (value & 1U)); }

/// The last word of each agent and column, and its last change, by which the next one is guessed.
/// Unsigned, so that they wrap and come back.
class WordHistory {
 public:
  /// New columns; agents that stay keep their words.
  void set_members(std::span<const std::uint64_t> ids, std::size_t columns) {
    std::unordered_map<std::uint64_t, std::size_t> at;
    at.reserve(ids_.size());
    for (std::size_t i = 0; i < ids_.size(); ++i) at.emplace(ids_[i], i);
    std::vector<Word> words(columns * ids.size());
    std::vector<std::uint8_t> is_known(ids.size());
    if (columns == columns_) {
      for (std::size_t i = 0; i < ids.size(); ++i) {
        const auto found = at.find(ids[i]);
        if (found == at.end()) continue;
        is_known[i] = is_known_[found->second];
        for (std::size_t c = 0; c < columns; ++c) {
          words[c * ids.size() + i] = words_[c * ids_.size() + found->second];
        }
      }
    }
    ids_.assign(ids.begin(), ids.end());
    words_.swap(words);
    is_known_.swap(is_known);
    columns_ = columns;
  }
  void forget() {
    words_.assign(words_.size(), Word());
    is_known_.assign(is_known_.size(), 0);
  }
  std::size_t agents() const { return ids_.size(); }

  std::uint32_t encode(std::size_t column, std::size_t agent, std::uint32_t now) {
    Word& word = words_[column * ids_.size() + agent];
    const std::uint32_t difference = now - word.before;
    const std::uint32_t coded = zigzag(difference - word.change);
    word.before = now;
    word.change = is_known_[agent] != 0 ? difference : 0;
    return coded;
  }
  std::uint32_t decode(std::size_t column, std::size_t agent, std::uint32_t coded) {
    Word& word = words_[column * ids_.size() + agent];
    const std::uint32_t difference = unzigzag(coded) + word.change;
    word.before += difference;
    word.change = is_known_[agent] != 0 ? difference : 0;
    return word.before;
  }
  /// For columns that jump: no guess by the last change.
  std::uint32_t exchange_bits(std::size_t column, std::size_t agent, std::uint32_t now) {
    Word& word = words_[column * ids_.size() + agent];
    const std::uint32_t before = word.before;
    word.before = now;
    return before;
  }
  std::uint32_t before(std::size_t column, std::size_t agent) const {
    return words_[column * ids_.size() + agent].before;
  }
  /// At the end of a frame: every agent has a word now.
  void all_known() { is_known_.assign(is_known_.size(), 1); }

 private:
  struct Word {
    std::uint32_t before = 0, change = 0;
  };
  std::vector<std::uint64_t> ids_;
  std::vector<Word> words_;  // [column][agent]
  std::vector<std::uint8_t> is_known_;
  std::size_t columns_ = 0;
};

template <typename T>
void put(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}
template <typename T>
T take(const char* at) {
  T value{};
  std::memcpy(&value, at, sizeof value);
  return value;
}

/// What the name of a part says: CROWD.STAMP.PART.trec, where STAMP has no dot.
struct PartName {
  std::string crowd, stem;  // the stem is CROWD.STAMP, one for each run
  unsigned part = 0;
};
std::optional<PartName> part_name(std::string_view file_name);

std::uint32_t record_checksum(std::string_view type_and_length, std::string_view payload);

}  // namespace throng::trajectory::detail
