#include "simplify/import/gltf.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <new>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "simplify/import/animation.hpp"
#include "simplify/import/clip_kind.hpp"
#include "simplify/import/document.hpp"
#include "simplify/import/file.hpp"
#include "simplify/import/humanoid.hpp"
#include "simplify/import/limits.hpp"
#include "simplify/import/mesh.hpp"
#include "simplify/import/scene.hpp"

namespace throng::simplify {
namespace gltf {
namespace {

using render::ClipKind;

/// glTF's x (left), y (up), z (forward) are our y, z, x.
glm::dmat4 turned_axes(double turn_deg) {
  glm::dmat4 axes(0.0);
  axes[0][1] = axes[1][2] = axes[2][0] = axes[3][3] = 1.0;
  const double angle = turn_deg * std::numbers::pi / 180.0;
  glm::dmat4 turn(1.0);
  turn[0][0] = turn[1][1] = std::cos(angle);
  turn[0][1] = std::sin(angle);
  turn[1][0] = -std::sin(angle);
  return turn * axes;
}

/// True when nothing in it is NaN or so large that products with it overflow.
bool is_moderate(const glm::mat4& matrix) {
  for (int c = 0; c < 4; ++c) {
    for (int r = 0; r < 4; ++r) {
      if (!(std::abs(matrix[c][r]) <= 1e9F)) return false;
    }
  }
  return true;
}

std::vector<glm::dmat4> world_at(const Scene& scene, const Motion* motion, double time_s) {
  if (motion == nullptr) return world_of(scene, scene.rest);
  std::vector<Local> locals = scene.rest;
  motion->pose(time_s, locals);
  return world_of(scene, locals);
}

/// The bindings that are kept as joints, parents first.
struct Skeleton {
  std::vector<std::uint32_t> binding;   // [J]
  std::vector<std::int32_t> parent;     // [J]
  std::vector<std::uint32_t> joint_of;  // [bindings], only for kept ones
};

absl::StatusOr<Skeleton> make_skeleton(const Scene& scene, const MergedMesh& mesh,
                                       std::vector<std::string>& notes) {
  const std::size_t count = mesh.bindings.size();
  std::vector<char> is_used(count, 0);
  for (const SourceTriangle& triangle : mesh.triangles) {
    for (const SourceCorner& corner : triangle.corner) {
      const MergedMesh::Point& point = mesh.points[corner.point];
      for (int k = 0; k < 4; ++k) {
        if (point.weight[k] > 0.0F) is_used[point.binding[k]] = 1;
      }
    }
  }
  const std::size_t used = static_cast<std::size_t>(std::count(is_used.begin(), is_used.end(), 1));
  if (used > kMaxJoints) {
    return absl::InvalidArgumentError(
        absl::StrCat("has ", used, " joints that move vertices, the limit is ", kMaxJoints));
  }

  std::vector<std::vector<std::uint32_t>> bindings_of(scene.order.size());
  for (std::uint32_t b = 0; b < count; ++b) bindings_of[mesh.bindings[b].node].push_back(b);
  // joints that only carry others keep the hierarchy readable, as long as there is room
  std::vector<char> is_kept = is_used;
  for (std::size_t i = scene.order.size(); i-- > 0;) {
    const std::uint32_t node = scene.order[i];
    const bool carries = std::any_of(bindings_of[node].begin(), bindings_of[node].end(),
                                     [&](std::uint32_t b) { return is_kept[b] != 0; });
    if (!carries) continue;
    for (std::int32_t above = scene.parent[node]; above != kNone;
         above = scene.parent[static_cast<std::size_t>(above)]) {
      const std::vector<std::uint32_t>& bound = bindings_of[static_cast<std::size_t>(above)];
      if (bound.empty()) continue;
      if (std::none_of(bound.begin(), bound.end(),
                       [&](std::uint32_t b) { return is_kept[b] != 0; })) {
        is_kept[bound.front()] = 1;
      }
      break;
    }
  }
  if (static_cast<std::size_t>(std::count(is_kept.begin(), is_kept.end(), 1)) > kMaxJoints)
    is_kept = is_used;

  Skeleton skeleton;
  skeleton.joint_of.assign(count, 0);
  std::vector<std::int32_t> first_joint(scene.order.size(), kNone);
  for (const std::uint32_t node : scene.order) {
    std::int32_t above = scene.parent[node];
    while (above != kNone && first_joint[static_cast<std::size_t>(above)] == kNone) {
      above = scene.parent[static_cast<std::size_t>(above)];
    }
    for (const std::uint32_t b : bindings_of[node]) {
      if (is_kept[b] == 0) continue;
      const std::uint32_t joint = static_cast<std::uint32_t>(skeleton.binding.size());
      skeleton.joint_of[b] = joint;
      skeleton.binding.push_back(b);
      skeleton.parent.push_back(above == kNone ? kNone
                                               : first_joint[static_cast<std::size_t>(above)]);
      if (first_joint[node] == kNone) first_joint[node] = static_cast<std::int32_t>(joint);
    }
  }
  const std::size_t dropped = count - skeleton.binding.size();
  if (dropped > 0)
    notes.push_back(absl::StrCat(dropped, " joints move no vertex and are left out"));
  return skeleton;
}

struct Box {
  glm::dvec3 low{std::numeric_limits<double>::infinity()};
  glm::dvec3 high{-std::numeric_limits<double>::infinity()};
  void add(const glm::dvec3& p) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
};

/// All points in the pose `world`, in our axes and the file's units.
std::vector<glm::dvec3> skinned(const MergedMesh& mesh, const std::vector<glm::dmat4>& world,
                                const glm::dmat4& axes) {
  std::vector<glm::dmat4> palette;
  palette.reserve(mesh.bindings.size());
  for (const Binding& binding : mesh.bindings)
    palette.push_back(axes * world[binding.node] * binding.joint_from_bind);
  std::vector<glm::dvec3> result;
  result.reserve(mesh.points.size());
  for (const MergedMesh::Point& point : mesh.points) {
    const glm::dvec4 bind(point.position, 1.0);
    glm::dvec4 sum(0.0);
    for (int k = 0; k < 4; ++k) {
      if (point.weight[k] > 0.0F)
        sum += double{point.weight[k]} * (palette[point.binding[k]] * bind);
    }
    result.emplace_back(sum);
  }
  return result;
}

/// Where a character stands in a pose: the ground below its feet, and between them.
glm::dvec3 footing(const Document& document, const Scene& scene, const MergedMesh& mesh,
                   const std::vector<glm::dvec3>& points) {
  Box box;
  for (const glm::dvec3& point : points) box.add(point);
  // the feet of a human are what its foot joints and those below them move; a sword may hang lower
  std::vector<char> is_foot(scene.order.size(), 0);
  if (const std::optional<Humanoid> humanoid = find_humanoid(document, scene)) {
    for (const std::int32_t foot : humanoid->foot) {
      if (foot != kNone) is_foot[static_cast<std::size_t>(foot)] = 1;
    }
    for (const std::uint32_t node : scene.order) {
      const std::int32_t parent = scene.parent[node];
      if (parent != kNone && is_foot[static_cast<std::size_t>(parent)] != 0) is_foot[node] = 1;
    }
  }
  Box feet;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (is_foot[mesh.bindings[mesh.points[i].binding[0]].node] != 0) feet.add(points[i]);
  }
  // a control that is called a foot moves nothing near the ground
  if (feet.low.z > box.low.z + 0.3 * (box.high.z - box.low.z)) feet = Box{};
  if (!(feet.low.z <= feet.high.z)) {
    const double band = box.low.z + 0.05 * (box.high.z - box.low.z);
    for (const glm::dvec3& point : points) {
      if (point.z <= band) feet.add(point);
    }
  }
  return {0.5 * (feet.low.x + feet.high.x), 0.5 * (feet.low.y + feet.high.y), feet.low.z};
}

/// True when the pose at the end is the pose at the start, root motion aside.
bool closes(const Scene& scene, const Motion& motion) {
  std::vector<Local> first = scene.rest;
  std::vector<Local> last = scene.rest;
  motion.pose(0.0, first);
  motion.pose(motion.duration_s, last);
  return std::all_of(motion.moved.begin(), motion.moved.end(), [&](std::uint32_t node) {
    const double cosine =
        std::abs(glm::dot(decomposed(first[node]).rotation, decomposed(last[node]).rotation));
    return cosine > 0.9990;  // 5 degrees
  });
}

struct Timing {
  std::uint32_t frame_count = 1;
  double rate_hz = 30.0;
  double step_s = 0.0;
  bool loop = true;
};

/// A looping clip's last frame is followed by its first, so a key that repeats the first isn't
/// sampled.
Timing timing_of(const Scene& scene, const Motion& motion, ClipKind kind, double rate_hz) {
  Timing timing;
  timing.rate_hz = rate_hz;
  const std::uint32_t steps = static_cast<std::uint32_t>(std::lround(motion.duration_s * rate_hz));
  if (steps == 0) return timing;
  timing.step_s = motion.duration_s / steps;
  timing.rate_hz = steps / motion.duration_s;
  const bool is_closed = closes(scene, motion);
  const bool is_cycle =
      kind == ClipKind::kIdle || kind == ClipKind::kWalk || kind == ClipKind::kRun;
  timing.loop = is_closed || is_cycle;
  timing.frame_count = is_closed ? steps : steps + 1;
  return timing;
}

absl::Status sample_clips(const Scene& scene, const std::vector<Motion>& motions,
                          const std::vector<ClipKind>& kinds, const MergedMesh& mesh,
                          const Skeleton& skeleton, const glm::dmat4& model_from_root,
                          double rate_hz, SourceCharacter& character) {
  const std::size_t joints = skeleton.binding.size();
  std::uint64_t total = 0;
  std::uint64_t evaluated = 0;
  for (std::size_t m = 0; m < motions.size(); ++m) {
    const Timing timing = timing_of(scene, motions[m], kinds[m], rate_hz);
    total += std::uint64_t{timing.frame_count} * joints;
    // the whole hierarchy is evaluated for each frame, so it counts as well
    evaluated += std::uint64_t{timing.frame_count} * scene.order.size();
    if (total > kMaxClipMatrices || evaluated > kMaxClipMatrices * 4) {
      return absl::InvalidArgumentError(absl::StrCat("clip ", m, " (", motions[m].name, ") makes ",
                                                     total, " joint matrices, the limit is ",
                                                     kMaxClipMatrices));
    }
    SourceClip& clip = character.clips.emplace_back();
    clip.name = motions[m].name;
    clip.kind = kinds[m];
    clip.rate_hz = static_cast<float>(timing.rate_hz);
    clip.loop = timing.loop;
    clip.frame_count = timing.frame_count;
    clip.model_from_joint.reserve(std::size_t{timing.frame_count} * joints);
    for (std::uint32_t frame = 0; frame < timing.frame_count; ++frame) {
      const double time_s = std::min(frame * timing.step_s, motions[m].duration_s);
      const std::vector<glm::dmat4> world = world_at(scene, &motions[m], time_s);
      for (const std::uint32_t b : skeleton.binding) {
        const glm::dmat4 placed = model_from_root * world[mesh.bindings[b].node];
        if (!is_moderate(glm::mat4(placed))) {
          return absl::InvalidArgumentError(absl::StrCat(
              "clip ", m, " (", motions[m].name, ") frame ", frame, " node ", mesh.bindings[b].node,
              " has a matrix that isn't finite or is beyond 1e9"));
        }
        clip.model_from_joint.emplace_back(placed);
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Motion>> collect_motions(const Document& document, const Scene& scene,
                                                    const ImportOptions& options,
                                                    std::vector<std::string>& notes) {
  absl::StatusOr<std::vector<Motion>> motions = read_motions(document, notes);
  if (!motions.ok()) return motions.status();
  for (const std::string& clip_file : options.clip_files) {
    absl::StatusOr<std::vector<Motion>> more = borrow_motions(document, scene, clip_file, notes);
    if (!more.ok()) return more.status();
    for (Motion& motion : *more) motions->push_back(std::move(motion));
  }
  if (!motions->empty()) return motions;
  if (const std::optional<Humanoid> humanoid = find_humanoid(document, scene)) {
    notes.push_back("has no clip; a default walk and idle are made for its humanoid skeleton");
    return make_default_motions(scene, *humanoid);
  }
  notes.push_back("has no clip and no skeleton known as a humanoid's; it stands in its rest pose");
  return motions;
}

absl::Status check_area(const SourceCharacter& character) {
  double area = 0.0;
  for (const SourceTriangle& triangle : character.triangles) {
    const glm::dvec3 a(character.points[triangle.corner[0].point].position);
    const glm::dvec3 b(character.points[triangle.corner[1].point].position);
    const glm::dvec3 c(character.points[triangle.corner[2].point].position);
    area += 0.5 * glm::length(glm::cross(b - a, c - a));
  }
  if (area > 1e-12) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "all ", character.triangles.size(), " triangles together have an area of ", area, " m2"));
}

absl::StatusOr<SourceCharacter> import_document(const Document& document,
                                                const ImportOptions& options) {
  SourceCharacter character;
  character.name = std::filesystem::path(document.path).stem().string();
  character.notes = document.notes;
  const Scene scene = make_scene(document);
  absl::StatusOr<std::vector<Motion>> motions =
      collect_motions(document, scene, options, character.notes);
  if (!motions.ok()) return motions.status();
  std::vector<char> moves(document.nodes.size(), 0);
  std::vector<std::string> names;
  for (const Motion& motion : *motions) {
    names.push_back(motion.name);
    for (const std::uint32_t node : motion.moved) moves[node] = 1;
  }
  absl::StatusOr<MergedMesh> mesh = merge_meshes(document, scene, moves, character.notes);
  if (!mesh.ok()) return mesh.status();
  const absl::StatusOr<Skeleton> skeleton = make_skeleton(scene, *mesh, character.notes);
  if (!skeleton.ok()) return skeleton.status();

  // the pose that says how large the character is and where it stands
  const std::vector<ClipKind> kinds = kinds_of(names);
  const Motion* reference = motions->empty() ? nullptr : &motions->front();
  for (const ClipKind wanted : {ClipKind::kWalk, ClipKind::kIdle}) {
    const auto found = std::find(kinds.begin(), kinds.end(), wanted);
    if (found != kinds.end())
      reference = &(*motions)[static_cast<std::size_t>(found - kinds.begin())];
  }
  const glm::dmat4 axes = turned_axes(options.turn_deg);
  const std::vector<glm::dmat4> world = world_at(scene, reference, 0.0);
  const std::vector<glm::dvec3> points = skinned(*mesh, world, axes);
  Box box;
  for (const glm::dvec3& point : points) box.add(point);
  const glm::dvec3 size = box.high - box.low;
  if (!(std::max({size.x, size.y, size.z}) <= 1e9)) {
    return absl::InvalidArgumentError("its vertices lie beyond 1e9 in the first pose");
  }
  const glm::dvec3 origin = footing(document, scene, *mesh, points);
  const double height = box.high.z - origin.z;
  double scale = 1.0;
  if (options.height_m.has_value()) {
    if (height < 1e-9)
      return absl::InvalidArgumentError("is flat, so it can't be scaled to a height");
    scale = double{*options.height_m} / height;
  } else if (height > 3.0 || height < 0.5) {
    character.notes.push_back(
        absl::StrCat("is ", height, " m tall; for a person pass --height 1.75"));
  }
  glm::dmat4 model_from_axes(scale);
  model_from_axes[3] = glm::dvec4(-scale * origin, 1.0);
  const glm::dmat4 model_from_root = model_from_axes * axes;
  const glm::dmat4 root_from_model = glm::inverse(model_from_root);

  for (std::size_t j = 0; j < skeleton->binding.size(); ++j) {
    const Binding& binding = mesh->bindings[skeleton->binding[j]];
    const std::string& name = document.nodes[binding.node].name;
    character.joints.push_back(
        SourceJoint{name.empty() ? absl::StrCat("joint_", binding.node) : name, skeleton->parent[j],
                    glm::mat4(binding.joint_from_bind * root_from_model)});
  }
  for (std::size_t j = 0; j < character.joints.size(); ++j) {
    if (is_moderate(character.joints[j].joint_from_model)) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("node ", mesh->bindings[skeleton->binding[j]].node,
                     " has a bind matrix that isn't finite or is beyond 1e9"));
  }
  character.points.reserve(mesh->points.size());
  for (const MergedMesh::Point& from : mesh->points) {
    SourcePoint point;
    point.position = glm::vec3(model_from_root * glm::dvec4(from.position, 1.0));
    for (int k = 0; k < 4; ++k) {
      point.weight[k] = from.weight[k];
      const std::uint32_t binding = from.weight[k] > 0.0F ? from.binding[k] : from.binding[0];
      point.joint[k] = static_cast<std::uint16_t>(skeleton->joint_of[binding]);
    }
    character.points.push_back(point);
  }
  character.normals.reserve(mesh->normals.size());
  for (const glm::vec3& normal : mesh->normals) {
    character.normals.push_back(glm::normalize(glm::vec3(axes * glm::dvec4(normal, 0.0))));
  }
  character.uvs = std::move(mesh->uvs);
  character.triangles = std::move(mesh->triangles);
  character.materials = std::move(mesh->materials);
  absl::Status status = check_area(character);
  if (status.ok()) {
    status = sample_clips(scene, *motions, kinds, *mesh, *skeleton, model_from_root,
                          options.sample_rate_hz, character);
  }
  if (!status.ok()) return status;
  if (character.clips.empty()) {
    // one frame of the rest pose, so that there is always something to show
    SourceClip& clip = character.clips.emplace_back();
    clip.name = "rest";
    clip.kind = ClipKind::kIdle;
    clip.rate_hz = options.sample_rate_hz;
    clip.frame_count = 1;
    for (const std::uint32_t b : skeleton->binding) {
      clip.model_from_joint.emplace_back(model_from_root * world[mesh->bindings[b].node]);
      if (!is_moderate(clip.model_from_joint.back())) {
        return absl::InvalidArgumentError(absl::StrCat(
            "node ", mesh->bindings[b].node, " has a matrix that isn't finite or is beyond 1e9"));
      }
    }
  }
  return character;
}

}  // namespace
}  // namespace gltf

absl::StatusOr<SourceCharacter> import_gltf(const std::string& path, const ImportOptions& options) {
  const absl::StatusOr<gltf::Bytes> bytes = gltf::read_file(path, gltf::kMaxFileBytes);
  if (!bytes.ok()) return bytes.status();
  return import_gltf_bytes(*bytes, path, options);
}

absl::StatusOr<SourceCharacter> import_gltf_bytes(std::span<const std::uint8_t> bytes,
                                                  const std::string& path,
                                                  const ImportOptions& options) {
  const auto out_of_range = [](absl::string_view option, double value, absl::string_view range) {
    return absl::InvalidArgumentError(
        absl::StrCat("import_gltf: ", option, " is ", value, ", must be in ", range));
  };
  if (!(options.sample_rate_hz > 0.0F && options.sample_rate_hz <= 240.0F)) {
    return out_of_range("sample_rate_hz", options.sample_rate_hz, "(0, 240]");
  }
  if (options.height_m.has_value() && !(*options.height_m > 0.0F && *options.height_m <= 1000.0F)) {
    return out_of_range("height_m", *options.height_m, "(0, 1000]");
  }
  if (!(std::abs(options.turn_deg) <= 360.0F)) {
    return out_of_range("turn_deg", options.turn_deg, "[-360, 360]");
  }
  absl::Status status;
  try {
    absl::StatusOr<gltf::Document> document = gltf::read_document(bytes, path);
    if (document.ok()) {
      absl::StatusOr<SourceCharacter> character = gltf::import_document(*document, options);
      if (character.ok()) return character;
      status = character.status();
    } else {
      status = document.status();
    }
  } catch (const std::bad_alloc&) {
    // a compressed part may ask for more than its size lets one guess
    status = absl::InvalidArgumentError("needs more memory than there is");
  } catch (const std::length_error&) {
    status = absl::InvalidArgumentError("needs more memory than there is");
  }
  return absl::InvalidArgumentError(absl::StrCat(path, ": ", status.message()));
}

}  // namespace throng::simplify
