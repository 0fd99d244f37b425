#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <cuda_runtime_api.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace throng::render::visibility::cuda {

/// NVIDIA's JPEG encoder, looked for when the program runs.
class NvJpeg {
 public:
  /// Unimplemented: the library is not there, or its header was not when this was built.
  static absl::StatusOr<std::unique_ptr<NvJpeg>> make(cudaStream_t stream);
  ~NvJpeg();

  /// Baseline JPEG, 4:2:0. Waits for it.
  /// @param rgb  device memory, rows of r g b without gaps
  absl::Status encode(std::uint8_t* rgb, std::uint32_t width_px, std::uint32_t height_px,
                      int quality, cudaStream_t stream, std::vector<std::uint8_t>& jpeg);

 private:
  struct State;
  explicit NvJpeg(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// "nvJPEG (libnvjpeg.so.13)", or "libjpeg-turbo (libnvjpeg.so.13: ...)": what encodes pictures.
std::string jpeg_encoder_name();

}  // namespace throng::render::visibility::cuda
