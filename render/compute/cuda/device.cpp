#include "render/compute/cuda/device.hpp"

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <cuda_runtime_api.h>

#include <atomic>
#include <fstream>
#include <limits>
#include <string>
#include <utility>

#include "render/compute/cuda/launch.hpp"
#include "render/compute/cuda/memory.hpp"

namespace throng::render::cuda {
namespace {

std::atomic<int> chosen{0};
std::atomic<std::uint64_t> held_bytes{0}, limit_bytes{std::numeric_limits<std::uint64_t>::max()};

/// The allocation of this thread that did not fit; 0: none.
thread_local std::uint64_t refused_bytes = 0;

std::string refusal() {
  const std::uint64_t wanted = std::exchange(refused_bytes, 0), limit = limit_bytes.load();
  if (wanted == 0) return "";
  std::size_t free_bytes = 0, total_bytes = 0;
  if (cudaMemGetInfo(&free_bytes, &total_bytes) != cudaSuccess) free_bytes = total_bytes = 0;
  const auto mib = [](std::uint64_t bytes) { return (bytes + (1 << 20) - 1) >> 20; };
  std::string text = absl::StrCat("; needs ", mib(wanted), " MiB more than the ",
                                  mib(held_bytes.load()), " MiB held, ");
  if (held_bytes.load() + wanted > limit) {
    return absl::StrCat(text, "the limit is ", limit >> 20, " MiB (--gpu-memory-mib)");
  }
  return absl::StrCat(text, free_bytes >> 20, " of the device's ", total_bytes >> 20,
                      " MiB are free");
}

/// What can be done about an error, empty where nobody knows.
const char* remedy_of(cudaError_t error) {
  switch (error) {
    case cudaErrorMemoryAllocation:
      return "; lower the vertex budget, the picture's size or the number of agents";
    case cudaErrorInsufficientDriver: {
      int driver = 0;
      if (cudaDriverGetVersion(&driver) != cudaSuccess || driver == 0) {
        return ": there is no driver; install it, or pass the host's GPUs on to the container";
      }
      return "; the driver is older than the CUDA runtime in this program: update it";
    }
    case cudaErrorNoDevice:
      return " (nvidia-smi tells what the driver sees; in a container, its GPUs must be passed on)";
    case cudaErrorNoKernelImageForDevice:
      return "; build with CMAKE_CUDA_ARCHITECTURES of this device";
    case cudaErrorSystemNotReady:
      return "; on boards whose GPUs are linked nvidia-fabricmanager must run";
    case cudaErrorSystemDriverMismatch:
    case cudaErrorCompatNotSupportedOnDevice:
      return "; the kernel's driver and its libraries are of different versions: restart the "
             "machine, or take a container of the host's version";
    case cudaErrorDevicesUnavailable:
      return "; another process has it to itself (nvidia-smi -q -d COMPUTE)";
    case cudaErrorIllegalAddress:
    case cudaErrorLaunchFailure:
    case cudaErrorLaunchTimeout:
    case cudaErrorIllegalInstruction:
    case cudaErrorMisalignedAddress:
    case cudaErrorHardwareStackError:
    case cudaErrorInvalidAddressSpace:
    case cudaErrorInvalidPc:
    case cudaErrorAssert:
      return "; the CUDA context is lost and the process must be restarted to draw with it again";
    case cudaErrorECCUncorrectable:
      return "; the device's memory is damaged (nvidia-smi -q -d ECC): the CUDA context is lost "
             "and "
             "the process must be restarted";
    default:
      return "";
  }
}

/// As nvidia-smi writes it.
std::string uuid_of(const cudaDeviceProp& properties) {
  std::string text = "GPU-";
  for (int i = 0; i < 16; ++i) {
    if (i == 4 || i == 6 || i == 8 || i == 10) text += '-';
    absl::StrAppend(
        &text, absl::Hex(static_cast<unsigned char>(properties.uuid.bytes[i]), absl::kZeroPad2));
  }
  return text;
}

absl::StatusOr<int> device_count(const char* call) {
  int devices = 0;
  cudaError_t error = cudaGetDeviceCount(&devices);
  if (error == cudaSuccess && devices == 0) error = cudaErrorNoDevice;
  if (error == cudaSuccess) return devices;
  cudaGetLastError();
  return absl::UnavailableError(
      absl::StrCat(call, ": no device: ", cudaGetErrorString(error), remedy_of(error)));
}

/// Runs an empty kernel there.
absl::Status try_device(int device, const char* call) {
  THRONG_CUDA_TRY(cudaSetDevice(device), call);
  // what a frame gives back is kept for the next one, not returned whenever the host waits; only
  // what is beyond the limit is
  cudaMemPool_t pool = nullptr;
  std::uint64_t threshold_bytes = limit_bytes.load();
  THRONG_CUDA_TRY(cudaDeviceGetDefaultMemPool(&pool, device), call);
  THRONG_CUDA_TRY(cudaMemPoolSetAttribute(pool, cudaMemPoolAttrReleaseThreshold, &threshold_bytes),
                  call);
  cudaStream_t stream = nullptr;
  THRONG_CUDA_TRY(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), call);
  cudaError_t error = probe_kernels(stream);
  if (error == cudaSuccess) error = cudaStreamSynchronize(stream);
  cudaStreamDestroy(stream);
  return to_status(error, call);
}

/// The kernel's part of the driver, as it names itself; empty: it is not loaded.
std::string driver_module() {
  std::ifstream file("/proc/driver/nvidia/version");
  std::string line;
  std::getline(file, line);
  return line;
}

std::string version_text(int version) {
  return absl::StrCat(version / 1000, ".", version % 1000 / 10);
}

}  // namespace

absl::Status to_status(cudaError_t error, const char* call) {
  if (error == cudaSuccess) return absl::OkStatus();
  const std::string text =
      absl::StrCat(call, ": ", cudaGetErrorString(error), " (", cudaGetErrorName(error), ")",
                   error == cudaErrorMemoryAllocation ? refusal() : "", remedy_of(error));
  cudaGetLastError();  // it sticks no longer than it is looked at
  if (error == cudaErrorMemoryAllocation) return absl::ResourceExhaustedError(text);
  return absl::InternalError(text);
}

cudaError_t allocate_device(void** data, std::size_t size_bytes, cudaStream_t stream) {
  // first what is asked for is counted, so that two threads don't both take the last of it
  const std::uint64_t held = held_bytes.fetch_add(size_bytes) + size_bytes;
  const cudaError_t error = held > limit_bytes.load() ? cudaErrorMemoryAllocation
                                                      : cudaMallocAsync(data, size_bytes, stream);
  if (error != cudaSuccess) held_bytes.fetch_sub(size_bytes);
  refused_bytes = error == cudaErrorMemoryAllocation ? size_bytes : 0;
  return error;
}

void free_device(void* data, std::size_t size_bytes, cudaStream_t stream) {
  cudaFreeAsync(data, stream);
  held_bytes.fetch_sub(size_bytes);
}

void limit_device_memory(std::uint64_t size_bytes) { limit_bytes.store(size_bytes); }

std::uint64_t device_memory_held() { return held_bytes.load(); }

std::string device_key() {
  int driver = 0;
  cudaDriverGetVersion(&driver);
  return absl::StrCat(device_name(chosen.load()), ", device ", chosen.load(), ", driver for CUDA ",
                      version_text(driver));
}

absl::StatusOr<int> open_device(const char* call) {
  const auto devices = device_count(call);
  if (!devices.ok()) return devices.status();
  const int device = chosen.load();
  if (absl::Status status = try_device(device, call); !status.ok()) {
    return absl::UnavailableError(absl::StrCat("CUDA device ", device, ": ", status.message()));
  }
  return device;
}

std::string device_name(int device) {
  cudaDeviceProp properties{};
  if (cudaGetDeviceProperties(&properties, device) != cudaSuccess) return "CUDA device";
  return absl::StrCat(properties.name, ", compute ", properties.major, ".", properties.minor);
}

absl::Status choose_device(const std::string& index_or_uuid) {
  const auto devices = device_count("choose_gpu");
  if (!devices.ok()) return devices.status();
  int index = index_or_uuid.empty() ? 0 : -1;
  if (absl::SimpleAtoi(index_or_uuid, &index) && index >= 0 && index < *devices) {
    chosen.store(index);
    return absl::OkStatus();
  }
  std::vector<std::string> there;
  for (int device = 0; device < *devices; ++device) {
    cudaDeviceProp properties{};
    THRONG_CUDA_TRY(cudaGetDeviceProperties(&properties, device), "choose_gpu");
    const std::string uuid = uuid_of(properties);
    if (index_or_uuid.empty() ||
        (absl::StartsWith(uuid, index_or_uuid) && index_or_uuid.size() > 4)) {
      chosen.store(device);
      return absl::OkStatus();
    }
    there.push_back(absl::StrCat(device, " (", uuid, ")"));
  }
  return absl::NotFoundError(absl::StrCat(
      "choose_gpu: '", index_or_uuid, "' is none of the devices: ", absl::StrJoin(there, ", ")));
}

std::vector<std::string> describe_devices() {
  int driver = 0, runtime = 0;
  cudaDriverGetVersion(&driver);
  cudaRuntimeGetVersion(&runtime);
  std::vector<std::string> lines = {driver == 0
                                        ? absl::StrCat("no driver, runtime ", version_text(runtime))
                                        : absl::StrCat("driver for CUDA ", version_text(driver),
                                                       ", runtime ", version_text(runtime))};
  if (std::string module = driver_module(); !module.empty()) lines.push_back(std::move(module));
  const auto devices = device_count("devices");
  if (!devices.ok()) {
    lines.emplace_back(devices.status().message());
    return lines;
  }
  int before = 0;
  cudaGetDevice(&before);
  for (int device = 0; device < *devices; ++device) {
    cudaDeviceProp properties{};
    if (const cudaError_t error = cudaGetDeviceProperties(&properties, device);
        error != cudaSuccess) {
      lines.push_back(absl::StrCat("device ", device, ": ", cudaGetErrorString(error)));
      continue;
    }
    const absl::Status runs = try_device(device, "an empty kernel");
    std::size_t free_bytes = 0, total_bytes = 0;
    cudaMemGetInfo(&free_bytes, &total_bytes);
    lines.push_back(absl::StrCat(
        "device ", device, device == chosen.load() ? " (chosen): " : ": ", properties.name,
        ", compute ", properties.major, ".", properties.minor, ", ", properties.multiProcessorCount,
        " multiprocessors, ", free_bytes >> 20, " of ", total_bytes >> 20, " MiB free, PCI ",
        absl::Hex(properties.pciDomainID, absl::kZeroPad4), ":",
        absl::Hex(properties.pciBusID, absl::kZeroPad2), ":",
        absl::Hex(properties.pciDeviceID, absl::kZeroPad2), ", ", uuid_of(properties), ", ",
        runs.ok() ? "runs this program" : runs.message()));
  }
  cudaSetDevice(before);
  return lines;
}

}  // namespace throng::render::cuda
