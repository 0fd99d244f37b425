#pragma once

#include <cstdint>
#include <glm/glm.hpp>

#include "render/compute/element/host_device.hpp"
#include "throng/render/color_map.hpp"

namespace throng::render::element {

/// sRGB decoding of one component by a cubic, within 0.003 of the standard's curve: tables and
/// tints need no pow, so they are the same on every backend.
THRONG_HOST_DEVICE constexpr float linear_from_srgb(float srgb) {
  return srgb * (srgb * (srgb * 0.305306011F + 0.682171111F) + 0.012522878F);
}

/// Linear colour of 0xRRGGBB.
THRONG_HOST_DEVICE inline glm::vec3 linear_from_hex(std::uint32_t rgb) {
  return {linear_from_srgb(static_cast<float>((rgb >> 16) & 255u) / 255.0F),
          linear_from_srgb(static_cast<float>((rgb >> 8) & 255u) / 255.0F),
          linear_from_srgb(static_cast<float>(rgb & 255u) / 255.0F)};
}

inline constexpr int kColorMapSamples = 17;

/// 0xRRGGBB of a map at `i` / 16. Viridis, plasma, inferno and magma are of S. van der Walt and
/// N. Smith (matplotlib, CC0), cividis of J. Nunez, C. Anderton and R. Renslow (PLOS ONE 2018).
THRONG_HOST_DEVICE constexpr std::uint32_t color_map_sample(ColorMap map, int i) {
  constexpr std::uint32_t kSamples[][kColorMapSamples] = {
      {0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c,
       0x1fa088, 0x28ae80, 0x3fbc73, 0x5ec962, 0x84d44b, 0xaddc30, 0xd8e219, 0xfde725},
      {0x0d0887, 0x310596, 0x4c02a1, 0x6600a7, 0x7e03a8, 0x9511a2, 0xa92396, 0xbb3587, 0xcb4778,
       0xd9596a, 0xe66c5c, 0xf07f4f, 0xf89441, 0xfdab33, 0xfdc328, 0xf9dd25, 0xf0f921},
      {0x000004, 0x0b0724, 0x210c4a, 0x3c0965, 0x57106d, 0x70196e, 0x89226a, 0xa32b61, 0xbb3755,
       0xd14644, 0xe35932, 0xf1711e, 0xf98d0a, 0xfcab0f, 0xf9ca32, 0xf2e865, 0xfcffa4},
      {0x000004, 0x0a0822, 0x1d1146, 0x36106a, 0x50127c, 0x691c81, 0x822681, 0x9c2e7f, 0xb63779,
       0xcf4170, 0xe65163, 0xf5695c, 0xfb8761, 0xfea571, 0xfec387, 0xfde0a2, 0xfcfdbf},
      {0x00224e, 0x002e6a, 0x1a386f, 0x32436d, 0x434e6c, 0x52596d, 0x61656f, 0x6f7073, 0x7c7b78,
       0x8b8778, 0x9b9376, 0xaba072, 0xbbad6c, 0xccba64, 0xddc958, 0xefd748, 0xfee838}};
  return kSamples[static_cast<std::uint32_t>(map)][i];
}

/// Colour of `t` in [0, 1] on a map, linear. A piecewise linear fit, within 8/255 of the published
/// 256 entries (16/255 at cividis' dark end).
THRONG_HOST_DEVICE inline glm::vec3 map_color(ColorMap map, float t) {
  const float scaled = glm::clamp(t, 0.0F, 1.0F) * static_cast<float>(kColorMapSamples - 1);
  const int last = kColorMapSamples - 2;
  const int low = scaled < static_cast<float>(last) ? static_cast<int>(scaled) : last;
  return glm::mix(linear_from_hex(color_map_sample(map, low)),
                  linear_from_hex(color_map_sample(map, low + 1)),
                  scaled - static_cast<float>(low));
}

/// A linear colour in [0, 1] as 10 bits a component of its square root (dark tones keep their
/// steps).
THRONG_HOST_DEVICE inline std::uint32_t pack_color(const glm::vec3& linear) {
  const glm::vec3 root = glm::sqrt(glm::clamp(linear, 0.0F, 1.0F)) * 1023.0F + 0.5F;
  return static_cast<std::uint32_t>(root.r) | static_cast<std::uint32_t>(root.g) << 10 |
         static_cast<std::uint32_t>(root.b) << 20;
}

/// The colour of pack_color.
THRONG_HOST_DEVICE inline glm::vec3 unpack_color(std::uint32_t bits) {
  const float r = static_cast<float>(bits & 1023U) * (1.0F / 1023.0F);
  const float g = static_cast<float>((bits >> 10) & 1023U) * (1.0F / 1023.0F);
  const float b = static_cast<float>((bits >> 20) & 1023U) * (1.0F / 1023.0F);
  return {r * r, g * g, b * b};
}

/// A tint in [0, 2], stored as the colour of its half.
THRONG_HOST_DEVICE inline std::uint32_t pack_tint(const glm::vec3& tint) {
  return pack_color(tint * 0.5F);
}

}  // namespace throng::render::element
