#include "simplify/import/mesh.hpp"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>
#include <utility>

#include "simplify/import/accessor.hpp"
#include "simplify/import/limits.hpp"
#include "simplify/import/material.hpp"
#include "simplify/import/normals.hpp"
#include "simplify/import/primitive.hpp"

namespace throng::simplify::gltf {
namespace {

/// One primitive at one node.
struct Instance {
  std::uint32_t node = 0;
  std::uint32_t mesh = 0;
  std::uint32_t primitive = 0;
  std::int32_t skin = kNone;  // kNone: rigid
  PrimitiveData data;

  std::string where() const { return absl::StrCat("mesh ", mesh, " primitive ", primitive); }
};

/// What was changed on the way in, to be told once and not for each vertex.
struct Tally {
  std::uint64_t cut = 0;         // vertices with more than four influences
  std::uint64_t unweighted = 0;  // vertices of a skin without any weight
  std::uint64_t degenerate = 0;
  std::uint64_t made_normals = 0;
  std::uint64_t morphed = 0;
  std::uint64_t lines = 0;
  std::uint64_t rigid = 0;
};

/// Equal rows of plain numbers get one index.
template <typename T>
class Unique {
 public:
  std::uint32_t add(const T& value, std::vector<T>& values) {
    const std::string_view key(reinterpret_cast<const char*>(&value), sizeof(T));
    const auto [slot, added] =
        known_.try_emplace(std::string(key), static_cast<std::uint32_t>(values.size()));
    if (added) values.push_back(value);
    return slot->second;
  }

 private:
  static_assert(std::is_trivially_copyable_v<T>);
  absl::flat_hash_map<std::string, std::uint32_t> known_;
};

absl::StatusOr<std::vector<glm::dmat4>> read_inverse_binds(const Document& document,
                                                           const Skin& skin) {
  std::vector<glm::dmat4> matrices(skin.joints.size(), glm::dmat4(1.0));
  if (skin.inverse_bind == kNone) return matrices;
  const std::uint32_t accessor = static_cast<std::uint32_t>(skin.inverse_bind);
  const absl::StatusOr<Table<float>> table = read_floats(document, accessor);
  if (!table.ok()) return table.status();
  if (table->components != 16 || table->count < skin.joints.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("accessor ", accessor, " has ", table->count, " rows of ", table->components,
                     " numbers, must have ", skin.joints.size(), " of 16"));
  }
  for (std::size_t j = 0; j < matrices.size(); ++j) {
    for (int i = 0; i < 16; ++i) {
      const float value = table->row(j)[i];
      if (!(std::abs(value) <= 1e9F)) {
        return absl::InvalidArgumentError(absl::StrCat(
            "accessor ", accessor, " matrix ", j, " has the value ", value, ", the limit is 1e9"));
      }
      matrices[j][i / 4][i % 4] = static_cast<double>(value);
    }
  }
  return matrices;
}

absl::StatusOr<std::vector<Instance>> read_instances(const Document& document, const Scene& scene,
                                                     Tally& tally) {
  std::vector<Instance> instances;
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
  for (const std::uint32_t node_index : scene.order) {
    const Node& node = document.nodes[node_index];
    if (scene.shown[node_index] == 0 || node.mesh == kNone) continue;
    const Mesh& mesh = document.meshes[static_cast<std::size_t>(node.mesh)];
    for (std::size_t p = 0; p < mesh.primitives.size(); ++p) {
      const Primitive& primitive = mesh.primitives[p];
      if (instances.size() >= kMaxInstances) {
        return absl::InvalidArgumentError(absl::StrCat("mesh ", node.mesh, " primitive ", p,
                                                       " is drawn beyond the limit of ",
                                                       kMaxInstances, " primitives"));
      }
      Instance instance{node_index,
                        static_cast<std::uint32_t>(node.mesh),
                        static_cast<std::uint32_t>(p),
                        kNone,
                        {}};
      const std::size_t joints =
          node.skin == kNone ? 0
                             : document.skins[static_cast<std::size_t>(node.skin)].joints.size();
      absl::StatusOr<PrimitiveData> data = read_primitive(document, primitive, joints);
      if (!data.ok()) {
        return absl::InvalidArgumentError(
            absl::StrCat(instance.where(), " ", data.status().message()));
      }
      if (!data->is_surface) {
        ++tally.lines;
        continue;
      }
      vertices += data->positions.size();
      triangles += data->triangles.size();
      if (vertices > kMaxVertices || triangles > kMaxTriangles) {
        return absl::InvalidArgumentError(
            absl::StrCat(instance.where(), " makes ", vertices, " vertices and ", triangles,
                         " triangles, the limits are ", kMaxVertices, " and ", kMaxTriangles));
      }
      if (data->influence_stride > 0) instance.skin = node.skin;
      if (instance.skin == kNone) ++tally.rigid;
      tally.morphed += primitive.morph_targets > 0;
      tally.degenerate += data->degenerate;
      instance.data = *std::move(data);
      instances.push_back(std::move(instance));
    }
  }
  return instances;
}

/// A rough size of the character, to which differences between bind matrices are compared.
double extent_of(const std::vector<Instance>& instances, std::span<const glm::dmat4> world) {
  double extent = 0.0;
  for (const Instance& instance : instances) {
    glm::dvec3 low(1e30);
    glm::dvec3 high(-1e30);
    for (const glm::vec3& position : instance.data.positions) {
      low = glm::min(low, glm::dvec3(position));
      high = glm::max(high, glm::dvec3(position));
    }
    double scale = 1.0;
    if (instance.skin == kNone)
      scale = std::cbrt(std::abs(glm::determinant(glm::dmat3(world[instance.node]))));
    extent = std::max(extent, glm::length(high - low) * scale);
  }
  return extent;
}

/// The strongest four of any number of influences, merged by joint, summing to 1.
MergedMesh::Point weigh(std::span<const Influence> influences,
                        std::span<const std::uint32_t> binding_of_joint, Tally& tally) {
  std::array<std::pair<std::uint32_t, float>, kMaxInfluenceSets * 4> merged;
  std::size_t count = 0;
  for (const Influence& influence : influences) {
    if (influence.weight <= 0.0F) continue;
    const std::uint32_t binding = binding_of_joint[influence.joint];
    const auto* end = merged.data() + count;
    auto* const found = std::find_if(merged.data(), merged.data() + count,
                                     [&](const auto& entry) { return entry.first == binding; });
    if (found != end) {
      found->second += influence.weight;
    } else {
      merged[count++] = {binding, influence.weight};
    }
  }
  MergedMesh::Point point;
  if (count == 0) {
    ++tally.unweighted;
    point.binding.fill(binding_of_joint.empty()
                           ? 0
                           : binding_of_joint[influences.empty() ? 0 : influences[0].joint]);
    return point;
  }
  tally.cut += count > 4;
  std::stable_sort(merged.begin(), merged.begin() + static_cast<std::ptrdiff_t>(count),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  const std::size_t kept = std::min<std::size_t>(count, 4);
  float sum = 0.0F;
  for (std::size_t i = 0; i < kept; ++i) sum += merged[i].second;
  point.weight.fill(0.0F);
  point.binding.fill(merged[0].first);
  for (std::size_t i = 0; i < kept; ++i) {
    point.binding[i] = merged[i].first;
    point.weight[i] = merged[i].second / sum;
  }
  return point;
}

/// Where an instance's vertices go and what moves them.
struct Placement {
  glm::dmat4 bind_from_mesh{1.0};
  std::vector<std::uint32_t> binding_of_joint;  // one entry for a rigid part
};

class Merger {
 public:
  Merger(const Document& document, std::vector<std::string>& notes)
      : materials_(document), document_(document), notes_(notes) {}

  absl::Status add(const Instance& instance, const Placement& placement, Tally& tally) {
    const PrimitiveData& data = instance.data;
    std::vector<std::uint32_t> point_of(data.positions.size());
    std::vector<glm::vec3> placed(data.positions.size());
    for (std::size_t v = 0; v < placed.size(); ++v) {
      const glm::dvec4 at = placement.bind_from_mesh * glm::dvec4(data.positions[v], 1.0);
      placed[v] = glm::vec3(at) + 0.0F;
      if (glm::any(glm::greaterThan(glm::abs(placed[v]), glm::vec3(1e9F))) ||
          glm::any(glm::isnan(placed[v]))) {
        return absl::InvalidArgumentError(
            absl::StrCat(instance.where(), " vertex ", v, " lies beyond 1e9 in the bind pose"));
      }
    }
    std::vector<char> is_used(placed.size(), 0);
    for (const auto& triangle : data.triangles) {
      for (const std::uint32_t corner : triangle) is_used[corner] = 1;
    }
    for (std::size_t v = 0; v < placed.size(); ++v) {
      if (is_used[v] == 0) continue;
      MergedMesh::Point point;
      if (instance.skin == kNone) {
        point.binding.fill(placement.binding_of_joint[0]);
      } else {
        point = weigh(
            std::span(data.influences).subspan(v * data.influence_stride, data.influence_stride),
            placement.binding_of_joint, tally);
      }
      point.position = placed[v];
      point_of[v] = unique_points_.add(point, mesh_.points);
    }

    // a mirrored part shows its inside unless its triangles are turned around
    const bool is_mirrored = glm::determinant(glm::dmat3(placement.bind_from_mesh)) < 0.0;
    std::vector<std::array<std::uint32_t, 3>> triangles = data.triangles;
    if (is_mirrored) {
      for (auto& triangle : triangles) std::swap(triangle[1], triangle[2]);
    }
    absl::StatusOr<Dressed> dressed = materials_.dress(
        document_.meshes[instance.mesh].primitives[instance.primitive], data, notes_);
    if (!dressed.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(instance.where(), " ", dressed.status().message()));
    }
    if (is_mirrored) {
      for (auto& uv : dressed->corner_uv) std::swap(uv[1], uv[2]);
    }

    const bool all_given = !data.normals.empty() &&
                           std::none_of(data.normals.begin(), data.normals.end(),
                                        [](const glm::vec3& n) { return n == glm::vec3(0.0F); });
    std::vector<std::array<glm::vec3, 3>> made;
    if (!all_given) {
      ++tally.made_normals;
      made = crease_normals(placed, triangles);
    }
    // normals go by the cofactor matrix: the inverse transpose up to a positive factor once winding
    // is fixed
    const glm::dmat3 linear(placement.bind_from_mesh);
    const double sign = is_mirrored ? -1.0 : 1.0;
    const glm::dmat3 cofactor(sign * glm::cross(linear[1], linear[2]),
                              sign * glm::cross(linear[2], linear[0]),
                              sign * glm::cross(linear[0], linear[1]));
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      SourceTriangle out;
      out.material = dressed->material;
      for (int c = 0; c < 3; ++c) {
        const std::uint32_t vertex = triangles[t][c];
        glm::vec3 normal(0.0F);
        if (!data.normals.empty()) {
          const glm::dvec3 turned = cofactor * glm::dvec3(data.normals[vertex]);
          const double length = glm::length(turned);
          if (length > 0.0 && std::isfinite(length)) normal = glm::vec3(turned / length);
        }
        if (normal == glm::vec3(0.0F))
          normal = made.empty() ? glm::vec3(0.0F, 1.0F, 0.0F) : made[t][c];
        out.corner[c] =
            SourceCorner{point_of[vertex], unique_normals_.add(normal + 0.0F, mesh_.normals),
                         unique_uvs_.add(dressed->corner_uv[t][c] + 0.0F, mesh_.uvs)};
      }
      const auto& corner = out.corner;
      if (corner[0].point == corner[1].point || corner[1].point == corner[2].point ||
          corner[2].point == corner[0].point) {
        ++tally.degenerate;
        continue;
      }
      mesh_.triangles.push_back(out);
    }
    return absl::OkStatus();
  }

  MergedMesh take() {
    mesh_.materials = materials_.take();
    return std::move(mesh_);
  }

 private:
  MaterialTable materials_;
  const Document& document_;
  std::vector<std::string>& notes_;
  MergedMesh mesh_;
  Unique<MergedMesh::Point> unique_points_;
  Unique<glm::vec3> unique_normals_;
  Unique<glm::vec2> unique_uvs_;
};

void tell(const Tally& tally, std::vector<std::string>& notes) {
  const auto note = [&](std::uint64_t count, absl::string_view what) {
    if (count > 0) notes.push_back(absl::StrCat(count, " ", what));
  };
  note(tally.cut, "vertices have more than four influences; the strongest four are kept");
  note(tally.unweighted, "vertices of a skin have no weight; they follow its first joint");
  note(tally.degenerate, "triangles with a repeated corner are left out");
  note(tally.made_normals, "primitives lack normals; they are computed, smooth up to 60 degrees");
  note(tally.morphed, "primitives have morph targets, which are ignored");
  note(tally.lines, "primitives are points or lines, which are left out");
}

/// Materials that no triangle has are dropped, the others keep their order.
void drop_unused_materials(MergedMesh& mesh) {
  std::vector<std::uint32_t> renamed(mesh.materials.size(), 0);
  for (const SourceTriangle& triangle : mesh.triangles) renamed[triangle.material] = 1;
  std::vector<SourceMaterial> kept;
  for (std::size_t i = 0; i < renamed.size(); ++i) {
    if (renamed[i] == 0) continue;
    renamed[i] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(std::move(mesh.materials[i]));
  }
  for (SourceTriangle& triangle : mesh.triangles) triangle.material = renamed[triangle.material];
  mesh.materials = std::move(kept);
}

}  // namespace

absl::StatusOr<MergedMesh> merge_meshes(const Document& document, const Scene& scene,
                                        std::span<const char> moves,
                                        std::vector<std::string>& notes) {
  Tally tally;
  absl::StatusOr<std::vector<Instance>> instances = read_instances(document, scene, tally);
  if (!instances.ok()) return instances.status();
  const std::vector<glm::dmat4> rest_world = world_of(scene, scene.rest);

  // skins first: what hangs on their joints takes their bind pose
  std::vector<std::vector<double>> weight(document.skins.size());
  std::vector<std::int32_t> wearer(document.skins.size(), kNone);  // a node with the skin's mesh
  for (const Instance& instance : *instances) {
    if (instance.skin == kNone) continue;
    const std::size_t skin = static_cast<std::size_t>(instance.skin);
    if (wearer[skin] == kNone) wearer[skin] = static_cast<std::int32_t>(instance.node);
    weight[skin].resize(document.skins[skin].joints.size(), 0.0);
    for (const Influence& influence : instance.data.influences) {
      weight[skin][influence.joint] += static_cast<double>(influence.weight);
    }
  }
  Bindings bindings(document.nodes.size(), 1e-3 * extent_of(*instances, rest_world));
  std::uint64_t bound_joints = 0;
  std::vector<Placement> placed_skins(document.skins.size());
  for (std::size_t s = 0; s < document.skins.size(); ++s) {
    if (wearer[s] == kNone) continue;
    bound_joints += document.skins[s].joints.size();
    if (bound_joints > kMaxBoundJoints) {
      return absl::InvalidArgumentError(absl::StrCat(
          "skin ", s, " makes ", bound_joints, " bound joints, the limit is ", kMaxBoundJoints));
    }
    const absl::StatusOr<std::vector<glm::dmat4>> inverse_bind =
        read_inverse_binds(document, document.skins[s]);
    if (!inverse_bind.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("skin ", s, " ", inverse_bind.status().message()));
    }
    Bindings::PlacedSkin placed =
        bindings.place_skin(scene, rest_world, document.skins[s], *inverse_bind, weight[s],
                            static_cast<std::uint32_t>(wearer[s]));
    placed_skins[s] = Placement{placed.bind_from_mesh, std::move(placed.binding)};
  }

  Merger merger(document, notes);
  for (const Instance& instance : *instances) {
    Placement placement;
    if (instance.skin == kNone) {
      const Bindings::PlacedPart part =
          bindings.place_part(scene, rest_world, moves, instance.node);
      placement = Placement{part.bind_from_mesh, {part.binding}};
    } else {
      placement = placed_skins[static_cast<std::size_t>(instance.skin)];
    }
    if (absl::Status added = merger.add(instance, placement, tally); !added.ok()) return added;
  }
  MergedMesh mesh = merger.take();
  mesh.bindings = bindings.all();
  if (mesh.triangles.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("has no triangles (", document.meshes.size(),
                                                   " meshes, ", document.nodes.size(), " nodes)"));
  }
  drop_unused_materials(mesh);
  tell(tally, notes);
  return mesh;
}

}  // namespace throng::simplify::gltf
