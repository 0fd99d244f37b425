#include "render/raster/gl/cuda_interop.hpp"

#include <absl/strings/str_cat.h>
// epoxy stands for GL/gl.h, which CUDA's header asks for
#include <epoxy/gl.h>

#include <cuda_gl_interop.h>
#include <cuda_runtime_api.h>

#include <algorithm>
#include <cstddef>

#include "render/compute/cuda/device.hpp"
#include "render/compute/cuda/device_frame.hpp"
#include "render/compute/cuda/memory.hpp"

namespace throng::render::gl {
namespace {

constexpr char kCall[] = "gl draw: CUDA-GL";

/// A buffer of OpenGL that CUDA writes. Only grows.
class SharedBuffer {
 public:
  ~SharedBuffer() { release(); }

  absl::Status reserve(std::size_t size_bytes) {
    if (size_bytes <= size_bytes_) return absl::OkStatus();
    release();
    size_bytes += size_bytes / 2;
    glCreateBuffers(1, &name_);
    glNamedBufferStorage(name_, static_cast<GLsizeiptr>(size_bytes), nullptr, 0);
    if (glGetError() != GL_NO_ERROR) {
      release();
      return absl::ResourceExhaustedError(
          absl::StrCat(kCall, ": no buffer of ", size_bytes, " bytes"));
    }
    if (const cudaError_t error =
            cudaGraphicsGLRegisterBuffer(&resource_, name_, cudaGraphicsRegisterFlagsWriteDiscard);
        error != cudaSuccess) {
      resource_ = nullptr;
      release();
      return cuda::to_status(error, "gl draw: cudaGraphicsGLRegisterBuffer");
    }
    size_bytes_ = size_bytes;
    return absl::OkStatus();
  }

  /// While mapped.
  cudaError_t copy(const void* from, std::size_t size_bytes, cudaStream_t stream) const {
    void* to = nullptr;
    std::size_t room_bytes = 0;
    const cudaError_t error = cudaGraphicsResourceGetMappedPointer(&to, &room_bytes, resource_);
    if (error != cudaSuccess) return error;
    if (room_bytes < size_bytes) return cudaErrorInvalidValue;
    return cudaMemcpyAsync(to, from, size_bytes, cudaMemcpyDeviceToDevice, stream);
  }

  GLuint name() const { return name_; }
  cudaGraphicsResource_t resource() const { return resource_; }

 private:
  void release() {
    if (resource_ != nullptr) cudaGraphicsUnregisterResource(resource_);
    if (name_ != 0) glDeleteBuffers(1, &name_);
    resource_ = nullptr;
    name_ = 0;
    size_bytes_ = 0;
  }
  GLuint name_ = 0;
  cudaGraphicsResource_t resource_ = nullptr;
  std::size_t size_bytes_ = 0;
};

class Interop final : public CudaInterop {
 public:
  explicit Interop(int device) : device_(device) {}

  absl::StatusOr<FrameGeometry> stage(const DeviceGeometry& on_device) override {
    const auto* frame = dynamic_cast<const cuda::DeviceFrame*>(&on_device);
    if (frame == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat(kCall, ": the geometry is of another backend"));
    }
    THRONG_CUDA_TRY(cudaSetDevice(device_), kCall);
    if (absl::Status status = share(*frame); !status.ok()) return status;
    return fetch_lists(*frame);
  }
  unsigned vertices() const override { return vertices_.name(); }
  unsigned indices() const override { return indices_.name(); }
  unsigned command() const override { return command_.name(); }

 private:
  static std::size_t vertex_bytes(const cuda::DeviceFrame& frame) {
    return frame.vertex_count * sizeof(BatchVertex);
  }
  static std::size_t index_bytes(const cuda::DeviceFrame& frame) {
    return 3 * frame.triangle_count * sizeof(std::uint32_t);
  }

  /// Vertices and indices into the buffers.
  absl::Status share(const cuda::DeviceFrame& frame) {
    if (frame.triangle_count == 0) return absl::OkStatus();
    if (auto status = vertices_.reserve(vertex_bytes(frame)); !status.ok()) return status;
    if (auto status = indices_.reserve(index_bytes(frame)); !status.ok()) return status;
    if (auto status = command_.reserve(sizeof(cuda::DrawCommand)); !status.ok()) return status;
    cudaGraphicsResource_t all[] = {vertices_.resource(), indices_.resource(), command_.resource()};
    THRONG_CUDA_TRY(cudaGraphicsMapResources(3, all, frame.stream), kCall);
    cudaError_t error = vertices_.copy(frame.vertices, vertex_bytes(frame), frame.stream);
    if (error == cudaSuccess) {
      error = indices_.copy(frame.indices, index_bytes(frame), frame.stream);
    }
    if (error == cudaSuccess) {
      error = command_.copy(frame.command, sizeof(cuda::DrawCommand), frame.stream);
    }
    // what OpenGL does next comes after the copies; whatever failed, it gets its buffers back
    const cudaError_t unmapped = cudaGraphicsUnmapResources(3, all, frame.stream);
    return cuda::to_status(error != cudaSuccess ? error : unmapped, kCall);
  }

  /// What shading and shadows look at on the host: 56 bytes an instance.
  absl::StatusOr<FrameGeometry> fetch_lists(const cuda::DeviceFrame& frame) {
    const std::size_t count = frame.instance_count;
    const std::size_t instances_bytes = count * sizeof(VisibleInstance);
    const std::size_t offsets_bytes = (count + 1) * sizeof(std::uint32_t);
    THRONG_CUDA_TRY(lists_.resize(instances_bytes + 2 * offsets_bytes), kCall);
    auto* instances = static_cast<std::byte*>(lists_.data());
    std::byte* vertex_offset = instances + instances_bytes;
    std::byte* triangle_offset = vertex_offset + offsets_bytes;
    const auto fetch = [&](std::byte* to, const void* from, std::size_t bytes) {
      return count == 0 ? cudaSuccess
                        : cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, frame.stream);
    };
    THRONG_CUDA_TRY(fetch(instances, frame.instances, instances_bytes), kCall);
    THRONG_CUDA_TRY(fetch(vertex_offset, frame.vertex_offset, offsets_bytes), kCall);
    THRONG_CUDA_TRY(fetch(triangle_offset, frame.triangle_offset, offsets_bytes), kCall);
    THRONG_CUDA_TRY(cudaStreamSynchronize(frame.stream), kCall);
    FrameGeometry geometry;
    if (count == 0) return geometry;
    geometry.instances = {reinterpret_cast<const VisibleInstance*>(instances), count};
    geometry.vertex_offset = {reinterpret_cast<const std::uint32_t*>(vertex_offset), count + 1};
    geometry.triangle_offset = {reinterpret_cast<const std::uint32_t*>(triangle_offset), count + 1};
    geometry.vertices = {frame.vertices, frame.vertex_count};
    geometry.indices = {frame.indices, 3 * frame.triangle_count};
    return geometry;
  }

  int device_;
  SharedBuffer vertices_, indices_, command_;
  cuda::PinnedBuffer lists_;
};

}  // namespace

absl::StatusOr<int> interop_device() { return cuda::open_device("CUDA-GL"); }

absl::StatusOr<std::unique_ptr<CudaInterop>> make_cuda_interop(int device) {
  constexpr unsigned kMost = 16;
  unsigned count = 0;
  int devices[kMost] = {};
  if (const cudaError_t error = cudaGLGetDevices(&count, devices, kMost, cudaGLDeviceListAll);
      error != cudaSuccess) {
    cudaGetLastError();
    return absl::UnavailableError(
        absl::StrCat("CUDA-GL: cudaGLGetDevices: ", cudaGetErrorString(error),
                     ": OpenGL draws on no CUDA device"));
  }
  if (std::find(devices, devices + std::min(count, kMost), device) ==
      devices + std::min(count, kMost)) {
    return absl::UnavailableError(
        absl::StrCat("CUDA-GL: OpenGL does not draw on CUDA device ", device));
  }
  return std::make_unique<Interop>(device);
}

}  // namespace throng::render::gl
