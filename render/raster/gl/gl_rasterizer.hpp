#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "throng/render/raster.hpp"

namespace throng::render::gl {

/// The rasterizer on OpenGL 4.5 core through EGL. Unavailable with what each EGL platform said.
///
/// A frame is: agents (one indexed draw), shadows into the colour target's alpha, then the ground and
/// the sky wherever no agent was drawn, darkened by that alpha. Four samples a pixel.
absl::StatusOr<std::unique_ptr<Rasterizer>> make_gl_rasterizer();

}  // namespace throng::render::gl
