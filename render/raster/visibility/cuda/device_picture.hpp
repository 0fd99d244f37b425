#pragma once

#include <absl/status/statusor.h>
#include <cuda_runtime_api.h>

#include <memory>

#include "render/compute/cuda/memory.hpp"
#include "render/raster/visibility/cuda/nvjpeg.hpp"
#include "throng/render/device_picture.hpp"

namespace throng::render::visibility::cuda {

/// A picture's pixels, drawn on a rasterizer's stream and taken away on one of its own.
class CudaPicture final : public DevicePicture {
 public:
  static absl::StatusOr<std::shared_ptr<CudaPicture>> make(int device);
  ~CudaPicture() override;

  /// Room for a picture of this size; nobody else may use the picture then. Waits when it grows.
  cudaError_t resize(std::uint32_t width_px, std::uint32_t height_px);
  std::uint32_t* pixels() const { return pixels_.data(); }
  std::uint64_t size_bytes() const { return pixels_.size_bytes() + packed_.size_bytes(); }
  /// To be recorded where the drawing ends.
  cudaEvent_t drawn() const { return drawn_; }

  absl::Status fetch(std::vector<std::uint8_t>& rgbx) override;
  absl::Status encode_jpeg(int quality, std::vector<std::uint8_t>& jpeg) override;

 private:
  CudaPicture(int device, cudaStream_t stream)
      : device_(device), stream_(stream), pixels_(stream), packed_(stream) {}

  int device_;
  cudaStream_t stream_;
  cudaEvent_t drawn_ = nullptr;
  std::uint32_t width_px_ = 0, height_px_ = 0;
  render::cuda::DeviceBuffer<std::uint32_t> pixels_;
  render::cuda::DeviceBuffer<std::uint32_t> packed_;  // r g b, as the encoder takes them
  render::cuda::PinnedBuffer read_back_;
  std::unique_ptr<NvJpeg> jpeg_;
};

}  // namespace throng::render::visibility::cuda
