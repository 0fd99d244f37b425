#include "throng/render/environment.hpp"

#include <absl/strings/str_cat.h>

#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "render/environment/geometry.hpp"

namespace throng::render {
namespace {

constexpr double kPieceM = 16.0;  // a side of a piece: about what a view culls by
// Each is a member of the cast, with its own tables; rasterizers keep its number in 16 bits.
constexpr std::size_t kMostPieces = 32'768;

// The texture's two columns: sides and tops.
constexpr std::uint8_t kColors[2][3] = {{196, 191, 182}, {86, 82, 78}};
constexpr std::uint16_t kSideU = 16384, kTopU = 49151;

/// One piece on its way: corners of its triangles, three by three.
struct Corners {
  std::vector<glm::vec3> position;
  std::vector<glm::vec3> normal;
  std::vector<std::uint16_t> u;

  void add(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, const glm::vec3& n,
           std::uint16_t column) {
    for (const glm::vec3& corner : {a, b, c}) {
      position.push_back(corner);
      normal.push_back(n);
      u.push_back(column);
    }
  }
};

using Pieces = std::map<std::pair<int, int>, Corners>;

Corners& piece_at(Pieces& pieces, const glm::dvec2& point) {
  return pieces[{static_cast<int>(std::floor(point.x / kPieceM)),
                 static_cast<int>(std::floor(point.y / kPieceM))}];
}

/// Long edges are halved until they are short, those of a top just as those of the side below it,
/// so that their points are the same.
void raise_side(Pieces& pieces, const glm::dvec2& a, const glm::dvec2& b, float height_m) {
  if (glm::distance(a, b) > kPieceM) {
    const glm::dvec2 middle = 0.5 * (a + b);
    raise_side(pieces, a, middle, height_m);
    raise_side(pieces, middle, b, height_m);
    return;
  }
  const glm::dvec2 along = glm::normalize(b - a);
  const glm::vec3 outwards(along.y, -along.x, 0.0);
  const glm::vec3 high_a(a, height_m), high_b(b, height_m);
  Corners& piece = piece_at(pieces, 0.5 * (a + b));
  piece.add(glm::vec3(a, 0.0), glm::vec3(b, 0.0), high_b, outwards, kSideU);
  piece.add(glm::vec3(a, 0.0), high_b, high_a, outwards, kSideU);
}

void add_top(Pieces& pieces, const std::array<glm::dvec2, 3>& corners, float height_m) {
  int longest = 0;
  double longest_m = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double length_m = glm::distance(corners[i], corners[(i + 1) % 3]);
    if (length_m > longest_m) {
      longest_m = length_m;
      longest = i;
    }
  }
  const glm::dvec2 &a = corners[longest], &b = corners[(longest + 1) % 3],
                   &c = corners[(longest + 2) % 3];
  if (longest_m > kPieceM) {
    const glm::dvec2 middle = 0.5 * (a + b);
    add_top(pieces, {a, middle, c}, height_m);
    add_top(pieces, {middle, b, c}, height_m);
    return;
  }
  piece_at(pieces, (a + b + c) / 3.0)
      .add(glm::vec3(a, height_m), glm::vec3(b, height_m), glm::vec3(c, height_m),
           glm::vec3(0, 0, 1), kTopU);
}

/// A site may be large or finely drawn, but its parts have to fit into memory.
absl::Status check_size(const Footprint& footprint) {
  constexpr double kMostParts = 2e6;
  double parts = static_cast<double>(footprint.triangles.size());
  for (const auto& [a, b] : footprint.edges) parts += 2.0 * glm::distance(a, b) / kPieceM + 2.0;
  if (parts <= kMostParts) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("walkable area: its walls have about ", parts,
                                                 " triangles, must be at most ", kMostParts));
}

/// A mesh that is always drawn whole, with one joint that never moves.
absl::StatusOr<Character> piece_of(const Corners& corners, std::size_t number) {
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
  data.triangle_flags.assign(data.triangle.size(), 0);
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
  data.height_m = high.z;
  // two texels; a third level would mix them
  data.base_color_width_px = 2;
  data.base_color_height_px = 1;
  data.base_color_levels = 1;
  for (const auto& color : kColors) {
    data.base_color.insert(data.base_color.end(), {color[0], color[1], color[2], 255});
  }
  return make_character(std::move(data));
}

}  // namespace

absl::Status check_environment(const std::string& wkt, const glm::dvec3& origin_world) {
  return check_area(wkt, glm::dvec2(origin_world));
}

absl::StatusOr<std::shared_ptr<const Environment>> make_environment(
    const std::string& wkt, const glm::dvec3& origin_world, const EnvironmentOptions& options) {
  for (const auto& [name, value_m] : {std::pair{"wall_height_m", options.wall_height_m},
                                      std::pair{"wall_thickness_m", options.wall_thickness_m}}) {
    if (!(value_m > 0.0 && value_m <= 100.0)) {
      return absl::InvalidArgumentError(
          absl::StrCat("make_environment: ", name, " is ", value_m, ", must be in (0, 100]"));
    }
  }
  const auto footprint = solids_around(wkt, glm::dvec2(origin_world), options.wall_thickness_m);
  if (!footprint.ok()) return footprint.status();

  if (absl::Status status = check_size(*footprint); !status.ok()) return status;
  Pieces pieces;
  const auto height_m = static_cast<float>(options.wall_height_m);
  for (const auto& [a, b] : footprint->edges) raise_side(pieces, a, b, height_m);
  for (const auto& triangle : footprint->triangles) add_top(pieces, triangle, height_m);
  if (pieces.size() > kMostPieces) {
    return absl::InvalidArgumentError(absl::StrCat("walkable area: its walls are in ",
                                                   pieces.size(), " squares of ", kPieceM,
                                                   " m, must be in at most ", kMostPieces));
  }
  auto environment = std::make_shared<Environment>();
  for (const auto& [cell, corners] : pieces) {
    absl::StatusOr<Character> piece = piece_of(corners, environment->pieces.size());
    if (!piece.ok()) return piece.status();
    environment->triangles += piece->triangle_count();
    environment->pieces.push_back(*std::move(piece));
  }
  return environment;
}

}  // namespace throng::render
