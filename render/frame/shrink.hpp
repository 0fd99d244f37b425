#pragma once

#include "render/compute/cpu/work_pool.hpp"
#include "throng/render/picture.hpp"

namespace throng::render {

/// A picture of half the width and height (both even): means of 2x2 pixels in linear light.
void shrink(const Picture& large, WorkPool& pool, Picture& small);

}  // namespace throng::render
