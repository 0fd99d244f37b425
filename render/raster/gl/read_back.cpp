#include "render/raster/gl/read_back.hpp"

#include <absl/strings/str_cat.h>

#include <atomic>
#include <cstring>
#include <new>
#include <utility>

namespace throng::render::gl {

GlPicture::~GlPicture() { context_->drop_fence(fence_); }

absl::Status GlPicture::resize(std::uint32_t width_px, std::uint32_t height_px) {
  context_->drop_fence(std::exchange(fence_, nullptr));
  size_bytes_ = std::size_t{4} * width_px * height_px;
  if (size_bytes_ <= capacity_) return absl::OkStatus();
  release();
  constexpr GLbitfield kFlags = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
  const auto size = static_cast<GLsizeiptr>(size_bytes_);
  glCreateBuffers(1, &buffer_);
  glNamedBufferStorage(buffer_, size, nullptr, kFlags | GL_CLIENT_STORAGE_BIT);
  data_ = glMapNamedBufferRange(buffer_, 0, size, kFlags);
  if (data_ == nullptr) {
    while (glGetError() != GL_NO_ERROR) {
    }
    release();
    return absl::ResourceExhaustedError(
        absl::StrCat("gl draw: no pixel buffer of ", size_bytes_, " bytes"));
  }
  capacity_ = size_bytes_;
  return absl::OkStatus();
}

void GlPicture::release() {
  if (buffer_ != 0) glDeleteBuffers(1, &buffer_);
  buffer_ = 0;
  data_ = nullptr;
  capacity_ = 0;
}

void GlPicture::close() {
  fence_ = context_->make_fence();
  if (fence_ == nullptr) glFinish();  // EGL before 1.5: nothing to wait for then
}

absl::Status GlPicture::wait() {
  return fence_ == nullptr ? absl::OkStatus() : context_->wait(fence_);
}

absl::Status GlPicture::fetch(std::vector<std::uint8_t>& rgbx) {
  if (absl::Status status = wait(); !status.ok()) return status;
  try {
    rgbx.resize(size_bytes_);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("fetch a picture: no memory for its pixels");
  }
  std::memcpy(rgbx.data(), data_, size_bytes_);
  return absl::OkStatus();
}

absl::Status GlPicture::encode_jpeg(int, std::vector<std::uint8_t>&) {
  return absl::UnimplementedError("encode a picture: OpenGL has no encoder");
}

absl::StatusOr<std::shared_ptr<GlPicture>> ReadBack::take(
    const std::shared_ptr<EglContext>& context, std::uint32_t width_px, std::uint32_t height_px) {
  std::shared_ptr<GlPicture> found;
  for (const std::shared_ptr<GlPicture>& picture : pictures_) {
    if (picture.use_count() != 1) continue;
    std::atomic_thread_fence(std::memory_order_acquire);  // what its last user did is done
    found = picture;
    break;
  }
  if (found == nullptr) {
    found.reset(new GlPicture(context));
    pictures_.push_back(found);
  }
  if (absl::Status status = found->resize(width_px, height_px); !status.ok()) return status;
  return found;
}

void ReadBack::release() {
  for (const std::shared_ptr<GlPicture>& picture : pictures_) {
    if (picture.use_count() == 1) picture->release();
  }
  pictures_.clear();
}

}  // namespace throng::render::gl
