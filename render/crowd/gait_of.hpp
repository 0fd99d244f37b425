#pragma once

#include "render/compute/element/gait.hpp"
#include "throng/render/asset.hpp"

namespace throng::render {

/// The clips a character stands, walks and runs with (its first of each kind) and their strides. A
/// character without any of them stands with its first clip; without a clip, in its first frame.
element::Gait gait_of(const Character& character);

}  // namespace throng::render
