#include "render/environment/pieces.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>

namespace throng::render {
namespace {

// Each is a member of the cast, with its own tables; rasterizers keep its number in 16 bits.
constexpr std::size_t kMostPieces = 32'768;

/// A mesh that is always drawn whole, with one joint that never moves.
absl::StatusOr<Character> piece_of(const Corners& corners, std::size_t number,
                                   std::span<const Rgb> colors, std::uint8_t triangle_flags) {
  CharacterData data;
  data.name = absl::StrCat("wall ", number);
  const auto count = static_cast<std::uint32_t>(corners.position.size());
  data.position = corners.position;
  glm::vec3 low = corners.position[0], high = low;
  for (std::uint32_t i = 0; i < count; ++i) {
    low = glm::min(low, corners.position[i]);
    high = glm::max(high, corners.position[i]);
    data.normal.push_back(encode_octahedral(corners.normal[i]));
    data.uv.push_back({corners.u[i], 32768});
    data.joint_index.push_back({0, 0, 0, 0});
    data.joint_weight.push_back({255, 0, 0, 0});
    data.collapse_target.push_back(0);
    if (i % 3 == 0) data.triangle.push_back({i, i + 1, i + 2});
  }
  data.triangle_flags.assign(data.triangle.size(), triangle_flags);
  data.triangle_count_at.assign(count + 1, 0);
  data.triangle_count_at[count] = static_cast<std::uint32_t>(data.triangle.size());
  data.legal_count.assign(count + 1, 0);
  data.legal_count[count] = count;
  data.collapse_error_m.assign(count, 0.0F);
  data.coarsest_count = count;
  const Affine still{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  data.joints = {{"root", -1, still}};
  data.clips = {{"still", ClipKind::kIdle, 0, 1, 1.0F, true, 0.0F, 0.0F}};
  data.palette = {still};
  data.bounds = glm::vec4(0.5F * (low + high), 0.5F * glm::length(high - low) + 1e-3F);
  data.height_m = std::max(high.z, 1e-3F);
  // one level; a smaller one would mix the colours
  data.base_color_width_px = static_cast<std::uint32_t>(colors.size());
  data.base_color_height_px = 1;
  data.base_color_levels = 1;
  for (const Rgb& color : colors) {
    data.base_color.insert(data.base_color.end(), {color[0], color[1], color[2], 255});
  }
  return make_character(std::move(data));
}

}  // namespace

absl::StatusOr<std::shared_ptr<Environment>> finish(const Pieces& pieces,
                                                    std::span<const Rgb> colors,
                                                    std::uint8_t triangle_flags, const char* what) {
  if (pieces.size() > kMostPieces) {
    return absl::InvalidArgumentError(absl::StrCat(what, " are in ", pieces.size(), " squares of ",
                                                   kPieceM, " m, must be in at most ",
                                                   kMostPieces));
  }
  auto environment = std::make_shared<Environment>();
  glm::vec3 low(std::numeric_limits<float>::max()), high(-low);
  for (const auto& [cell, corners] : pieces) {
    for (const glm::vec3& corner : corners.position) {
      low = glm::min(low, corner);
      high = glm::max(high, corner);
    }
    absl::StatusOr<Character> piece =
        piece_of(corners, environment->pieces.size(), colors, triangle_flags);
    if (!piece.ok()) return piece.status();
    environment->triangles += piece->triangle_count();
    environment->pieces.push_back(*std::move(piece));
  }
  if (!pieces.empty()) {
    environment->low_m = low;
    environment->high_m = high;
  }
  return environment;
}

}  // namespace throng::render
