#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

#include "throng/render/encode.hpp"

namespace throng::client {

/// Keeps the pictures that are shown as a video, at the times they were shown.
class Recorder {
 public:
  bool is_on() const { return video_ != nullptr; }

  /// Unavailable with the reason. The size of all pictures is that of the first.
  absl::Status start(const std::string& path, const render::DecodedImage& first, double now_s);

  /// FailedPrecondition: the picture has another size. A picture that is shown again costs nothing.
  absl::Status add(const std::shared_ptr<const render::DecodedImage>& image, double now_s);

  /// Ends the file. What there is to say of it.
  absl::StatusOr<std::string> stop();

 private:
  std::unique_ptr<render::VideoWriter> video_;
  std::string path_;
  std::shared_ptr<const render::DecodedImage> last_;
  std::uint32_t width_px_ = 0, height_px_ = 0, pictures_ = 0;
  double began_s_ = 0.0;
  std::int64_t last_us_ = -1;
};

}  // namespace throng::client
