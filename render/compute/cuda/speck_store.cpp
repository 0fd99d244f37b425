#include "render/compute/cuda/speck_store.hpp"

#include <algorithm>
#include <new>
#include <utility>
#include <vector>

#include "render/compute/cpu/kernels.hpp"

namespace throng::render::cuda {
namespace {

template <typename T>
cudaError_t copy(const std::vector<T>& from, DeviceBuffer<T>& to, cudaStream_t stream) {
  const cudaError_t error = to.resize(std::max<std::size_t>(from.size(), 1));
  if (error != cudaSuccess || from.empty()) return error;
  return cudaMemcpyAsync(to.data(), from.data(), from.size() * sizeof(T), cudaMemcpyHostToDevice,
                         stream);
}

}  // namespace

absl::StatusOr<std::shared_ptr<const SpeckStore>> SpeckStore::make(std::shared_ptr<const Cast> cast,
                                                                   const SpeckStore* before,
                                                                   cudaStream_t stream) {
  std::shared_ptr<SpeckStore> store(new SpeckStore(stream));
  try {
    const SpeckTable* table = before == nullptr ? nullptr : before->table_.get();
    auto characters =
        make_cast_table(std::move(cast), table == nullptr ? nullptr : table->cast.get());
    if (!characters.ok()) return characters.status();
    WorkPool pool(0);
    std::vector<WorkerScratch> scratch(pool.thread_count());
    store->table_ =
        make_speck_table(*characters, {pool, kernels(best_kernel_level())}, scratch, table);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("select: no memory for the pictures of specks");
  }
  constexpr char kCall[] = "select: the pictures of specks";
  THRONG_CUDA_TRY(copy(store->table_->has_images, store->has_images_, stream), kCall);
  THRONG_CUDA_TRY(copy(store->table_->image, store->image_, stream), kCall);
  THRONG_CUDA_TRY(copy(store->table_->slab, store->slab_, stream), kCall);
  THRONG_CUDA_TRY(cudaStreamSynchronize(stream), kCall);  // rasterizers read it by other streams
  return store;
}

}  // namespace throng::render::cuda
