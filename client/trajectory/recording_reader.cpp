#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <unordered_set>

#include "readers.hpp"
#include "recording_format.hpp"
#include "support.hpp"
#include "throng/trajectory/recording.hpp"

/// What throng-server keeps with --record; recording.hpp and recording_format.hpp tell the layout.
namespace throng::trajectory::detail {
namespace {

constexpr std::size_t kReadBytes = 1u << 20;
constexpr std::int64_t kLatestUs = std::int64_t{1} << 53;

class RecordingReader final : public Reader {
 public:
  /// @param is_single  this part alone, with the producer's own times
  explicit RecordingReader(std::string path, bool is_single = false)
      : path_(std::move(path)), is_single_(is_single) {
    info_.format = "throng-recording";
  }

  const RecordingSpec& spec() const { return spec_; }
  /// Behind the last complete record, once all frames were read.
  std::uint64_t end() const { return record_at_; }

  absl::Status open(const ReadOptions& options) {
    if (absl::Status s = require_metres(path_, options, "a recording"); !s.ok()) return s;
    if (options.source_fps.has_value()) {
      return fault(path_, "a recording has the time of every frame; leave out --source-fps");
    }
    if (absl::Status s = open_file(); !s.ok()) return s;
    // Up to the first frame: the walkable area comes before it.
    absl::StatusOr<bool> more = next_frame_record();
    if (!more.ok()) return more.status();
    if (!has_start_) return fault(path_, at("the recording ends before it begins"));
    if (!*more) return fault(path_, "the recording has no complete frame");
    has_pending_ = true;
    return absl::OkStatus();
  }

  const Info& info() const override { return info_; }

  absl::StatusOr<bool> next(Frame& frame) override {
    if (!has_pending_) {
      absl::StatusOr<bool> more = next_frame_record();
      if (!more.ok() || !*more) return more;
    }
    has_pending_ = false;
    if (absl::Status s = fill(frame); !s.ok()) return s;
    return true;
  }

  std::string agent_name(std::uint64_t id) const override {
    const auto found = names_.find(id);
    return found != names_.end() ? found->second : std::string();
  }
  std::int32_t agent_character(std::uint64_t id) const override {
    const auto found = characters_.find(id);
    return found != characters_.end() ? found->second : -1;
  }

 private:
  std::string at(std::string_view message) const {
    return absl::StrCat("byte ", record_at_, ": ",
                        absl::string_view(message.data(), message.size()));
  }

  absl::Status open_file() {
    file_ = std::ifstream(path_, std::ios::binary);
    if (!file_) return absl::UnavailableError(absl::StrCat(path_, ": cannot be opened"));
    std::array<char, kRecordingMagic.size()> magic{};
    file_.read(magic.data(), magic.size());
    if (std::string_view(magic.data(), magic.size()) != kRecordingMagic) {
      return fault(path_, "this is no recording of throng-server");
    }
    record_at_ = 0;
    position_ = kRecordingMagic.size();
    has_start_ = has_members_ = false;
    return absl::OkStatus();
  }

  /// A record with the right checksum. False where the file ends, also within a record: that is how
  /// a killed server leaves it.
  absl::StatusOr<bool> next_record() {
    record_at_ = position_;
    std::array<char, kRecordHead> head{};
    file_.read(head.data(), head.size());
    if (file_.gcount() == 0) return false;
    if (file_.gcount() != static_cast<std::streamsize>(head.size())) return torn();
    type_.assign(head.data(), 4);
    const auto length = take<std::uint32_t>(head.data() + 4);
    if (std::all_of(head.begin(), head.end(), [](char c) { return c == 0; })) return torn();
    if (length > kMostPayload) {
      return fault(path_, at(absl::StrCat("a record of ", length, " bytes, at most ", kMostPayload,
                                          "; the file is damaged")));
    }
    // Read piece by piece: a length that lies makes no memory.
    payload_.clear();
    while (payload_.size() < length) {
      const std::size_t had = payload_.size();
      payload_.resize(had + std::min<std::size_t>(kReadBytes, length - had));
      file_.read(payload_.data() + had, static_cast<std::streamsize>(payload_.size() - had));
      if (!file_) return torn();
    }
    position_ += head.size() + length;
    if (record_checksum({head.data(), 8}, payload_) != take<std::uint32_t>(head.data() + 8)) {
      if (file_.peek() == std::ifstream::traits_type::eof()) return torn();
      return fault(path_, at("the checksum is wrong; the file is damaged from here on"));
    }
    return true;
  }

  bool torn() {
    info_.notes.push_back(absl::StrCat("the record at byte ", record_at_,
                                       " is cut short, as a killed server leaves it, and is "
                                       "ignored"));
    return false;
  }

  /// Takes records until one is a frame.
  absl::StatusOr<bool> next_frame_record() {
    while (true) {
      absl::StatusOr<bool> more = next_record();
      if (!more.ok() || !*more) return more;
      if (type_ == "STRT") {
        if (absl::Status s = start(); !s.ok()) return s;
        continue;
      }
      if (!has_start_) return fault(path_, at("the first record is not STRT"));
      if (type_ == "FRAM") return true;
      if (type_ == "MEMB") {
        if (absl::Status s = members(); !s.ok()) return s;
      } else if (type_ == "CHAR") {
        if (absl::Status s = characters(); !s.ok()) return s;
      } else if (type_ == "HINT") {
        if (absl::Status s = hints(); !s.ok()) return s;
      } else if (type_ == "AREA") {
        area();
      } else if (type_ == "NEXT") {
        if (is_single_) return false;
        absl::StatusOr<bool> opened = next_part();
        if (!opened.ok() || !*opened) return opened;
      }  // others are of later versions
    }
  }

  absl::Status start() {
    if (has_start_) return fault(path_, at("STRT comes twice"));
    const nlohmann::json json = nlohmann::json::parse(payload_, nullptr, false);
    const auto wrong = [&](const char* what) {
      return fault(path_, at(absl::StrCat("STRT: ", what)));
    };
    if (!json.is_object()) return wrong("it is no JSON object");
    std::vector<std::string> channels;
    if (const auto found = json.find("channels"); found != json.end()) {
      if (!found->is_array() || found->size() > kMaxColumns) return wrong("channels is no list");
      for (const auto& channel : *found) {
        if (!channel.is_string()) return wrong("a channel is no text");
        channels.push_back(channel.get<std::string>());
      }
    }
    std::array<double, 3> origin{};
    if (const auto found = json.find("origin_m"); found != json.end()) {
      if (!found->is_array() || found->size() != 3) return wrong("origin_m is no list of 3");
      for (std::size_t i = 0; i < 3; ++i) {
        if (!(*found)[i].is_number()) return wrong("origin_m has no number");
        origin[i] = (*found)[i].get<double>();
        if (!(std::abs(origin[i]) <= 1e9)) return wrong("origin_m is beyond 1e9");
      }
    }
    const bool is_first = !was_started_;
    if (!is_first && channels != info_.channel_names) {
      return wrong("this part has other channels than the one before");
    }
    if (is_first) {
      info_.channel_names = channels;
      if (const auto found = json.find("seed"); found != json.end() && found->is_number_unsigned())
        info_.seed = found->get<std::uint64_t>();
      if (const auto found = json.find("rate_hz"); found != json.end() && found->is_number()) {
        const double rate = found->get<double>();
        if (rate != 0.0 && valid_fps(rate)) info_.fps = rate;
      }
    }
    const auto text = [&](const char* key) {
      const auto found = json.find(key);
      return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
    };
    spec_ = {text("crowd"),          text("run_id"), text("producer"), origin,
             info_.seed.value_or(0), info_.fps,      channels,         {}};
    if (const auto found = json.find("channel_units");
        found != json.end() && found->is_array() && found->size() == channels.size()) {
      for (const auto& unit : *found) {
        spec_.channel_units.push_back(unit.is_string() ? unit.get<std::string>() : "");
      }
    }
    origin_m_ = origin;
    was_started_ = has_start_ = true;
    return absl::OkStatus();
  }

  void area() {
    if (!has_frames_ || is_single_) {
      info_.walkable_area_wkt = payload_;
    } else if (payload_ != info_.walkable_area_wkt && !area_changed_) {
      area_changed_ = true;
      info_.notes.push_back("the walkable area changes later; the first one holds here");
    }
  }

  absl::StatusOr<bool> next_part() {
    const std::filesystem::path name(payload_);
    if (name.empty() || name != name.filename()) {
      return fault(path_, at(absl::StrCat("the next part is ", detail::quoted(payload_),
                                          ", must be a name in the same folder")));
    }
    const std::filesystem::path next = std::filesystem::path(path_).replace_filename(name);
    if (++parts_ > 1'000'000 || next == path_) return fault(path_, at("parts go in a circle"));
    std::error_code error;
    if (!std::filesystem::is_regular_file(next, error)) {
      info_.notes.push_back(
          absl::StrCat("the recording goes on in ", name.string(), ", which is not there"));
      return false;
    }
    path_ = next.string();
    if (absl::Status s = open_file(); !s.ok()) return s;
    return true;
  }

  absl::Status members() {
    if (payload_.size() < 8) return fault(path_, at("MEMB is too short"));
    const std::size_t agents = take<std::uint32_t>(payload_.data());
    const std::size_t raw_size = take<std::uint32_t>(payload_.data() + 4);
    const std::size_t packed = payload_.size() - 8;
    // Ids differ from each other, so they cannot be packed as small as that.
    if (agents > kMaxAgentsPerFrame || raw_size < 8 * agents || raw_size > 4096 + 256 * packed ||
        raw_size > kMostPayload) {
      return fault(path_, at(absl::StrCat("MEMB: ", agents, " agents in ", raw_size,
                                          " bytes, packed ", packed, ", is not possible")));
    }
    std::string raw(raw_size, '\0');
    if (absl::Status s = unpack(8, raw); !s.ok()) return s;
    ids_.resize(agents);
    if (agents > 0) std::memcpy(ids_.data(), raw.data(), 8 * agents);
    std::unordered_set<std::uint64_t> distinct(ids_.begin(), ids_.end());
    if (distinct.size() != agents) return fault(path_, at("MEMB: an id is there twice"));
    std::size_t offset = 8 * agents;
    for (std::size_t i = 0; i < agents && offset < raw_size; ++i) {
      if (raw_size - offset < 2) return fault(path_, at("MEMB: the names are cut short"));
      const std::size_t length = take<std::uint16_t>(raw.data() + offset);
      offset += 2;
      if (length > kMaxNameBytes || length > raw_size - offset) {
        return fault(path_, at(absl::StrCat("MEMB: a name of ", length, " bytes does not fit")));
      }
      if (length > 0) names_.insert_or_assign(ids_[i], raw.substr(offset, length));
      offset += length;
    }
    history_.set_members(ids_, 4 + info_.channel_names.size());
    has_members_ = true;
    motion_.clear();
    return absl::OkStatus();
  }

  /// What is packed of a record for each of the present members, at most so many bytes.
  absl::Status unpack_members(std::size_t most, std::string& raw) {
    if (!has_members_ || payload_.size() < 8) {
      return fault(path_, at(absl::StrCat(type_, " comes before MEMB, or is too short")));
    }
    const std::size_t agents = take<std::uint32_t>(payload_.data());
    const std::size_t raw_size = take<std::uint32_t>(payload_.data() + 4);
    if (agents != ids_.size() || raw_size > most) {
      return fault(path_, at(absl::StrCat(type_, ": ", agents, " agents in ", raw_size,
                                          " bytes, there are ", ids_.size(), ", at most ", most)));
    }
    raw.resize(raw_size);
    return unpack(8, raw);
  }

  absl::Status characters() {
    std::string raw;
    if (absl::Status s = unpack_members(4 * ids_.size(), raw); !s.ok()) return s;
    if (raw.size() != 4 * ids_.size()) return fault(path_, at("CHAR: it is cut short"));
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      const auto member = take<std::int32_t>(raw.data() + 4 * i);
      if (member < -1) return fault(path_, at(absl::StrCat("CHAR: a character is ", member)));
      characters_.insert_or_assign(ids_[i], member);
    }
    return absl::OkStatus();
  }

  absl::Status hints() {
    std::string raw;
    const std::size_t most = 1 + kMostHints * (1 + kLongestHint) + ids_.size();
    if (absl::Status s = unpack_members(most, raw); !s.ok()) return s;
    const auto cut = [this] { return fault(path_, at("HINT: names or codes do not fit")); };
    if (raw.empty()) return cut();
    // codes of this record to those of Info, which may have no more room
    std::vector<std::uint8_t> code(1, 0);
    std::size_t offset = 1;
    for (std::size_t names = static_cast<unsigned char>(raw[0]); names > 0; --names) {
      const std::size_t length = offset < raw.size() ? static_cast<unsigned char>(raw[offset]) : 0;
      if (code.size() > kMostHints || length > kLongestHint || offset + 1 + length > raw.size()) {
        return cut();
      }
      const std::string name = raw.substr(offset + 1, length);
      offset += 1 + length;
      std::vector<std::string>& known = info_.motion_names;
      auto found = std::find(known.begin(), known.end(), name);
      if (found == known.end() && known.size() < kMostHints) found = known.insert(found, name);
      code.push_back(found == known.end() ? std::uint8_t{0}
                                          : static_cast<std::uint8_t>(found - known.begin() + 1));
    }
    if (raw.size() - offset != ids_.size()) return cut();
    motion_.resize(ids_.size());
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      const auto one = static_cast<unsigned char>(raw[offset + i]);
      if (one >= code.size()) return cut();
      motion_[i] = code[one];
    }
    return absl::OkStatus();
  }

  absl::Status unpack(std::size_t offset, std::string& raw) {
    const std::size_t got =
        ZSTD_decompress(raw.data(), raw.size(), payload_.data() + offset, payload_.size() - offset);
    if (ZSTD_isError(got) != 0 || got != raw.size()) {
      return fault(path_, at(absl::StrCat(type_, ": it does not unpack to ", raw.size(),
                                          " bytes; the file is damaged")));
    }
    return absl::OkStatus();
  }

  absl::Status fill(Frame& frame) {
    if (!has_members_) return fault(path_, at("FRAM comes before MEMB"));
    if (payload_.size() < kFrameHead) return fault(path_, at("FRAM is too short"));
    const auto time_us = take<std::int64_t>(payload_.data());
    const int step = static_cast<unsigned char>(payload_[8]);
    const int flags = static_cast<unsigned char>(payload_[9]);
    if (step > kMostStep || time_us < -kLatestUs || time_us > kLatestUs) {
      return fault(path_, at("FRAM: step or time is out of range"));
    }
    if (has_frames_ && time_us <= last_us_) {
      return fault(path_, at(absl::StrCat("FRAM: time ", time_us, " us is not after ", last_us_)));
    }
    if (!has_frames_) first_us_ = time_us;
    if ((flags & kIsKey) != 0) {
      history_.forget();
    } else if (!has_frames_ || step != step_) {
      return fault(path_, at("FRAM: it needs the frame before it"));
    }
    step_ = step;
    has_frames_ = true;
    last_us_ = time_us;

    const std::size_t agents = ids_.size();
    const bool has_heading = (flags & kHasHeading) != 0;
    const std::size_t channels = info_.channel_names.size();
    const std::size_t packed_channels = (flags & kHasChannels) != 0 ? channels : 0;
    planes_.resize(4 * agents * (3 + (has_heading ? 1 : 0) + packed_channels));
    if (absl::Status s = unpack(kFrameHead, planes_); !s.ok()) return s;

    frame.time_us = is_single_ ? time_us : time_us - first_us_;
    frame.ids = ids_;
    const char* plane = planes_.data();
    const auto word = [&](std::size_t i) {
      const auto byte = [&](std::size_t k) {
        return static_cast<std::uint32_t>(static_cast<unsigned char>(plane[k * agents + i]));
      };
      return byte(0) | byte(1) << 8 | byte(2) << 16 | byte(3) << 24;
    };
    const double metres = step_m(step);
    bool is_flat = true;
    std::vector<double>* const axes[] = {&frame.x_m, &frame.y_m, &frame.z_m};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      axes[axis]->resize(agents);
      for (std::size_t i = 0; i < agents; ++i) {
        const auto steps = static_cast<std::int32_t>(history_.decode(axis, i, word(i)));
        (*axes[axis])[i] = origin_m_[axis] + steps * metres;
        is_flat = is_flat && (axis < 2 || (*axes[axis])[i] == 0.0);
      }
      plane += 4 * agents;
    }
    if (is_flat) frame.z_m.clear();
    frame.heading_rad.clear();
    if (has_heading) {
      frame.heading_rad.resize(agents);
      for (std::size_t i = 0; i < agents; ++i) {
        const std::uint32_t now = history_.before(3, i) + unzigzag(word(i));
        history_.exchange_bits(3, i, now);
        frame.heading_rad[i] =
            now >= kHeadingUnknown
                ? std::numeric_limits<float>::quiet_NaN()
                : static_cast<float>((static_cast<double>(now) / kHeadingSteps - 0.5) * 2.0 * kPi);
      }
      plane += 4 * agents;
    }
    frame.channels.resize(channels);
    for (std::size_t channel = 0; channel < channels; ++channel) {
      frame.channels[channel].assign(agents, std::numeric_limits<float>::quiet_NaN());
      if (packed_channels == 0) continue;
      for (std::size_t i = 0; i < agents; ++i) {
        const std::uint32_t now = word(i) ^ history_.before(4 + channel, i);
        history_.exchange_bits(4 + channel, i, now);
        frame.channels[channel][i] = std::bit_cast<float>(now);
      }
      plane += 4 * agents;
    }
    history_.all_known();
    frame.motion = motion_;
    return absl::OkStatus();
  }

  std::string path_;
  bool is_single_ = false;
  RecordingSpec spec_;
  Info info_;
  std::ifstream file_;
  std::uint64_t position_ = 0, record_at_ = 0;
  std::string type_, payload_, planes_;
  bool has_pending_ = false;
  bool was_started_ = false, has_start_ = false, has_members_ = false, has_frames_ = false;
  bool area_changed_ = false;
  std::uint64_t parts_ = 0;
  std::array<double, 3> origin_m_{};
  std::vector<std::uint64_t> ids_;
  std::unordered_map<std::uint64_t, std::string> names_;
  std::unordered_map<std::uint64_t, std::int32_t> characters_;
  std::vector<std::uint8_t> motion_;  // [A] of the last HINT, or empty
  WordHistory history_;
  std::int64_t first_us_ = 0, last_us_ = 0;
  int step_ = 0;
};

}  // namespace

ReaderOr open_recording(const std::string& path, const ReadOptions& options) {
  auto reader = std::make_unique<RecordingReader>(path);
  if (absl::Status status = reader->open(options); !status.ok()) return status;
  return std::unique_ptr<Reader>(std::move(reader));
}

}  // namespace throng::trajectory::detail

namespace throng::trajectory {
namespace {

namespace fs = std::filesystem;

struct Part {
  detail::PartName name;
  fs::path path;
  std::uint64_t bytes = 0;
};

/// All parts in a folder, runs by their stamp and each run's parts in their order.
std::vector<Part> parts_in(const std::string& folder) {
  std::vector<Part> parts;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    std::optional<detail::PartName> name = detail::part_name(at->path().filename().string());
    std::error_code failed;
    const std::uint64_t bytes = at->file_size(failed);
    if (name.has_value() && !failed) parts.push_back({*std::move(name), at->path(), bytes});
  }
  std::sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return std::tie(a.name.crowd, a.name.stem, a.name.part) <
           std::tie(b.name.crowd, b.name.stem, b.name.part);
  });
  return parts;
}

fs::path removed_path(const std::string& folder, const std::string& stem) {
  return fs::path(folder) / (stem + ".removed");
}

}  // namespace

std::vector<std::string> recorded_crowds(const std::string& folder) {
  std::vector<std::string> crowds;
  const std::vector<Part> parts = parts_in(folder);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const detail::PartName& name = parts[i].name;
    const bool is_last = i + 1 == parts.size() || parts[i + 1].name.crowd != name.crowd;
    std::error_code error;
    if (is_last && !fs::exists(removed_path(folder, name.stem), error)) {
      crowds.push_back(name.crowd);
    }
  }
  return crowds;
}

absl::Status give_up_recordings(const std::string& folder, const std::string& crowd) {
  std::string newest;
  for (const Part& part : parts_in(folder)) {
    if (part.name.crowd != crowd) continue;
    // that of an older run has had its day
    std::error_code ignored;
    if (part.name.stem != newest && !newest.empty())
      fs::remove(removed_path(folder, newest), ignored);
    newest = part.name.stem;
  }
  if (newest.empty()) return absl::OkStatus();
  const std::string path = removed_path(folder, newest).string();
  // on the disk before anybody is told: a power cut must not bring the crowd back
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  bool is_kept = file >= 0 && ::write(file, "\n", 1) == 1 && ::fsync(file) == 0;
  int error = errno;
  if (file >= 0) ::close(file);
  const int entries = is_kept ? ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
  if (entries >= 0) {
    is_kept = ::fsync(entries) == 0 || errno == EINVAL;
    error = errno;
    ::close(entries);
  }
  if (is_kept) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(path, ": cannot be written: ", std::strerror(error)));
}

absl::StatusOr<RecordedRun> read_last_run(
    const std::string& folder, const std::string& crowd, std::uint64_t most_bytes,
    const std::function<absl::Status(const RecordingSpec&, const Frame&, const Reader&)>& take) {
  std::vector<Part> parts = parts_in(folder);
  std::erase_if(parts, [&](const Part& part) { return part.name.crowd != crowd; });
  if (parts.empty()) {
    return absl::NotFoundError(absl::StrCat(folder, ": there is no recording of '", crowd, "'"));
  }
  const std::string stem = parts.back().name.stem;
  std::size_t first = parts.size() - 1;
  std::uint64_t bytes = parts[first].bytes;
  while (first > 0 && parts[first - 1].name.stem == stem &&
         bytes + parts[first - 1].bytes <= most_bytes) {
    bytes += parts[--first].bytes;
  }
  RecordedRun run;
  for (std::size_t i = first; i < parts.size(); ++i) {
    detail::RecordingReader reader(parts[i].path.string(), true);
    absl::Status status = reader.open({});
    Frame frame;
    const std::uint64_t frames_before = run.frames;
    while (status.ok()) {
      absl::StatusOr<bool> more = reader.next(frame);
      status = more.status();
      if (!status.ok() || !*more) break;
      if (absl::Status taken = take(reader.spec(), frame, reader); !taken.ok()) return taken;
      ++run.frames;
    }
    run.notes.insert(run.notes.end(), reader.info().notes.begin(), reader.info().notes.end());
    if (!status.ok()) run.notes.emplace_back(status.message());
    if (run.frames == frames_before) continue;  // killed before its first frame
    run.spec = reader.spec();
    run.spec.crowd = crowd;  // as the files are called, whatever is in them: it names the next
    run.walkable_area_wkt = reader.info().walkable_area_wkt;
    // What is damaged in its middle stays as it is; the run goes on in another recording.
    run.end = status.ok() ? RecordingEnd{parts[i].path.string(), reader.end()} : RecordingEnd{};
  }
  if (run.frames == 0) {
    return absl::NotFoundError(absl::StrCat(stem, ": ", run.notes.empty() ? "" : run.notes.back()));
  }
  return run;
}

}  // namespace throng::trajectory
