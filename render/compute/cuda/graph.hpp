#pragma once

#include <absl/status/status.h>
#include <cuda_runtime_api.h>

#include <utility>

#include "render/compute/cuda/memory.hpp"

namespace throng::render::cuda {

/// Launches that go to the device in one go. They are recorded anew for each frame, as their
/// arguments change, and put into the graph of the frame before, which is cheap while the kernels
/// are the same; where they are not, a new graph is made. The first time they are launched one by
/// one: kernels are loaded when they are first used, and that is not for a recording.
class LaunchGraph {
 public:
  LaunchGraph() = default;
  LaunchGraph(const LaunchGraph&) = delete;
  LaunchGraph& operator=(const LaunchGraph&) = delete;
  ~LaunchGraph() {
    if (ready_ != nullptr) cudaGraphExecDestroy(ready_);
    if (recorder_ != nullptr) cudaStreamDestroy(recorder_);
  }

  /// @param launches  called once, with a stream to launch on and whether it is recorded, and
  ///   does nothing else: no memory, no waiting.
  template <typename Launches>
  absl::Status run(cudaStream_t stream, const char* call, const Launches& launches) {
    if (!std::exchange(is_warm_, true)) return launches(stream, false);
    if (!has_recorder_) {
      THRONG_CUDA_TRY(cudaStreamCreateWithFlags(&recorder_, cudaStreamNonBlocking), call);
      has_recorder_ = true;
    }
    THRONG_CUDA_TRY(cudaStreamBeginCapture(recorder_, cudaStreamCaptureModeRelaxed), call);
    absl::Status status = launches(recorder_, true);
    cudaGraph_t graph = nullptr;
    const cudaError_t ended = cudaStreamEndCapture(recorder_, &graph);
    if (!status.ok() || ended != cudaSuccess) {
      if (graph != nullptr) cudaGraphDestroy(graph);
      if (!status.ok()) cudaGetLastError();
      return !status.ok() ? status : to_status(ended, call);
    }
    const cudaError_t error = submit(graph, stream);
    cudaGraphDestroy(graph);
    return to_status(error, call);
  }

 private:
  cudaError_t submit(cudaGraph_t graph, cudaStream_t stream) {
    if (ready_ != nullptr) {
      cudaGraphExecUpdateResultInfo info{};
      if (cudaGraphExecUpdate(ready_, graph, &info) != cudaSuccess) {
        cudaGetLastError();  // other kernels: it can't be
        cudaGraphExecDestroy(ready_);
        ready_ = nullptr;
      }
    }
    if (ready_ == nullptr) {
      if (const cudaError_t error = cudaGraphInstantiate(&ready_, graph, 0); error != cudaSuccess) {
        ready_ = nullptr;
        return error;
      }
    }
    return cudaGraphLaunch(ready_, stream);
  }

  cudaStream_t recorder_ = nullptr;
  bool is_warm_ = false, has_recorder_ = false;
  cudaGraphExec_t ready_ = nullptr;
};

}  // namespace throng::render::cuda
