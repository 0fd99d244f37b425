#pragma once

#include <absl/status/status.h>
#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

namespace throng::render::cuda {

/// OK, ResourceExhausted when memory ran out, else Internal with the runtime's own words.
absl::Status to_status(cudaError_t error, const char* call);

#define THRONG_CUDA_TRY(expression, call)                                     \
  if (const cudaError_t try_error = (expression); try_error != cudaSuccess) { \
    return ::throng::render::cuda::to_status(try_error, call);                \
  }

/// cudaMallocAsync within the limit of limit_device_memory: cudaErrorMemoryAllocation beyond it,
/// and the next to_status of this thread says what was wanted and what there is.
cudaError_t allocate_device(void** data, std::size_t size_bytes, cudaStream_t stream);
void free_device(void* data, std::size_t size_bytes, cudaStream_t stream);

/// Of all buffers of this process.
void limit_device_memory(std::uint64_t size_bytes);
std::uint64_t device_memory_held();

/// Device memory of one stream that only grows; growing forgets the contents. It is given back in
/// the order of the stream, so that a kernel still under way keeps what it reads.
template <typename T>
class DeviceBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  explicit DeviceBuffer(cudaStream_t stream) : stream_(stream) {}
  ~DeviceBuffer() { release(); }
  DeviceBuffer(DeviceBuffer&& other) noexcept
      : stream_(other.stream_),
        data_(std::exchange(other.data_, nullptr)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  DeviceBuffer& operator=(DeviceBuffer&&) = delete;
  /// Both are of one stream.
  void swap(DeviceBuffer& other) {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
  }

  cudaError_t resize(std::size_t size) {
    if (size <= capacity_) return cudaSuccess;
    const std::size_t capacity = size + size / 2;  // a crowd that grows slowly allocates rarely
    release();
    void* data = nullptr;
    cudaError_t error = allocate_device(&data, capacity * sizeof(T), stream_);
    if (error == cudaErrorMemoryAllocation) {  // with no room to grow it may fit
      cudaGetLastError();
      error = allocate_device(&data, size * sizeof(T), stream_);
      if (error == cudaSuccess) capacity_ = size;
    } else if (error == cudaSuccess) {
      capacity_ = capacity;
    }
    if (error != cudaSuccess) return error;
    data_ = static_cast<T*>(data);
    return cudaSuccess;
  }
  T* data() const { return data_; }
  std::size_t size_bytes() const { return capacity_ * sizeof(T); }

  void release() {
    if (data_ != nullptr) free_device(data_, size_bytes(), stream_);
    data_ = nullptr;
    capacity_ = 0;
  }

 private:
  cudaStream_t stream_;
  T* data_ = nullptr;
  std::size_t capacity_ = 0;
};

/// Page-locked memory of the host, which copies go through without waiting. Only grows.
class PinnedBuffer {
 public:
  PinnedBuffer() = default;
  ~PinnedBuffer() { release(); }
  PinnedBuffer(const PinnedBuffer&) = delete;
  PinnedBuffer& operator=(const PinnedBuffer&) = delete;

  cudaError_t resize(std::size_t size_bytes) {
    if (size_bytes <= capacity_) return cudaSuccess;
    release();
    const std::size_t capacity = size_bytes + size_bytes / 2;
    if (const cudaError_t error = cudaMallocHost(&data_, capacity); error != cudaSuccess) {
      data_ = nullptr;
      return error;
    }
    capacity_ = capacity;
    return cudaSuccess;
  }
  void* data() const { return data_; }
  std::size_t size_bytes() const { return capacity_; }

 private:
  void release() {
    if (data_ != nullptr) cudaFreeHost(data_);
    data_ = nullptr;
    capacity_ = 0;
  }
  void* data_ = nullptr;
  std::size_t capacity_ = 0;
};

}  // namespace throng::render::cuda
