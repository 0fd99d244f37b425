#include <absl/strings/str_cat.h>

#include <cmath>
#include <unordered_map>

#include "writers.hpp"

namespace throng::trajectory::detail {
namespace {

/// Columns as of PeTrack; x and y in metres. Further columns follow the ones that others read.
class ArchiveWriter final : public Writer {
 public:
  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    if (absl::Status s = file_.open(path); !s.ok()) return s;
    std::string header = "# framerate: ";
    append(header, spec.fps);
    header += " fps\n# id frame x/m y/m z/m";
    if (spec.has_heading) header += " viewDirX viewDirY";
    for (std::string name : spec.channel_names) {
      for (char& c : name) {
        if (c == ' ' || c == '\t' || c == '/' || c == '\n' || c == '\r') c = '_';
      }
      absl::StrAppend(&header, " ", name);
    }
    return file_.put(header + "\n");
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>&) override {
    const auto number = numbered_frame(path_, spec_, frame, names, last_);
    if (!number.ok()) return number.status();
    last_ = *number;
    text_.clear();
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      text_ += std::to_string(frame.ids[i]) + " " + std::to_string(last_);
      for (const double value :
           {frame.x_m[i], frame.y_m[i], frame.z_m.empty() ? 0.0 : frame.z_m[i]}) {
        text_ += ' ';
        append(text_, value);
      }
      if (spec_.has_heading) {
        const bool known = heading_known(frame, i);
        for (const float value : {known ? std::cos(frame.heading_rad[i]) : 0.0f,
                                  known ? std::sin(frame.heading_rad[i]) : 0.0f}) {
          text_ += ' ';
          append(text_, value);
        }
      }
      for (const auto& channel : frame.channels) {
        text_ += ' ';
        if (std::isfinite(channel[i])) {
          append(text_, channel[i]);
        } else {
          text_ += "nan";
        }
      }
      text_ += '\n';
    }
    return file_.put(text_);
  }

  absl::Status close() override { return file_.close(); }

 private:
  std::string path_;
  WriteSpec spec_;
  OutputFile file_;
  std::string text_;
  std::int64_t last_ = -1;
};

/// ETH's obsmat: frame id pos_x pos_z pos_y v_x v_z v_y, the ground in the columns 3 and 5. The
/// velocity is that of the way to the next sample, at the last one that of the way to it.
class ObsmatWriter final : public Writer {
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
    std::unordered_map<std::uint64_t, std::size_t> before;
    for (std::size_t i = 0; i < held_.ids.size(); ++i) before.emplace(held_.ids[i], i);
    const double step_s = 1e-6 * static_cast<double>(frame.time_us - held_.time_us);
    std::vector<double> vx(frame.ids.size(), 0.0), vy(frame.ids.size(), 0.0);
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      const auto found = before.find(frame.ids[i]);
      if (found == before.end()) continue;
      const std::size_t k = found->second;
      vx[i] = held_vx_[k] = (frame.x_m[i] - held_.x_m[k]) / step_s;
      vy[i] = held_vy_[k] = (frame.y_m[i] - held_.y_m[k]) / step_s;
    }
    if (absl::Status s = put_held(); !s.ok()) return s;
    last_ = *number;
    held_.time_us = frame.time_us;
    held_.ids = frame.ids;
    held_.x_m = frame.x_m;
    held_.y_m = frame.y_m;
    held_vx_ = std::move(vx);
    held_vy_ = std::move(vy);
    return absl::OkStatus();
  }

  absl::Status close() override {
    if (absl::Status s = put_held(); !s.ok()) return s;
    return file_.close();
  }

 private:
  absl::Status put_held() {
    text_.clear();
    for (std::size_t i = 0; i < held_.ids.size(); ++i) {
      append(text_, last_);
      text_ += ' ';
      append(text_, held_.ids[i]);
      for (const double value : {held_.x_m[i], 0.0, held_.y_m[i], held_vx_[i], 0.0, held_vy_[i]}) {
        text_ += ' ';
        append(text_, value);
      }
      text_ += '\n';
    }
    return file_.put(text_);
  }

  std::string path_;
  WriteSpec spec_;
  OutputFile file_;
  std::string text_;
  Frame held_;  // the newest sample: its velocity is known with the next
  std::vector<double> held_vx_, held_vy_;
  std::int64_t last_ = -1;
};

}  // namespace

WriterOr write_archive_text(const std::string& path, const WriteSpec& spec) {
  return opened<ArchiveWriter>(path, spec);
}

WriterOr write_obsmat(const std::string& path, const WriteSpec& spec) {
  return opened<ObsmatWriter>(path, spec);
}

}  // namespace throng::trajectory::detail
