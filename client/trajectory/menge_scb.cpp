#include <absl/strings/str_cat.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

#include "readers.hpp"
#include "sorted_reader.hpp"

/// Menge's binary trajectories: a header, then frames of equal size without any count.
namespace throng::trajectory::detail {
namespace {

static_assert(std::endian::native == std::endian::little, "SCB files are little-endian");

struct Version {
  const char* text;
  std::size_t numbers;  // float32 of each agent in each frame
  std::vector<const char*> channels;
};

/// Layouts of Menge's SCBWriter.
const Version* find_version(std::string_view text) {
  static const Version kVersions[] = {
      {"1.0", 3, {}},
      {"2.0", 3, {"class"}},
      {"2.1", 4, {"class", "state"}},
      {"2.2", 8, {"class", "state", "pref_vx", "pref_vy", "vx", "vy"}},
      {"2.3", 4, {"class"}},
      {"2.4", 4, {"class"}},
  };
  for (const Version& version : kVersions) {
    if (text == version.text) return &version;
  }
  return nullptr;
}

class ScbReader final : public Reader {
 public:
  explicit ScbReader(std::string path) : path_(std::move(path)) { info_.format = "menge-scb"; }

  absl::Status open(const ReadOptions& options) {
    if (absl::Status s = require_metres(path_, options, "Menge"); !s.ok()) return s;
    file_.open(path_, std::ios::binary | std::ios::ate);
    if (!file_) return absl::UnavailableError(absl::StrCat(path_, ": cannot be opened"));
    const auto size = static_cast<std::uint64_t>(file_.tellg());
    file_.seekg(0);
    char head[8] = {};
    if (size < sizeof head || !file_.read(head, sizeof head)) {
      return fault(path_, absl::StrCat("the file has ", size,
                                       " bytes, less than its header of 8; "
                                       "it is cut short"));
    }
    const std::string text(head, strnlen(head, 4));
    version_ = find_version(text);
    if (version_ == nullptr || head[3] != '\0') {
      return fault(path_, absl::StrCat("version is ", quoted(text), ", must be 1.0 or 2.0 to 2.4"));
    }
    std::int32_t count = 0;
    std::memcpy(&count, head + 4, 4);
    const bool has_step = text != "1.0";
    // What the header promises must fit the file before memory is made for it.
    if (count <= 0 || static_cast<std::size_t>(count) > kMaxAgentsPerFrame) {
      return fault(path_, absl::StrCat("byte 4: the number of agents is ", count, ", must be 1 to ",
                                       kMaxAgentsPerFrame));
    }
    agents_ = static_cast<std::size_t>(count);
    header_bytes_ = 8 + (has_step ? 4 + 4 * agents_ : 0);
    frame_bytes_ = agents_ * version_->numbers * 4;
    if (size < header_bytes_ + frame_bytes_) {
      return fault(path_, absl::StrCat("the header says ", agents_, " agents, which needs ",
                                       header_bytes_ + frame_bytes_,
                                       " bytes for one frame, but the "
                                       "file has ",
                                       size, "; it is cut short or no SCB file"));
    }
    std::optional<double> of_file;
    if (has_step) {
      float step_s = 0.0f;
      file_.read(reinterpret_cast<char*>(&step_s), 4);
      // In single precision 1 / 0.1f is 10 again.
      const double fps = static_cast<double>(1.0f / step_s);
      if (!file_ || !(step_s > 0.0f) || !valid_fps(fps)) {
        return fault(path_, absl::StrCat("byte 8: the time step is ", number_text(step_s),
                                         " s, must be between 0.00001 and 10000 s"));
      }
      of_file = fps;
      std::vector<std::uint32_t> classes(agents_);
      file_.read(reinterpret_cast<char*>(classes.data()),
                 static_cast<std::streamsize>(4 * agents_));
      if (!file_) return short_read();
      classes_.assign(classes.begin(), classes.end());
    }
    absl::StatusOr<double> fps =
        resolve_fps(path_, of_file, options, "SCB version 1.0 has no time step");
    if (!fps.ok()) return fps.status();
    info_.fps = *fps;
    info_.channel_names.assign(version_->channels.begin(), version_->channels.end());
    frames_ = (size - header_bytes_) / frame_bytes_;
    if (const std::uint64_t rest = (size - header_bytes_) % frame_bytes_; rest != 0) {
      info_.notes.push_back(absl::StrCat("the last frame is cut short (", rest, " of ",
                                         frame_bytes_,
                                         " bytes), as Menge leaves it, and is ignored"));
    }
    columns_.z = text == "2.4";
    columns_.heading = true;
    columns_.channels = version_->channels.size();
    numbers_.resize(agents_ * version_->numbers);
    return absl::OkStatus();
  }

  const Info& info() const override { return info_; }

  absl::StatusOr<bool> next(Frame& frame) override {
    if (index_ >= frames_) return false;
    file_.read(reinterpret_cast<char*>(numbers_.data()),
               static_cast<std::streamsize>(frame_bytes_));
    if (!file_) return short_read();
    clear_frame(columns_, std::llround(static_cast<double>(index_) * 1e6 / info_.fps), frame);
    const std::string_view version = version_->text;
    double values[16];
    for (std::size_t agent = 0; agent < agents_; ++agent) {
      const float* row = numbers_.data() + agent * version_->numbers;
      std::size_t at = 0;
      const bool y_up = version == "2.4";  // ground plane is the first and third number
      values[at++] = row[0];
      values[at++] = y_up ? row[2] : row[1];
      if (y_up) values[at++] = row[1];
      for (std::size_t i = 0; i < at; ++i) {
        if (std::isfinite(values[i]) && std::abs(values[i]) <= kMaxPositionM) continue;
        return fault(
            path_,
            absl::StrCat("frame ", index_, ", agent ", agent, ", byte ",
                         header_bytes_ + index_ * frame_bytes_ + agent * version_->numbers * 4,
                         ": ", std::string(1, "xyz"[i]), " is ", number_text(values[i]),
                         " m, must be a number between -1e8 and 1e8 m"));
      }
      double heading = std::numeric_limits<double>::quiet_NaN();
      if (version == "2.3") {
        const bool known =
            std::isfinite(row[2]) && std::isfinite(row[3]) && (row[2] != 0.0f || row[3] != 0.0f);
        if (known) heading = std::atan2(row[3], row[2]);
      } else {
        const float yaw = y_up ? row[3] : row[2];
        if (std::isfinite(yaw)) heading = std::remainder(static_cast<double>(yaw), 2.0 * kPi);
      }
      values[at++] = heading;
      if (!classes_.empty()) values[at++] = classes_[agent];
      for (std::size_t i = 3; version != "2.3" && !y_up && i < version_->numbers; ++i) {
        values[at++] = row[i];
      }
      append_row(columns_, agent, std::span<const double>(values, at), frame);
    }
    ++index_;
    return true;
  }

 private:
  absl::Status short_read() const {
    return absl::DataLossError(absl::StrCat(path_, ": frame ", index_,
                                            " could not be read; did the file change meanwhile?"));
  }

  std::string path_;
  Info info_;
  std::ifstream file_;
  const Version* version_ = nullptr;
  Columns columns_;
  std::size_t agents_ = 0;
  std::uint64_t header_bytes_ = 0, frame_bytes_ = 0, frames_ = 0, index_ = 0;
  std::vector<double> classes_;
  std::vector<float> numbers_;
};

}  // namespace

ReaderOr open_menge_scb(const std::string& path, const ReadOptions& options) {
  auto reader = std::make_unique<ScbReader>(path);
  if (absl::Status status = reader->open(options); !status.ok()) return status;
  return std::unique_ptr<Reader>(std::move(reader));
}

}  // namespace throng::trajectory::detail
