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
  const bool is_known =
      stbi_info_from_memory(bytes.data(), size_bytes, &width, &height, &channels) != 0;
  if (is_png && bytes.size() >= 24) {
    // the library doesn't tell the size of a picture that is too large for it
    const auto big_endian = [&](std::size_t at) {
      return bytes[at] >= 0x40
                 ? INT_MAX
                 : bytes[at] << 24 | bytes[at + 1] << 16 | bytes[at + 2] << 8 | bytes[at + 3];
    };
    width = big_endian(16);
    height = big_endian(20);
  }
  const int limit = static_cast<int>(kMaxImageSidePx);
  if (width > limit || height > limit ||
      static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) > kMaxTexels) {
    return absl::InvalidArgumentError(absl::StrCat("is ", width, "x", height, " px, the limit is ",
                                                   limit, " a side and ", kMaxTexels, " in all"));
  }
  if (!is_known) {
    return absl::InvalidArgumentError(absl::StrCat("is damaged: ", stbi_failure_reason()));
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
