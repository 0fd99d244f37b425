#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <span>
#include <vector>

#include "simplify/collapse/collapse.hpp"
#include "simplify/collapse/texture.hpp"
#include "simplify/collapse/wedges.hpp"

namespace throng::simplify {

/// Small pictures of a surface, from all around in some of its poses: what a change is to the eye
/// (image-driven simplification, Lindstrom & Turk 2000). They know what quadrics can't: what hides
/// what, where a gap shows the background, whether texture that slid is of one colour anyway.
class Views {
 public:
  /// A triangle as it is drawn now.
  struct Drawn {
    glm::uvec3 point, wedge;
    std::uint8_t flags;
  };

  Views(const PoseSet& poses, const WedgeMesh& mesh, float size_m);

  /// How much of each triangle [T] the pictures show of what is turned to the viewer: 0 for the
  /// inside of a mouth, up to 1. Neighbours are averaged.
  std::vector<float> visibility(const WedgeMesh& mesh) const;

  /// Takes these triangles for what is drawn now.
  /// @param thin_share  0 to 1: how much the thin parts of the figure count beyond their pixels
  /// @param toned  a triangle has one colour in each picture, the mean of what is seen where it is,
  ///     as coarse levels have (render::CornerTones); else it shows the texture
  void set(std::span<const Drawn> triangles, float thin_share, bool toned);

  /// Mean error over the pictures of what was set, in m^2 as for `change`.
  float error() const;

  /// By how much the mean error over the pictures would grow, in m^2 on the picture plane (an area
  /// that differs by all there is in colour), if `triangles`, which differ from the ones that were
  /// set at `changed` only, were drawn. Gives up, with any value above it, beyond `limit`.
  /// @param removed  of `changed`: those that aren't drawn any more
  float change(std::span<const Drawn> triangles, std::span<const std::uint32_t> changed,
               const std::vector<bool>& removed,
               float limit = std::numeric_limits<float>::max()) const;

 private:
  struct Rect {
    std::int16_t x0, y0, x1, y1;  // pixels, x1 and y1 excluded
  };
  struct Picture {
    std::vector<glm::vec3> place;               // [P] pixels right and down, and nearness
    std::vector<float> shade;                   // [C]
    std::vector<std::uint32_t> reference, now;  // r g b a of what is seen
    std::vector<float> thin;                    // how much more pixels of thin parts count
    std::vector<float> weight;                  // of each pixel
    std::vector<float> error;                   // of `now`
    std::vector<Rect> boxes;                    // [drawn_]
    std::vector<glm::vec4> tones;               // [drawn_] sums of colours and pixels
  };

  Rect box(const Picture& picture, const glm::uvec3& point) const;
  void draw(const Picture& picture, std::span<const Drawn> triangles,
            const std::vector<bool>* removed, const Rect& rect, std::vector<std::uint32_t>& image,
            std::span<const Rect> boxes) const;

  /// Both of them: `fill(triangle, its doubled area)` gives what tells the colour at three weights
  /// of its corners, none for a hole.
  template <typename Fill>
  void fill_each(const Picture& picture, std::span<const Drawn> triangles,
                 const std::vector<bool>* removed, const Rect& rect,
                 std::vector<std::uint32_t>& image, std::span<const Rect> boxes,
                 const Fill& fill) const;

  /// Which triangle is seen: its number and kSeen.
  void draw_numbers(const Picture& picture, std::span<const Drawn> triangles,
                    const std::vector<bool>* removed, const Rect& rect,
                    std::vector<std::uint32_t>& image, std::span<const Rect> boxes) const;
  /// Calls `visit(pixel, color)` for the pixels of `rect`: numbers become their triangles' colours.
  template <typename Visit>
  void for_toned(const Picture& picture, const Rect& rect, const std::vector<std::uint32_t>& image,
                 std::span<const glm::vec4> tones, Visit visit) const;

  const Surface& surface_;
  bool is_two_sided_;
  float pixel_m_ = 1.0F;
  bool toned_ = false;
  std::vector<TextureLevel> levels_;
  std::vector<Picture> pictures_;
  std::vector<Drawn> drawn_;                  // as set
  mutable std::vector<float> near_;           // depth buffer
  mutable std::vector<std::uint32_t> image_;  // of a change
  mutable std::vector<glm::vec4> tones_;      // [drawn_] of a change
  mutable std::vector<bool> is_changed_;      // [drawn_]
};

}  // namespace throng::simplify
