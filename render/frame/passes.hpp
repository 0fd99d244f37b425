#pragma once

#include <memory>

#include "throng/render/frame.hpp"

namespace throng::render {

/// Depth in metres, who is where, and boxes from what the rasterizer kept.
/// @param shown  the agents by slot; slots beyond its columns are surroundings. Null: no geometry.
void fill_passes(const PixelFacts& facts, const FrameGeometry& geometry,
                 const std::shared_ptr<const Snapshot>& shown, const ViewSettings& settings,
                 const glm::dvec3& origin_world, FramePasses& passes);

}  // namespace throng::render
