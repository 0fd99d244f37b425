#pragma once

#include <cuda_runtime_api.h>

// How kernels are launched. The tests compile the same files for the processor, where a header of
// theirs stands for the runtime's and gives both macros another meaning: what has no device is
// tested all the same.
#if defined(__CUDACC__)

/// Launches `kernel(...)`, whose threads may wait for one another.
#define THRONG_LAUNCH(kernel, blocks, threads, shared_bytes, stream, ...) \
  kernel<<<(blocks), (threads), (shared_bytes), (stream)>>>(__VA_ARGS__)

/// The same of a kernel whose threads have nothing to do with one another.
#define THRONG_LAUNCH_APART(kernel, blocks, threads, stream, ...) \
  kernel<<<(blocks), (threads), 0, (stream)>>>(__VA_ARGS__)

/// Blocks of a kernel that takes its work in turns, as much as there is.
#define THRONG_PERSISTENT(blocks) (blocks)

/// The shared memory whose size the launch gives.
#define THRONG_DYNAMIC_SHARED(Type, name) extern __shared__ Type name[]

#elif !defined(THRONG_LAUNCH)
#error "kernels need nvcc, or the header that stands for the runtime in tests"
#endif
