#include "render/raster/visibility/cuda/device_picture.hpp"

#include <cstring>
#include <new>
#include <utility>

#include "render/raster/visibility/cuda/launch.hpp"

namespace throng::render::visibility::cuda {
namespace {

constexpr char kFetch[] = "fetch a picture";
constexpr char kEncode[] = "encode a picture";

}  // namespace

absl::StatusOr<std::shared_ptr<CudaPicture>> CudaPicture::make(int device) {
  constexpr char kCall[] = "make a picture";
  THRONG_CUDA_TRY(cudaSetDevice(device), kCall);
  cudaStream_t stream = nullptr;
  THRONG_CUDA_TRY(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), kCall);
  auto picture = std::shared_ptr<CudaPicture>(new CudaPicture(device, stream));
  THRONG_CUDA_TRY(cudaEventCreateWithFlags(&picture->drawn_, cudaEventDisableTiming), kCall);
  return picture;
}

CudaPicture::~CudaPicture() {
  cudaSetDevice(device_);
  jpeg_.reset();
  if (drawn_ != nullptr) {
    cudaEventSynchronize(drawn_);
    cudaEventDestroy(drawn_);
  }
  // memory is given back in the order of the stream, so the stream goes last
  pixels_.release();
  packed_.release();
  cudaStreamSynchronize(stream_);
  cudaStreamDestroy(stream_);
}

cudaError_t CudaPicture::resize(std::uint32_t width_px, std::uint32_t height_px) {
  width_px_ = width_px;
  height_px_ = height_px;
  // whole groups of four pixels are packed at a time
  const std::size_t pixels = std::size_t{width_px} * height_px + 3;
  const std::uint32_t* before = pixels_.data();
  // a picture that nobody wanted may still be drawn
  if (const cudaError_t error = cudaStreamWaitEvent(stream_, drawn_, 0); error != cudaSuccess) {
    return error;
  }
  if (const cudaError_t error = pixels_.resize(pixels); error != cudaSuccess) return error;
  // another stream draws there
  return pixels_.data() == before ? cudaSuccess : cudaStreamSynchronize(stream_);
}

absl::Status CudaPicture::fetch(std::vector<std::uint8_t>& rgbx) {
  THRONG_CUDA_TRY(cudaSetDevice(device_), kFetch);
  const std::size_t size_bytes = std::size_t{4} * width_px_ * height_px_;
  THRONG_CUDA_TRY(read_back_.resize(size_bytes), kFetch);
  THRONG_CUDA_TRY(cudaStreamWaitEvent(stream_, drawn_, 0), kFetch);
  THRONG_CUDA_TRY(cudaMemcpyAsync(read_back_.data(), pixels_.data(), size_bytes,
                                  cudaMemcpyDeviceToHost, stream_),
                  kFetch);
  THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), kFetch);
  try {
    rgbx.resize(size_bytes);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("fetch a picture: no memory for its pixels");
  }
  std::memcpy(rgbx.data(), read_back_.data(), size_bytes);
  return absl::OkStatus();
}

absl::Status CudaPicture::encode_jpeg(int quality, std::vector<std::uint8_t>& jpeg) {
  THRONG_CUDA_TRY(cudaSetDevice(device_), kEncode);
  if (jpeg_ == nullptr) {
    auto made = NvJpeg::make(stream_);
    if (!made.ok()) return made.status();
    jpeg_ = *std::move(made);
  }
  const std::size_t groups = (std::size_t{width_px_} * height_px_ + 3) / 4;
  THRONG_CUDA_TRY(packed_.resize(3 * groups), kEncode);
  THRONG_CUDA_TRY(cudaStreamWaitEvent(stream_, drawn_, 0), kEncode);
  THRONG_CUDA_TRY(
      launch_pack(pixels_.data(), packed_.data(), static_cast<std::uint32_t>(groups), stream_),
      kEncode);
  return jpeg_->encode(reinterpret_cast<std::uint8_t*>(packed_.data()), width_px_, height_px_,
                       quality, stream_, jpeg);
}

}  // namespace throng::render::visibility::cuda
