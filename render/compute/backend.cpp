#include "render/compute/cpu/cpu_backend.hpp"

namespace throng::render {

absl::StatusOr<std::unique_ptr<ComputeBackend>> make_backend(BackendKind kind, unsigned threads) {
  switch (kind) {
    case BackendKind::kCpu:
      return make_cpu_backend(threads);
    case BackendKind::kCuda:
      return absl::UnavailableError("make_backend: cuda is not built into this program");
  }
  return absl::InvalidArgumentError("make_backend: unknown kind");
}

}  // namespace throng::render
