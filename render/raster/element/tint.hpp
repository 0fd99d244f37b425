#pragma once

#include <cstdint>
#include <glm/glm.hpp>

#include "render/raster/element/color.hpp"

namespace throng::render::element {

/// What the four regions of a character's tint mask are multiplied with, linear, 0 to 2.
///
/// Textures are painted for it: skin and hair in a natural tone of their own, which a tint only
/// shifts; tops and bottoms as light neutrals (about sRGB 0.74 and 0.62), which a tint dyes.
struct Tints {
  glm::vec3 skin, hair, top, bottom;
};

/// Finaliser of MurmurHash3 (A. Appleby, public domain): every output bit depends on every input
/// bit.
THRONG_HOST_DEVICE inline std::uint32_t mix_bits(std::uint32_t bits) {
  bits ^= bits >> 16;
  bits *= 0x85ebca6bu;
  bits ^= bits >> 13;
  bits *= 0xc2b2ae35u;
  return bits ^ (bits >> 16);
}

/// Tints of an agent by its seed: the same agent always wears the same clothes.
///
/// A street's crowd, by proportion: about two of five tops are black, white, grey or navy, the
/// others muted with a few saturated ones; trousers are mostly denim and dark. Brightness varies by
/// 10 % around each colour, so that neighbours in the same coat still differ.
THRONG_HOST_DEVICE inline Tints tints_of(std::uint32_t seed) {
  constexpr glm::vec3 kSkin[8] = {
      {1.12F, 1.13F, 1.14F}, {1.06F, 1.06F, 1.05F}, {1.00F, 1.00F, 1.00F}, {1.00F, 0.97F, 0.94F},
      {0.93F, 0.89F, 0.85F}, {0.85F, 0.80F, 0.75F}, {0.75F, 0.69F, 0.63F}, {0.64F, 0.57F, 0.51F}};
  constexpr glm::vec3 kHair[8] = {
      {1.00F, 1.00F, 1.00F}, {0.80F, 0.80F, 0.80F}, {0.62F, 0.61F, 0.60F}, {0.48F, 0.47F, 0.47F},
      {1.30F, 1.18F, 1.05F}, {1.25F, 0.95F, 0.78F}, {1.60F, 1.48F, 1.35F}, {0.72F, 0.74F, 0.80F}};
  constexpr std::uint32_t kTop[32] = {
      0x23252b, 0x2d2f36, 0x1f2a44, 0x2b3b5c, 0xf0efea, 0xe4e2dc, 0xd5d3cc, 0x9b9da1,
      0x6f7379, 0x4b5058, 0x8a2f33, 0xb5403d, 0xc9604a, 0x6d2740, 0x2f5d4a, 0x4d7358,
      0x7d8a5c, 0x2c6e80, 0x3f86a8, 0x7fa9c4, 0x3a55a0, 0x5a4a86, 0x8c6aa0, 0xd39aa6,
      0xd8a23c, 0xe3c15e, 0xc98345, 0x8b6a4a, 0xb79f7f, 0xd9c8a9, 0x2a4f55, 0x7a3b2e};
  constexpr std::uint32_t kBottom[16] = {0x2b3a55, 0x34476a, 0x3f5577, 0x5a7190, 0x7890ab, 0x23262d,
                                         0x1c1d21, 0x2c2e33, 0x45474c, 0x6a6c70, 0x8e7f68, 0xb3a283,
                                         0x5b4a3b, 0x3b3129, 0x4a5240, 0xd2cdc2};
  // what the neutrals of the textures reflect
  constexpr float kTopBase = 0.50F, kBottomBase = 0.34F;
  const std::uint32_t a = mix_bits(seed ^ 0x9e3779b9u), b = mix_bits(a + 0x7f4a7c15u);
  const auto vary = [](const glm::vec3& color, std::uint32_t bits, float range) {
    const float factor = 1.0F + range * (static_cast<float>(bits & 255u) / 127.5F - 1.0F);
    return glm::min(color * factor, glm::vec3(2.0F));
  };
  Tints tints;
  tints.skin = vary(kSkin[a & 7u], a >> 6, 0.04F);
  tints.hair = vary(kHair[(a >> 3) & 7u], a >> 14, 0.10F);
  tints.top = vary(linear_from_hex(kTop[b & 31u]) / kTopBase, b >> 5, 0.10F);
  tints.bottom = vary(linear_from_hex(kBottom[(b >> 13) & 15u]) / kBottomBase, b >> 17, 0.10F);
  return tints;
}

}  // namespace throng::render::element
