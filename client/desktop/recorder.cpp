#include "client/desktop/recorder.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

namespace throng::client {

absl::Status Recorder::start(const std::string& path, const render::DecodedImage& first,
                             double now_s) {
  constexpr double kFps = 30.0;  // only a hint: every picture has its time
  auto video = render::open_video(path, first.width_px, first.height_px, kFps);
  if (!video.ok()) return video.status();
  video_ = *std::move(video);
  path_ = path;
  last_.reset();
  width_px_ = first.width_px;
  height_px_ = first.height_px;
  pictures_ = 0;
  began_s_ = now_s;
  last_us_ = -1;
  return absl::OkStatus();
}

absl::Status Recorder::add(const std::shared_ptr<const render::DecodedImage>& image, double now_s) {
  if (video_ == nullptr || image == nullptr || image == last_) return absl::OkStatus();
  if (image->width_px != width_px_ || image->height_px != height_px_) {
    return absl::FailedPreconditionError("the picture has another size now");
  }
  const std::int64_t time_us = std::llround((now_s - began_s_) * 1e6);
  last_us_ = std::max(last_us_ + 1, time_us);
  if (absl::Status status = video_->add(image->rgbx, last_us_); !status.ok()) return status;
  last_ = image;
  ++pictures_;
  return absl::OkStatus();
}

absl::StatusOr<std::string> Recorder::stop() {
  const std::unique_ptr<render::VideoWriter> video = std::move(video_);
  last_.reset();
  if (pictures_ == 0) return std::string("Nothing recorded: no picture came in that time");
  if (absl::Status status = video->finish(); !status.ok()) return status;
  return absl::StrCat("Saved ", path_, ", ", pictures_, " pictures");
}

}  // namespace throng::client
