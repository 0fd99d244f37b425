#include <cuda_runtime.h>

#include "bench/experiments/gpu_rates.hpp"

namespace throng::bench {
namespace {

constexpr unsigned kWords = 3840U * 2160U;  // samples of 1920x1080
constexpr unsigned kThreads = 256;
constexpr int kRuns = 7, kRounds = 8;

/// Rising values, so that no maximum is in vain. `shift`: neighbours that share a word, as a power
/// of two; 32: all.
__global__ void maxima_kernel(unsigned long long* words, unsigned shift, unsigned long long value) {
  const unsigned i = blockIdx.x * kThreads + threadIdx.x;
  if (i < kWords) atomicMax(&words[shift >= 32 ? 0 : i >> shift], value + i);
}

struct Device {
  unsigned long long *from = nullptr, *to = nullptr;
  cudaEvent_t began = nullptr, ended = nullptr;
  ~Device() {
    cudaFree(from);
    cudaFree(to);
    if (began != nullptr) cudaEventDestroy(began);
    if (ended != nullptr) cudaEventDestroy(ended);
  }
};

/// Least milliseconds of one round.
template <typename Body>
cudaError_t time_of(Device& device, double& least_ms, const Body& body) {
  least_ms = 1e30;
  for (int run = 0; run < kRuns; ++run) {
    cudaError_t error = cudaEventRecord(device.began);
    for (int round = 0; round < kRounds && error == cudaSuccess; ++round) {
      error = body(static_cast<unsigned long long>(run * kRounds + round) << 32);
    }
    if (error == cudaSuccess) error = cudaEventRecord(device.ended);
    if (error == cudaSuccess) error = cudaEventSynchronize(device.ended);
    float ms = 0.0F;
    if (error == cudaSuccess) error = cudaEventElapsedTime(&ms, device.began, device.ended);
    if (error != cudaSuccess) return error;
    if (ms / kRounds < least_ms) least_ms = ms / kRounds;
  }
  return cudaSuccess;
}

cudaError_t measure(GpuRates& rates) {
  Device device;
  constexpr std::size_t kBytes = std::size_t{1} << 30;
  // before this takes some itself
  std::size_t free_bytes = 0, total_bytes = 0;
  cudaError_t error = cudaMemGetInfo(&free_bytes, &total_bytes);
  rates.used_mib = static_cast<double>(total_bytes - free_bytes) / (1 << 20);
  if (error == cudaSuccess) error = cudaMalloc(&device.from, kBytes);
  if (error == cudaSuccess) error = cudaMalloc(&device.to, kBytes);
  if (error == cudaSuccess) error = cudaMemset(device.from, 0, kBytes);
  if (error == cudaSuccess) error = cudaEventCreate(&device.began);
  if (error == cudaSuccess) error = cudaEventCreate(&device.ended);
  double ms = 0;
  if (error == cudaSuccess) {
    error = time_of(device, ms, [&](unsigned long long) {
      return cudaMemcpyAsync(device.to, device.from, kBytes, cudaMemcpyDeviceToDevice);
    });
    rates.copy_gb_per_s = 2e-6 * static_cast<double>(kBytes) / ms;
  }
  const struct {
    unsigned shift;
    double GpuRates::*rate;
  } patterns[] = {{0, &GpuRates::spread_atomics_g_per_s},
                  {5, &GpuRates::near_atomics_g_per_s},
                  {32, &GpuRates::one_atomic_g_per_s}};
  for (const auto& pattern : patterns) {
    if (error != cudaSuccess) break;
    error = cudaMemset(device.from, 0, std::size_t{8} * kWords);
    if (error != cudaSuccess) break;
    error = time_of(device, ms, [&](unsigned long long value) {
      maxima_kernel<<<(kWords + kThreads - 1) / kThreads, kThreads>>>(device.from, pattern.shift,
                                                                      value);
      return cudaGetLastError();
    });
    rates.*pattern.rate = 1e-6 * kWords / ms;
  }
  return error;
}

}  // namespace

GpuRates measure_gpu_rates() {
  GpuRates rates;
  if (const cudaError_t error = measure(rates); error != cudaSuccess) {
    rates.error = cudaGetErrorString(error);
    cudaGetLastError();
  }
  return rates;
}

}  // namespace throng::bench
