#pragma once

#include <algorithm>
#include <cmath>

#include "render/compute/element/selection.hpp"
#include "throng/render/representation.hpp"

namespace throng::render {

/// The height of a speck's slabs in pixels at an error. Under half a pixel of error they are as
/// high as the error: 100,000 agents from above, 3 to 6 px, gain .006 SSIM by half as high ones.
inline float slab_px(float error_px) {
  return error_px < 0.5F ? std::max(error_px, 0.25F) : coarse_px(error_px);
}

/// Under which height some stand for all: two slabs, or less where less is asked for; beyond 3
/// pixels of error more do. 1,000,000 agents from above gain .08 SSIM where all are drawn, for a
/// quarter more time.
inline float least_px_of(const MixedForms& mixed, float error_px) {
  const float least = std::min(mixed.least_px, 2.0F * slab_px(error_px));
  return error_px > 3.0F ? std::max(least, coarse_px(error_px)) : least;
}

/// What specks may be off by (element::near_error_of): the error of the highest one that keeps to
/// that, which is where speck_error * height = near_error_px * (near / height)^2.
inline float speck_error_of(const MixedForms& mixed, const element::Projection& projection) {
  if (!(mixed.budget_ms > 0.0)) return mixed.error_px;
  const float near_px2 = 0.01F * projection.viewport_px2;
  const float height_px = std::cbrt(mixed.near_error_px * near_px2 / mixed.speck_error);
  return std::min(mixed.error_px, std::max(mixed.near_error_px, mixed.speck_error * height_px));
}

}  // namespace throng::render
