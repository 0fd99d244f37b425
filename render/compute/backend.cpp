#include "render/compute/cpu/cpu_backend.hpp"
#if THRONG_WITH_CUDA
#include "render/compute/cuda/cuda_backend.hpp"
#endif

namespace throng::render {

BackendKind best_backend(std::string& why) {
  const auto cuda = make_backend(BackendKind::kCuda);
  why = cuda.ok() ? "a CUDA device runs this program" : std::string(cuda.status().message());
  return cuda.ok() ? BackendKind::kCuda : BackendKind::kCpu;
}

absl::StatusOr<std::unique_ptr<ComputeBackend>> make_backend(BackendKind kind, unsigned threads) {
  switch (kind) {
    case BackendKind::kCpu:
      return make_cpu_backend(threads);
    case BackendKind::kCuda:
#if THRONG_WITH_CUDA
      return make_cuda_backend();
#else
      return absl::UnavailableError("make_backend: cuda is not built into this program");
#endif
  }
  return absl::InvalidArgumentError("make_backend: unknown kind");
}

}  // namespace throng::render
