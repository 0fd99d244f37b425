#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "recording_format.hpp"
#include "throng/trajectory/recording.hpp"

namespace throng::trajectory {
namespace {

using namespace detail;
namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "recordings are little-endian");

constexpr int kZstdLevel = 1;
constexpr std::uint64_t kParts = 8;
constexpr std::uint64_t kLeastPartBytes = 4u << 10, kMostPartBytes = 64u << 20;

std::string utc_stamp() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%dT%H%M%SZ", &parts);
  return text;
}

std::string compressed(const std::string& raw) {
  std::string bytes(ZSTD_compressBound(raw.size()), '\0');
  const std::size_t size =
      ZSTD_compress(bytes.data(), bytes.size(), raw.data(), raw.size(), kZstdLevel);
  bytes.resize(ZSTD_isError(size) != 0 ? 0 : size);
  return bytes;
}

}  // namespace

namespace detail {
std::optional<PartName> part_name(std::string_view name) {
  PartName parts;
  if (!absl::EndsWith(absl::string_view(name.data(), name.size()), ".trec")) return std::nullopt;
  name.remove_suffix(std::string_view(".trec").size());
  const std::size_t number = name.rfind('.');
  if (number == std::string_view::npos ||
      !absl::SimpleAtoi(absl::string_view(name.data() + number + 1, name.size() - number - 1),
                        &parts.part)) {
    return std::nullopt;
  }
  parts.stem = std::string(name.substr(0, number));
  const std::size_t stamp = parts.stem.rfind('.');
  if (stamp == std::string::npos || parts.stem.size() - stamp < 17 || parts.stem[stamp + 9] != 'T')
    return std::nullopt;
  parts.crowd = parts.stem.substr(0, stamp);
  return parts;
}

std::uint32_t record_checksum(std::string_view type_and_length, std::string_view payload) {
  const auto bytes = [](std::string_view text) {
    return reinterpret_cast<const Bytef*>(text.data());
  };
  uLong sum = crc32(0, bytes(type_and_length), static_cast<uInt>(type_and_length.size()));
  sum = crc32(sum, bytes(payload), static_cast<uInt>(payload.size()));
  return static_cast<std::uint32_t>(sum);
}
}  // namespace detail

struct RecordingWriter::State {
  std::string folder;
  RecordingSpec spec;
  std::uint64_t limit_bytes;
  std::vector<std::uint64_t> ids;
  std::vector<std::string> names;
  std::vector<std::int32_t> characters;
  std::vector<std::uint8_t> motion;  // as it was written last; empty: all by speed
  std::vector<std::string> motion_names;
  std::string wkt;
  bool members_changed = true, is_key = true;
  int step = 0;
  WordHistory history;
  std::string planes;  // of a frame, before compression

  int file = -1;
  std::string stem, path;
  bool is_entry_synced = false;  // the file's name is on the disk as well
  unsigned part = 0;
  RecordingEnd continues;
  std::uint64_t part_bytes = 0, frame_bytes = 0;  // of the part, of the newest frame
  absl::Status failed;

  ~State() {
    if (file >= 0) ::close(file);
  }

  absl::Status fail(const std::string& what, int error) {
    const std::string message = absl::StrCat(what, ": ", std::strerror(error));
    failed = error == ENOSPC || error == EDQUOT || error == EFBIG
                 ? absl::ResourceExhaustedError(message)
                 : absl::UnavailableError(message);
    return failed;
  }

  absl::Status append(std::string_view bytes) {
    const std::uint64_t before = part_bytes;
    while (!bytes.empty()) {
      const ssize_t written = ::write(file, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) {
        const int error = written < 0 ? errno : EIO;
        // Half a record would be read as a torn one; better none.
        [[maybe_unused]] const int cut = ::ftruncate(file, static_cast<off_t>(before));
        return fail(absl::StrCat(path, ": cannot be written"), error);
      }
      part_bytes += static_cast<std::uint64_t>(written);
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
    return absl::OkStatus();
  }

  absl::Status sync() {
    if (!failed.ok() || file < 0) return failed;
    if (::fdatasync(file) != 0) return fail(absl::StrCat(path, ": cannot be synced"), errno);
    if (is_entry_synced) return absl::OkStatus();
    const int entries = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (entries < 0) return fail(absl::StrCat(folder, ": cannot be synced"), errno);
    // Not every file system syncs folders; those that do not need no help.
    is_entry_synced = ::fsync(entries) == 0 || errno == EINVAL;
    ::close(entries);
    return absl::OkStatus();
  }

  absl::Status record(std::string_view type, const std::string& payload) {
    std::string bytes(type);
    put(bytes, static_cast<std::uint32_t>(payload.size()));
    put(bytes, record_checksum(bytes, payload));
    bytes += payload;
    return append(bytes);
  }

  /// Takes the file up that a run before has left, without what a kill tore at its end.
  absl::Status reopen_last_part() {
    const std::optional<PartName> name = part_name(fs::path(continues.path).filename().string());
    if (!name.has_value()) return fail(absl::StrCat(continues.path, ": no part's name"), EINVAL);
    path = continues.path;
    file = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
    if (file < 0 || ::ftruncate(file, static_cast<off_t>(continues.bytes)) != 0) {
      return fail(absl::StrCat(path, ": cannot be continued"), errno);
    }
    stem = name->stem;
    part = name->part;
    part_bytes = continues.bytes;
    continues.path.clear();
    return absl::OkStatus();
  }

  absl::Status open_part() {
    if (file < 0 && !continues.path.empty()) {
      if (absl::Status s = reopen_last_part(); !s.ok()) return s;
    }
    const bool is_new_run = part == 0;
    std::string name;
    int opened = -1;
    for (int attempt = 0; opened < 0 && attempt < 1000; ++attempt) {
      // A run that begins in the same second gets another stamp, which sorts behind; a part that a
      // killed server left without its beginning is passed over.
      if (is_new_run) {
        stem = absl::StrCat(spec.crowd, ".", utc_stamp());
        if (attempt > 0) absl::StrAppendFormat(&stem, "-%04d", attempt + 1);
        part = 0;
      }
      name = absl::StrFormat("%s.%04u.trec", stem, ++part);
      opened = ::open((fs::path(folder) / name).c_str(),
                      O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
      if (opened < 0 && errno != EEXIST) break;
    }
    if (opened < 0) {
      return fail(absl::StrCat((fs::path(folder) / name).string(), ": cannot be made"), errno);
    }
    if (file >= 0) {
      absl::Status s = record("NEXT", name);
      if (s.ok()) s = sync();
      if (!s.ok()) {
        ::close(opened);
        return s;
      }
      ::close(file);
    }
    file = opened;
    path = (fs::path(folder) / name).string();
    is_entry_synced = false;
    part_bytes = 0;
    is_key = members_changed = true;
    const nlohmann::json start = {{"crowd", spec.crowd},
                                  {"run_id", spec.run_id},
                                  {"producer", spec.producer},
                                  {"origin_m", spec.origin_m},
                                  {"seed", spec.seed},
                                  {"rate_hz", spec.rate_hz},
                                  {"channels", spec.channel_names},
                                  {"channel_units", spec.channel_units},
                                  {"part", part}};
    std::string head(kRecordingMagic);
    if (absl::Status s = append(head); !s.ok()) return s;
    // A name that is not UTF-8 is no reason to keep nothing.
    if (absl::Status s =
            record("STRT", start.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
        !s.ok()) {
      return s;
    }
    if (!wkt.empty()) {
      if (absl::Status s = record("AREA", wkt); !s.ok()) return s;
    }
    remove_oldest();
    return absl::OkStatus();
  }

  /// Makes room for one more part; what cannot be removed stays.
  void remove_oldest() const {
    std::error_code error;
    std::vector<std::pair<fs::file_time_type, fs::path>> parts;
    std::uint64_t bytes = 0;
    for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
      const fs::directory_entry& entry = *at;
      const std::string name = entry.path().filename().string();
      const std::optional<PartName> part_of = part_name(name);
      if (!part_of.has_value() || part_of->crowd != spec.crowd || entry.path() == fs::path(path)) {
        continue;
      }
      bytes += entry.file_size(error);
      parts.emplace_back(entry.last_write_time(error), entry.path());
    }
    std::sort(parts.begin(), parts.end());
    const std::uint64_t room = limit_bytes - std::min(limit_bytes / kParts, kMostPartBytes);
    for (const auto& [time, part_path] : parts) {
      if (bytes <= room) return;
      const std::uint64_t size = fs::file_size(part_path, error);
      if (!error && fs::remove(part_path, error)) bytes -= std::min(bytes, size);
    }
  }

  absl::Status agents_record(std::string_view type, const std::string& raw) {
    std::string payload;
    put(payload, static_cast<std::uint32_t>(ids.size()));
    put(payload, static_cast<std::uint32_t>(raw.size()));
    return record(type, payload + compressed(raw));
  }

  /// What agents do, where it has changed.
  absl::Status write_motion(std::span<const std::uint8_t> now,
                            std::span<const std::string> now_names) {
    const bool any = std::any_of(now.begin(), now.end(), [](std::uint8_t code) { return code; });
    if (!any && motion.empty()) return absl::OkStatus();
    if (std::ranges::equal(now, motion) && std::ranges::equal(now_names, motion_names)) {
      return absl::OkStatus();
    }
    std::string raw;
    put(raw, static_cast<std::uint8_t>(any ? now_names.size() : 0));
    for (const std::string& name : now_names.first(any ? now_names.size() : 0)) {
      put(raw, static_cast<std::uint8_t>(name.size()));
      raw += name;
    }
    motion.assign(any ? now.begin() : now.end(), now.end());
    motion_names.assign(now_names.begin(), now_names.end());
    raw.append(motion.begin(), motion.end());
    if (!any) raw.append(ids.size(), '\0');
    return agents_record("HINT", raw);
  }

  absl::Status write_members() {
    std::string raw;
    raw.reserve(8 * ids.size());
    for (const std::uint64_t id : ids) put(raw, id);
    for (const std::string& name : names) {
      put(raw, static_cast<std::uint16_t>(std::min<std::size_t>(name.size(), 4096)));
      raw.append(name, 0, 4096);
    }
    if (absl::Status s = agents_record("MEMB", raw); !s.ok()) return s;
    motion.clear();
    if (!characters.empty()) {
      const std::string columns(reinterpret_cast<const char*>(characters.data()),
                                sizeof(std::int32_t) * characters.size());
      if (absl::Status s = agents_record("CHAR", columns); !s.ok()) return s;
    }
    history.set_members(ids, 4 + spec.channel_names.size());
    members_changed = false;
    return absl::OkStatus();
  }

  /// Adds one column to `planes`.
  template <typename WordOf>
  void column(WordOf&& word_of) {
    const std::size_t begin = planes.size(), agents = ids.size();
    planes.resize(begin + 4 * agents);
    char* const out = planes.data() + begin;
    for (std::size_t i = 0; i < agents; ++i) {
      const std::uint32_t word = word_of(i);
      out[i] = static_cast<char>(word);
      out[agents + i] = static_cast<char>(word >> 8);
      out[2 * agents + i] = static_cast<char>(word >> 16);
      out[3 * agents + i] = static_cast<char>(word >> 24);
    }
  }
};

RecordingWriter::RecordingWriter(std::string folder, RecordingSpec spec, std::uint64_t limit_bytes,
                                 RecordingEnd continues)
    : state_(std::make_unique<State>()) {
  state_->continues = std::move(continues);
  state_->folder = std::move(folder);
  state_->spec = std::move(spec);
  state_->limit_bytes = limit_bytes;
}

RecordingWriter::~RecordingWriter() = default;

const std::string& RecordingWriter::path() const { return state_->path; }

void RecordingWriter::set_members(std::span<const std::uint64_t> ids,
                                  std::span<const std::string> names,
                                  std::span<const std::int32_t> characters) {
  state_->ids.assign(ids.begin(), ids.end());
  state_->names.assign(names.begin(), names.end());
  state_->characters.assign(characters.begin(), characters.end());
  state_->members_changed = true;
}

absl::Status RecordingWriter::sync() { return state_->sync(); }

absl::Status RecordingWriter::set_walkable_area(const std::string& wkt) {
  State& s = *state_;
  if (!s.failed.ok()) return s.failed;
  if (wkt == s.wkt) return absl::OkStatus();
  s.wkt = wkt;
  return s.file >= 0 ? s.record("AREA", wkt) : absl::OkStatus();
}

absl::Status RecordingWriter::write(std::int64_t time_us, std::span<const float> position_m,
                                    std::span<const float> heading_rad,
                                    std::span<const std::vector<float>> channels,
                                    std::span<const std::uint8_t> motion,
                                    std::span<const std::string> motion_names) {
  State& s = *state_;
  if (!s.failed.ok()) return s.failed;
  const std::size_t agents = s.ids.size();
  if (position_m.size() != 3 * agents || (!heading_rad.empty() && heading_rad.size() != agents) ||
      (!channels.empty() && channels.size() != s.spec.channel_names.size()) ||
      (!motion.empty() && motion.size() != agents) ||
      (!s.characters.empty() && s.characters.size() != agents)) {
    return absl::InvalidArgumentError(
        absl::StrCat("write: the columns do not fit ", agents, " agents"));
  }
  if (motion_names.size() > kMostHints ||
      std::ranges::any_of(motion_names,
                          [](const auto& name) { return name.size() > kLongestHint; }) ||
      std::ranges::any_of(motion, [&](std::uint8_t code) { return code > motion_names.size(); })) {
    return absl::InvalidArgumentError("write: the motions do not fit their names");
  }
  const std::uint64_t part_limit =
      std::clamp(s.limit_bytes / kParts, kLeastPartBytes, kMostPartBytes);
  if (s.file < 0 || s.part_bytes + s.frame_bytes > part_limit) {
    if (absl::Status status = s.open_part(); !status.ok()) return status;
  }
  if (s.members_changed) {
    if (absl::Status status = s.write_members(); !status.ok()) return status;
  }
  if (absl::Status status = s.write_motion(motion, motion_names); !status.ok()) return status;

  float farthest_m = 0.0F;
  bool is_good = true;
  for (const float value : position_m) {
    is_good = is_good && std::fabs(value) <= 1e7F;  // not so for NaN
    farthest_m = std::max(farthest_m, std::fabs(value));
  }
  if (!is_good) {
    return absl::InvalidArgumentError("write: a position is not a number within +-1e7");
  }
  while (static_cast<double>(farthest_m) / step_m(s.step) > 2e9) {
    ++s.step;
    s.is_key = true;
  }
  if (s.is_key) s.history.forget();

  const double steps_per_m = 1.0 / step_m(s.step);
  s.planes.clear();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    s.column([&](std::size_t i) {
      const double steps = static_cast<double>(position_m[3 * i + axis]) * steps_per_m;
      return s.history.encode(axis, i, static_cast<std::uint32_t>(std::lround(steps)));
    });
  }
  if (!heading_rad.empty()) {
    s.column([&](std::size_t i) {
      std::uint32_t now = kHeadingUnknown;
      const double heading = static_cast<double>(heading_rad[i]);
      if (std::isfinite(heading)) {
        const double turns = std::remainder(heading, 6.283185307179586) / 6.283185307179586 + 0.5;
        now = static_cast<std::uint32_t>(std::lround(turns * kHeadingSteps)) %
              static_cast<std::uint32_t>(kHeadingSteps);
      }
      return zigzag(now - s.history.exchange_bits(3, i, now));
    });
  }
  for (std::size_t channel = 0; channel < channels.size(); ++channel) {
    s.column([&](std::size_t i) {
      const auto now = std::bit_cast<std::uint32_t>(channels[channel][i]);
      return now ^ s.history.exchange_bits(4 + channel, i, now);
    });
  }
  s.history.all_known();

  std::string payload;
  put(payload, time_us);
  put(payload, static_cast<std::uint8_t>(s.step));
  put(payload,
      static_cast<std::uint8_t>((heading_rad.empty() ? 0 : kHasHeading) |
                                (channels.empty() ? 0 : kHasChannels) | (s.is_key ? kIsKey : 0)));
  payload += compressed(s.planes);
  s.is_key = false;
  s.frame_bytes = kRecordHead + payload.size();
  return s.record("FRAM", payload);
}

}  // namespace throng::trajectory
