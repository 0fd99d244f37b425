#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "simplify/bake/levels.hpp"
#include "simplify/report/pose.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/raster.hpp"

namespace throng::simplify {

/// One figure on a picture.
struct Figure {
  const PosedVertices* posed = nullptr;
  float turn_rad = 0.0F;      // 0: faces the viewer; counter-clockwise seen from above
  glm::vec2 origin_px{0.0F};  // where the model's origin comes to lie, rows from the top
};

/// How a picture is taken: parallel rays, from above by `elevation_rad`.
struct Shot {
  float elevation_rad = 0.0F;
  float px_per_m = 100.0F;
  std::uint32_t width_px = 0, height_px = 0;
};

/// Box around a posed figure on a picture, relative to its origin, in metres; y downward.
struct Frame {
  glm::vec2 low{0.0F}, high{0.0F};
};
Frame frame_of(const PosedVertices& posed, float turn_rad, float elevation_rad);

/// A figure without its background: linear colours times coverage, and coverage. [height][width]
struct Cutout {
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<glm::vec4> pixels;
};

/// Of a character's tints on pictures, from its name (FNV-1a): the same in every picture.
std::uint32_t seed_of(std::string_view name);

/// Draws one character in many poses with the rasterizer that viewers' pictures come from, in front
/// of one even colour.
class Studio {
 public:
  /// @param seed  of the tints
  static absl::StatusOr<std::unique_ptr<Studio>> make(const render::Character& character,
                                                      std::uint32_t seed);

  /// Four samples a pixel. `picture` is resized to the shot.
  absl::Status draw(const LevelMesh& mesh, std::span<const Figure> figures, const Shot& shot,
                    render::Picture& picture);
  /// What of each pixel the figures cover, 0 to 4 samples. [height][width]
  absl::Status cover(const LevelMesh& mesh, std::span<const Figure> figures, const Shot& shot,
                     std::vector<std::uint8_t>& samples);
  /// One figure by itself, at half the size of the shot.
  absl::StatusOr<Cutout> cut_out(const LevelMesh& mesh, const Figure& figure, const Shot& shot);

 private:
  Studio() = default;
  absl::Status draw_lit(const LevelMesh& mesh, std::span<const Figure> figures, const Shot& shot,
                        const render::Look& look, render::Picture& picture);
  absl::Status use_flags(const LevelMesh& mesh);

  render::Character character_;
  std::uint32_t seed_ = 0;
  bool has_cutout_ = false;
  std::unique_ptr<render::Rasterizer> rasterizer_;
  render::Picture scratch_;
  std::vector<std::uint8_t> flags_;
  std::vector<render::VisibleInstance> instances_;
  std::vector<std::uint32_t> vertex_offset_, triangle_offset_, indices_;
  std::vector<render::BatchVertex> vertices_;
};

/// sRGB.
float linear_from_byte(std::uint8_t byte);
std::uint8_t byte_from_linear(float c);

/// Pictures of half the size, averaged in linear light. Sides must be even.
render::Picture halved(const render::Picture& picture);

}  // namespace throng::simplify
