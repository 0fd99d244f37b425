#pragma once

#include <memory>
#include <string>

#include "throng/render/frame.hpp"

namespace throng::render {

/// Draws two frames of a small crowd with the visibility rasterizer and with OpenGL, and returns
/// the one whose second frame took less time; visibility where neither can. Measured once for each
/// device, driver and cast size; `why` says what each took, or why it can't.
RasterKind faster_rasterizer(const std::shared_ptr<const Cast>& cast,
                             const FramePipelineOptions& options, std::string& why);

}  // namespace throng::render
