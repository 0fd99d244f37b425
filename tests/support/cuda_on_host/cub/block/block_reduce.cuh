#pragma once

#include <cuda_runtime_api.h>

namespace cub {

/// The sum over a block's threads, by the first one.
template <typename T, int kThreads>
class BlockReduce {
 public:
  struct TempStorage {
    T values[kThreads];
  };
  explicit BlockReduce(TempStorage& storage) : storage_(storage) {}
  T Sum(T value) {
    storage_.values[threadIdx.x] = value;
    __syncthreads();
    T sum = 0;
    for (int i = 0; i < kThreads && threadIdx.x == 0; ++i) sum += storage_.values[i];
    return sum;
  }

 private:
  TempStorage& storage_;
};

}  // namespace cub
