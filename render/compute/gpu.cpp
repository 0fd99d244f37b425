#include "throng/render/gpu.hpp"

#if THRONG_WITH_CUDA
#include <cstdlib>

#include "render/compute/cuda/device.hpp"
#include "render/compute/cuda/memory.hpp"
#endif

namespace throng::render {

#if THRONG_WITH_CUDA
void prepare_gpu() { setenv("CUDA_MODULE_LOADING", "EAGER", /*overwrite=*/0); }

absl::Status choose_gpu(const std::string& index_or_uuid) {
  return cuda::choose_device(index_or_uuid);
}

std::vector<std::string> describe_cuda() { return cuda::describe_devices(); }

void limit_gpu_memory(std::uint64_t size_bytes) { cuda::limit_device_memory(size_bytes); }

std::uint64_t gpu_memory_held() { return cuda::device_memory_held(); }

std::string gpu_key() { return cuda::device_key(); }
#else
void prepare_gpu() {}

absl::Status choose_gpu(const std::string& index_or_uuid) {
  if (index_or_uuid.empty()) return absl::OkStatus();
  return absl::UnavailableError("choose_gpu: cuda is not built into this program");
}

std::vector<std::string> describe_cuda() { return {"not built into this program"}; }

void limit_gpu_memory(std::uint64_t) {}

std::uint64_t gpu_memory_held() { return 0; }

std::string gpu_key() { return ""; }
#endif

}  // namespace throng::render
