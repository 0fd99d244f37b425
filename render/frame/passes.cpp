#include "render/frame/passes.hpp"

#include <algorithm>
#include <limits>

#include "render/raster/scene.hpp"

namespace throng::render {
namespace {

constexpr float kSkyM = std::numeric_limits<float>::infinity();

/// How far along the viewing axis the ground plane is at a pixel's centre.
float ground_depth_m(const SceneFrame& scene, float x_px, float y_px) {
  const glm::vec3 origin = scene.ray_origin + scene.ray_origin_x * x_px + scene.ray_origin_y * y_px;
  const glm::vec3 direction =
      scene.ray_direction + scene.ray_direction_x * x_px + scene.ray_direction_y * y_px;
  if (!scene.ground || direction.z >= 0.0F) return kSkyM;  // it has no underside
  const float depth_m = (scene.ground_relative_m - origin.z) / direction.z;
  return depth_m > 0.0F ? depth_m : kSkyM;
}

void grow(PixelBox& box, std::int32_t x, std::int32_t y) {
  if (box.x_low > box.x_high) {
    box = {x, y, x, y};
    return;
  }
  box = {std::min(box.x_low, x), std::min(box.y_low, y), std::max(box.x_high, x),
         std::max(box.y_high, y)};
}

}  // namespace

void fill_passes(const PixelFacts& facts, const FrameGeometry& geometry,
                 const std::shared_ptr<const Snapshot>& shown, const ViewSettings& settings,
                 const glm::dvec3& origin_world, FramePasses& passes) {
  const Camera& camera = settings.camera;
  passes.width_px = settings.viewport.width_px;
  passes.height_px = settings.viewport.height_px;
  passes.instances.assign(geometry.instances.size(), {});
  for (std::size_t i = 0; i < passes.instances.size(); ++i) {
    const std::uint32_t slot = geometry.instances[i].slot;
    SeenInstance& seen = passes.instances[i];
    seen.surrounding = shown == nullptr || slot >= shown->present.size();
    if (!seen.surrounding) seen.agent_id = shown->roster->id[slot];
    seen.bounds = facts.bounds[i];
  }
  const SceneFrame scene = make_scene_frame(camera, settings.viewport, origin_world, settings.look);
  const auto near_m = static_cast<float>(camera.near_m), far_m = static_cast<float>(camera.far_m);
  passes.instance = facts.instance;
  passes.depth_m.resize(facts.depth.size());
  std::size_t pixel = 0;
  for (std::uint32_t y = 0; y < passes.height_px; ++y) {
    for (std::uint32_t x = 0; x < passes.width_px; ++x, ++pixel) {
      const std::uint32_t i = facts.instance[pixel];
      if (i == PixelFacts::kNothing) {
        passes.depth_m[pixel] =
            ground_depth_m(scene, static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
        continue;
      }
      // the inverse of clip_from_relative's third row
      const float depth = facts.depth[pixel];
      passes.depth_m[pixel] =
          scene.orthographic ? far_m - depth * (far_m - near_m) : near_m / depth;
      SeenInstance& seen = passes.instances[i];
      ++seen.visible_px;
      grow(seen.visible, static_cast<std::int32_t>(x), static_cast<std::int32_t>(y));
    }
  }
}

}  // namespace throng::render
