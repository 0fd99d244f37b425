#include <absl/strings/str_cat.h>

#include <cmath>
#include <unordered_map>
#include <unordered_set>

#include "writers.hpp"

namespace throng::trajectory::detail {
namespace {

/// Footsteps: one row for the way from each sample of a pedestrian to its next, the channels as
/// they are where it begins. Who is there for one sample only makes a step on the spot.
class VadereWriter final : public Writer {
 public:
  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    if (absl::Status s = file_.open(path); !s.ok()) return s;
    std::string header =
        "pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1";
    for (std::string name : spec.channel_names) {
      for (char& c : name) {
        if (c == ' ' || c == '\t' || c == '\n' || c == '\r') c = '_';
      }
      absl::StrAppend(&header, " ", name, "-PID2");
    }
    return file_.put(header + "\n");
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>&) override {
    if (absl::Status s = check_columns(path_, spec_, frame, names); !s.ok()) return s;
    if (absl::Status s = check_ids(path_, frame, kLargestVadereId); !s.ok()) return s;
    std::string time;
    append_time(time, frame.time_us);
    std::unordered_map<std::uint64_t, std::size_t> before;
    for (std::size_t i = 0; i < held_.ids.size(); ++i) before.emplace(held_.ids[i], i);
    text_.clear();
    std::vector<bool> arrived(frame.ids.size(), false);
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      const auto found = before.find(frame.ids[i]);
      if (found != before.end()) {
        put_step(found->second, time, frame.x_m[i], frame.y_m[i]);
        arrived[i] = true;
        arrived_[found->second] = true;
      } else if (!seen_.insert(frame.ids[i]).second) {
        ++returns_;
      }
    }
    put_single_samples();
    held_ = frame;
    held_time_ = std::move(time);
    arrived_ = std::move(arrived);
    return file_.put(text_);
  }

  absl::Status close() override {
    text_.clear();
    put_single_samples();
    if (absl::Status s = file_.put(text_); !s.ok()) return s;
    return file_.close();
  }

  std::vector<std::string> notes() const override {
    if (returns_ == 0) return {};
    return {absl::StrCat(counted(returns_, "agent that left and came back stands",
                                 "agents that left and came back stand"),
                         " where it left meanwhile: Vadere's footsteps know no absence")};
  }

 private:
  /// In full where it is a frame but for the rounding to microseconds: who reads at that rate
  /// meets the samples exactly.
  void append_time(std::string& text, std::int64_t time_us) const {
    const double time_s = 1e-6 * static_cast<double>(time_us);
    const double frame_s = valid_fps(spec_.fps) ? std::round(time_s * spec_.fps) / spec_.fps : 0.0;
    append(text, std::abs(frame_s - time_s) < 1e-6 ? frame_s : time_s);
  }

  void put_step(std::size_t held, const std::string& end_time, double x_m, double y_m) {
    absl::StrAppend(&text_, held_.ids[held], " ", held_time_, " ", end_time);
    for (const double value : {held_.x_m[held], held_.y_m[held], x_m, y_m}) {
      text_ += ' ';
      append(text_, value);
    }
    for (const auto& channel : held_.channels) {
      text_ += ' ';
      if (std::isfinite(channel[held])) {
        append(text_, channel[held]);
      } else {
        text_ += "NaN";
      }
    }
    text_ += '\n';
  }

  void put_single_samples() {
    for (std::size_t i = 0; i < held_.ids.size(); ++i) {
      if (!arrived_[i]) put_step(i, held_time_, held_.x_m[i], held_.y_m[i]);
    }
  }

  std::string path_;
  WriteSpec spec_;
  OutputFile file_;
  std::string text_;
  Frame held_;  // the newest sample
  std::string held_time_;
  std::vector<bool> arrived_;               // of held_: some step began or ended there
  std::unordered_set<std::uint64_t> seen_;  // everybody so far
  std::uint64_t returns_ = 0;
};

}  // namespace

WriterOr write_vadere(const std::string& path, const WriteSpec& spec) {
  return opened<VadereWriter>(path, spec);
}

}  // namespace throng::trajectory::detail
