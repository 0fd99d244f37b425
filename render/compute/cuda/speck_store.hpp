#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "render/compute/cpu/speck_table.hpp"
#include "render/compute/cuda/memory.hpp"
#include "throng/render/asset.hpp"

namespace throng::render::cuda {

/// A cast's SpeckTable in device memory. The processor makes it, once for a cast.
class SpeckStore {
 public:
  /// Waits until all is there.
  /// @param before  null, or the store of the cast before: where only the surroundings are others
  ///                its pictures are taken over.
  static absl::StatusOr<std::shared_ptr<const SpeckStore>> make(std::shared_ptr<const Cast> cast,
                                                                const SpeckStore* before,
                                                                cudaStream_t stream);

  const Cast* cast() const { return table_->cast->cast.get(); }
  const SpeckTable& table() const { return *table_; }
  const std::uint8_t* has_images() const { return has_images_.data(); }  // by character
  const SpeckImage* image() const { return image_.data(); }
  const SpeckSlab* slab() const { return slab_.data(); }

 private:
  explicit SpeckStore(cudaStream_t stream) : has_images_(stream), image_(stream), slab_(stream) {}

  std::shared_ptr<const SpeckTable> table_;
  DeviceBuffer<std::uint8_t> has_images_;
  DeviceBuffer<SpeckImage> image_;
  DeviceBuffer<SpeckSlab> slab_;
};

}  // namespace throng::render::cuda
