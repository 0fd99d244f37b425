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

absl::Status write_json(const std::string& file, const nlohmann::ordered_json& json) {
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  std::error_code error;
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  // a NaN becomes null: a number that was not measured
  const std::string text = json.dump(1) + "\n";
  return render::write_file(file,
                            {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

}  // namespace throng::bench
