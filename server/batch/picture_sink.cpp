#include "server/batch/picture_sink.hpp"

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "server/batch/passes.hpp"

namespace throng::server {
namespace {

template <typename Bytes>
absl::Status write_bytes(const std::string& path, const absl::StatusOr<Bytes>& bytes) {
  if (!bytes.ok()) return bytes.status();
  if (absl::Status status = render::make_folder_of(path); !status.ok()) return status;
  return render::write_file(path, *bytes);
}

}  // namespace

PictureSink::PictureSink(OutputKind kind, int jpeg_quality, render::VideoWriter* video,
                         int stream_fd)
    : kind_(kind),
      jpeg_quality_(jpeg_quality),
      video_(video),
      stream_fd_(stream_fd),
      thread_([this] { run(); }) {}

void PictureSink::add(FinishedPicture finished) {
  std::unique_lock lock(mutex_);
  idle_.wait(lock, [this] { return !waiting_; });
  finished_ = std::move(finished);
  waiting_ = true;
  work_.notify_one();
}

bool PictureSink::failed() {
  const std::lock_guard lock(mutex_);
  return !failures_.empty();
}

const std::vector<std::pair<std::string, absl::Status>>& PictureSink::drain() {
  {
    std::unique_lock lock(mutex_);
    idle_.wait(lock, [this] { return !waiting_; });
    ended_ = true;
    work_.notify_one();
  }
  if (thread_.joinable()) thread_.join();
  return failures_;
}

absl::Status PictureSink::write_stream() {
  const render::Picture& picture = finished_.picture;
  std::string bytes = absl::StrCat("P6\n", picture.width_px, " ", picture.height_px, "\n255\n");
  const std::size_t first = bytes.size(), pixels = picture.rgbx.size() / 4;
  bytes.resize(first + 3 * pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    std::memcpy(bytes.data() + first + 3 * i, picture.rgbx.data() + 4 * i, 3);
  }
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count = ::write(stream_fd_, bytes.data() + done, bytes.size() - done);
    if (count >= 0) {
      done += static_cast<std::size_t>(count);
    } else if (errno != EINTR) {
      return absl::UnavailableError(
          absl::StrCat("standard output: can't be written: ", std::strerror(errno)));
    }
  }
  return absl::OkStatus();
}

absl::Status PictureSink::write_color() {
  const render::Picture& picture = finished_.picture;
  switch (kind_) {
    case OutputKind::kVideo:
      return video_->add(picture.rgbx, finished_.time_us);
    case OutputKind::kStream:
      return write_stream();
    case OutputKind::kPng:
      return write_bytes(finished_.color_path,
                         render::encode_png(picture.rgbx, picture.width_px, picture.height_px));
    case OutputKind::kJpeg:
      return write_bytes(finished_.color_path, jpeg_.encode(picture.rgbx, picture.width_px,
                                                            picture.height_px, jpeg_quality_));
    case OutputKind::kExr:
      break;
  }
  return absl::InternalError("PictureSink: EXR holds no colours");
}

absl::Status PictureSink::write() {
  if (!finished_.color_path.empty()) {
    if (absl::Status status = write_color(); !status.ok()) return status;
  }
  if (!finished_.depth_path.empty()) {
    absl::Status status = write_bytes(finished_.depth_path, encode_depth(finished_.passes));
    if (!status.ok()) return status;
  }
  if (finished_.id_path.empty()) return absl::OkStatus();
  return write_bytes(finished_.id_path, encode_ids(finished_.passes));
}

void PictureSink::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    work_.wait(lock, [this] { return waiting_ || ended_; });
    if (!waiting_) return;
    lock.unlock();
    absl::Status status = write();
    lock.lock();
    if (!status.ok()) failures_.emplace_back(finished_.color_path, std::move(status));
    waiting_ = false;
    idle_.notify_all();
  }
}

}  // namespace throng::server
