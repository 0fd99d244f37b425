#include "simplify/import/image.hpp"

#include <absl/strings/str_cat.h>

#include <climits>
#include <cstring>

#include "simplify/import/limits.hpp"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wunused-but-set-variable"
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#include <stb_image.h>
#pragma GCC diagnostic pop

namespace throng::simplify::gltf {

absl::StatusOr<SourceImage> decode_image(std::span<const std::uint8_t> bytes) {
  const bool is_png = bytes.size() >= 8 && std::memcmp(bytes.data(), "\x89PNG\r\n\x1a\n", 8) == 0;
  const bool is_jpeg =
      bytes.size() >= 3 && bytes[0] == 0xFF && bytes[1] == 0xD8 && bytes[2] == 0xFF;
  if ((!is_png && !is_jpeg) || bytes.size() > INT_MAX) {
    return absl::InvalidArgumentError("is neither PNG nor JPEG");
  }
  const int size_bytes = static_cast<int>(bytes.size());
  int width = 0;
  int height = 0;
  int channels = 0;
  if (stbi_info_from_memory(bytes.data(), size_bytes, &width, &height, &channels) == 0) {
    return absl::InvalidArgumentError(absl::StrCat("is damaged: ", stbi_failure_reason()));
  }
  const int limit = static_cast<int>(kMaxImageSidePx);
  if (width < 1 || height < 1 || width > limit || height > limit ||
      static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) > kMaxTexels) {
    return absl::InvalidArgumentError(absl::StrCat("is ", width, "x", height, " px, the limit is ",
                                                   limit, " a side and ", kMaxTexels, " in all"));
  }
  std::uint8_t* texels =
      stbi_load_from_memory(bytes.data(), size_bytes, &width, &height, &channels, 4);
  if (texels == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat("is damaged: ", stbi_failure_reason()));
  }
  SourceImage image;
  image.width_px = static_cast<std::uint32_t>(width);
  image.height_px = static_cast<std::uint32_t>(height);
  image.rgba.assign(texels, texels + std::size_t{4} * image.width_px * image.height_px);
  stbi_image_free(texels);
  return image;
}

}  // namespace throng::simplify::gltf
