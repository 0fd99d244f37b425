#pragma once

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cstddef>

namespace throng::render::gl {

/// A buffer that stays mapped. A draw ends with a read-back, so nobody reads it when it is written.
/// Needs the bound context in every call, its end included.
class MappedBuffer {
 public:
  ~MappedBuffer() { release(); }
  void release() {
    if (name_ != 0) glDeleteBuffers(1, &name_);
    name_ = 0;
    size_bytes_ = 0;
    data_ = nullptr;
  }
  absl::Status reserve(std::size_t size_bytes) {
    size_bytes = std::max<std::size_t>(size_bytes, 256);
    if (size_bytes <= size_bytes_) return absl::OkStatus();
    size_bytes += size_bytes / 2;
    release();
    constexpr GLbitfield kFlags = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    glCreateBuffers(1, &name_);
    glNamedBufferStorage(name_, static_cast<GLsizeiptr>(size_bytes), nullptr, kFlags);
    data_ = glMapNamedBufferRange(name_, 0, static_cast<GLsizeiptr>(size_bytes), kFlags);
    if (data_ == nullptr) {
      while (glGetError() != GL_NO_ERROR) {
      }
      release();
      return absl::ResourceExhaustedError(
          absl::StrCat("gl draw: no buffer of ", size_bytes, " bytes"));
    }
    size_bytes_ = size_bytes;
    return absl::OkStatus();
  }
  GLuint name() const { return name_; }
  void* data() const { return data_; }

 private:
  GLuint name_ = 0;
  std::size_t size_bytes_ = 0;
  void* data_ = nullptr;
};

}  // namespace throng::render::gl
