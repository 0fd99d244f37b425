#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>

namespace throng::render::gl {

/// A context of OpenGL 4.5 core without any surface, on the first EGL platform that gives one: the
/// device platform on hardware, Mesa's surfaceless platform, the device platform on software.
/// The environment variable THRONG_EGL chooses one instead: `device:N` or `surfaceless`.
class EglContext {
 public:
  /// Unavailable with a reason for each platform and device that was tried.
  /// @param cuda_device  an EGL device that is this CUDA device is tried first, and where it is not
  ///   taken `passed_by` says why; -1: none is asked for.
  static absl::StatusOr<std::unique_ptr<EglContext>> make(int cuda_device = -1);
  ~EglContext();
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  /// Makes the context current on this thread. FailedPrecondition while another thread has it.
  absl::Status bind();
  /// Gives the thread back whatever context it had before `bind`.
  void unbind();

  /// What was asked of the bound context so far, flushed; null where EGL has no fences.
  void* make_fence();
  /// Waits until it is done. Of any thread. Internal when it is not within ten seconds.
  absl::Status wait(void* fence) const;
  void drop_fence(void* fence) const;

  const std::string& platform() const { return platform_; }  // "EGL surfaceless", "EGL device 0"
  const std::string& vendor() const { return vendor_; }
  const std::string& renderer() const { return renderer_; }
  const std::string& version() const { return version_; }
  bool software() const { return software_; }
  /// Why not on a platform that would have been better, empty: there is none.
  const std::string& passed_by() const { return passed_by_; }

 private:
  friend struct Ladder;
  EglContext() = default;
  void* display_ = nullptr;
  void* context_ = nullptr;
  void* before_display_ = nullptr;
  void* before_context_ = nullptr;
  void* before_draw_ = nullptr;
  void* before_read_ = nullptr;
  std::string platform_, vendor_, renderer_, version_, passed_by_;
  bool software_ = false;
};

/// Binds for a scope.
class BoundContext {
 public:
  explicit BoundContext(EglContext& context) : context_(context), status_(context.bind()) {}
  ~BoundContext() {
    if (status_.ok()) context_.unbind();
  }
  const absl::Status& status() const { return status_; }

 private:
  EglContext& context_;
  absl::Status status_;
};

}  // namespace throng::render::gl
