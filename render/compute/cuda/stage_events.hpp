#pragma once

#include <cuda_runtime_api.h>

#include <array>
#include <cstddef>

namespace throng::render::cuda {

/// The moments between stages, on the device's clock. Times are 0 until they are known.
template <std::size_t kMoments>
class StageEvents {
 public:
  StageEvents() = default;
  StageEvents(const StageEvents&) = delete;
  StageEvents& operator=(const StageEvents&) = delete;
  ~StageEvents() {
    if (!made_) return;
    for (cudaEvent_t event : events_) cudaEventDestroy(event);
  }

  /// @param captured  into a graph: the moment is then when the graph gets there.
  cudaError_t record(std::size_t moment, cudaStream_t stream, bool captured) {
    if (const cudaError_t error = make(); error != cudaSuccess) return error;
    return cudaEventRecordWithFlags(events_[moment], stream,
                                    captured ? cudaEventRecordExternal : cudaEventRecordDefault);
  }

  /// Events can't be made while a graph is captured.
  cudaError_t make() {
    if (made_) return cudaSuccess;
    for (cudaEvent_t& event : events_) {
      if (const cudaError_t error = cudaEventCreate(&event); error != cudaSuccess) return error;
    }
    made_ = true;
    return cudaSuccess;
  }

  double ms(std::size_t from, std::size_t to) const {
    float ms = 0.0F;
    if (!made_ || cudaEventElapsedTime(&ms, events_[from], events_[to]) != cudaSuccess) {
      cudaGetLastError();  // not there yet is no error
      return 0.0;
    }
    return static_cast<double>(ms);
  }

 private:
  std::array<cudaEvent_t, kMoments> events_{};
  bool made_ = false;
};

}  // namespace throng::render::cuda
