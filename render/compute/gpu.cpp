#include "throng/render/gpu.hpp"

#if THRONG_WITH_CUDA
#include "render/compute/cuda/device.hpp"
#endif

namespace throng::render {

#if THRONG_WITH_CUDA
absl::Status choose_gpu(const std::string& index_or_uuid) {
  return cuda::choose_device(index_or_uuid);
}

std::vector<std::string> describe_cuda() { return cuda::describe_devices(); }
#else
absl::Status choose_gpu(const std::string& index_or_uuid) {
  if (index_or_uuid.empty()) return absl::OkStatus();
  return absl::UnavailableError("choose_gpu: cuda is not built into this program");
}

std::vector<std::string> describe_cuda() { return {"not built into this program"}; }
#endif

}  // namespace throng::render
