#pragma once

#include <cub/block/block_reduce.cuh>

#include "render/compute/cuda/kernel.hpp"

// For .cu files.
namespace throng::render::cuda {

inline constexpr std::uint32_t kSumThreads = 256;  // of a block that adds up

/// Adds a block's sum to `total`, once. Integers, so that any order gives the same.
__device__ inline void add_up(std::uint64_t value, std::uint64_t* total) {
  using Reduce = cub::BlockReduce<std::uint64_t, kSumThreads>;
  __shared__ typename Reduce::TempStorage storage;
  const std::uint64_t sum = Reduce(storage).Sum(value);
  __syncthreads();
  if (threadIdx.x == 0 && sum != 0) {
    atomicAdd(reinterpret_cast<unsigned long long*>(total), static_cast<unsigned long long>(sum));
  }
}

}  // namespace throng::render::cuda
