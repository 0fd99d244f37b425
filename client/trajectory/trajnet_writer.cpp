#include <absl/strings/str_cat.h>

#include <algorithm>
#include <map>

#include "writers.hpp"

namespace throng::trajectory::detail {
namespace {

/// Tracks in order of time, then one scene of the whole file: only then its last frame and the
/// samples a second are known, and readers collect both kinds of lines in any order.
class TrajnetWriter final : public Writer {
 public:
  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    return file_.open(path);
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>&) override {
    const auto number = numbered_frame(path_, spec_, frame, names, last_);
    if (!number.ok()) return number.status();
    last_ = *number;
    if (frame.ids.empty()) return absl::OkStatus();  // a file of tracks has no such moment
    if (first_ < 0) {
      first_ = *number;
      agent_ = frame.ids.front();
    } else {
      ++steps_[*number - last_track_];
    }
    last_track_ = *number;
    text_.clear();
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      absl::StrAppend(&text_, "{\"track\": {\"f\": ", *number, ", \"p\": ", frame.ids[i],
                      ", \"x\": ");
      append(text_, frame.x_m[i]);
      text_ += ", \"y\": ";
      append(text_, frame.y_m[i]);
      text_ += "}}\n";
    }
    return file_.put(text_);
  }

  absl::Status close() override {
    if (first_ >= 0) {
      text_ = absl::StrCat("{\"scene\": {\"id\": 0, \"p\": ", agent_, ", \"s\": ", first_,
                           ", \"e\": ", last_track_, ", \"fps\": ");
      append(text_, spec_.fps / static_cast<double>(usual_step()));
      text_ += ", \"tag\": 0}}\n";
      if (absl::Status s = file_.put(text_); !s.ok()) return s;
    }
    return file_.close();
  }

 private:
  /// The median: samples a second are counted in strides of the frame numbers.
  std::int64_t usual_step() const {
    std::uint64_t all = 0, passed = 0;
    for (const auto& [step, count] : steps_) all += count;
    for (const auto& [step, count] : steps_) {
      passed += count;
      if (passed > all / 2) return step;
    }
    return 1;
  }

  std::string path_;
  WriteSpec spec_;
  OutputFile file_;
  std::string text_;
  std::map<std::int64_t, std::uint64_t> steps_;  // between frames with somebody: how often
  std::uint64_t agent_ = 0;                      // the scene's: the first one
  std::int64_t last_ = -1, first_ = -1, last_track_ = -1;
};

}  // namespace

WriterOr write_trajnet(const std::string& path, const WriteSpec& spec) {
  return opened<TrajnetWriter>(path, spec);
}

}  // namespace throng::trajectory::detail
