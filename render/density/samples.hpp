#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::render {

/// A surface point of some character, brought to a figure a metre high.
struct Sample {
  glm::vec3 position, normal;
  glm::vec3 color;    // linear
  glm::vec4 regions;  // shares of the tint mask
  float weight = 1.0F;
};

/// Palette frame of somebody who stands: the first one of the idle clip, or of all.
std::uint32_t standing_frame(const Character& character);

/// The character's first `count` points, or all that there are, in a frame of its palette.
std::vector<Sample> surface_samples(const Character& character, std::uint32_t count,
                                    std::uint32_t frame);

/// What a splat shows: a disc that faces the eye, its width `squeeze` of its height, or one that
/// lies in the surface (`normal` is not zero) and is seen from outside only.
struct Disc {
  glm::vec3 centre;
  float radius;
  float squeeze = 1.0F;
  glm::vec3 normal{0.0F};
};

/// Area that discs cover together as seen from the side, the mean of six directions; m2 of a figure
/// a metre high.
float seen_area(std::span<const Disc> discs, float factor);

/// The same of the whole figure.
float seen_area_of(const Character& character);

/// Area of the character's surface, m2 of a figure a metre high.
float surface_area(const Character& character);

/// What the discs' radii are to be multiplied with, so that they are seen as large as `area`.
float fitted_factor(std::span<const Disc> discs, float area);

}  // namespace throng::render
