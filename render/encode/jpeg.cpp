#include <absl/strings/str_cat.h>
#include <turbojpeg.h>

#include <new>

#include "render/encode/image_size.hpp"
#include "throng/render/encode.hpp"

namespace throng::render {

struct JpegEncoder::State {
  tjhandle handle = nullptr;
  std::vector<std::uint8_t> buffer;
  ~State() {
    if (handle != nullptr) tjDestroy(handle);
  }
};

JpegEncoder::JpegEncoder() : state_(std::make_unique<State>()) {}
JpegEncoder::~JpegEncoder() = default;

absl::StatusOr<std::span<const std::uint8_t>> JpegEncoder::encode(
    std::span<const std::uint8_t> rgbx, std::uint32_t width_px, std::uint32_t height_px,
    int quality) {
  if (auto status = check_image("JpegEncoder::encode", rgbx.size(), width_px, height_px);
      !status.ok()) {
    return status;
  }
  if (quality < 1 || quality > 100) {
    return absl::InvalidArgumentError(
        absl::StrCat("JpegEncoder::encode: quality is ", quality, ", must be 1 to 100"));
  }
  if (state_->handle == nullptr) state_->handle = tjInitCompress();
  if (state_->handle == nullptr) {
    return absl::ResourceExhaustedError("JpegEncoder::encode: tjInitCompress failed");
  }
  const int width = static_cast<int>(width_px), height = static_cast<int>(height_px);
  try {
    // The worst case: the encoder then never reallocates behind our back.
    const unsigned long worst = tjBufSize(width, height, TJSAMP_420);
    if (state_->buffer.size() < worst) state_->buffer.resize(worst);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat("JpegEncoder::encode: no memory for ", width, "x", height, " px"));
  }
  unsigned char* output = state_->buffer.data();
  unsigned long size_bytes = state_->buffer.size();
  if (tjCompress2(state_->handle, rgbx.data(), width, 0, height, TJPF_RGBX, &output, &size_bytes,
                  TJSAMP_420, quality, TJFLAG_NOREALLOC) != 0) {
    return absl::InternalError(
        absl::StrCat("JpegEncoder::encode: tjCompress2: ", tjGetErrorStr2(state_->handle)));
  }
  return std::span<const std::uint8_t>(output, size_bytes);
}

absl::StatusOr<DecodedImage> decode_jpeg(std::span<const std::uint8_t> jpeg) {
  struct Handle {
    tjhandle value = tjInitDecompress();
    ~Handle() {
      if (value != nullptr) tjDestroy(value);
    }
  } handle;
  if (handle.value == nullptr) {
    return absl::ResourceExhaustedError("decode_jpeg: tjInitDecompress failed");
  }
  const auto invalid = [&](const char* call) {
    return absl::InvalidArgumentError(absl::StrCat("decode_jpeg: ", jpeg.size(), " bytes: ", call,
                                                   ": ", tjGetErrorStr2(handle.value)));
  };
  int width = 0, height = 0, subsampling = 0, color_space = 0;
  if (tjDecompressHeader3(handle.value, jpeg.data(), jpeg.size(), &width, &height, &subsampling,
                          &color_space) != 0) {
    return invalid("header");
  }
  if (width < 1 || height < 1 || width > static_cast<int>(kMaxSidePx) ||
      height > static_cast<int>(kMaxSidePx)) {
    return absl::InvalidArgumentError(absl::StrCat("decode_jpeg: size is ", width, "x", height,
                                                   " px, each side must be 1 to ", kMaxSidePx));
  }
  DecodedImage image;
  image.width_px = static_cast<std::uint32_t>(width);
  image.height_px = static_cast<std::uint32_t>(height);
  try {
    image.rgbx.resize(std::size_t{4} * image.width_px * image.height_px);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat("decode_jpeg: no memory for ", width, "x", height, " px"));
  }
  // RGBA rather than RGBX: only then is the fourth byte defined (255). A truncated file is only a
  // warning to the library and an error here; the scan limit stops progressive bombs.
  if (tjDecompress2(handle.value, jpeg.data(), jpeg.size(), image.rgbx.data(), width, 0, height,
                    TJPF_RGBA, TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) != 0) {
    return invalid("data");
  }
  return image;
}

}  // namespace throng::render
