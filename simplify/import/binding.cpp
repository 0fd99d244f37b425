#include "simplify/import/binding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

namespace throng::simplify::gltf {
namespace {

double distance(const glm::dmat4& a, const glm::dmat4& b) {
  double sum = 0.0;
  for (int c = 0; c < 4; ++c) sum += glm::dot(a[c] - b[c], a[c] - b[c]);
  return std::sqrt(sum);
}

double volume(const glm::dmat4& matrix) { return std::abs(glm::determinant(glm::dmat3(matrix))); }

/// True when two frames differ by less than about six degrees.
bool turns_little(const glm::dmat4& a, const glm::dmat4& b) {
  double difference = 0.0;
  double size = 0.0;
  for (int c = 0; c < 3; ++c) {
    difference = std::max(difference, glm::length(glm::dvec3(a[c] - b[c])));
    size = std::max(size, glm::length(glm::dvec3(a[c])));
  }
  return difference < 0.1 * size;
}

/// The candidate with the smallest weighted distance to all others.
std::optional<glm::dmat4> medoid(std::span<const glm::dmat4> candidates,
                                 std::span<const double> weight) {
  std::optional<glm::dmat4> best;
  double least = std::numeric_limits<double>::infinity();
  for (const glm::dmat4& candidate : candidates) {
    if (!is_invertible(candidate)) continue;
    double sum = 0.0;
    for (std::size_t j = 0; j < candidates.size(); ++j)
      sum += weight[j] * distance(candidate, candidates[j]);
    if (sum < least) {
      least = sum;
      best = candidate;
    }
  }
  return best;
}

}  // namespace

bool Bindings::agrees(const glm::dmat4& a, const glm::dmat4& b) const {
  if (!is_invertible(a)) return false;
  // both map the bind frame to one joint, so back and forth is the identity
  const glm::dmat4 round_trip = glm::inverse(a) * b;
  for (int c = 0; c < 3; ++c) {
    glm::dvec4 unit(0.0);
    unit[c] = 1.0;
    if (glm::length(round_trip[c] - unit) > 1e-3) return false;
  }
  return glm::length(glm::dvec3(round_trip[3])) <= tolerance_;
}

const Binding* Bindings::find(std::uint32_t node) const {
  const std::int32_t first = first_of_node_[node];
  return first == kNone ? nullptr : &all_[static_cast<std::size_t>(first)];
}

std::uint32_t Bindings::find_or_add(std::uint32_t node, const glm::dmat4& joint_from_bind) {
  if (first_of_node_[node] != kNone) {
    for (std::size_t i = static_cast<std::size_t>(first_of_node_[node]); i < all_.size(); ++i) {
      if (all_[i].node == node && agrees(all_[i].joint_from_bind, joint_from_bind)) {
        return static_cast<std::uint32_t>(i);
      }
    }
  } else {
    first_of_node_[node] = static_cast<std::int32_t>(all_.size());
  }
  all_.push_back(Binding{node, joint_from_bind});
  return static_cast<std::uint32_t>(all_.size() - 1);
}

Bindings::PlacedSkin Bindings::place_skin(const Scene& scene,
                                          std::span<const glm::dmat4> rest_world, const Skin& skin,
                                          std::span<const glm::dmat4> inverse_bind,
                                          std::span<const double> weight, std::uint32_t mesh_node) {
  // the heaviest joints decide; more than these would only cost quadratic time
  constexpr std::size_t kMaxVoters = 64;
  std::vector<std::size_t> voters(skin.joints.size());
  std::iota(voters.begin(), voters.end(), std::size_t{0});
  std::erase_if(voters, [&](std::size_t j) { return !(weight[j] > 0.0); });
  std::stable_sort(voters.begin(), voters.end(),
                   [&](std::size_t a, std::size_t b) { return weight[a] > weight[b]; });
  if (voters.size() > kMaxVoters) voters.resize(kMaxVoters);

  // 1. the frame of a skin that is already here, when all joints they share allow it
  PlacedSkin placed;
  std::optional<glm::dmat4> frame;
  for (const std::size_t j : voters) {
    const Binding* known = find(skin.joints[j]);
    if (known == nullptr || !is_invertible(known->joint_from_bind)) continue;
    const glm::dmat4 tried = glm::inverse(known->joint_from_bind) * inverse_bind[j];
    if (!is_invertible(tried)) break;
    const glm::dmat4 back = glm::inverse(tried);
    const bool fits = std::all_of(voters.begin(), voters.end(), [&](std::size_t k) {
      const Binding* other = find(skin.joints[k]);
      return other == nullptr || agrees(other->joint_from_bind, inverse_bind[k] * back);
    });
    if (fits) frame = tried;
    break;
  }
  // 2. its own
  if (!frame.has_value()) {
    std::vector<glm::dmat4> candidates;
    std::vector<double> votes;
    for (const std::size_t j : voters) {
      candidates.push_back(rest_world[skin.joints[j]] * inverse_bind[j]);
      votes.push_back(weight[j]);
    }
    frame = medoid(candidates, votes);
    const bool is_bind_pose = frame.has_value() && std::all_of(candidates.begin(), candidates.end(),
                                                               [&](const auto& other) {
                                                                 return turns_little(*frame, other);
                                                               });
    if (frame.has_value() && !is_bind_pose) {
      const double ratio = volume(rest_world[mesh_node]) / volume(*frame);
      if (is_invertible(rest_world[mesh_node]) && ratio > 0.5 && ratio < 2.0)
        frame = rest_world[mesh_node];
    }
  }
  placed.bind_from_mesh = frame.value_or(glm::dmat4(1.0));
  const glm::dmat4 mesh_from_bind = glm::inverse(placed.bind_from_mesh);
  placed.binding.reserve(skin.joints.size());
  for (std::size_t j = 0; j < skin.joints.size(); ++j) {
    placed.binding.push_back(find_or_add(skin.joints[j], inverse_bind[j] * mesh_from_bind));
  }
  return placed;
}

Bindings::PlacedPart Bindings::place_part(const Scene& scene,
                                          std::span<const glm::dmat4> rest_world,
                                          std::span<const char> moves, std::uint32_t node) {
  std::uint32_t carrier = node;
  glm::dmat4 carrier_from_mesh(1.0);
  while (find(carrier) == nullptr && moves[carrier] == 0 && scene.parent[carrier] != kNone) {
    carrier_from_mesh = matrix_of(scene.rest[carrier]) * carrier_from_mesh;
    carrier = static_cast<std::uint32_t>(scene.parent[carrier]);
  }
  if (const Binding* known = find(carrier);
      known != nullptr && is_invertible(known->joint_from_bind)) {
    return {glm::inverse(known->joint_from_bind) * carrier_from_mesh,
            static_cast<std::uint32_t>(known - all_.data())};
  }
  // a prop that is scaled to nothing in the rest pose still needs a frame: it gets one without
  // scale
  glm::dmat4 bind_from_joint = rest_world[carrier];
  if (!is_invertible(bind_from_joint)) {
    Local unscaled = decomposed(scene.rest[carrier]);
    unscaled.scale = glm::dvec3(1.0);
    const std::int32_t parent = scene.parent[carrier];
    const glm::dmat4 above =
        parent == kNone ? glm::dmat4(1.0) : rest_world[static_cast<std::size_t>(parent)];
    bind_from_joint = (is_invertible(above) ? above : glm::dmat4(1.0)) * matrix_of(unscaled);
  }
  return {bind_from_joint * carrier_from_mesh, find_or_add(carrier, glm::inverse(bind_from_joint))};
}

}  // namespace throng::simplify::gltf
