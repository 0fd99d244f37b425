#pragma once

#include <cmath>
#include <glm/glm.hpp>

#include "render/raster/element/scene_frame.hpp"
#include "render/raster/visibility/element/clip.hpp"
#include "render/raster/visibility/element/shade.hpp"
#include "throng/render/relief_box.hpp"
#include "throng/render/representation.hpp"
#include "throng/render/vertex.hpp"

// Relief impostors: where their boxes are, and where a ray meets what is in one. The search of
// cpu/relief_simd.cpp does the same for vectors of rays: the same bits.
namespace throng::render::element {

/// The rays of one frame by samples, and what depth they have t along them:
/// (z0 + z1 t) / (w0 + w1 t).
struct ReliefView {
  glm::vec3 origin, origin_x, origin_y, direction, direction_x, direction_y;
  float z0, z1, w0, w1;
  float px_per_tangent;
  bool orthographic;
};

/// A box where it stands in this frame. One cache line.
struct alignas(64) PlacedBox {
  glm::vec4 box_from_relative[3];              // rows
  std::uint16_t x_low, y_low, x_high, y_high;  // samples, inclusive; x_low > x_high: nothing
  float depth_high;
  float px_per_m;
};
static_assert(sizeof(PlacedBox) == 64);

THRONG_HOST_DEVICE inline glm::vec3 turned_by(const JointedInstance& jointed, float scale,
                                              const glm::vec3& v) {
  return {v.x * jointed.cosine_scale - v.y * jointed.sine_scale,
          v.x * jointed.sine_scale + v.y * jointed.cosine_scale, v.z * scale};
}

THRONG_HOST_DEVICE inline glm::vec3 moved_by(const float* m, const glm::vec3& v) {
  return {m[0] * v.x + m[4] * v.y + m[8] * v.z, m[1] * v.x + m[5] * v.y + m[9] * v.z,
          m[2] * v.x + m[6] * v.y + m[10] * v.z};
}

/// What crosses the near plane covers the whole picture.
THRONG_HOST_DEVICE inline PlacedBox place_box(const ReliefBox& box, const VisibleInstance& instance,
                                              const JointedInstance& jointed, const float* joints,
                                              const ReliefView& view, const SampleGrid& grid) {
  const glm::mat4& clip = grid.clip_from_relative;
  const float distance_m =
      view.orthographic ? 1.0F : most(glm::length(instance.position_relative), 0.1F);
  PlacedBox own;
  own.x_low = 1;
  own.x_high = own.y_low = own.y_high = 0;
  own.depth_high = 0.0F;
  own.px_per_m = view.px_per_tangent / distance_m * instance.scale;
  const float* m = joints + static_cast<std::size_t>(16) * (jointed.first_joint + box.joint);
  glm::vec3 side[3];
  for (int a = 0; a < 3; ++a)
    side[a] = turned_by(jointed, instance.scale, moved_by(m, box.side[a]));
  const glm::vec3 origin =
      instance.position_relative +
      turned_by(jointed, instance.scale, moved_by(m, box.origin) + glm::vec3(m[12], m[13], m[14]));
  const glm::vec3 cross[3] = {glm::cross(side[1], side[2]), glm::cross(side[2], side[0]),
                              glm::cross(side[0], side[1])};
  const float volume = glm::dot(side[0], cross[0]);
  if (!(std::fabs(volume) > 1e-15F)) return own;
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
    x_low = least(x_low, x);
    x_high = most(x_high, x);
    y_low = least(y_low, y);
    y_high = most(y_high, y);
    nearest = most(nearest, p.z / p.w);
  }
  std::int32_t low_x = 0, low_y = 0, high_x = grid.width - 1, high_y = grid.height - 1;
  float depth_high = 1.0F;
  if (!is_clipped) {
    const float half_x = 0.5F * static_cast<float>(grid.width);
    const float half_y = 0.5F * static_cast<float>(grid.height);
    const auto sample = [](float value, std::int32_t count) {
      return static_cast<std::int32_t>(least(most(value, -2.0F), static_cast<float>(count) + 1.0F));
    };
    const auto inside_low = [](std::int32_t at) { return at < 0 ? 0 : at; };
    const auto inside_high = [](std::int32_t at, std::int32_t count) {
      return at < count ? at : count - 1;
    };
    low_x = inside_low(sample(std::floor((1.0F + x_low) * half_x - 0.6F), grid.width));
    low_y = inside_low(sample(std::floor((1.0F - y_high) * half_y - 0.6F), grid.height));
    high_x =
        inside_high(sample(std::ceil((1.0F + x_high) * half_x - 0.4F), grid.width), grid.width);
    high_y =
        inside_high(sample(std::ceil((1.0F - y_low) * half_y - 0.4F), grid.height), grid.height);
    depth_high = least(nearest * (1.0F + 1e-5F), 1.0F);
  }
  if (low_x > high_x || low_y > high_y || !(depth_high > 0.0F)) return own;
  own.x_low = static_cast<std::uint16_t>(low_x);
  own.y_low = static_cast<std::uint16_t>(low_y);
  own.x_high = static_cast<std::uint16_t>(high_x);
  own.y_high = static_cast<std::uint16_t>(high_y);
  own.depth_high = depth_high;
  return own;
}

/// A level of a face's texels.
struct ReliefLevel {
  std::int32_t first, width, height;
};
/// Outlines in texels of 0.3 to 0.6 pixels, colours in twice that.
struct ReliefLevels {
  ReliefLevel search, color;
};
THRONG_HOST_DEVICE inline ReliefLevels relief_levels_of(const ReliefBox& box, float px_per_m,
                                                        int face) {
  const float area_px = most(glm::length(box.side[(face / 2 + 1) % 3]) * px_per_m *
                                 (glm::length(box.side[(face / 2 + 2) % 3]) * px_per_m),
                             1e-6F);
  ReliefLevel level{static_cast<std::int32_t>(box.face[face].first), box.face[face].width_px,
                    box.face[face].height_px};
  const auto halve = [&level] {
    level.first += level.width * level.height;
    level.width = level.width > 1 ? level.width / 2 : 1;
    level.height = level.height > 1 ? level.height / 2 : 1;
  };
  const auto are_more_than = [&](float limit) {
    return static_cast<float>(level.width) * static_cast<float>(level.height) > limit * area_px &&
           (level.width > 1 || level.height > 1);
  };
  while (are_more_than(12.0F)) halve();
  ReliefLevels levels{level, level};
  if (are_more_than(3.0F)) halve();
  levels.color = level;
  return levels;
}

/// The rays in a box's own frame, and how far they look.
struct ReliefRays {
  float origin[3], origin_x[3], origin_y[3];           // of the ray through sample (0, 0)
  float direction[3], direction_x[3], direction_y[3];  // for each metre ahead
  int linear, binary;
  bool crosses;
};
THRONG_HOST_DEVICE inline ReliefRays relief_rays(const ReliefBox& box, const PlacedBox& placed,
                                                 const ReliefView& view,
                                                 const ReliefSearch& search) {
  ReliefRays rays;
  float most_px = 0.0F;
  for (int a = 0; a < 3; ++a) {
    const glm::vec4& row = placed.box_from_relative[a];
    const glm::vec3 linear(row.x, row.y, row.z);
    rays.origin[a] = row.w + glm::dot(linear, view.origin);
    rays.origin_x[a] = glm::dot(linear, view.origin_x);
    rays.origin_y[a] = glm::dot(linear, view.origin_y);
    rays.direction[a] = glm::dot(linear, view.direction);
    rays.direction_x[a] = glm::dot(linear, view.direction_x);
    rays.direction_y[a] = glm::dot(linear, view.direction_y);
    most_px = most(most_px, glm::length(box.side[a]) * placed.px_per_m);
  }
  rays.linear = static_cast<int>(search.linear_steps);
  rays.binary = static_cast<int>(search.binary_steps);
  rays.crosses = search.adaptive;
  if (search.adaptive) {
    // steps of about 1.5 pixels, then to a quarter of one
    const float steps = least(most_px * 0.67F, 65536.0F);
    const int wanted = static_cast<int>(steps) + 2;
    rays.linear = wanted < rays.linear ? wanted : rays.linear;
    float step_px = most_px / static_cast<float>(rays.linear);
    int binary = 1;
    for (; binary < rays.binary && step_px > 0.25F; ++binary) step_px *= 0.5F;
    rays.binary = binary < rays.binary ? binary : rays.binary;
  }
  return rays;
}

/// Where a ray first passes from before the front depth to behind it: a linear search, then a
/// binary one (Policarpo et al. 2005), as the face shows it through which the ray enters.
struct ReliefFound {
  float depth;  // 0: nothing is there
  std::uint32_t texel;
};
/// @param hidden_below  depth of what is nearer for sure: the search may be left out beyond it.
THRONG_HOST_DEVICE inline ReliefFound search_relief(const std::uint32_t* shape,
                                                    const ReliefBox& box, const ReliefRays& rays,
                                                    float px_per_m, const ReliefView& view,
                                                    int sample_x, int sample_y,
                                                    float hidden_below) {
  const auto sx = static_cast<float>(sample_x), sy = static_cast<float>(sample_y);
  const ReliefFound nothing{0.0F, 0};
  // where the ray is between the box's faces
  float at[3], direction[3];
  float t_in = -1e30F, t_out = 1e30F;
  int axis = 0;
  for (int a = 0; a < 3; ++a) {
    at[a] = rays.origin[a] + (rays.origin_x[a] * sx + rays.origin_y[a] * sy);
    float d = rays.direction[a] + (rays.direction_x[a] * sx + rays.direction_y[a] * sy);
    if (std::fabs(d) < 1e-9F) d = 1e-9F;
    direction[a] = d;
    const float inverse = 1.0F / d;
    const float t0 = -at[a] * inverse, t1 = (1.0F - at[a]) * inverse;
    const float from = least(t0, t1);
    if (from > t_in) axis = a;
    t_in = most(t_in, from);
    t_out = least(t_out, most(t0, t1));
  }
  const auto depth_of = [&view](float t) {
    return (view.z0 + view.z1 * t) / (view.w0 + view.w1 * t);
  };
  // not before the near plane
  t_in = most(t_in, view.orthographic ? (1.0F - view.z0) / view.z1 : view.z0);
  if (!(t_in < t_out) || !(depth_of(t_in) >= hidden_below)) return nothing;
  // u, v and depth along the ray, as the entry face counts them
  const int u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
  const float u0 = at[u_axis], ud = direction[u_axis], v0 = at[v_axis], vd = direction[v_axis];
  const bool is_far = direction[axis] < 0.0F;
  const float s0 = (is_far ? 1.0F - at[axis] : at[axis]) * 255.0F;
  const float sd = (is_far ? -direction[axis] : direction[axis]) * 255.0F;
  const ReliefLevels levels = relief_levels_of(box, px_per_m, 2 * axis + (is_far ? 1 : 0));
  const auto texel_in = [&](float t, const ReliefLevel& level) {
    const auto wide = static_cast<float>(level.width), high = static_cast<float>(level.height);
    const float u = std::floor((u0 + ud * t) * wide), v = std::floor((v0 + vd * t) * high);
    const auto x = static_cast<std::int32_t>(least(most(u, 0.0F), wide - 1.0F));
    const auto y = static_cast<std::int32_t>(least(most(v, 0.0F), high - 1.0F));
    return static_cast<std::uint32_t>(level.first + (y * level.width + x));
  };
  const auto front_of = [](std::uint32_t word) { return static_cast<float>(word & 255U); };
  const auto back_of = [](std::uint32_t word) { return static_cast<float>((word >> 8) & 255U); };
  const float step = (t_out - t_in) * (1.0F / static_cast<float>(rays.linear));
  float t = t_in - step * 0.5F;
  bool found = false, before = false;  // in front of something at the last step
  for (int i = 0; i < rays.linear && !found; ++i) {
    t = t + step;
    const std::uint32_t word = shape[texel_in(t, levels.search)];
    const float d = s0 + sd * t, front = front_of(word), back = back_of(word);
    const bool is_something = front < back, behind_front = is_something && d >= front;
    found = behind_front && d <= back;
    if (rays.crosses) {
      found = found || (behind_front && before);
      before = is_something && d < front;
    }
  }
  if (!found) return nothing;
  // between the last step outside and the first inside
  float low = most(t - step, t_in), high = t;
  for (int i = 0; i < rays.binary; ++i) {
    const float middle = (low + high) * 0.5F;
    const std::uint32_t word = shape[texel_in(middle, levels.search)];
    const float d = s0 + sd * middle, front = front_of(word), back = back_of(word);
    const bool inside = front < back && d >= front && (rays.crosses || d <= back);
    (inside ? high : low) = middle;
  }
  // the coarser level shows less only where it shows nothing
  const std::uint32_t color = texel_in(high, levels.color), word = shape[color];
  return {least(depth_of(high), 1.0F),
          front_of(word) < back_of(word) ? color : texel_in(high, levels.search)};
}

/// A place of an impostor's surface as it is shaded.
struct ReliefHit {
  glm::vec3 relative;  // metres, relative to the eye
  glm::vec3 normal;    // world axes, of any length
};
/// @param shape  the texel's.
THRONG_HOST_DEVICE inline ReliefHit relief_hit(const ReliefBox& box, std::uint32_t shape,
                                               const VisibleInstance& instance,
                                               const JointedInstance& jointed, const float* joints,
                                               const ReliefView& view, int sample_x, int sample_y,
                                               float depth) {
  const auto x = static_cast<float>(sample_x), y = static_cast<float>(sample_y);
  const float t = (view.z0 - depth * view.w0) / (depth * view.w1 - view.z1);
  ReliefHit hit;
  hit.relative = view.origin + x * view.origin_x + y * view.origin_y +
                 t * (view.direction + x * view.direction_x + y * view.direction_y);
  // octahedral, snorm8
  const auto decode = [](std::uint32_t byte) {
    return static_cast<float>(static_cast<std::int8_t>(byte)) * (1.0F / 127.0F);
  };
  glm::vec3 n(decode(shape >> 16 & 255U), decode(shape >> 24 & 255U), 0.0F);
  n.z = 1.0F - std::fabs(n.x) - std::fabs(n.y);
  const float fold = most(-n.z, 0.0F);
  n.x += n.x >= 0.0F ? -fold : fold;
  n.y += n.y >= 0.0F ? -fold : fold;
  const float* m = joints + static_cast<std::size_t>(16) * (jointed.first_joint + box.joint);
  hit.normal = turned_by(jointed, instance.scale, moved_by(m, n));
  return hit;
}

}  // namespace throng::render::element
