#pragma once

#include <cstdint>
#include <glm/glm.hpp>

#include "render/raster/element/color.hpp"

namespace throng::render::element {

/// What the four regions of a character's tint mask are multiplied with, linear.
struct Tints {
  glm::vec3 skin, hair, top, bottom;
};

/// Finaliser of MurmurHash3 (A. Appleby, public domain): every output bit depends on every input
/// bit.
inline std::uint32_t mix_bits(std::uint32_t bits) {
  bits ^= bits >> 16;
  bits *= 0x85ebca6bu;
  bits ^= bits >> 13;
  bits *= 0xc2b2ae35u;
  return bits ^ (bits >> 16);
}

/// Tints of an agent by its seed: the same agent always wears the same clothes.
///
/// A street's crowd, by proportion: about two of five tops are black, white, grey or navy, the
/// others muted with a few saturated ones; trousers are mostly denim and dark. Hair follows skin:
/// the darker the skin, the likelier is dark hair; grey hair comes with any. Brightness varies by
/// 10 % around each colour, so that neighbours in the same coat still differ.
inline Tints tints_of(std::uint32_t seed) {
  constexpr std::uint32_t kSkin[8] = {0xf3d3bd, 0xeac0a2, 0xe0ac8a, 0xcf9674,
                                      0xb57d5a, 0x946244, 0x714a34, 0x533629};
  constexpr std::uint32_t kHair[12] = {0x1b1715, 0x241a15, 0x33231a, 0x2b1d16, 0x4a3020, 0x6b4a2f,
                                       0x8a6540, 0xc09a5f, 0xd8bd85, 0x7c3b22, 0x9a9693, 0xcfcac4};
  constexpr std::uint32_t kTop[32] = {
      0x23252b, 0x2d2f36, 0x1f2a44, 0x2b3b5c, 0xf0efea, 0xe4e2dc, 0xd5d3cc, 0x9b9da1,
      0x6f7379, 0x4b5058, 0x8a2f33, 0xb5403d, 0xc9604a, 0x6d2740, 0x2f5d4a, 0x4d7358,
      0x7d8a5c, 0x2c6e80, 0x3f86a8, 0x7fa9c4, 0x3a55a0, 0x5a4a86, 0x8c6aa0, 0xd39aa6,
      0xd8a23c, 0xe3c15e, 0xc98345, 0x8b6a4a, 0xb79f7f, 0xd9c8a9, 0x2a4f55, 0x7a3b2e};
  constexpr std::uint32_t kBottom[16] = {0x2b3a55, 0x34476a, 0x3f5577, 0x5a7190, 0x7890ab, 0x23262d,
                                         0x1c1d21, 0x2c2e33, 0x45474c, 0x6a6c70, 0x8e7f68, 0xb3a283,
                                         0x5b4a3b, 0x3b3129, 0x4a5240, 0xd2cdc2};
  const std::uint32_t a = mix_bits(seed ^ 0x9e3779b9u), b = mix_bits(a + 0x7f4a7c15u);
  const auto vary = [](std::uint32_t hex, std::uint32_t bits) {
    return linear_from_hex(hex) * (0.90F + 0.20F * static_cast<float>(bits & 255u) / 255.0F);
  };
  const std::uint32_t skin = a & 7u;
  // one in eight is grey or white; else the range of hair colours narrows as skin darkens
  const std::uint32_t shades = skin < 3 ? 10u : skin < 5 ? 6u : 4u;
  const std::uint32_t hair =
      ((a >> 3) & 7u) == 0 ? 10u + ((a >> 6) & 1u) : (((a >> 7) & 255u) * shades) >> 8;
  Tints tints;
  tints.skin = vary(kSkin[skin], a >> 15);
  tints.hair = vary(kHair[hair], a >> 23);
  tints.top = vary(kTop[b & 31u], b >> 5);
  tints.bottom = vary(kBottom[(b >> 13) & 15u], b >> 17);
  return tints;
}

}  // namespace throng::render::element
