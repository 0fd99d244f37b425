#include <absl/strings/str_cat.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_map>

#include "writers.hpp"

namespace throng::trajectory::detail {
namespace {

static_assert(std::endian::native == std::endian::little, "SCB files are little-endian");

template <typename Number>
void append_bytes(std::string& bytes, Number value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Menge's SCB, version 2.4: x, elevation, z, yaw in single precision. An agent has no id but its
/// place in every frame; the places are those in the first frame. A channel "class" is that
/// frame's.
class ScbWriter final : public Writer {
 public:
  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    const auto& channels = spec.channel_names;
    class_ = static_cast<std::size_t>(std::find(channels.begin(), channels.end(), "class") -
                                      channels.begin());
    return file_.open(path);
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>&) override {
    const auto number = numbered_frame(path_, spec_, frame, names, last_,
                                       std::numeric_limits<std::uint64_t>::max());
    if (!number.ok()) return number.status();
    const std::string time = number_text(1e-6 * static_cast<double>(frame.time_us));
    if (last_ >= 0 && *number != last_ + 1) {
      return fault(
          path_, absl::StrCat("write: no frame before ", time, " s, but Menge's SCB has one every ",
                              number_text(1.0 / spec_.fps), " s; write another format"));
    }
    bytes_.clear();
    if (last_ < 0) {
      if (absl::Status s = begin(frame); !s.ok()) return s;
    }
    last_ = *number;
    if (frame.ids.size() != places_.size()) return not_everybody(time, frame.ids.size());
    const std::size_t header = bytes_.size();
    bytes_.resize(header + frame.ids.size() * sizeof(Row));
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      const auto place = places_.find(frame.ids[i]);
      if (place == places_.end()) return not_everybody(time, frame.ids.size());
      const double z_m = frame.z_m.empty() ? 0.0 : frame.z_m[i];
      for (const double value : {frame.x_m[i], frame.y_m[i], z_m}) {
        if (std::abs(value) <= kMaxScbPositionM) continue;
        return fault(
            path_, absl::StrCat("write: a position is ", number_text(value),
                                " m; Menge's SCB is in single precision, so at most ",
                                number_text(kMaxScbPositionM), " m are written: move the origin"));
      }
      const Row row{
          static_cast<float>(frame.x_m[i]), static_cast<float>(z_m),
          static_cast<float>(frame.y_m[i]),
          heading_known(frame, i) ? frame.heading_rad[i] : std::numeric_limits<float>::quiet_NaN()};
      std::memcpy(bytes_.data() + header + place->second * sizeof row, &row, sizeof row);
    }
    return file_.put(bytes_);
  }

  absl::Status close() override {
    if (places_.empty()) return fault(path_, "write: there is no frame; Menge's SCB needs one");
    return file_.close();
  }

 private:
  struct Row {
    float x_m, elevation_m, z_m, yaw_rad;
  };

  /// The header, of who is in the first frame.
  absl::Status begin(const Frame& frame) {
    if (frame.ids.empty()) {
      return fault(path_,
                   "write: nobody is in the first frame, but Menge's SCB has the same agents in "
                   "every frame; write another format");
    }
    bytes_.assign("2.4\0", 4);
    append_bytes(bytes_, static_cast<std::int32_t>(frame.ids.size()));
    append_bytes(bytes_, static_cast<float>(1.0 / spec_.fps));
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      places_.emplace(frame.ids[i], i);
      const float named = class_ < frame.channels.size() ? frame.channels[class_][i] : 0.0f;
      // what is no number of a class is none
      const bool whole = named >= 0.0f && named < 4294967296.0f && named == std::floor(named);
      append_bytes(bytes_, whole ? static_cast<std::uint32_t>(named) : 0u);
    }
    return absl::OkStatus();
  }

  absl::Status not_everybody(const std::string& time, std::size_t agents) const {
    return fault(path_, absl::StrCat("write: the ", agents, " agents at ", time, " s are not the ",
                                     places_.size(),
                                     " of the first frame; Menge's SCB has the same agents in "
                                     "every frame: write another format"));
  }

  std::string path_;
  WriteSpec spec_;
  OutputFile file_;
  std::string bytes_;
  std::size_t class_ = 0;  // channel; behind the last: none
  std::unordered_map<std::uint64_t, std::size_t> places_;
  std::int64_t last_ = -1;
};

}  // namespace

WriterOr write_menge_scb(const std::string& path, const WriteSpec& spec) {
  return opened<ScbWriter>(path, spec);
}

}  // namespace throng::trajectory::detail
