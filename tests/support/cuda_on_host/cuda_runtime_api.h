#pragma once

// Stands for the CUDA runtime in tests: the same sources that nvcc compiles run on the processor,
// one block after the other, so that kernels and the code around them are tested bit by bit where
// there is no device. Device memory is the host's, filled with rubbish; streams run at once.
//
// Threads that wait for one another (barriers, votes, shuffles) are fibers, each run until it
// waits. With THRONG_CUDA_BACKWARDS set, blocks and threads run from the last to the first: what
// comes out must be the same, or something did not wait that should have. Not for speed, and not
// thread safe.
#include <ucontext.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/common_interface_defs.h>
#endif

enum cudaError_t {
  cudaSuccess = 0,
  cudaErrorInvalidValue = 1,
  cudaErrorMemoryAllocation = 2,
  cudaErrorInsufficientDriver = 35,
  cudaErrorDevicesUnavailable = 46,
  cudaErrorNoDevice = 100,
  cudaErrorNoKernelImageForDevice = 209,
  cudaErrorECCUncorrectable = 214,
  cudaErrorNotReady = 600,
  cudaErrorIllegalAddress = 700,
  cudaErrorLaunchTimeout = 702,
  cudaErrorAssert = 710,
  cudaErrorHardwareStackError = 714,
  cudaErrorIllegalInstruction = 715,
  cudaErrorMisalignedAddress = 716,
  cudaErrorInvalidAddressSpace = 717,
  cudaErrorInvalidPc = 718,
  cudaErrorLaunchFailure = 719,
  cudaErrorSystemNotReady = 802,
  cudaErrorSystemDriverMismatch = 803,
  cudaErrorCompatNotSupportedOnDevice = 804,
  cudaErrorGraphExecUpdateFailure = 910,
};
enum cudaMemcpyKind { cudaMemcpyHostToDevice, cudaMemcpyDeviceToHost, cudaMemcpyDeviceToDevice };
enum cudaMemPoolAttr { cudaMemPoolAttrReleaseThreshold };
inline constexpr unsigned cudaStreamNonBlocking = 1, cudaEventDisableTiming = 2;
using cudaStream_t = struct CudaOnHostStream*;
using cudaEvent_t = struct CudaOnHostEvent*;
using cudaMemPool_t = struct CudaOnHostPool*;
using cudaGraph_t = struct CudaOnHostGraph*;
using cudaGraphExec_t = struct CudaOnHostGraphExec*;
enum cudaStreamCaptureMode { cudaStreamCaptureModeRelaxed };
struct cudaGraphExecUpdateResultInfo {};
struct cudaUUID_t {
  char bytes[16];
};
struct cudaDeviceProp {
  char name[256];
  cudaUUID_t uuid;
  int major, minor, multiProcessorCount, pciDomainID, pciBusID, pciDeviceID;
  std::size_t totalGlobalMem;
};
struct uint3 {
  unsigned x, y, z;
};

namespace throng::test::cuda_on_host {

/// What the next calls answer: lets tests see how faults are told.
struct Faults {
  cudaError_t devices = cudaSuccess;  // of cudaGetDeviceCount
  cudaError_t launch = cudaSuccess;   // of the next cudaGetLastError, as after a bad launch
  int driver = 0;                     // version, where there are no devices
  cudaError_t wait = cudaSuccess;     // of cudaStreamSynchronize: a kernel that went wrong
  std::size_t most_bytes = SIZE_MAX;  // of one allocation
};
inline Faults faults;

/// True between the begin and the end of a capture, where memory may not be had and nobody waits.
inline bool captures = false;

/// What a graph consists of, in its order: kernels, copies and the like by name. Their arguments
/// and grids may change, their kinds may not.
using Nodes = std::vector<std::string>;
inline Nodes captured;
inline void capture(const char* node) {
  if (captures) captured.emplace_back(node);
}
/// How often a graph was made anew, and how often the one before was taken with new arguments.
inline int graphs_made = 0, graphs_updated = 0;

/// The i-th of `count` blocks or threads in the order in which they run.
inline unsigned in_order(unsigned i, unsigned count) {
  static const bool backwards = std::getenv("THRONG_CUDA_BACKWARDS") != nullptr;
  return backwards ? count - 1 - i : i;
}

/// The threads of one block.
class Block {
 public:
  static constexpr unsigned kWarp = 32;
  static inline Block* current = nullptr;

  Block(unsigned threads, std::size_t shared_bytes, const std::function<void()>& kernel)
      : kernel_(kernel), shared_(shared_bytes / 16 + 1), warps_((threads + kWarp - 1) / kWarp) {
    fibers_.resize(threads);
    static std::vector<std::unique_ptr<char[]>> stacks;  // kept from launch to launch
    for (unsigned i = 0; i < threads; ++i) {
      if (stacks.size() <= i) {
        stacks.push_back(std::make_unique_for_overwrite<char[]>(kStackBytes));
      }
      fibers_[i].stack = stacks[i].get();
    }
    block_.waits_for = threads;
    for (unsigned w = 0; w < warps_.size(); ++w) {
      warps_[w].waits_for = w + 1 < warps_.size() ? kWarp : threads - w * kWarp;
    }
  }

  void run() {
    current = this;
    for (unsigned i = 0; i < fibers_.size(); ++i) {
      Fiber& fiber = fibers_[i];
      fiber.done = false;
      getcontext(&fiber.context);
      fiber.context.uc_stack.ss_sp = fiber.stack;
      fiber.context.uc_stack.ss_size = kStackBytes;
      fiber.context.uc_link = nullptr;
      makecontext(&fiber.context, &Block::enter, 0);
    }
    for (std::size_t left = fibers_.size(); left > 0;) {
      for (unsigned k = 0; k < fibers_.size(); ++k) {
        const unsigned i = in_order(k, static_cast<unsigned>(fibers_.size()));
        if (fibers_[i].done) continue;
        resume(i);
        if (fibers_[i].done) --left;
      }
    }
    current = nullptr;
  }

  void* shared() { return shared_.data(); }
  unsigned lane() const { return now_ % kWarp; }

  /// All threads of the block; returns the sum of `value` over them.
  int barrier(int value) { return meet(block_, value); }
  /// All lanes of the warp: what each gave.
  const std::uint64_t* exchange(std::uint64_t value) {
    Meeting& warp = warps_[now_ / kWarp];
    warp.values[lane()] = value;
    meet(warp, 0);
    std::copy(warp.values, warp.values + kWarp, fibers_[now_].seen);
    meet(warp, 0);
    return fibers_[now_].seen;
  }

 private:
  static constexpr std::size_t kStackBytes = 64 << 10;
  struct Fiber {
    ucontext_t context;
    char* stack = nullptr;
    bool done = false;
    void* fake_stack = nullptr;
    std::uint64_t seen[kWarp] = {};
  };
  struct Meeting {
    unsigned waits_for = 0, arrived = 0;
    std::uint64_t turn = 0;
    int sum = 0, last_sum = 0;
    std::uint64_t values[kWarp] = {};
  };

  int meet(Meeting& meeting, int value) {
    meeting.sum += value;
    if (++meeting.arrived == meeting.waits_for) {
      meeting.arrived = 0;
      meeting.last_sum = meeting.sum;
      meeting.sum = 0;
      ++meeting.turn;
    } else {
      const std::uint64_t turn = meeting.turn;
      while (meeting.turn == turn) yield();
    }
    return meeting.last_sum;
  }

  void resume(unsigned i);
  void yield() { leave(false); }
  void leave(bool for_good) {
    Fiber& fiber = fibers_[now_];
#if defined(__SANITIZE_ADDRESS__)
    __sanitizer_start_switch_fiber(for_good ? nullptr : &fiber.fake_stack, main_bottom_,
                                   main_size_);
#endif
    swapcontext(&fiber.context, &main_);
#if defined(__SANITIZE_ADDRESS__)
    __sanitizer_finish_switch_fiber(fiber.fake_stack, &main_bottom_, &main_size_);
#endif
  }
  static void enter() {
#if defined(__SANITIZE_ADDRESS__)
    __sanitizer_finish_switch_fiber(nullptr, &current->main_bottom_, &current->main_size_);
#endif
    current->kernel_();
    current->fibers_[current->now_].done = true;
    current->leave(true);
  }

  const std::function<void()>& kernel_;
  std::vector<Fiber> fibers_;
  struct alignas(64) SharedLine {
    char bytes[64];
  };
  std::vector<SharedLine> shared_;
  Meeting block_;
  std::vector<Meeting> warps_;
  ucontext_t main_;
  void* main_fake_stack_ = nullptr;
  const void* main_bottom_ = nullptr;
  std::size_t main_size_ = 0;
  unsigned now_ = 0;
};

}  // namespace throng::test::cuda_on_host

inline uint3 threadIdx{}, blockIdx{}, blockDim{}, gridDim{};

namespace throng::test::cuda_on_host {

inline void Block::resume(unsigned i) {
  now_ = i;
  threadIdx = {i, 0, 0};
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_start_switch_fiber(&main_fake_stack_, fibers_[i].stack, kStackBytes);
#endif
  swapcontext(&main_, &fibers_[i].context);
#if defined(__SANITIZE_ADDRESS__)
  __sanitizer_finish_switch_fiber(main_fake_stack_, nullptr, nullptr);
#endif
}

inline void launch(const char* name, unsigned blocks, unsigned threads, std::size_t shared_bytes,
                   const std::function<void()>& kernel) {
  capture(name);
  // as the runtime; more shared memory would have to be asked for by an attribute of the kernel
  constexpr std::size_t kMostSharedBytes = 48 << 10;
  if (blocks == 0 || threads == 0 || threads > 1024 || shared_bytes > kMostSharedBytes) {
    faults.launch = cudaErrorInvalidValue;
    return;
  }
  gridDim = {blocks, 1, 1};
  blockDim = {threads, 1, 1};
  Block block(threads, shared_bytes, kernel);
  for (unsigned b = 0; b < blocks; ++b) {
    blockIdx = {in_order(b, blocks), 0, 0};
    block.run();
  }
}

inline void launch_apart(const char* name, unsigned blocks, unsigned threads,
                         const std::function<void()>& kernel) {
  capture(name);
  if (blocks == 0 || threads == 0 || threads > 1024) {
    faults.launch = cudaErrorInvalidValue;
    return;
  }
  gridDim = {blocks, 1, 1};
  blockDim = {threads, 1, 1};
  for (unsigned b = 0; b < blocks; ++b) {
    blockIdx = {in_order(b, blocks), 0, 0};
    for (unsigned t = 0; t < threads; ++t) {
      threadIdx = {in_order(t, threads), 0, 0};
      kernel();
    }
  }
}

inline cudaError_t allocate(void** data, std::size_t size_bytes) {
  if (captures) return cudaErrorInvalidValue;
  if (size_bytes > faults.most_bytes) return cudaErrorMemoryAllocation;
  *data = std::malloc(size_bytes);
  if (*data == nullptr) return cudaErrorMemoryAllocation;
  std::memset(*data, 0xa5, size_bytes);
  return cudaSuccess;
}

}  // namespace throng::test::cuda_on_host

#define THRONG_LAUNCH(kernel, blocks, threads, shared_bytes, stream, ...)      \
  ::throng::test::cuda_on_host::launch(#kernel, blocks, threads, shared_bytes, \
                                       [&] { kernel(__VA_ARGS__); })
#define THRONG_LAUNCH_APART(kernel, blocks, threads, stream, ...) \
  ::throng::test::cuda_on_host::launch_apart(#kernel, blocks, threads, [&] { kernel(__VA_ARGS__); })
#define THRONG_PERSISTENT(blocks) 3
#define THRONG_DYNAMIC_SHARED(Type, name) \
  Type* name = static_cast<Type*>(::throng::test::cuda_on_host::Block::current->shared())

#define __global__
#define __device__
#define __shared__ static
#define __launch_bounds__(...)

// in kernels

inline void __syncthreads() { throng::test::cuda_on_host::Block::current->barrier(0); }
inline int __syncthreads_or(int value) {
  return throng::test::cuda_on_host::Block::current->barrier(value != 0 ? 1 : 0) != 0 ? 1 : 0;
}
inline void __syncwarp(unsigned = 0xffffffffU) {
  throng::test::cuda_on_host::Block::current->exchange(0);
}
inline unsigned __ballot_sync(unsigned, bool value) {
  const std::uint64_t* all = throng::test::cuda_on_host::Block::current->exchange(value ? 1 : 0);
  unsigned bits = 0;
  for (unsigned lane = 0; lane < 32; ++lane) bits |= static_cast<unsigned>(all[lane]) << lane;
  return bits;
}
// lanes that have nothing to give are not listened to
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
template <typename T>
T __shfl_sync(unsigned, T value, int lane) {
  static_assert(sizeof(T) <= sizeof(std::uint64_t));
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof value);
  bits = throng::test::cuda_on_host::Block::current->exchange(bits)[lane];
  std::memcpy(&value, &bits, sizeof value);
  return value;
}
#pragma GCC diagnostic pop
inline int __popc(unsigned bits) { return __builtin_popcount(bits); }
inline int __ffs(int bits) { return __builtin_ffs(bits); }
template <typename T>
T atomicAdd(T* at, std::type_identity_t<T> value) {
  const T old = *at;
  *at = old + value;
  return old;
}
template <typename T>
T atomicExch(T* at, std::type_identity_t<T> value) {
  const T old = *at;
  *at = value;
  return old;
}
template <typename T>
T atomicMin(T* at, std::type_identity_t<T> value) {
  const T old = *at;
  if (value < old) *at = value;
  return old;
}
template <typename T>
T atomicMax(T* at, std::type_identity_t<T> value) {
  const T old = *at;
  if (value > old) *at = value;
  return old;
}

// on the host

inline const char* cudaGetErrorString(cudaError_t error) {
  return error == cudaSuccess                 ? "no error"
         : error == cudaErrorMemoryAllocation ? "out of memory"
                                              : "unspecified failure";
}
inline const char* cudaGetErrorName(cudaError_t error) {
  return error == cudaErrorMemoryAllocation ? "cudaErrorMemoryAllocation" : "cudaError";
}
inline cudaError_t cudaGetLastError() {
  return std::exchange(throng::test::cuda_on_host::faults.launch, cudaSuccess);
}
inline cudaError_t cudaPeekAtLastError() { return throng::test::cuda_on_host::faults.launch; }
inline cudaError_t cudaGetDeviceCount(int* count) {
  *count = 1;
  return throng::test::cuda_on_host::faults.devices;
}
inline cudaError_t cudaGetDevice(int* device) {
  *device = 0;
  return cudaSuccess;
}
inline cudaError_t cudaSetDevice(int) { return cudaSuccess; }
inline cudaError_t cudaGetDeviceProperties(cudaDeviceProp* properties, int) {
  *properties = {"processor", {{1, 2, 3, 4}}, 0, 0, 1, 0, 0, 0, std::size_t{1} << 30};
  return cudaSuccess;
}
inline cudaError_t cudaMallocAsync(void** data, std::size_t size_bytes, cudaStream_t) {
  return throng::test::cuda_on_host::allocate(data, size_bytes);
}
inline cudaError_t cudaFreeAsync(void* data, cudaStream_t) {
  std::free(data);
  return cudaSuccess;
}
inline cudaError_t cudaMallocHost(void** data, std::size_t size_bytes) {
  return throng::test::cuda_on_host::allocate(data, size_bytes);
}
inline cudaError_t cudaFreeHost(void* data) {
  std::free(data);
  return cudaSuccess;
}
inline cudaError_t cudaMemcpyAsync(void* to, const void* from, std::size_t size_bytes,
                                   cudaMemcpyKind, cudaStream_t) {
  throng::test::cuda_on_host::capture("copy");
  if (to == nullptr || from == nullptr) return cudaErrorInvalidValue;  // stricter than the runtime
  if (size_bytes > 0) std::memcpy(to, from, size_bytes);
  return cudaSuccess;
}
inline cudaError_t cudaMemsetAsync(void* to, int value, std::size_t size_bytes, cudaStream_t) {
  throng::test::cuda_on_host::capture("set");
  if (to == nullptr || size_bytes == 0) return cudaErrorInvalidValue;  // stricter than the runtime
  std::memset(to, value, size_bytes);
  return cudaSuccess;
}
inline cudaError_t cudaStreamCreateWithFlags(cudaStream_t* stream, unsigned) {
  *stream = nullptr;
  return cudaSuccess;
}
inline cudaError_t cudaStreamDestroy(cudaStream_t) { return cudaSuccess; }
// what is captured runs at once, so launching the graph has nothing left to do
inline cudaError_t cudaStreamBeginCapture(cudaStream_t, cudaStreamCaptureMode) {
  using namespace throng::test::cuda_on_host;
  if (std::exchange(captures, true)) return cudaErrorInvalidValue;
  captured.clear();
  return cudaSuccess;
}
inline cudaError_t cudaStreamEndCapture(cudaStream_t, cudaGraph_t* graph) {
  using namespace throng::test::cuda_on_host;
  *graph = reinterpret_cast<cudaGraph_t>(new Nodes(std::move(captured)));
  return std::exchange(captures, false) ? cudaSuccess : cudaErrorInvalidValue;
}
inline cudaError_t cudaGraphInstantiate(cudaGraphExec_t* ready, cudaGraph_t graph, unsigned) {
  using namespace throng::test::cuda_on_host;
  ++graphs_made;
  *ready = reinterpret_cast<cudaGraphExec_t>(new Nodes(*reinterpret_cast<const Nodes*>(graph)));
  return cudaSuccess;
}
inline cudaError_t cudaGraphExecUpdate(cudaGraphExec_t ready, cudaGraph_t graph,
                                       cudaGraphExecUpdateResultInfo*) {
  using namespace throng::test::cuda_on_host;
  if (*reinterpret_cast<const Nodes*>(ready) != *reinterpret_cast<const Nodes*>(graph)) {
    return cudaErrorGraphExecUpdateFailure;
  }
  ++graphs_updated;
  return cudaSuccess;
}
inline cudaError_t cudaGraphLaunch(cudaGraphExec_t, cudaStream_t) { return cudaSuccess; }
inline cudaError_t cudaGraphDestroy(cudaGraph_t graph) {
  delete reinterpret_cast<throng::test::cuda_on_host::Nodes*>(graph);
  return cudaSuccess;
}
inline cudaError_t cudaGraphExecDestroy(cudaGraphExec_t ready) {
  delete reinterpret_cast<throng::test::cuda_on_host::Nodes*>(ready);
  return cudaSuccess;
}
inline cudaError_t cudaEventQuery(cudaEvent_t) { return cudaSuccess; }
inline cudaError_t cudaStreamSynchronize(cudaStream_t) {
  if (throng::test::cuda_on_host::captures) return cudaErrorInvalidValue;
  return throng::test::cuda_on_host::faults.wait;
}
inline cudaError_t cudaStreamWaitEvent(cudaStream_t, cudaEvent_t, unsigned) { return cudaSuccess; }
inline cudaError_t cudaEventCreateWithFlags(cudaEvent_t* event, unsigned) {
  *event = nullptr;
  return cudaSuccess;
}
inline cudaError_t cudaEventCreate(cudaEvent_t* event) {
  return cudaEventCreateWithFlags(event, 0);
}
inline cudaError_t cudaEventElapsedTime(float* ms, cudaEvent_t, cudaEvent_t) {
  *ms = 0.0F;
  return cudaSuccess;
}
inline cudaError_t cudaDriverGetVersion(int* version) {
  using throng::test::cuda_on_host::faults;
  *version = faults.devices == cudaSuccess ? 13000 : faults.driver;
  return cudaSuccess;
}
inline cudaError_t cudaRuntimeGetVersion(int* version) {
  *version = 13000;
  return cudaSuccess;
}
inline cudaError_t cudaMemGetInfo(std::size_t* free_bytes, std::size_t* total_bytes) {
  *free_bytes = *total_bytes = std::size_t{1} << 30;
  return cudaSuccess;
}
inline cudaError_t cudaEventDestroy(cudaEvent_t) { return cudaSuccess; }
inline cudaError_t cudaEventRecord(cudaEvent_t, cudaStream_t) { return cudaSuccess; }
inline constexpr unsigned cudaEventRecordDefault = 0, cudaEventRecordExternal = 1;
inline cudaError_t cudaEventRecordWithFlags(cudaEvent_t, cudaStream_t, unsigned) {
  throng::test::cuda_on_host::capture("event");
  return cudaSuccess;
}
inline cudaError_t cudaEventSynchronize(cudaEvent_t) { return cudaSuccess; }
inline cudaError_t cudaDeviceGetDefaultMemPool(cudaMemPool_t* pool, int) {
  *pool = nullptr;
  return cudaSuccess;
}
inline cudaError_t cudaMemPoolSetAttribute(cudaMemPool_t, cudaMemPoolAttr, void*) {
  return cudaSuccess;
}
