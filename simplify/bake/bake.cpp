#include "simplify/bake/bake.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <utility>

#include "simplify/bake/clips.hpp"
#include "simplify/bake/joints.hpp"
#include "simplify/points/points.hpp"
#include "simplify/tones/tones.hpp"

namespace throng::simplify {
namespace {

/// Sphere around all points in all frames: the box's centre, and the farthest point from it.
glm::vec4 bounds_of(const Surface& surface, std::span<const render::Affine> palette,
                    std::size_t joints) {
  std::vector<glm::vec3> position(surface.points.size());
  const std::size_t frames = palette.size() / joints;
  glm::vec3 low(INFINITY), high(-INFINITY);
  for (std::size_t f = 0; f < frames; ++f) {
    skin(surface.points, palette.subspan(f * joints, joints), position);
    for (const glm::vec3& each : position) {
      low = glm::min(low, each);
      high = glm::max(high, each);
    }
  }
  const glm::vec3 centre = 0.5F * (low + high);
  float radius_m = 0.0F;
  for (std::size_t f = 0; f < frames; ++f) {
    skin(surface.points, palette.subspan(f * joints, joints), position);
    for (const glm::vec3& each : position)
      radius_m = std::max(radius_m, glm::distance(each, centre));
  }
  // weights are rounded to 8 bits at run time
  return {centre, radius_m * 1.004F + 1.0e-4F};
}

/// The frames of idle, walk and run; all where a character has none of them: what agents do most.
std::vector<render::Affine> usual_frames(const BakedClips& clips, std::size_t joints) {
  std::vector<render::Affine> usual;
  for (const render::Clip& clip : clips.clips) {
    if (clip.kind != render::ClipKind::kIdle && clip.kind != render::ClipKind::kWalk &&
        clip.kind != render::ClipKind::kRun) {
      continue;
    }
    const auto first =
        clips.palette.begin() + static_cast<std::ptrdiff_t>(clip.first_frame * joints);
    usual.insert(usual.end(), first,
                 first + static_cast<std::ptrdiff_t>(clip.frame_count * joints));
  }
  return usual.empty() ? clips.palette : usual;
}

void fill_mesh(const Surface& surface, const CollapseOrder& order, render::CharacterData& data) {
  const std::uint32_t vertices = surface.wedge_count();
  for (const std::uint32_t wedge : order.wedge) {
    const SourcePoint& point = surface.points[surface.wedge_point[wedge]];
    data.position.push_back(point.position);
    data.normal.push_back(render::encode_octahedral(surface.wedge_normal[wedge]));
    data.uv.push_back(
        glm::u16vec2(glm::clamp(surface.wedge_uv[wedge], 0.0F, 1.0F) * 65535.0F + 0.5F));
    quantize_weights(point, data.joint_index.emplace_back(), data.joint_weight.emplace_back());
  }
  std::vector<std::uint32_t> new_index(vertices);
  for (std::uint32_t i = 0; i < vertices; ++i) new_index[order.wedge[i]] = i;
  for (const std::uint32_t t : order.triangle) {
    const glm::uvec3& corner = surface.triangles[t];
    data.triangle.push_back({new_index[corner.x], new_index[corner.y], new_index[corner.z]});
    data.triangle_flags.push_back(surface.triangle_flags[t]);
  }
  for (const SourcePoint& point : surface.points)
    data.height_m = std::max(data.height_m, point.position.z);
  data.collapse_target = order.target;
  data.triangle_count_at = order.triangle_count_at;
  data.legal_count = order.legal_count;
  data.collapse_error_m = order.error_m;
  data.coarsest_count = order.coarsest_count;
}

void fill_textures(const Surface& surface, render::CharacterData& data) {
  data.base_color_width_px = surface.base_color.width_px;
  data.base_color_height_px = surface.base_color.height_px;
  data.base_color_levels = surface.base_color.level_count;
  data.base_color = surface.base_color.texels;
  data.tint_mask_width_px = surface.tint_mask.width_px;
  data.tint_mask_height_px = surface.tint_mask.height_px;
  data.tint_mask_levels = surface.tint_mask.level_count;
  data.tint_mask = surface.tint_mask.texels;
}

/// Where the vertices are in the first few poses that a viewer may see: the bind pose is none.
std::vector<std::vector<glm::vec3>> posed_vertices(const Surface& surface,
                                                   const CollapseOrder& order,
                                                   const PoseSet& poses) {
  constexpr std::uint32_t kMostPoses = 6;  // farthest-point sampling has the most different first
  const std::uint32_t first = poses.count > 1 ? 1 : 0;
  std::vector<std::vector<glm::vec3>> posed;
  for (std::uint32_t p = first; p < std::min(poses.count, first + kMostPoses); ++p) {
    std::vector<glm::vec3>& position = posed.emplace_back();
    for (const std::uint32_t wedge : order.wedge) {
      position.push_back(poses.position[p * surface.points.size() + surface.wedge_point[wedge]]);
    }
  }
  return posed;
}

}  // namespace

absl::StatusOr<BakeResult> bake(const SourceCharacter& original, const BakeOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  BakeResult result;
  result.notes = original.notes;
  SourceCharacter source = original;
  if (source.joints.empty())
    return absl::InvalidArgumentError("the character has no joint, must have at least one");
  for (std::size_t j = 0; j < source.joints.size(); ++j) {
    if (source.joints[j].parent >= static_cast<std::int64_t>(j) || source.joints[j].parent < -1) {
      return absl::InvalidArgumentError(absl::StrCat(
          "joint ", j, " has parent ", source.joints[j].parent, ", must be -1 or below ", j));
    }
  }
  if (auto status = limit_joints(source, result.notes); !status.ok()) return status;

  float top_m = 0.0F;
  for (const SourcePoint& point : source.points) top_m = std::max(top_m, point.position.z);
  if (options.height_m > 0.0F && top_m > 0.0F && std::isfinite(top_m)) {
    scale(source, options.height_m / top_m);
  }

  auto surface = rebuild(source, options.rebuild);
  if (!surface.ok()) return surface.status();
  result.notes.insert(result.notes.end(), surface->notes.begin(), surface->notes.end());
  auto clips = bake_clips(source, result.notes);
  if (!clips.ok()) return clips.status();

  const auto joints = static_cast<std::uint32_t>(source.joints.size());
  const bool is_peng = options.criterion == Criterion::kPeng2011;
  const std::uint32_t max_poses = options.bind_pose_only ? 1 : options.max_poses;
  const PoseSet poses = is_peng && !options.bind_pose_only
                            ? all_poses(*surface, clips->palette, joints)
                            : sample_poses(*surface, clips->palette, joints, max_poses);
  const std::size_t frames = clips->palette.size() / joints;
  if (is_peng && poses.count - 1 < frames) {
    result.notes.push_back(absl::StrCat("cost averaged over ", poses.count - 1, " of ", frames,
                                        " frames, evenly spaced: all would need over 1 GiB"));
  }
  CollapseOptions collapse_options;
  collapse_options.criterion = options.criterion;
  collapse_options.coarsest_count = options.coarsest_count;
  collapse_options.on_progress = options.on_progress;
  collapse_options.threads = options.threads;
  collapse_options.prefers_tones = [&](const CollapseOrder& so_far) {
    render::CharacterData data;
    fill_mesh(*surface, so_far, data);
    data.coarsest_count = options.coarsest_count;
    fill_textures(*surface, data);
    return prefers_corner_tones(data, posed_vertices(*surface, so_far, poses),
                                so_far.coarsest_count);
  };
  auto order = collapse(*surface, poses, collapse_options);
  if (!order.ok()) return order.status();
  result.notes.insert(result.notes.end(), order->notes.begin(), order->notes.end());

  render::CharacterData& data = result.character;
  data.name = source.name;
  fill_mesh(*surface, *order, data);
  for (const SourceJoint& joint : source.joints) {
    const glm::mat4 rows = glm::transpose(joint.joint_from_model);
    data.joints.push_back({joint.name, joint.parent, {{rows[0], rows[1], rows[2]}}});
  }
  data.bounds = bounds_of(*surface, clips->palette, joints);
  data.gait_bounds = bounds_of(*surface, usual_frames(*clips, joints), joints);
  data.clips = std::move(clips->clips);
  data.palette = std::move(clips->palette);
  if (!(data.height_m > 0.0F)) data.height_m = data.bounds.w;
  fill_textures(*surface, data);
  sample_points(data);
  // the published rule knows textures only
  if (!is_peng) {
    make_corner_tones(data, posed_vertices(*surface, *order, poses), order->toned_count);
  }
  result.point_count = surface->point_count();
  result.pose_count = poses.count;
  result.pose_frames = poses.frame;
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace throng::simplify
