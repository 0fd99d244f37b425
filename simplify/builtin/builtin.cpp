#include "simplify/builtin/builtin.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "simplify/builtin/body.hpp"
#include "simplify/builtin/motion.hpp"
#include "simplify/builtin/paint.hpp"
#include "simplify/builtin/rig.hpp"
#include "simplify/builtin/unwrap.hpp"

namespace throng::builtin {
namespace {

/// Where the vertices that the table still grants are spent.
float importance(const MeshFace& face, const glm::vec3& canonical) {
  switch (face.region) {
    case Region::kLining:
      return 0.25F;
    case Region::kSole:
      return 0.4F;
    default:
      break;
  }
  return canonical.z > 1.70F ? 2.2F : canonical.z > 1.54F ? 1.4F : 1.0F;
}

std::vector<float> chart_density() {
  std::vector<float> density(kChartCount, 1.0F);
  density[kChartHead] = 1.9F;
  density[kChartHair] = 1.1F;
  density[kChartHat] = 1.1F;
  density[kChartSoleLeft] = density[kChartSoleRight] = 0.6F;
  return density;
}

SourceCharacter assemble(const Figure& figure) {
  Body body = make_body(figure);
  Mesh& mesh = body.mesh;
  cut_to_discs(mesh);
  // every vertex that is added later lies inside a chart and brings one wedge
  const int seams = figure.uv_count - figure.vertex_count;
  add_slits(mesh, body.slits, static_cast<int>(mesh.vertices.size()) + seams);
  mesh.triangulate();
  mesh.refine(figure.vertex_count, importance);

  std::vector<glm::vec3> canonical, position;
  for (const MeshVertex& v : mesh.vertices) {
    canonical.push_back(v.position);
    position.push_back(to_model(figure, v.position, v.part));
  }
  const std::vector<glm::vec3> normal = mesh.normals(position);
  const Unwrap layout = unwrap(mesh, position, chart_density());
  const Rig rig = make_rig(figure, mesh);
  const std::vector<Skin> skin = make_skin(figure, mesh, rig);

  SourceCharacter out;
  out.name = figure.name;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    simplify::SourcePoint point;
    point.position = position[v];
    for (int i = 0; i < 4; ++i) {
      point.joint[i] = static_cast<std::uint16_t>(skin[v].joint[i]);
      point.weight[i] = skin[v].weight[i];
    }
    out.points.push_back(point);
  }
  out.normals = normal;
  out.uvs = layout.uv;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    simplify::SourceTriangle triangle;
    for (int i = 0; i < 3; ++i) {
      const auto v = static_cast<std::uint32_t>(mesh.faces[f].corner[i]);
      triangle.corner[i] = {v, v, static_cast<std::uint32_t>(layout.corner[f][i])};
    }
    out.triangles.push_back(triangle);
  }
  simplify::SourceMaterial material;
  material.name = figure.name;
  material.wrap_u = material.wrap_v = simplify::Wrap::kClamp;
  paint(figure, mesh, mesh.normals(canonical), sky_visibility(mesh, position, normal), layout,
        material);
  out.materials.push_back(std::move(material));
  for (const RigJoint& joint : rig.joints) {
    out.joints.push_back(
        {joint.name, joint.parent, glm::translate(glm::mat4(1.0F), -joint.position)});
  }
  out.clips = make_clips(figure, rig);
  return out;
}

}  // namespace

std::vector<std::string> builtin_names() {
  std::vector<std::string> names;
  for (const Figure& figure : figures()) names.push_back(figure.name);
  return names;
}

SourceCharacter make_builtin(const std::string& name, const MeshCounts& counts) {
  for (Figure figure : figures()) {
    if (figure.name != name) continue;
    if (counts.vertices > 0) {
      // coarser tubes to start from; refinement fills up to the count
      const float coarser =
          0.6F * std::sqrt(static_cast<float>(counts.vertices) / figure.vertex_count);
      figure.columns = std::max(8, 2 * static_cast<int>(0.5F * figure.columns * coarser));
      figure.rows *= std::min(coarser, 1.0F);
      figure.vertex_count = counts.vertices;
    }
    if (counts.uvs > 0) figure.uv_count = counts.uvs;
    return assemble(figure);
  }
  SourceCharacter out;
  out.name = name;
  out.notes.push_back("make_builtin: no character named '" + name + "'");
  return out;
}

}  // namespace throng::builtin
