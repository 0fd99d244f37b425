#include "client/cli/output.hpp"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "client/cli/commands.hpp"
#include "throng/render/encode.hpp"

namespace throng::client {
namespace {

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::string extension_of(const std::string& path) {
  return absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
}

class PictureFiles final : public PictureOutput {
 public:
  PictureFiles(std::string pattern, std::size_t begin, std::size_t digits)
      : pattern_(std::move(pattern)),
        begin_(begin),
        digits_(digits),
        png_(extension_of(pattern_) == ".png") {}

  absl::Status add(const std::string& jpeg, std::int64_t) override {
    const std::string path = path_of(++count_);
    if (!png_) return render::write_file(path, bytes_of(jpeg));
    const auto image = render::decode_jpeg(bytes_of(jpeg));
    if (!image.ok()) return image.status();
    const auto png = render::encode_png(image->rgbx, image->width_px, image->height_px);
    if (!png.ok()) return png.status();
    return render::write_file(path, *png);
  }

  absl::StatusOr<std::string> finish() override {
    if (count_ == 0) return absl::UnavailableError("no picture came");
    if (digits_ == 0) return pattern_;
    return absl::StrCat(path_of(1), " to ", path_of(count_));
  }

  bool single() const override { return digits_ == 0; }

 private:
  std::string path_of(std::uint64_t number) const {
    if (digits_ == 0) return pattern_;
    std::string digits = std::to_string(number);
    if (digits.size() < digits_) digits.insert(0, digits_ - digits.size(), '0');
    return pattern_.substr(0, begin_) + digits + pattern_.substr(begin_ + digits_);
  }

  const std::string pattern_;
  const std::size_t begin_, digits_;
  const bool png_;
  std::uint64_t count_ = 0;
};

class VideoFile final : public PictureOutput {
 public:
  VideoFile(std::string path, double fps, std::unique_ptr<render::VideoWriter> writer)
      : path_(std::move(path)), fps_(fps), writer_(std::move(writer)) {}

  absl::Status add(const std::string& jpeg, std::int64_t time_us) override {
    // On the grid of the frame rate: players jitter with times that are a little off.
    const auto tick =
        static_cast<std::int64_t>(std::llround(static_cast<double>(time_us) * 1e-6 * fps_));
    if (tick <= last_tick_) return absl::OkStatus();
    const auto image = render::decode_jpeg(bytes_of(jpeg));
    if (!image.ok()) return image.status();
    last_tick_ = tick;
    ++count_;
    return writer_->add(image->rgbx, std::llround(static_cast<double>(tick) * 1e6 / fps_));
  }

  absl::StatusOr<std::string> finish() override {
    if (count_ == 0) return absl::UnavailableError("no picture came");
    if (absl::Status status = writer_->finish(); !status.ok()) return status;
    return absl::StrCat(path_, " (", writer_->codec(), ")");
  }

 private:
  const std::string path_;
  const double fps_;
  std::unique_ptr<render::VideoWriter> writer_;
  std::int64_t last_tick_ = -1;
  std::uint64_t count_ = 0;
};

}  // namespace

int report(const char* command, const absl::Status& status) {
  std::fprintf(stderr, "throng %s: %s\n", command, std::string(status.message()).c_str());
  return kFailure;
}

bool has_terminal() {
  const char* term = std::getenv("TERM");
  return isatty(STDERR_FILENO) == 1 && std::getenv("NO_COLOR") == nullptr &&
         (term == nullptr || std::string(term) != "dumb");
}

void Progress::show(const std::string& text) {
  if (quiet_) return;
  static const bool terminal = has_terminal();
  const double now_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  if (now_s - last_s_ < (terminal ? 0.1 : 5.0)) return;
  last_s_ = now_s;
  if (terminal) {
    std::fprintf(stderr, "\r\033[K%s", text.c_str());
    std::fflush(stderr);
    open_ = true;
  } else {
    std::fprintf(stderr, "%s\n", text.c_str());
  }
}

void Progress::end() {
  if (open_) std::fprintf(stderr, "\r\033[K");
  open_ = false;
}

absl::StatusOr<std::unique_ptr<PictureOutput>> open_output(const std::string& pattern,
                                                           std::uint32_t width_px,
                                                           std::uint32_t height_px, double fps) {
  const std::string extension = extension_of(pattern);
  if (extension == ".jpg" || extension == ".jpeg" || extension == ".png") {
    const std::size_t first = pattern.find('#');
    std::size_t digits = 0;
    if (first != std::string::npos) {
      std::size_t end = pattern.find_first_not_of('#', first);
      if (end == std::string::npos) end = pattern.size();
      digits = end - first;
      if (pattern.find('#', end) != std::string::npos) {
        return absl::InvalidArgumentError(
            absl::StrCat("-o: '", pattern, "' has more than one run of #"));
      }
    }
    if (absl::Status status = render::make_folder_of(pattern); !status.ok()) return status;
    return std::make_unique<PictureFiles>(pattern, digits == 0 ? 0 : first, digits);
  }
  if (extension == ".mp4" || extension == ".mkv" || extension == ".mov") {
    if (absl::Status status = render::make_folder_of(pattern); !status.ok()) return status;
    auto writer = render::open_video(pattern, width_px, height_px, fps);
    if (!writer.ok()) return writer.status();
    return std::make_unique<VideoFile>(pattern, fps, *std::move(writer));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("-o: '", pattern, "' ends in none of .mp4 .mkv .mov .jpg .png"));
}

}  // namespace throng::client
