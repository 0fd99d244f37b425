#include "render/raster/gl/egl_context.hpp"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "throng/render/raster.hpp"

namespace throng::render::gl {
namespace {

std::string egl_error() {
  const EGLint code = eglGetError();
  switch (code) {
    case EGL_SUCCESS:
      return "EGL_SUCCESS";
    case EGL_NOT_INITIALIZED:
      return "EGL_NOT_INITIALIZED";
    case EGL_BAD_ACCESS:
      return "EGL_BAD_ACCESS";
    case EGL_BAD_ALLOC:
      return "EGL_BAD_ALLOC";
    case EGL_BAD_ATTRIBUTE:
      return "EGL_BAD_ATTRIBUTE";
    case EGL_BAD_CONFIG:
      return "EGL_BAD_CONFIG";
    case EGL_BAD_CONTEXT:
      return "EGL_BAD_CONTEXT";
    case EGL_BAD_DISPLAY:
      return "EGL_BAD_DISPLAY";
    case EGL_BAD_MATCH:
      return "EGL_BAD_MATCH";
    case EGL_BAD_PARAMETER:
      return "EGL_BAD_PARAMETER";
    default:
      return absl::StrCat("EGL error 0x", absl::Hex(code));
  }
}

bool has_extension(const char* extensions, absl::string_view name) {
  if (extensions == nullptr) return false;
  for (absl::string_view extension : absl::StrSplit(extensions, ' ')) {
    if (extension == name) return true;
  }
  return false;
}

std::string gl_string(GLenum name) {
  const GLubyte* text = glGetString(name);
  return text == nullptr ? "unknown" : reinterpret_cast<const char*>(text);
}

constexpr char kRemedy[] =
    "the graphics part of the device's driver is missing: install it (for an NVIDIA GPU in a "
    "container NVIDIA_DRIVER_CAPABILITIES must name graphics), or libegl-mesa0 to draw on the "
    "processor";

/// One way to a display.
struct Rung {
  std::string name;
  EGLDeviceEXT device = nullptr;  // null: the surfaceless platform
  bool software = false;
  int cuda_device = -1;  // as CUDA counts, -1: none that EGL knows of
};

/// Which extensions the EGL library has, and the rungs they open, best first.
struct Platforms {
  std::string problem;  // not empty: nothing can be tried
  std::vector<Rung> rungs;
  std::vector<std::string> notes;
};

Platforms find_platforms() {
  Platforms found;
  // libepoxy ends the process when the library is not there, so look first.
  static void* library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_GLOBAL);
  if (library == nullptr) {
    found.problem = absl::StrCat("libEGL.so.1 is not installed (Debian: libegl1); ", kRemedy);
    return found;
  }
  const char* extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (extensions == nullptr) {
    found.problem = absl::StrCat("EGL has no client extensions (", egl_error(),
                                 "): no driver is registered under glvnd/egl_vendor.d; ", kRemedy);
    return found;
  }
  const bool devices = has_extension(extensions, "EGL_EXT_platform_device") &&
                       (has_extension(extensions, "EGL_EXT_device_enumeration") ||
                        has_extension(extensions, "EGL_EXT_device_base"));
  std::vector<Rung> software;
  if (devices) {
    EGLDeviceEXT list[64];
    EGLint count = 0;
    if (eglQueryDevicesEXT(64, list, &count) == EGL_FALSE) {
      found.notes.push_back(absl::StrCat("device platform: eglQueryDevicesEXT: ", egl_error()));
      count = 0;
    } else if (count == 0) {
      found.notes.push_back("device platform: no devices");
    }
    for (EGLint i = 0; i < count; ++i) {
      Rung rung{absl::StrCat("EGL device ", i), list[i], false};
      const char* device_extensions = eglQueryDeviceStringEXT(list[i], EGL_EXTENSIONS);
      rung.software = has_extension(device_extensions, "EGL_MESA_device_software");
      if (EGLAttrib cuda = 0; has_extension(device_extensions, "EGL_NV_device_cuda") &&
                              eglQueryDeviceAttribEXT(list[i], EGL_CUDA_DEVICE_NV, &cuda)) {
        rung.cuda_device = static_cast<int>(cuda);
      }
      (rung.software ? software : found.rungs).push_back(std::move(rung));
    }
  } else {
    found.notes.push_back("device platform: EGL_EXT_platform_device is missing");
  }
  if (has_extension(extensions, "EGL_MESA_platform_surfaceless")) {
    found.rungs.push_back({"EGL surfaceless", nullptr, false});
  } else {
    found.notes.push_back("surfaceless platform: EGL_MESA_platform_surfaceless is missing");
  }
  found.rungs.insert(found.rungs.end(), software.begin(), software.end());
  return found;
}

}  // namespace

/// Tries a rung down to a current context.
struct Ladder {
  static absl::StatusOr<std::unique_ptr<EglContext>> climb(const Rung& rung) {
    const auto failed = [&](const char* call) {
      return absl::UnavailableError(absl::StrCat(rung.name, ": ", call, ": ", egl_error()));
    };
    EGLDisplay display =
        rung.device != nullptr
            ? eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, rung.device, nullptr)
            : eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    if (display == EGL_NO_DISPLAY) return failed("eglGetPlatformDisplay");
    // The display is never terminated: it is shared by every context of the process on this rung.
    EGLint major = 0, minor = 0;
    if (eglInitialize(display, &major, &minor) == EGL_FALSE) return failed("eglInitialize");
    const char* extensions = eglQueryString(display, EGL_EXTENSIONS);
    if (!has_extension(extensions, "EGL_KHR_surfaceless_context")) {
      return absl::UnavailableError(
          absl::StrCat(rung.name, ": EGL_KHR_surfaceless_context is missing"));
    }
    if (eglBindAPI(EGL_OPENGL_API) == EGL_FALSE) return failed("eglBindAPI(OpenGL)");

    EGLConfig config = nullptr;  // EGL_NO_CONFIG_KHR
    if (!has_extension(extensions, "EGL_KHR_no_config_context")) {
      const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE};
      EGLint count = 0;
      if (eglChooseConfig(display, wanted, &config, 1, &count) == EGL_FALSE || count == 0) {
        return failed("eglChooseConfig(OpenGL)");
      }
    }
    const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                 4,
                                 EGL_CONTEXT_MINOR_VERSION,
                                 5,
                                 EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                 EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                 EGL_NONE};
    EGLContext handle = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes);
    if (handle == EGL_NO_CONTEXT) return failed("eglCreateContext(4.5 core)");
    std::unique_ptr<EglContext> context(new EglContext);
    context->display_ = display;
    context->context_ = handle;
    context->platform_ = rung.name;
    BoundContext bound(*context);
    if (!bound.status().ok()) {
      return absl::UnavailableError(absl::StrCat(rung.name, ": ", bound.status().message()));
    }
    context->vendor_ = gl_string(GL_VENDOR);
    context->renderer_ = gl_string(GL_RENDERER);
    context->version_ = gl_string(GL_VERSION);
    context->software_ = rung.software || absl::StrContains(context->renderer_, "llvmpipe") ||
                         absl::StrContains(context->renderer_, "softpipe");
    if (epoxy_gl_version() < 45) {
      return absl::UnavailableError(
          absl::StrCat(rung.name, ": OpenGL is ", context->version_, ", must be 4.5 or newer"));
    }
    return context;
  }
};

absl::StatusOr<std::unique_ptr<EglContext>> EglContext::make(int cuda_device) {
  Platforms platforms = find_platforms();
  if (!platforms.problem.empty()) return absl::UnavailableError(platforms.problem);
  std::vector<std::string> reasons = platforms.notes;
  // by what EGL says of its devices, never by their order, which is another one than CUDA's
  if (cuda_device >= 0) {
    const auto others = std::stable_partition(
        platforms.rungs.begin(), platforms.rungs.end(),
        [cuda_device](const Rung& rung) { return rung.cuda_device == cuda_device; });
    if (others == platforms.rungs.begin()) {
      reasons.push_back(absl::StrCat("no EGL device is CUDA device ", cuda_device, ", ", kRemedy));
    }
  }
  const char* only = std::getenv("THRONG_EGL");
  for (const Rung& rung : platforms.rungs) {
    if (only != nullptr && *only != '\0') {
      const std::string name =
          rung.device == nullptr ? "surfaceless"
                                 : absl::StrCat("device:", rung.name.substr(sizeof("EGL device")));
      if (name != only) {
        reasons.push_back(absl::StrCat(rung.name, ": not asked for (THRONG_EGL=", only, ")"));
        continue;
      }
    }
    auto context = Ladder::climb(rung);
    if (context.ok()) {
      (*context)->passed_by_ = absl::StrJoin(reasons, "; ");
      return context;
    }
    reasons.emplace_back(context.status().message());
  }
  return absl::UnavailableError(absl::StrCat(
      "no EGL platform gives OpenGL 4.5 core: ", absl::StrJoin(reasons, "; "), "; ", kRemedy));
}

EglContext::~EglContext() {
  if (context_ != nullptr) eglDestroyContext(display_, context_);
}

absl::Status EglContext::bind() {
  before_display_ = eglGetCurrentDisplay();
  before_context_ = eglGetCurrentContext();
  before_draw_ = eglGetCurrentSurface(EGL_DRAW);
  before_read_ = eglGetCurrentSurface(EGL_READ);
  eglBindAPI(EGL_OPENGL_API);  // a setting of the thread
  if (eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) == EGL_FALSE) {
    return absl::FailedPreconditionError(
        absl::StrCat("eglMakeCurrent on ", platform_, ": ", egl_error(),
                     " (is the context current on another thread?)"));
  }
  return absl::OkStatus();
}

void EglContext::unbind() {
  if (before_context_ != EGL_NO_CONTEXT && before_context_ != context_) {
    eglMakeCurrent(before_display_, before_draw_, before_read_, before_context_);
  } else if (before_context_ == EGL_NO_CONTEXT) {
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  }
}

void* EglContext::make_fence() {
  if (epoxy_egl_version(display_) < 15) return nullptr;
  // epoxy looks a function up when it is first called, and ends the program where the calling
  // thread has no context then, as those have none that wait for fences and drop them
  static const bool is_looked_up = [this] {
    const EGLSync first = eglCreateSync(display_, EGL_SYNC_FENCE, nullptr);
    eglClientWaitSync(display_, first, 0, 0);
    return eglDestroySync(display_, first) == EGL_TRUE;
  }();
  (void)is_looked_up;
  const EGLSync fence = eglCreateSync(display_, EGL_SYNC_FENCE, nullptr);
  glFlush();
  return fence == EGL_NO_SYNC ? nullptr : fence;
}

absl::Status EglContext::wait(void* fence) const {
  constexpr EGLTime kMostNs = 10'000'000'000;
  const EGLint waited = eglClientWaitSync(display_, fence, 0, kMostNs);
  if (waited == EGL_CONDITION_SATISFIED) return absl::OkStatus();
  return absl::InternalError(waited == EGL_TIMEOUT_EXPIRED
                                 ? "gl: a picture was not drawn within 10 s"
                                 : "gl: the fence of a picture was lost");
}

void EglContext::drop_fence(void* fence) const {
  if (fence != nullptr) eglDestroySync(display_, fence);
}

}  // namespace throng::render::gl

namespace throng::render {

std::vector<std::string> describe_egl() {
  gl::Platforms platforms = gl::find_platforms();
  if (!platforms.problem.empty()) return {platforms.problem};
  std::vector<std::string> lines = platforms.notes;
  for (const gl::Rung& rung : platforms.rungs) {
    const auto context = gl::Ladder::climb(rung);
    const std::string cuda =
        rung.cuda_device < 0 ? "" : absl::StrCat(" (CUDA device ", rung.cuda_device, ")");
    lines.push_back(context.ok()
                        ? absl::StrCat(rung.name, cuda, ": ",
                                       (*context)->software() ? "software" : "hardware", ", ",
                                       (*context)->renderer(), ", OpenGL ", (*context)->version())
                        : absl::StrCat(context.status().message(), cuda));
  }
  return lines;
}

}  // namespace throng::render
