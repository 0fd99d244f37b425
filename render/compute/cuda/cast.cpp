#include "render/compute/cuda/cast.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "render/compute/cpu/levels.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/shared_pose.hpp"
#include "render/crowd/motion_graph.hpp"

namespace throng::render::cuda {
namespace {

template <typename T>
cudaError_t copy(const std::vector<T>& from, DeviceBuffer<T>& to, const T*& pointer,
                 cudaStream_t stream) {
  if (const cudaError_t error = to.resize(std::max<std::size_t>(from.size(), 1));
      error != cudaSuccess) {
    return error;
  }
  pointer = to.data();
  if (from.empty()) return cudaSuccess;
  return cudaMemcpyAsync(to.data(), from.data(), from.size() * sizeof(T), cudaMemcpyHostToDevice,
                         stream);
}

}  // namespace

absl::StatusOr<std::shared_ptr<const CudaCast>> CudaCast::upload(std::shared_ptr<const Cast> cast,
                                                                 cudaStream_t stream) {
  if (cast == nullptr) return absl::InvalidArgumentError("upload: the cast is missing");
  const MotionGraph motions = motion_graph_of(*cast);
  std::vector<DeviceCharacter> characters;
  std::vector<element::SourceVertex> vertices;
  std::vector<glm::u16vec2> uvs;
  std::vector<std::uint32_t> targets, triangle_counts, legal_counts;
  std::vector<glm::uvec3> triangles;
  std::vector<element::JointMatrix> palettes;
  std::shared_ptr<CudaCast> result(new CudaCast(stream));
  const LevelTable table = make_levels(*cast);
  result->may_share_ = table.is_listed;
  static_assert(kMostLevelVertices == LevelTable::kMostVertices);
  std::vector<DeviceLevel> levels;
  for (const Level& level : table.levels) {
    levels.push_back({level.vertex_count, level.triangle_count, level.first_triangle});
  }
  std::vector<std::uint32_t> level_at, error_counts;
  std::vector<element::SourceVertex> points;
  std::vector<float> point_radii;
  std::vector<DevicePointTone> point_tones;

  for (std::size_t m = 0; m < cast->members.size(); ++m) {
    const Character& from = cast->members[m].character;
    const std::uint32_t joints = from.joint_count();
    if (from.vertex_count() == 0 || joints == 0 || from.palette.size() < joints ||
        from.coarsest_count == 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("upload: cast member ", m, " ('", from.name, "') has ", from.vertex_count(),
                       " vertices, ", joints, " joints, ", from.palette.size(),
                       " palette entries and a coarsest level of ", from.coarsest_count,
                       " vertices; each must be at least 1"));
    }
    DeviceCharacter& to = characters.emplace_back();
    to.gait = gait_of(from, motions);
    add_stance_shift(from, to.gait);
    to.bounds = from.bounds;
    to.gait_bounds = from.gait_bounds;
    to.vertex_count = from.vertex_count();
    to.coarsest_count = from.coarsest_count;
    to.joint_count = joints;
    to.first_vertex = static_cast<std::uint32_t>(vertices.size());
    to.first_triangle = static_cast<std::uint32_t>(triangles.size());
    to.first_count = static_cast<std::uint32_t>(legal_counts.size());
    to.first_matrix = static_cast<std::uint32_t>(palettes.size());
    to.height_m = from.height_m;
    to.first_level = DeviceCharacter::kNeverShares;
    if (table.is_listed[m]) {
      to.first_level = static_cast<std::uint32_t>(level_at.size());
      level_at.insert(level_at.end(), table.level_at[m].begin(), table.level_at[m].end());
      result->mesh_count_ = static_cast<std::uint32_t>(m + 1) * element::kSharedPoses;
    }
    result->most_joints_ = std::max(result->most_joints_, joints);

    for (std::uint32_t i = 0; i < from.vertex_count(); ++i) {
      element::SourceVertex& vertex = vertices.emplace_back();
      vertex.position_m = from.position[i];
      vertex.normal = element::unpack_octahedral(from.normal[i]);
      vertex.joint_index = from.joint_index[i];
      vertex.joint_weight = from.joint_weight[i];
      uvs.push_back(from.uv[i]);
      targets.push_back(from.collapse_target[i]);
    }
    const ErrorTable& errors = result->errors_.emplace_back(make_error_table(from));
    error_counts.insert(error_counts.end(), errors.vertex_count.begin(), errors.vertex_count.end());
    to.has_relief = from.relief != nullptr ? 1 : 0;
    to.first_point = static_cast<std::uint32_t>(points.size());
    to.point_count = from.points.count();
    to.first_tone = static_cast<std::uint32_t>(point_tones.size());
    for (const SurfacePoint& point : from.points.point) {
      points.push_back({point.position, element::unpack_octahedral(point.normal), point.joint_index,
                        point.joint_weight});
    }
    point_radii.insert(point_radii.end(), from.points.radius_m.begin(), from.points.radius_m.end());
    for (const PointTone& tone : from.points.tone) point_tones.push_back({tone.base, tone.regions});
    for (const auto& corners : from.triangle) triangles.push_back(glm::uvec3(corners));
    triangle_counts.insert(triangle_counts.end(), from.triangle_count_at.begin(),
                           from.triangle_count_at.end());
    legal_counts.insert(legal_counts.end(), from.legal_count.begin(), from.legal_count.end());
    for (const Affine& affine : from.palette) {
      element::JointMatrix& matrix = palettes.emplace_back();
      for (int c = 0; c < 4; ++c) {
        for (int r = 0; r < 3; ++r) matrix.m[4 * c + r] = affine.row[r][c];
        matrix.m[4 * c + 3] = 0.0F;
      }
    }
  }

  DeviceCast& device = result->device_;
  constexpr char kCall[] = "upload: the cast";
  THRONG_CUDA_TRY(copy(characters, result->character_, device.character, stream), kCall);
  THRONG_CUDA_TRY(copy(vertices, result->vertex_, device.vertex, stream), kCall);
  THRONG_CUDA_TRY(copy(uvs, result->uv_, device.uv, stream), kCall);
  THRONG_CUDA_TRY(copy(targets, result->collapse_target_, device.collapse_target, stream), kCall);
  THRONG_CUDA_TRY(copy(triangles, result->triangle_, device.triangle, stream), kCall);
  THRONG_CUDA_TRY(
      copy(triangle_counts, result->triangle_count_at_, device.triangle_count_at, stream), kCall);
  THRONG_CUDA_TRY(copy(legal_counts, result->legal_count_, device.legal_count, stream), kCall);
  THRONG_CUDA_TRY(copy(palettes, result->palette_, device.palette, stream), kCall);
  THRONG_CUDA_TRY(copy(levels, result->level_, device.level, stream), kCall);
  THRONG_CUDA_TRY(copy(table.corners, result->level_corners_, device.level_corners, stream), kCall);
  THRONG_CUDA_TRY(copy(level_at, result->level_at_, device.level_at, stream), kCall);
  THRONG_CUDA_TRY(copy(error_counts, result->error_count_, device.error_count, stream), kCall);
  THRONG_CUDA_TRY(copy(points, result->point_, device.point, stream), kCall);
  THRONG_CUDA_TRY(copy(point_radii, result->point_radius_m_, device.point_radius_m, stream), kCall);
  THRONG_CUDA_TRY(copy(point_tones, result->point_tone_, device.point_tone, stream), kCall);
  THRONG_CUDA_TRY(cudaStreamSynchronize(stream), kCall);  // the vectors end here
  result->cast_ = std::move(cast);
  return result;
}

}  // namespace throng::render::cuda
