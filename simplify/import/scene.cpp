#include "simplify/import/scene.hpp"

#include <cmath>
#include <glm/gtc/quaternion.hpp>

namespace throng::simplify::gltf {
namespace {

glm::dquat to_quat(const glm::dvec4& v) { return glm::dquat(v.w, v.x, v.y, v.z); }
glm::dvec4 to_vec(const glm::dquat& q) { return glm::dvec4(q.x, q.y, q.z, q.w); }

}  // namespace

Scene make_scene(const Document& document) {
  const std::size_t count = document.nodes.size();
  Scene scene;
  scene.parent.assign(count, kNone);
  scene.shown.assign(count, 0);
  scene.rest.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    scene.rest.push_back(document.nodes[i].local);
    for (const std::uint32_t child : document.nodes[i].children) {
      scene.parent[child] = static_cast<std::int32_t>(i);
    }
  }
  for (const std::uint32_t root : document.roots) scene.shown[root] = 1;

  std::vector<std::uint32_t> stack;
  for (std::size_t root = count; root-- > 0;) {
    if (scene.parent[root] == kNone) stack.push_back(static_cast<std::uint32_t>(root));
  }
  while (!stack.empty()) {
    const std::uint32_t node = stack.back();
    stack.pop_back();
    scene.order.push_back(node);
    const std::vector<std::uint32_t>& children = document.nodes[node].children;
    for (std::size_t i = children.size(); i-- > 0;) {
      if (scene.shown[node] != 0) scene.shown[children[i]] = 1;
      stack.push_back(children[i]);
    }
  }
  return scene;
}

glm::dmat4 matrix_of(const Local& local) {
  if (local.is_matrix) return local.matrix;
  glm::dmat4 matrix = glm::mat4_cast(to_quat(local.rotation));
  for (int i = 0; i < 3; ++i) matrix[i] *= local.scale[i];
  matrix[3] = glm::dvec4(local.translation, 1.0);
  return matrix;
}

Local decomposed(const Local& local) {
  if (!local.is_matrix) return local;
  Local result;
  result.translation = glm::dvec3(local.matrix[3]);
  glm::dmat3 axes(local.matrix);
  for (int i = 0; i < 3; ++i) {
    result.scale[i] = glm::length(axes[i]);
    if (result.scale[i] > 1e-12) axes[i] /= result.scale[i];
  }
  if (glm::determinant(axes) < 0.0) {
    result.scale.x = -result.scale.x;
    axes[0] = -axes[0];
  }
  const glm::dquat rotation = glm::quat_cast(axes);
  const double length = glm::length(rotation);
  if (std::isfinite(length) && length > 1e-9) result.rotation = to_vec(rotation) / length;
  return result;
}

std::vector<glm::dmat4> world_of(const Scene& scene, std::span<const Local> locals) {
  std::vector<glm::dmat4> world(locals.size());
  for (const std::uint32_t node : scene.order) {
    const glm::dmat4 own = matrix_of(locals[node]);
    const std::int32_t parent = scene.parent[node];
    world[node] = parent == kNone ? own : world[static_cast<std::size_t>(parent)] * own;
  }
  return world;
}

glm::dvec4 multiply_rotations(const glm::dvec4& a, const glm::dvec4& b) {
  return to_vec(to_quat(a) * to_quat(b));
}

glm::dvec4 inverse_rotation(const glm::dvec4& q) { return glm::dvec4(-q.x, -q.y, -q.z, q.w); }

bool is_invertible(const glm::dmat4& matrix) {
  double scale = 1.0;
  for (int i = 0; i < 3; ++i) scale *= glm::length(glm::dvec3(matrix[i]));
  const double determinant = glm::determinant(glm::dmat3(matrix));
  return std::isfinite(determinant) && scale > 1e-30 && std::abs(determinant) > 1e-6 * scale;
}

}  // namespace throng::simplify::gltf
