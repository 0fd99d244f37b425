#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "render/raster/element/scene_frame.hpp"
#include "throng/render/raster.hpp"

namespace throng::render {

SceneFrame make_scene_frame(const Camera& camera, const Viewport& viewport,
                            const glm::dvec3& origin_world, const Look& look);

/// Fills `shades` [V] and chooses who casts a projected shadow: figures from 40 px on (fading in up
/// to 64), the tallest first, until they cost a third of the figures' own triangles; and all of the
/// surroundings. `casters` are indices into the visible list, rising.
void shade_instances(const FrameGeometry& geometry, const Cast& cast, const SceneFrame& scene,
                     const Look& look, WorkPool& pool, std::vector<InstanceShade>& shades,
                     std::vector<std::uint32_t>& casters);

}  // namespace throng::render
