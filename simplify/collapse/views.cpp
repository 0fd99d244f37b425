#include "simplify/collapse/views.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "simplify/collapse/pixels.hpp"
#include "throng/render/asset.hpp"

namespace throng::simplify {
namespace {

constexpr int kSize_px = 88;         // of a picture
constexpr float kFigure_px = 64.0F;  // the longest side of the figure
constexpr int kDirections = 4;       // for each pose
constexpr std::uint32_t kMostPoses = 6;
constexpr int kVisibilityScale = 4;  // pictures that count what is visible are larger
// What an outline that moved counts on top of its colours, as a squared difference.
constexpr float kCoverage = 0.4F;
// Pixels of thin parts count more, at most so many times: a lost leg is few pixels, but is missed.
constexpr float kThin = 2.0F;
constexpr int kThinRadius_px = 5;
constexpr std::uint32_t kBackground = 0x00808080U;
constexpr std::uint32_t kSeen = 0xFF000000U;  // what is not background, whatever its colour

std::uint32_t pack(const glm::vec3& color) {
  const glm::uvec3 c(glm::clamp(color, 0.0F, 1.0F) * 255.0F + 0.5F);
  return c.x | (c.y << 8U) | (c.z << 16U) | 0xFF000000U;
}

float difference(std::uint32_t a, std::uint32_t b) {
  if (a == b) return 0.0F;
  int sum = 0;
  for (unsigned shift = 0; shift < 24; shift += 8) {
    const int d = static_cast<int>((a >> shift) & 255U) - static_cast<int>((b >> shift) & 255U);
    sum += d * d;
  }
  return static_cast<float>(sum) / (3.0F * 255.0F * 255.0F) +
         ((a ^ b) >> 24U != 0U ? kCoverage : 0.0F);
}

/// One over the share of the figure in the square around each pixel of it; 1 outside.
std::vector<float> thinness(const std::vector<std::uint32_t>& image) {
  std::vector<int> sum(std::size_t{kSize_px + 1} * (kSize_px + 1), 0);  // up to a row and column
  const auto at = [](int x, int y) { return static_cast<std::size_t>(y) * (kSize_px + 1) + x; };
  for (int y = 0; y < kSize_px; ++y) {
    for (int x = 0; x < kSize_px; ++x) {
      sum[at(x + 1, y + 1)] =
          sum[at(x, y + 1)] + sum[at(x + 1, y)] - sum[at(x, y)] +
          (image[static_cast<std::size_t>(y) * kSize_px + x] >> 31U != 0U ? 1 : 0);
    }
  }
  constexpr int kSide = 2 * kThinRadius_px + 1;
  std::vector<float> weight(image.size(), 1.0F);
  for (int y = 0; y < kSize_px; ++y) {
    const int y0 = std::max(0, y - kThinRadius_px), y1 = std::min(kSize_px, y + kThinRadius_px + 1);
    for (int x = 0; x < kSize_px; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * kSize_px + x;
      if (image[pixel] >> 31U == 0U) continue;
      const int x0 = std::max(0, x - kThinRadius_px),
                x1 = std::min(kSize_px, x + kThinRadius_px + 1);
      const int covered = sum[at(x1, y1)] - sum[at(x0, y1)] - sum[at(x1, y0)] + sum[at(x0, y0)];
      weight[pixel] = std::min(
          kThin, static_cast<float>(kSide * kSide) / static_cast<float>(std::max(1, covered)));
    }
  }
  return weight;
}

}  // namespace

Views::Views(const PoseSet& poses, const WedgeMesh& mesh, float size_m)
    : surface_(mesh.surface()),
      is_two_sided_(surface_.is_two_sided()),
      pixel_m_(size_m / kFigure_px),
      levels_(small_levels(mesh.surface())),
      near_(kSize_px * kSize_px) {
  const std::size_t points = surface_.points.size();
  const auto triangles = static_cast<std::uint32_t>(surface_.triangles.size());
  for (std::uint32_t t = 0; t < triangles; ++t) {
    drawn_.push_back({mesh.points(t), mesh.wedges(t), surface_.triangle_flags[t]});
  }
  // farthest-point sampling puts the most different poses first; the bind pose is seen by nobody
  const std::uint32_t first = poses.count > 1 ? 1 : 0;
  const std::uint32_t end = std::min(poses.count, first + kMostPoses);
  for (std::uint32_t pose = first; pose < end; ++pose) {
    const std::span at = std::span(poses.position).subspan(pose * points, points);
    std::vector<glm::vec3> normal(surface_.wedge_count(), glm::vec3(0.0F));
    glm::vec3 low(at[0]), high(at[0]);
    for (const glm::vec3& p : at) {
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
    for (const Drawn& t : drawn_) {
      const glm::vec3 n = glm::cross(at[t.point.y] - at[t.point.x], at[t.point.z] - at[t.point.x]);
      for (int i = 0; i < 3; ++i) normal[t.wedge[i]] += n;
    }
    for (int k = 0; k < kDirections; ++k) {
      // every pose from other sides
      const float turn = static_cast<float>(k) + 0.37F * static_cast<float>(pose - first);
      const float azimuth_rad = 6.2831853F / kDirections * turn;
      const float elevation_rad = k % 2 == 0 ? 0.15F : 0.45F;
      const glm::vec3 towards(std::cos(elevation_rad) * std::cos(azimuth_rad),
                              std::cos(elevation_rad) * std::sin(azimuth_rad),
                              std::sin(elevation_rad));
      const glm::vec3 right = glm::normalize(glm::cross(glm::vec3(0, 0, 1), towards));
      const glm::vec3 up = glm::cross(towards, right);
      const glm::vec3 light = glm::normalize(towards + 0.6F * right + 0.9F * up);
      Picture picture;
      picture.place.reserve(points);
      for (const glm::vec3& p : at) {
        const glm::vec3 d = (p - 0.5F * (low + high)) / pixel_m_;
        picture.place.emplace_back(0.5F * kSize_px + glm::dot(d, right),
                                   0.5F * kSize_px - glm::dot(d, up), glm::dot(d, towards));
      }
      for (const glm::vec3& n : normal) {
        const float length = glm::length(n);
        const float facing = length > 0.0F ? glm::dot(n, light) / length : 0.0F;
        picture.shade.push_back(0.45F + 0.55F * std::max(0.0F, facing));
      }
      picture.reference.assign(std::size_t{kSize_px} * kSize_px, kBackground);
      draw(picture, drawn_, nullptr, {0, 0, kSize_px, kSize_px}, picture.reference, {});
      picture.thin = thinness(picture.reference);
      picture.weight.assign(picture.thin.size(), 1.0F);
      picture.now = picture.reference;
      picture.error.assign(picture.now.size(), 0.0F);
      pictures_.push_back(std::move(picture));
    }
  }
}

Views::Rect Views::box(const Picture& picture, const glm::uvec3& point) const {
  const glm::vec3 &a = picture.place[point.x], &b = picture.place[point.y],
                  &c = picture.place[point.z];
  const auto clamped = [](float value) {
    return static_cast<std::int16_t>(std::clamp(value, 0.0F, static_cast<float>(kSize_px)));
  };
  return {clamped(std::min({a.x, b.x, c.x}) - 1.0F), clamped(std::min({a.y, b.y, c.y}) - 1.0F),
          clamped(std::max({a.x, b.x, c.x}) + 2.0F), clamped(std::max({a.y, b.y, c.y}) + 2.0F)};
}

template <typename Fill>
void Views::fill_each(const Picture& picture, std::span<const Drawn> triangles,
                      const std::vector<bool>* removed, const Rect& rect,
                      std::vector<std::uint32_t>& image, std::span<const Rect> boxes,
                      const Fill& fill) const {
  for (int y = rect.y0; y < rect.y1; ++y) {
    std::fill_n(near_.begin() + y * kSize_px + rect.x0, rect.x1 - rect.x0, -1.0e30F);
    std::fill_n(image.begin() + y * kSize_px + rect.x0, rect.x1 - rect.x0, kBackground);
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (removed != nullptr && (*removed)[t]) continue;
    if (!boxes.empty()) {
      const Rect& each = boxes[t];
      if (each.x0 >= rect.x1 || each.x1 <= rect.x0 || each.y0 >= rect.y1 || each.y1 <= rect.y0)
        continue;
    }
    const Drawn& drawn = triangles[t];
    const glm::vec3 &a = picture.place[drawn.point.x], &b = picture.place[drawn.point.y],
                    &c = picture.place[drawn.point.z];
    const float area = doubled_area(a, b, c);
    if (area == 0.0F) continue;
    if (area > 0.0F && !is_two_sided_) continue;
    const auto color_at = fill(t, area);
    for_pixels(a, b, c, rect.x0, rect.y0, rect.x1, rect.y1, [&](int x, int y, float w0, float w1) {
      const float w2 = 1.0F - w0 - w1;
      const float nearness = w0 * a.z + w1 * b.z + w2 * c.z;
      const std::size_t pixel = static_cast<std::size_t>(y) * kSize_px + x;
      if (nearness <= near_[pixel]) return;
      const std::optional<std::uint32_t> color = color_at(w0, w1, w2);
      if (!color.has_value()) return;
      near_[pixel] = nearness;
      image[pixel] = *color;
    });
  }
}

void Views::draw(const Picture& picture, std::span<const Drawn> triangles,
                 const std::vector<bool>* removed, const Rect& rect,
                 std::vector<std::uint32_t>& image, std::span<const Rect> boxes) const {
  fill_each(picture, triangles, removed, rect, image, boxes, [&](std::size_t t, float area) {
    const Drawn& drawn = triangles[t];
    const glm::vec2 &ua = surface_.wedge_uv[drawn.wedge.x], &ub = surface_.wedge_uv[drawn.wedge.y],
                    &uc = surface_.wedge_uv[drawn.wedge.z];
    const glm::vec3 shade(picture.shade[drawn.wedge.x], picture.shade[drawn.wedge.y],
                          picture.shade[drawn.wedge.z]);
    // as the renderer does: what is stretched over much of the texture shows the mean of it
    std::size_t level = 0;
    if (!levels_.empty()) {
      const glm::vec2 u = ub - ua, v = uc - ua;
      float texels = std::fabs(u.x * v.y - u.y * v.x) *
                     static_cast<float>(levels_[0].width_px * levels_[0].height_px);
      for (; texels > 2.0F * std::fabs(area) && level + 1 < levels_.size(); ++level)
        texels *= 0.25F;
    }
    const bool has_holes = (drawn.flags & render::kTriangleAlphaCutout) != 0;
    return [this, &ua, &ub, &uc, shade, level, has_holes](
               float w0, float w1, float w2) -> std::optional<std::uint32_t> {
      glm::vec3 color(0.8F);
      if (!levels_.empty()) {
        const std::uint8_t* at = levels_[level].at(w0 * ua + w1 * ub + w2 * uc);
        if (at[3] < 128 && has_holes) return std::nullopt;
        color = glm::vec3(at[0], at[1], at[2]) / 255.0F;
      }
      return pack(color * (w0 * shade.x + w1 * shade.y + w2 * shade.z));
    };
  });
}

namespace {

/// Adds a colour r g b a in bytes, if it is of the figure.
void add_seen(std::uint32_t reference, glm::vec4& sum) {
  if (reference >> 24U == 0U) return;
  sum += glm::vec4(static_cast<float>(reference & 255U), static_cast<float>(reference >> 8U & 255U),
                   static_cast<float>(reference >> 16U & 255U), 1.0F);
}

template <typename Rect, typename Visit>
void for_rect(const Rect& rect, Visit visit) {
  for (int y = rect.y0; y < rect.y1; ++y) {
    for (int x = rect.x0; x < rect.x1; ++x) visit(static_cast<std::size_t>(y) * kSize_px + x);
  }
}

}  // namespace

void Views::draw_numbers(const Picture& picture, std::span<const Drawn> triangles,
                         const std::vector<bool>* removed, const Rect& rect,
                         std::vector<std::uint32_t>& image, std::span<const Rect> boxes) const {
  fill_each(picture, triangles, removed, rect, image, boxes, [](std::size_t t, float) {
    const auto number = static_cast<std::uint32_t>(t) | kSeen;
    return [number](float, float, float) { return std::optional(number); };
  });
}

template <typename Visit>
void Views::for_toned(const Picture& picture, const Rect& rect,
                      const std::vector<std::uint32_t>& image, std::span<const glm::vec4> tones,
                      Visit visit) const {
  for_rect(rect, [&](std::size_t pixel) {
    std::uint32_t color = image[pixel];
    if (color != kBackground) {
      const glm::vec4& tone = tones[color & ~kSeen];
      // wholly beyond the figure's outline there is no colour to miss
      color = tone.w > 0.0F ? pack(glm::vec3(tone) / (255.0F * tone.w))
                            : picture.reference[pixel] | kSeen;
    }
    visit(pixel, color);
  });
}

std::vector<float> Views::visibility(const WedgeMesh& mesh) const {
  constexpr int kWide_px = kSize_px * kVisibilityScale;
  const auto triangles = static_cast<std::uint32_t>(surface_.triangles.size());
  std::vector<float> seen(triangles, 0.0F), turned(triangles, 0.0F);
  std::vector<float> near(std::size_t{kWide_px} * kWide_px);
  std::vector<std::uint32_t> who(near.size());
  for (const Picture& picture : pictures_) {
    std::fill(near.begin(), near.end(), -1.0e30F);
    std::fill(who.begin(), who.end(), kNoIndex);
    for (std::uint32_t t = 0; t < triangles; ++t) {
      glm::vec3 p[3];
      for (int i = 0; i < 3; ++i)
        p[i] = picture.place[mesh.points(t)[i]] * static_cast<float>(kVisibilityScale);
      const float area = doubled_area(p[0], p[1], p[2]);
      if (area == 0.0F || (area > 0.0F && !is_two_sided_)) continue;
      turned[t] += 0.5F * std::fabs(area);
      for_pixels(p[0], p[1], p[2], 0, 0, kWide_px, kWide_px, [&](int x, int y, float w0, float w1) {
        const float nearness = w0 * p[0].z + w1 * p[1].z + (1.0F - w0 - w1) * p[2].z;
        const std::size_t pixel = static_cast<std::size_t>(y) * kWide_px + x;
        if (nearness <= near[pixel]) return;
        near[pixel] = nearness;
        who[pixel] = t;
      });
    }
    for (const std::uint32_t t : who) {
      if (t != kNoIndex) seen[t] += 1.0F;
    }
  }
  // a triangle smaller than a pixel is seen by chance, so it is judged with what is around it
  std::vector<glm::vec2> around(surface_.points.size(), glm::vec2(0.0F));
  for (std::uint32_t t = 0; t < triangles; ++t) {
    for (int i = 0; i < 3; ++i) around[mesh.points(t)[i]] += glm::vec2(seen[t], turned[t]);
  }
  std::vector<float> share(triangles, 1.0F);
  for (std::uint32_t t = 0; t < triangles; ++t) {
    const glm::vec2 sum =
        around[mesh.points(t).x] + around[mesh.points(t).y] + around[mesh.points(t).z];
    if (sum.y > 0.0F) share[t] = std::min(1.0F, sum.x / sum.y);
  }
  return share;
}

void Views::set(std::span<const Drawn> triangles, float thin_share, bool toned) {
  drawn_.assign(triangles.begin(), triangles.end());
  toned_ = toned;
  constexpr Rect kAll{0, 0, kSize_px, kSize_px};
  for (Picture& picture : pictures_) {
    if (toned) {
      image_.resize(near_.size());
      draw_numbers(picture, drawn_, nullptr, kAll, image_, {});
      picture.tones.assign(drawn_.size(), glm::vec4(0.0F));
      for (std::size_t i = 0; i < image_.size(); ++i) {
        if (image_[i] != kBackground)
          add_seen(picture.reference[i], picture.tones[image_[i] & ~kSeen]);
      }
      for_toned(picture, kAll, image_, picture.tones,
                [&](std::size_t pixel, std::uint32_t color) { picture.now[pixel] = color; });
    } else {
      draw(picture, drawn_, nullptr, kAll, picture.now, {});
    }
    picture.boxes.clear();
    for (const Drawn& each : drawn_) picture.boxes.push_back(box(picture, each.point));
    for (std::size_t i = 0; i < picture.now.size(); ++i) {
      picture.weight[i] = 1.0F + thin_share * (picture.thin[i] - 1.0F);
      picture.error[i] = picture.weight[i] * difference(picture.now[i], picture.reference[i]);
    }
  }
}

float Views::error() const {
  double sum = 0.0;
  for (const Picture& picture : pictures_)
    sum += std::accumulate(picture.error.begin(), picture.error.end(), 0.0);
  return static_cast<float>(sum * pixel_m_ * pixel_m_ / static_cast<double>(pictures_.size()));
}

float Views::change(std::span<const Drawn> triangles, std::span<const std::uint32_t> changed,
                    const std::vector<bool>& removed, float limit) const {
  const float scale = pixel_m_ * pixel_m_ / static_cast<float>(pictures_.size());
  image_.resize(near_.size());
  float sum = 0.0F;
  for (const Picture& picture : pictures_) {
    Rect rect{kSize_px, kSize_px, 0, 0};
    for (const std::uint32_t t : changed) {
      for (const glm::uvec3& point : {drawn_[t].point, triangles[t].point}) {
        const Rect each = box(picture, point);
        rect = {std::min(rect.x0, each.x0), std::min(rect.y0, each.y0), std::max(rect.x1, each.x1),
                std::max(rect.y1, each.y1)};
      }
    }
    if (rect.x0 >= rect.x1 || rect.y0 >= rect.y1) continue;
    float error = 0.0F;
    const auto compare = [&](std::size_t pixel, std::uint32_t color) {
      if (color == picture.now[pixel]) return;
      error += picture.weight[pixel] * difference(color, picture.reference[pixel]) -
               picture.error[pixel];
    };
    // what changes lies inside, wherever its box was
    if (toned_) {
      draw_numbers(picture, triangles, &removed, rect, image_, picture.boxes);
      tones_.assign(picture.tones.begin(), picture.tones.end());
      for (const std::uint32_t t : changed) tones_[t] = glm::vec4(0.0F);
      is_changed_.assign(drawn_.size(), false);
      for (const std::uint32_t t : changed) is_changed_[t] = true;
      for_rect(rect, [&](std::size_t pixel) {
        if (image_[pixel] == kBackground || !is_changed_[image_[pixel] & ~kSeen]) return;
        add_seen(picture.reference[pixel], tones_[image_[pixel] & ~kSeen]);
      });
      for_toned(picture, rect, image_, tones_, compare);
    } else {
      draw(picture, triangles, &removed, rect, image_, picture.boxes);
      for_rect(rect, [&](std::size_t pixel) { compare(pixel, image_[pixel]); });
    }
    sum += error * scale;
    // other pictures may win something back, but hardly as much
    if (sum > 2.0F * limit) return sum;
  }
  return sum;
}

}  // namespace throng::simplify
