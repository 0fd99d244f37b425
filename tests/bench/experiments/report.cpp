#include "bench/experiments/report.hpp"

#include <unistd.h>

#include <cstdio>
#include <filesystem>

#include "throng/render/encode.hpp"

namespace throng::bench {

std::atomic<bool> stop_requested = false;

Progress::Progress(std::string what, std::size_t total)
    : what_(std::move(what)), total_(total), terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (terminal_ && done_ > 0) std::fputc('\n', stderr);
}

void Progress::step(const std::string& detail) {
  ++done_;
  if (terminal_) {
    std::fprintf(stderr, "\r%s %zu/%zu %s\033[K", what_.c_str(), done_, total_, detail.c_str());
  } else if (done_ == total_ || done_ * 4 / total_ != (done_ - 1) * 4 / total_) {
    std::fprintf(stderr, "%s %zu/%zu %s\n", what_.c_str(), done_, total_, detail.c_str());
  }
}

namespace {

absl::Status write(const std::string& file, std::span<const std::uint8_t> bytes) {
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  std::error_code error;  // write_file says what is wrong
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  const absl::Status status = render::write_file(file, bytes);
  return status.ok() ? status : absl::PermissionDeniedError(status.message());
}

}  // namespace

absl::Status write_json(const std::string& file, const nlohmann::ordered_json& json) {
  // a NaN becomes null: a number that was not measured
  const std::string text = json.dump(1) + "\n";
  return write(file, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

absl::Status write_png(const std::string& file, const render::Picture& picture) {
  const auto png = render::encode_png(picture.rgbx, picture.width_px, picture.height_px);
  return png.ok() ? write(file, *png) : png.status();
}

}  // namespace throng::bench
