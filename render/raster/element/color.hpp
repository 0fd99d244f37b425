#pragma once

#include <cstdint>
#include <glm/glm.hpp>

#include "render/compute/element/host_device.hpp"

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

/// Colour of `t` in [0, 1] on the viridis map (S. van der Walt, N. Smith, matplotlib, CC0), linear.
/// A piecewise linear fit through 17 samples, within 2/255 of the 256-entry table.
THRONG_HOST_DEVICE inline glm::vec3 viridis(float t) {
  constexpr std::uint32_t kSamples[17] = {
      0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c,
      0x1fa088, 0x28ae80, 0x3fbc73, 0x5ec962, 0x84d44b, 0xaddc30, 0xd8e219, 0xfde725};
  const float scaled = glm::clamp(t, 0.0F, 1.0F) * 16.0F;
  const int low = scaled < 15.0F ? static_cast<int>(scaled) : 15;
  return glm::mix(linear_from_hex(kSamples[low]), linear_from_hex(kSamples[low + 1]),
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
