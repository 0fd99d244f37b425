#include "render/raster/visibility/cpu/relief.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "render/raster/element/color.hpp"

namespace throng::render::visibility {

absl::StatusOr<ReliefStore> make_relief_store(const Cast& cast, ReliefStore store,
                                              std::size_t kept) {
  store.members.resize(kept);
  float linear[256];
  for (int i = 0; i < 256; ++i) {
    linear[i] = element::linear_from_srgb(static_cast<float>(i) / 255.0F);
  }
  for (const CastMember& member : std::span(cast.members).subspan(kept)) {
    ReliefStore::Member& own = store.members.emplace_back();
    const Relief* relief = member.character.relief.get();
    if (relief == nullptr) continue;
    const std::size_t first = store.shape.size();
    if (first + relief->shape.size() > 0x7fffffffULL) {
      return absl::ResourceExhaustedError(absl::StrCat("visibility upload: impostors have over ",
                                                       0x7fffffff, " texels, at most that many"));
    }
    own.first_box = static_cast<std::uint32_t>(store.boxes.size());
    own.box_count = static_cast<std::uint32_t>(relief->boxes.size());
    for (ReliefBox box : relief->boxes) {
      for (ReliefFace& face : box.face) face.first += static_cast<std::uint32_t>(first);
      store.boxes.push_back(box);
    }
    store.shape.insert(store.shape.end(), relief->shape.begin(), relief->shape.end());
    store.regions.insert(store.regions.end(), relief->tint.begin(), relief->tint.end());
    store.base.reserve(store.shape.size());
    for (const std::uint32_t color : relief->color) {
      store.base.push_back(element::pack_color(
          {linear[color & 255U], linear[color >> 8 & 255U], linear[color >> 16 & 255U]}));
    }
  }
  return store;
}

ReliefView make_relief_view(const SceneFrame& scene, const SampleGrid& grid) {
  ReliefView view{};
  // samples lie half a pixel apart, the first one a quarter in
  const auto by_samples = [](const glm::vec3& at, const glm::vec3& x, const glm::vec3& y,
                             glm::vec3& to, glm::vec3& to_x, glm::vec3& to_y) {
    to = at + 0.25F * x + 0.25F * y;
    to_x = 0.5F * x;
    to_y = 0.5F * y;
  };
  by_samples(scene.ray_origin, scene.ray_origin_x, scene.ray_origin_y, view.origin, view.origin_x,
             view.origin_y);
  by_samples(scene.ray_direction, scene.ray_direction_x, scene.ray_direction_y, view.direction,
             view.direction_x, view.direction_y);
  const glm::mat4& m = grid.clip_from_relative;
  view.orthographic = scene.orthographic;
  view.px_per_tangent = scene.px_per_tangent;
  view.z0 = m[3][2];
  if (scene.orthographic) {
    view.z1 = glm::dot(glm::vec3(m[0][2], m[1][2], m[2][2]), scene.ray_direction);
    view.w0 = 1.0F;
  } else {
    view.w1 = 1.0F;  // a direction goes forward by 1 m
  }
  return view;
}

Footprint place_boxes(const ReliefStore& store, const ReliefStore::Member& member,
                      const VisibleInstance& instance, const JointedInstance& jointed,
                      const float* joints, const ReliefView& view, const SampleGrid& grid,
                      PlacedBox* placed) {
  Footprint all{grid.width, grid.height, -1, -1, 0.0F, false};
  for (std::uint32_t b = 0; b < member.box_count; ++b) {
    placed[b] = element::place_box(store.boxes[member.first_box + b], instance, jointed, joints,
                                   view, grid);
    const PlacedBox& own = placed[b];
    if (own.x_low > own.x_high) continue;
    all.x_low = std::min<std::int32_t>(all.x_low, own.x_low);
    all.y_low = std::min<std::int32_t>(all.y_low, own.y_low);
    all.x_high = std::max<std::int32_t>(all.x_high, own.x_high);
    all.y_high = std::max<std::int32_t>(all.y_high, own.y_high);
    all.depth_high = std::max(all.depth_high, own.depth_high);
  }
  return all;
}

}  // namespace throng::render::visibility
