#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "throng/render/raster.hpp"

namespace throng::render::gl {

/// The rasterizer on OpenGL 4.5 core through EGL. Unavailable with what each EGL platform said.
///
/// A frame is: agents (one indexed draw), shadows into the colour target's alpha, then the ground
/// and the sky wherever no agent was drawn, darkened by that alpha. Hardware takes four samples a
/// pixel; software takes one and smooths the edges afterwards, on `threads` threads (0: one for
/// each core). THRONG_GL_SAMPLES=1 or 4 in the environment decides otherwise.
/// @param compute  kCuda: on the EGL device that is the CUDA device, if there is one; then vertices
/// come from its memory, else through the host, and `RasterInfo::detail` says why.
/// @param hardware_only  FailedPrecondition where OpenGL is software, naming it.
absl::StatusOr<std::unique_ptr<Rasterizer>> make_gl_rasterizer(
    unsigned threads, bool hardware_only = false, BackendKind compute = BackendKind::kCpu);

}  // namespace throng::render::gl
