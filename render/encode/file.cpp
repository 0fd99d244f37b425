#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "throng/render/encode.hpp"

namespace throng::render {
namespace {

absl::Status file_error(const char* call, const std::string& path, int error) {
  return absl::UnavailableError(
      absl::StrCat("write_file: ", call, " ", path, ": ", std::strerror(error)));
}

}  // namespace

absl::Status make_folder_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) return absl::OkStatus();
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat(folder.string(), ": can't be made: ", error.message()));
}

absl::Status write_file(const std::string& path, std::span<const std::uint8_t> bytes) {
  // Process and counter in the name: several writers may aim at one path, the last rename wins.
  static std::atomic<unsigned> counter{0};
  const std::string temporary =
      absl::StrCat(path, ".", ::getpid(), ".", counter.fetch_add(1), ".part");
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0) return file_error("open", temporary, errno);

  int error = 0;
  const char* failed = nullptr;
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count = ::write(file, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      error = errno;
      failed = "write";
      break;
    }
    done += static_cast<std::size_t>(count);
  }
  // Some file systems cannot sync (EINVAL, ENOTSUP): the rename is still atomic there.
  if (failed == nullptr && ::fsync(file) != 0 && errno != EINVAL && errno != ENOTSUP) {
    error = errno;
    failed = "fsync";
  }
  if (::close(file) != 0 && failed == nullptr) {
    error = errno;
    failed = "close";
  }
  if (failed == nullptr && std::rename(temporary.c_str(), path.c_str()) != 0) {
    error = errno;
    failed = "rename";
  }
  if (failed == nullptr) return absl::OkStatus();
  ::unlink(temporary.c_str());
  return file_error(failed, failed == std::string("rename") ? path : temporary, error);
}

}  // namespace throng::render
