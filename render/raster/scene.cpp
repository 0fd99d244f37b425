#include "render/raster/scene.hpp"

#include <algorithm>
#include <cmath>

#include "render/compute/cpu/work_pool.hpp"
#include "render/raster/element/instance_shade.hpp"

namespace throng::render {
SceneFrame make_scene_frame(const Camera& camera, const Viewport& viewport,
                            const glm::dvec3& origin_world, const Look& look) {
  const auto width = static_cast<double>(viewport.width_px);
  const auto height = static_cast<double>(viewport.height_px);
  SceneFrame scene{};
  scene.orthographic = camera.ortho_height_m > 0.0;
  scene.sun_direction = glm::normalize(look.sun_direction_world);
  scene.sun_color = look.sun_color;
  scene.sky_color = look.sky_color;
  scene.ground_light = look.ground_light;
  scene.horizon_color = look.horizon_color;
  scene.ground_color = look.ground_color;
  scene.ground_relative_m = static_cast<float>(origin_world.z - camera.eye_world.z);
  scene.ground = look.ground;
  scene.shadows = look.ground && look.shadows && scene.ground_relative_m < 0.0F;

  const glm::dmat3 world_from_view =
      glm::transpose(glm::dmat3(glm::mat3(view_from_relative(camera))));
  const double half_height =
      scene.orthographic ? 0.5 * camera.ortho_height_m : std::tan(0.5 * camera.fov_y_rad);
  const double per_px = 2.0 * half_height / height;
  const glm::dvec3 right = world_from_view[0] * per_px, down = world_from_view[1] * -per_px;
  const glm::dvec3 corner = right * (-0.5 * width) + down * (-0.5 * height);
  const glm::dvec3 forward = -world_from_view[2];
  scene.px_per_tangent = static_cast<float>(1.0 / per_px);
  // who looks at a whole city from far wants to see it
  const double target_m = glm::length(camera.target_world - camera.eye_world);
  scene.haze_per_m = static_cast<float>(1.0 / std::max(1800.0, 5.0 * target_m));
  if (scene.orthographic) {
    scene.ray_origin = glm::vec3(corner);
    scene.ray_origin_x = glm::vec3(right);
    scene.ray_origin_y = glm::vec3(down);
    scene.ray_direction = glm::vec3(forward);
  } else {
    scene.ray_direction = glm::vec3(forward + corner);
    scene.ray_direction_x = glm::vec3(right);
    scene.ray_direction_y = glm::vec3(down);
  }
  // within the grid's period, so that shading's numbers stay small anywhere on earth
  const glm::dvec3 eye = camera.eye_world - origin_world;
  scene.grid_eye =
      glm::vec2(eye.x - 20.0 * std::floor(eye.x / 20.0), eye.y - 20.0 * std::floor(eye.y / 20.0));
  return scene;
}

void shade_instances(const FrameGeometry& geometry, const Cast& cast, const SceneFrame& scene,
                     const Look& look, WorkPool& pool, std::vector<InstanceShade>& shades,
                     std::vector<std::uint32_t>& casters) {
  const std::size_t count = geometry.instances.size();
  shades.resize(count);
  casters.clear();
  const auto first_surrounding = static_cast<std::uint32_t>(
      std::find_if(cast.members.begin(), cast.members.end(),
                   [](const CastMember& member) { return member.environment; }) -
      cast.members.begin());
  const element::ChannelRange channel{look.channel_low, look.channel_high, look.color_by_channel,
                                      look.color_map};
  std::vector<std::uint32_t> walls;
  constexpr std::size_t kChunk = 512;
  pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const VisibleInstance& instance = geometry.instances[i];
      const Character& character = cast.members[instance.character].character;
      shades[i] = element::instance_shade(instance, character.height_m,
                                          character.corner_tones.most_vertices(), scene, channel,
                                          first_surrounding);
    }
  });
  for (std::size_t i = 0; i < count && scene.shadows; ++i) {
    if (geometry.instances[i].character >= first_surrounding) {
      walls.push_back(static_cast<std::uint32_t>(i));
      continue;
    }
    const bool has_vertices =
        (geometry.shared.empty() || geometry.shared[i].level == SharedInstance::kOwn) &&
        geometry.vertex_offset[i + 1] > geometry.vertex_offset[i];
    if (has_vertices && shades[i].size_px > element::kCastShadowFromPx) {
      casters.push_back(static_cast<std::uint32_t>(i));
    }
  }
  std::sort(casters.begin(), casters.end(), [&](std::uint32_t a, std::uint32_t b) {
    return shades[a].size_px != shades[b].size_px ? shades[a].size_px > shades[b].size_px : a < b;
  });
  std::uint64_t triangles_drawn = 0;
  for (const VisibleInstance& instance : geometry.instances) {
    triangles_drawn += instance.triangle_count;
  }
  std::uint64_t room = element::shadow_room(triangles_drawn);
  std::size_t kept = 0;
  for (; kept < casters.size(); ++kept) {
    const std::uint32_t i = casters[kept];
    const std::uint32_t charge = element::shadow_charge(
        geometry.triangle_offset[i + 1] - geometry.triangle_offset[i], shades[i].size_px);
    if (charge > room) break;
    room -= charge;
    shades[i].cast_shadow = element::cast_shadow_of(shades[i].size_px);
  }
  casters.resize(kept);
  casters.insert(casters.end(), walls.begin(), walls.end());
  std::sort(casters.begin(), casters.end());
}

}  // namespace throng::render
