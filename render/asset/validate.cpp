#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "render/asset/layout.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/relief.hpp"

namespace throng::render {
namespace layout {

const char* name_of(Section section) {
  switch (section) {
    case Section::kInfo:
      return "info";
    case Section::kStrings:
      return "strings";
    case Section::kPosition:
      return "position";
    case Section::kNormal:
      return "normal";
    case Section::kUv:
      return "uv";
    case Section::kJointIndex:
      return "joint index";
    case Section::kJointWeight:
      return "joint weight";
    case Section::kCollapseTarget:
      return "collapse target";
    case Section::kTriangle:
      return "triangle";
    case Section::kTriangleFlags:
      return "triangle flags";
    case Section::kTriangleCountAt:
      return "triangle count at";
    case Section::kLegalCount:
      return "legal count";
    case Section::kCollapseError:
      return "collapse error";
    case Section::kJoint:
      return "joint";
    case Section::kClip:
      return "clip";
    case Section::kPalette:
      return "palette";
    case Section::kBaseColor:
      return "base colour";
    case Section::kTintMask:
      return "tint mask";
    case Section::kImpostor:
      return "impostor";
    case Section::kPoint:
      return "point";
    case Section::kPointRadius:
      return "point radius";
    case Section::kPointTone:
      return "point tone";
    case Section::kCornerTone:
      return "corner tone";
  }
  return "unknown";
}

}  // namespace layout

namespace {

template <typename... Parts>
absl::Status bad(const Parts&... parts) {
  return absl::InvalidArgumentError(absl::StrCat(parts...));
}

absl::Status check_size(const char* section, std::uint64_t size, std::uint64_t expected) {
  if (size == expected) return absl::OkStatus();
  return bad(section, " has ", size, " elements, must have ", expected);
}

bool is_coordinate(float value) { return std::fabs(value) <= layout::kMaxCoordinate_m; }  // NaN: no

bool is_affine(const Affine& matrix) {
  for (const glm::vec4& row : matrix.row) {
    for (int i = 0; i < 4; ++i) {
      if (!is_coordinate(row[i])) return false;
    }
  }
  return true;
}

absl::Status check_counts(const Character& character) {
  const std::uint64_t vertices = character.position.size();
  const std::uint64_t triangles = character.triangle.size();
  const std::uint64_t joints = character.joints.size();
  if (vertices < 3 || vertices > layout::kMaxVertices) {
    return bad("position has ", vertices, " elements, must have 3 to ", layout::kMaxVertices);
  }
  if (triangles < 1 || triangles > layout::kMaxTriangles) {
    return bad("triangle has ", triangles, " elements, must have 1 to ", layout::kMaxTriangles);
  }
  if (joints < 1 || joints > layout::kMaxJoints) {
    return bad("joint has ", joints, " elements, must have 1 to ", layout::kMaxJoints);
  }
  if (character.clips.empty() || character.clips.size() > layout::kMaxClips) {
    return bad("clip has ", character.clips.size(), " elements, must have 1 to ",
               layout::kMaxClips);
  }
  const std::pair<const char*, std::pair<std::uint64_t, std::uint64_t>> columns[] = {
      {"normal", {character.normal.size(), vertices}},
      {"uv", {character.uv.size(), vertices}},
      {"joint index", {character.joint_index.size(), vertices}},
      {"joint weight", {character.joint_weight.size(), vertices}},
      {"collapse target", {character.collapse_target.size(), vertices}},
      {"collapse error", {character.collapse_error_m.size(), vertices}},
      {"triangle flags", {character.triangle_flags.size(), triangles}},
      {"triangle count at", {character.triangle_count_at.size(), vertices + 1}},
      {"legal count", {character.legal_count.size(), vertices + 1}},
  };
  for (const auto& [section, sizes] : columns) {
    if (auto status = check_size(section, sizes.first, sizes.second); !status.ok()) return status;
  }
  if (character.name.empty() || character.name.size() > layout::kMaxNameSize) {
    return bad("name has ", character.name.size(), " bytes, must have 1 to ", layout::kMaxNameSize);
  }
  return absl::OkStatus();
}

absl::Status check_vertices(const Character& character) {
  const std::size_t joints = character.joints.size();
  for (std::size_t i = 0; i < character.position.size(); ++i) {
    const glm::vec3& position = character.position[i];
    if (!is_coordinate(position.x) || !is_coordinate(position.y) || !is_coordinate(position.z)) {
      return bad("position ", i, " is (", position.x, ", ", position.y, ", ", position.z,
                 "), must be finite and at most ", layout::kMaxCoordinate_m, " m");
    }
    const glm::u8vec4& weight = character.joint_weight[i];
    const int sum = int{weight.x} + weight.y + weight.z + weight.w;
    if (sum != 255) return bad("joint weight ", i, " sums to ", sum, ", must be 255");
    if (weight.x < weight.y || weight.y < weight.z || weight.z < weight.w) {
      return bad("joint weight ", i, " is not strongest first");
    }
    for (int k = 0; k < 4; ++k) {
      const int joint = character.joint_index[i][k];
      if (joint >= static_cast<int>(joints)) {
        return bad("joint index ", i, " is ", joint, ", must be below ", joints);
      }
    }
    const float error_m = character.collapse_error_m[i];
    if (!(error_m >= 0.0F) || !is_coordinate(error_m)) {
      return bad("collapse error ", i, " is ", error_m, ", must be finite and not negative");
    }
  }
  return absl::OkStatus();
}

absl::Status check_collapse(const Character& character) {
  const auto& target = character.collapse_target;
  const std::size_t vertices = target.size();
  const std::size_t triangles = character.triangle.size();
  if (target[0] != 0) return bad("collapse target 0 is ", target[0], ", must be 0");
  // Runtime walks the chain of targets, so its length is a cost and has a limit.
  std::vector<std::uint16_t> depth(vertices, 0);
  for (std::size_t i = 1; i < vertices; ++i) {
    if (target[i] >= i) return bad("collapse target ", i, " is ", target[i], ", must be below ", i);
    depth[i] = static_cast<std::uint16_t>(depth[target[i]] + 1);
    if (depth[i] > layout::kMaxCollapseDepth) {
      return bad("collapse target ", i, " starts a chain longer than ", layout::kMaxCollapseDepth);
    }
  }

  // Levels: counts rise with n, and legal counts are a projection onto themselves.
  const auto& count_at = character.triangle_count_at;
  const auto& legal = character.legal_count;
  const std::size_t coarsest = character.coarsest_count;
  if (coarsest < 1 || coarsest > vertices) {
    return bad("coarsest count is ", coarsest, ", must be 1 to ", vertices);
  }
  for (std::size_t n = 0; n <= vertices; ++n) {
    if (count_at[n] > triangles || (n > 0 && count_at[n] < count_at[n - 1])) {
      return bad("triangle count at ", n, " is ", count_at[n], ", must not fall and be at most ",
                 triangles);
    }
    const bool is_projection =
        n < coarsest ? legal[n] == 0 : legal[n] == n || (n > coarsest && legal[n] == legal[n - 1]);
    if (!is_projection) {
      return bad("legal count ", n, " is ", legal[n], ", must be ", n, " or that of ", n,
                 " - 1, and 0 below the coarsest count ", coarsest);
    }
  }
  if (count_at[vertices] != triangles) {
    return bad("triangle count at ", vertices, " is ", count_at[vertices], ", must be ", triangles);
  }
  if (legal[vertices] != vertices) {
    return bad("legal count ", vertices, " is ", legal[vertices], ", must be ", vertices);
  }
  if (count_at[coarsest] == 0)
    return bad("triangle count at the coarsest count ", coarsest, " is 0");

  // A triangle keeps three corners for as long as it is drawn. Corners only ever merge, so the
  // coarsest legal level that draws it decides.
  std::size_t level = coarsest;
  for (std::size_t k = 0; k < triangles; ++k) {
    const glm::uvec3& triangle = character.triangle[k];
    for (int corner = 0; corner < 3; ++corner) {
      if (triangle[corner] >= vertices) {
        return bad("triangle ", k, " has corner ", triangle[corner], ", must be below ", vertices);
      }
    }
    while (level < vertices && (count_at[level] <= k || legal[level] != level)) ++level;
    glm::uvec3 corner = triangle;
    for (int i = 0; i < 3; ++i) {
      while (corner[i] >= level) corner[i] = target[corner[i]];
    }
    if (corner.x == corner.y || corner.y == corner.z || corner.z == corner.x) {
      return bad("triangle ", k, " is drawn at ", level, " vertices but has lost a corner there");
    }
  }
  return absl::OkStatus();
}

absl::Status check_animation(const Character& character) {
  const std::uint64_t joints = character.joints.size();
  for (std::uint64_t j = 0; j < joints; ++j) {
    const Joint& joint = character.joints[j];
    if (joint.parent < -1 || joint.parent >= static_cast<std::int64_t>(j)) {
      return bad("joint ", j, " has parent ", joint.parent, ", must be -1 or below ", j);
    }
    if (joint.name.size() > layout::kMaxNameSize) {
      return bad("joint ", j, " has a name of ", joint.name.size(), " bytes, limit ",
                 layout::kMaxNameSize);
    }
    if (!is_affine(joint.joint_from_model))
      return bad("joint ", j, " has an inverse bind matrix that is not finite");
  }
  if (character.palette.size() % joints != 0) {
    return bad("palette has ", character.palette.size(), " elements, must be a multiple of ",
               joints, " joints");
  }
  const std::uint64_t frames = character.palette.size() / joints;
  if (frames > layout::kMaxFrames)
    return bad("palette has ", frames, " frames, limit ", layout::kMaxFrames);
  for (std::size_t c = 0; c < character.clips.size(); ++c) {
    const Clip& clip = character.clips[c];
    if (clip.name.size() > layout::kMaxNameSize) {
      return bad("clip ", c, " has a name of ", clip.name.size(), " bytes, limit ",
                 layout::kMaxNameSize);
    }
    if (name_of(clip.kind) == nullptr)
      return bad("clip ", c, " has unknown kind ", static_cast<std::uint32_t>(clip.kind));
    if (clip.frame_count < 1 || std::uint64_t{clip.first_frame} + clip.frame_count > frames) {
      return bad("clip ", c, " has frames ", clip.first_frame, " + ", clip.frame_count,
                 ", must be at least one and end by ", frames);
    }
    if (!(clip.rate_hz > 0.0F && clip.rate_hz <= 1000.0F)) {
      return bad("clip ", c, " has rate ", clip.rate_hz, " Hz, must be over 0 and at most 1000");
    }
    if (!(clip.stride_m >= 0.0F && is_coordinate(clip.stride_m))) {
      return bad("clip ", c, " has stride ", clip.stride_m, " m, must be finite and not negative");
    }
    if (!(clip.speed_mps >= 0.0F && is_coordinate(clip.speed_mps))) {
      return bad("clip ", c, " has speed ", clip.speed_mps,
                 " m/s, must be finite and not negative");
    }
  }
  for (std::size_t i = 0; i < character.palette.size(); ++i) {
    if (!is_affine(character.palette[i])) {
      return bad("palette of frame ", i / joints, " joint ", i % joints, " is not finite");
    }
  }
  for (int i = 0; i < 4; ++i) {
    if (!is_coordinate(character.bounds[i]) || !is_coordinate(character.gait_bounds[i])) {
      return bad("bounds are not finite");
    }
  }
  if (!(character.bounds.w > 0.0F))
    return bad("bounds have radius ", character.bounds.w, " m, must be over 0");
  if (!(character.gait_bounds.w > 0.0F))
    return bad("gait bounds have radius ", character.gait_bounds.w, " m, must be over 0");
  if (!(character.height_m > 0.0F && is_coordinate(character.height_m))) {
    return bad("height is ", character.height_m, " m, must be over 0 and finite");
  }
  return absl::OkStatus();
}

absl::Status check_image(const char* section, const MipImage& image, bool required) {
  if (!required && image.width_px == 0 && image.height_px == 0 && image.level_count == 0 &&
      image.texels.empty()) {
    return absl::OkStatus();
  }
  for (const std::uint32_t size_px : {image.width_px, image.height_px}) {
    if (size_px < 1 || size_px > layout::kMaxImageSize_px) {
      return bad(section, " is ", image.width_px, " x ", image.height_px, " px, each must be 1 to ",
                 layout::kMaxImageSize_px);
    }
  }
  std::uint32_t most_levels = 1;
  while ((std::max(image.width_px, image.height_px) >> most_levels) > 0) ++most_levels;
  if (image.level_count < 1 || image.level_count > most_levels) {
    return bad(section, " has ", image.level_count, " levels, must have 1 to ", most_levels);
  }
  const std::uint64_t size_bytes =
      4 * layout::texel_count(image.width_px, image.height_px, image.level_count);
  if (image.texels.size() != size_bytes) {
    return bad(section, " has ", image.texels.size(), " bytes, must have ", size_bytes);
  }
  return absl::OkStatus();
}

absl::Status check_points(const Character& character) {
  const SurfacePoints& points = character.points;
  const std::uint32_t count = points.count();
  if (points.point.size() > layout::kMaxPoints) {
    return bad("point has ", points.point.size(), " elements, limit ", layout::kMaxPoints);
  }
  if (auto status = check_size("point radius", points.radius_m.size(), count); !status.ok())
    return status;
  if (auto status = check_size("point tone", points.tone.size(), point_tone_count(count));
      !status.ok()) {
    return status;
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const SurfacePoint& point = points.point[i];
    std::uint32_t sum = 0;
    for (int k = 0; k < 4; ++k) {
      if (!(k == 3 || is_coordinate(point.position[k])))
        return bad("point ", i, " has a position that is not finite");
      if (point.joint_index[k] >= character.joints.size()) {
        return bad("point ", i, " has joint ", int{point.joint_index[k]}, ", must be below ",
                   character.joints.size());
      }
      sum += point.joint_weight[k];
    }
    if (sum != 255) return bad("point ", i, " has weights that sum to ", sum, ", must be 255");
    const float least = i + 1 < count ? points.radius_m[i + 1] : 0.0F;
    if (!(is_coordinate(points.radius_m[i]) && points.radius_m[i] > 0.0F &&
          points.radius_m[i] >= least)) {
      return bad("point radius ", i, " is ", points.radius_m[i],
                 " m, must be over 0 and not under the next one's ", least);
    }
  }
  return absl::OkStatus();
}

/// After check_collapse: triangle counts are known to be right.
absl::Status check_corner_tones(const Character& character) {
  const CornerTones& tones = character.corner_tones;
  if (tones.band.size() > CornerTones::kMostBands) {
    return bad("corner tone has ", tones.band.size(), " bands, limit ", CornerTones::kMostBands);
  }
  std::uint64_t triangles = 0;
  std::uint32_t limit = character.vertex_count();
  for (std::size_t b = 0; b < tones.band.size(); ++b) {
    const ToneBand& band = tones.band[b];
    if (band.vertex_count < 1 || band.vertex_count > limit) {
      return bad("corner tone band ", b, " is for ", band.vertex_count, " vertices, must be 1 to ",
                 limit);
    }
    if (band.first != triangles) {
      return bad("corner tone band ", b, " begins at ", band.first, ", must at ", triangles);
    }
    triangles += character.triangle_count_at[band.vertex_count];
    limit = band.vertex_count - 1;
  }
  return check_size("corner tone", tones.tone.size(), 3 * triangles);
}

Character view_of(const std::shared_ptr<const CharacterData>& data) {
  Character character;
  character.name = data->name;
  character.position = data->position;
  character.normal = data->normal;
  character.uv = data->uv;
  character.joint_index = data->joint_index;
  character.joint_weight = data->joint_weight;
  character.collapse_target = data->collapse_target;
  character.triangle = data->triangle;
  character.triangle_flags = data->triangle_flags;
  character.triangle_count_at = data->triangle_count_at;
  character.legal_count = data->legal_count;
  character.collapse_error_m = data->collapse_error_m;
  character.coarsest_count = data->coarsest_count;
  character.joints = data->joints;
  character.clips = data->clips;
  character.palette = data->palette;
  character.bounds = data->bounds;
  character.gait_bounds = data->gait_bounds.w > 0.0F ? data->gait_bounds : data->bounds;
  character.height_m = data->height_m;
  character.base_color = {data->base_color_width_px, data->base_color_height_px,
                          data->base_color_levels, data->base_color};
  character.tint_mask = {data->tint_mask_width_px, data->tint_mask_height_px,
                         data->tint_mask_levels, data->tint_mask};
  character.points = {data->point, data->point_radius_m, data->point_tone};
  character.corner_tones = {data->tone_band, data->corner_tone};
  character.storage = data;
  return character;
}

}  // namespace

absl::Status validate(const Character& character) {
  if (auto status = check_counts(character); !status.ok()) return status;
  if (auto status = check_vertices(character); !status.ok()) return status;
  if (auto status = check_collapse(character); !status.ok()) return status;
  if (auto status = check_animation(character); !status.ok()) return status;
  if (auto status = check_image("base colour", character.base_color, true); !status.ok())
    return status;
  if (auto status = check_image("tint mask", character.tint_mask, false); !status.ok())
    return status;
  if (auto status = check_points(character); !status.ok()) return status;
  if (auto status = check_corner_tones(character); !status.ok()) return status;
  if (character.relief == nullptr) return absl::OkStatus();
  return validate_relief(*character.relief, character.joints.size(),
                         character.palette.size() / character.joints.size());
}

absl::StatusOr<Character> make_character(CharacterData data) {
  Character character = view_of(std::make_shared<const CharacterData>(std::move(data)));
  if (auto status = validate(character); !status.ok()) return status;
  return character;
}

}  // namespace throng::render
