#pragma once

#include <absl/status/statusor.h>
#include <epoxy/gl.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "render/raster/gl/egl_context.hpp"
#include "throng/render/device_picture.hpp"

namespace throng::render::gl {

/// Pixels on their way from OpenGL: a pixel buffer that stays mapped, and a fence that tells when
/// they are there. The fence is EGL's, so that any thread may wait for it without a context.
class GlPicture final : public DevicePicture {
 public:
  ~GlPicture() override;
  absl::Status fetch(std::vector<std::uint8_t>& rgbx) override;
  absl::Status encode_jpeg(int quality, std::vector<std::uint8_t>& jpeg) override;

  /// Until the frame is drawn and read. Of any thread.
  absl::Status wait();
  GLuint buffer() const { return buffer_; }
  /// What was asked of OpenGL so far ends in the picture. On the context's thread.
  void close();

 private:
  friend class ReadBack;
  explicit GlPicture(std::shared_ptr<EglContext> context) : context_(std::move(context)) {}
  /// Needs the bound context, as does the end of the buffer; with the context it ends anyway.
  absl::Status resize(std::uint32_t width_px, std::uint32_t height_px);
  void release();

  std::shared_ptr<EglContext> context_;  // pictures may outlive the rasterizer
  std::size_t size_bytes_ = 0, capacity_ = 0;
  GLuint buffer_ = 0;
  const void* data_ = nullptr;
  void* fence_ = nullptr;
};

/// The pictures of a rasterizer: one is drawn while another is fetched. Needs the bound context in
/// every call.
class ReadBack {
 public:
  /// One that nobody looks at any more.
  absl::StatusOr<std::shared_ptr<GlPicture>> take(const std::shared_ptr<EglContext>& context,
                                                  std::uint32_t width_px, std::uint32_t height_px);
  void release();

 private:
  std::vector<std::shared_ptr<GlPicture>> pictures_;  // those that nobody else has are free
};

}  // namespace throng::render::gl
