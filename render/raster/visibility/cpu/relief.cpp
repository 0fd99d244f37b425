#include "render/raster/visibility/cpu/relief.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "render/raster/element/color.hpp"

namespace throng::render::visibility {
namespace {

glm::vec3 turned(const glm::vec3& v, const JointedInstance& jointed, float scale) {
  return {v.x * jointed.cosine_scale - v.y * jointed.sine_scale,
          v.x * jointed.sine_scale + v.y * jointed.cosine_scale, v.z * scale};
}

glm::vec3 moved(const float* m, const glm::vec3& v) {
  return {m[0] * v.x + m[4] * v.y + m[8] * v.z, m[1] * v.x + m[5] * v.y + m[9] * v.z,
          m[2] * v.x + m[6] * v.y + m[10] * v.z};
}

glm::vec3 unpack_normal(std::uint32_t shape) {
  const auto decode = [](std::uint32_t byte) {
    return static_cast<float>(static_cast<std::int8_t>(byte)) * (1.0F / 127.0F);
  };
  glm::vec3 n(decode(shape >> 16 & 255U), decode(shape >> 24 & 255U), 0.0F);
  n.z = 1.0F - std::abs(n.x) - std::abs(n.y);
  const float fold = std::max(-n.z, 0.0F);
  n.x += n.x >= 0.0F ? -fold : fold;
  n.y += n.y >= 0.0F ? -fold : fold;
  return n;
}

}  // namespace

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
  const float half_x = 0.5F * static_cast<float>(grid.width);
  const float half_y = 0.5F * static_cast<float>(grid.height);
  const glm::mat4& clip = grid.clip_from_relative;
  const float distance_m =
      view.orthographic ? 1.0F : std::max(glm::length(instance.position_relative), 0.1F);
  for (std::uint32_t b = 0; b < member.box_count; ++b) {
    const ReliefBox& box = store.boxes[member.first_box + b];
    PlacedBox& own = placed[b];
    own.x_low = 1;
    own.x_high = own.y_low = own.y_high = 0;
    own.depth_high = 0.0F;
    own.px_per_m = view.px_per_tangent / distance_m * instance.scale;
    const float* m = joints + std::size_t{16} * (jointed.first_joint + box.joint);
    glm::vec3 side[3];
    for (int a = 0; a < 3; ++a) side[a] = turned(moved(m, box.side[a]), jointed, instance.scale);
    const glm::vec3 origin =
        instance.position_relative +
        turned(moved(m, box.origin) + glm::vec3(m[12], m[13], m[14]), jointed, instance.scale);
    const glm::vec3 cross[3] = {glm::cross(side[1], side[2]), glm::cross(side[2], side[0]),
                                glm::cross(side[0], side[1])};
    const float volume = glm::dot(side[0], cross[0]);
    if (!(std::abs(volume) > 1e-15F)) continue;
    for (int a = 0; a < 3; ++a) {
      const glm::vec3 row = cross[a] / volume;
      own.box_from_relative[a] = glm::vec4(row, -glm::dot(row, origin));
    }
    const glm::vec4 from = clip * glm::vec4(origin, 1.0F);
    glm::vec4 along[3];
    for (int a = 0; a < 3; ++a) along[a] = clip * glm::vec4(side[a], 0.0F);
    float x_low = 1e30F, y_low = 1e30F, x_high = -1e30F, y_high = -1e30F, nearest = 0.0F;
    bool is_clipped = false;
    for (int corner = 0; corner < 8; ++corner) {
      glm::vec4 p = from;
      if ((corner & 1) != 0) p += along[0];
      if ((corner & 2) != 0) p += along[1];
      if ((corner & 4) != 0) p += along[2];
      is_clipped = is_clipped || !(p.w > 1e-6F) || !(p.z <= p.w);
      const float x = p.x / p.w, y = p.y / p.w;
      x_low = std::min(x_low, x);
      x_high = std::max(x_high, x);
      y_low = std::min(y_low, y);
      y_high = std::max(y_high, y);
      nearest = std::max(nearest, p.z / p.w);
    }
    Footprint f{0, 0, grid.width - 1, grid.height - 1, 1.0F, false};
    if (!is_clipped) {
      const auto sample = [](float value, float last) {
        return static_cast<std::int32_t>(std::clamp(value, -2.0F, last + 1.0F));
      };
      const float last_x = static_cast<float>(grid.width), last_y = static_cast<float>(grid.height);
      f.x_low = std::max(0, sample(std::floor((1.0F + x_low) * half_x - 0.6F), last_x));
      f.y_low = std::max(0, sample(std::floor((1.0F - y_high) * half_y - 0.6F), last_y));
      f.x_high =
          std::min(grid.width - 1, sample(std::ceil((1.0F + x_high) * half_x - 0.4F), last_x));
      f.y_high =
          std::min(grid.height - 1, sample(std::ceil((1.0F - y_low) * half_y - 0.4F), last_y));
      f.depth_high = std::min(nearest * (1.0F + 1e-5F), 1.0F);
    }
    if (f.x_low > f.x_high || f.y_low > f.y_high || !(f.depth_high > 0.0F)) continue;
    own.x_low = static_cast<std::uint16_t>(f.x_low);
    own.y_low = static_cast<std::uint16_t>(f.y_low);
    own.x_high = static_cast<std::uint16_t>(f.x_high);
    own.y_high = static_cast<std::uint16_t>(f.y_high);
    own.depth_high = f.depth_high;
    all.x_low = std::min(all.x_low, f.x_low);
    all.y_low = std::min(all.y_low, f.y_low);
    all.x_high = std::max(all.x_high, f.x_high);
    all.y_high = std::max(all.y_high, f.y_high);
    all.depth_high = std::max(all.depth_high, f.depth_high);
  }
  return all;
}

ReliefHit relief_hit(const ReliefStore& store, const ReliefBox& box, std::uint32_t texel,
                     const VisibleInstance& instance, const JointedInstance& jointed,
                     const float* joints, const ReliefView& view, int sample_x, int sample_y,
                     float depth) {
  const float x = static_cast<float>(sample_x), y = static_cast<float>(sample_y);
  const float t = (view.z0 - depth * view.w0) / (depth * view.w1 - view.z1);
  ReliefHit hit;
  hit.relative = view.origin + x * view.origin_x + y * view.origin_y +
                 t * (view.direction + x * view.direction_x + y * view.direction_y);
  const float* m = joints + std::size_t{16} * (jointed.first_joint + box.joint);
  hit.normal = turned(moved(m, unpack_normal(store.shape[texel])), jointed, instance.scale);
  return hit;
}

}  // namespace throng::render::visibility
