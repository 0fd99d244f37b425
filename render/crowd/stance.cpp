#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "render/compute/element/stance.hpp"
#include "render/crowd/motion_graph.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kMostVertices = 2000;  // collapse order: these are a level of the whole mesh

/// A vertex in a frame of the palette.
glm::vec3 posed(const Character& character, std::size_t vertex, std::size_t frame) {
  const Affine* palette = character.palette.data() + frame * character.joint_count();
  const glm::vec4 bind(character.position[vertex], 1.0F);
  glm::vec3 sum(0.0F);
  for (int k = 0; k < 4; ++k) {
    const std::uint8_t weight = character.joint_weight[vertex][k];
    if (weight == 0) continue;
    const Affine& joint = palette[character.joint_index[vertex][k]];
    sum += static_cast<float>(weight) / 255.0F *
           glm::vec3(glm::dot(joint.row[0], bind), glm::dot(joint.row[1], bind),
                     glm::dot(joint.row[2], bind));
  }
  return sum;
}

struct Stance {
  glm::vec2 centre_m{0.0F};  // of what is on the ground; at the origin where nothing is
  float ease = 1.0F;         // of turning on it
};

/// What rests on the ground in each frame of a clip: it is low and goes back under the body as fast
/// as the body goes ahead.
std::vector<Stance> stances_of(const Character& character, const element::ClipRange& clip,
                               float stride_m) {
  const std::size_t vertices = std::min<std::size_t>(kMostVertices, character.vertex_count());
  const std::size_t frames = clip.frame_count;
  std::vector<glm::vec3> place(frames * vertices);
  float ground_m = std::numeric_limits<float>::max();
  for (std::size_t f = 0; f < frames; ++f) {
    for (std::size_t i = 0; i < vertices; ++i) {
      place[f * vertices + i] = posed(character, i, clip.first_frame + f);
      ground_m = std::min(ground_m, place[f * vertices + i].z);
    }
  }
  const float foot_m = 0.09F * stride_m;  // two feet that stand are farther than this apart
  const float reach_m = 0.005F * std::max(character.height_m, 0.1F);
  const float step_m = stride_m / static_cast<float>(frames);
  std::vector<Stance> stances(frames);
  for (std::size_t f = 0; f < frames; ++f) {
    const glm::vec3* before = place.data() + (f + frames - 1) % frames * vertices;
    const glm::vec3* now = place.data() + f * vertices;
    const glm::vec3* after = place.data() + (f + 1) % frames * vertices;
    glm::vec2 sum(0.0F);
    float total = 0.0F, squares = 0.0F;
    for (std::size_t i = 0; i < vertices; ++i) {
      const float height = (now[i].z - ground_m) / reach_m;
      const float slide = std::fabs(0.5F * (before[i].x - after[i].x) - step_m) / (0.3F * step_m);
      const float weight = std::max(0.0F, 1.0F - height) * std::max(0.0F, 1.0F - slide);
      sum += weight * glm::vec2(now[i]);
      squares += weight * (now[i].x * now[i].x + now[i].y * now[i].y);
      total += weight;
    }
    if (!(total > 0.0F)) continue;
    stances[f].centre_m = sum / total;
    const glm::vec2& c = stances[f].centre_m;
    const float spread_m = std::sqrt(std::max(0.0F, squares / total - glm::dot(c, c))) / foot_m;
    stances[f].ease = 1.0F / (1.0F + spread_m * spread_m * spread_m * spread_m);
  }
  return stances;
}

/// A periodic sum of rates [F] from one frame to the next, zero in the mean: what does not come
/// back in a cycle is no shift but another path.
template <typename T>
std::vector<T> sum_up(const std::vector<T>& rates) {
  const std::size_t frames = rates.size();
  const auto share = 1.0F / static_cast<float>(frames);
  T drift(0.0F), mean(0.0F);
  for (const T& rate : rates) drift += share * rate;
  std::vector<T> sum(frames + 1, T(0.0F));
  for (std::size_t f = 0; f < frames; ++f) {
    sum[f + 1] = sum[f] + rates[f] - drift;
    mean += share * sum[f];
  }
  for (T& value : sum) value -= mean;
  return sum;
}

void fill(const Character& character, const element::ClipRange& clip, float stride_m,
          glm::vec3* shift) {
  const std::size_t frames = clip.frame_count;
  if (frames < 4 || !(stride_m > 0.0F) || !std::isfinite(stride_m)) return;
  if ((clip.first_frame + frames) * character.joint_count() > character.palette.size()) return;
  const std::vector<Stance> stances = stances_of(character, clip, stride_m);
  const float step_m = stride_m / static_cast<float>(frames);
  float ease = 0.0F;
  for (const Stance& stance : stances) ease += stance.ease / static_cast<float>(frames);
  std::vector<float> turn_rate(frames);
  std::vector<glm::vec2> rate(frames);
  // r of stance.hpp in the middle between two frames
  const auto turning = [&](std::size_t f) {
    const float here = 0.5F * (stances[f].ease + stances[(f + 1) % frames].ease) / ease;
    return std::min(here, 2.0F);
  };
  for (std::size_t f = 0; f < frames; ++f) turn_rate[f] = (turning(f) - 1.0F) * step_m;
  const std::vector<float> turn_m = sum_up(turn_rate);
  for (std::size_t f = 0; f < frames; ++f) {
    const glm::vec2 at = 0.5F * (stances[f].centre_m + stances[(f + 1) % frames].centre_m);
    rate[f] = step_m *
              glm::vec2(turning(f) * at.y, 0.5F * (turn_m[f] + turn_m[f + 1]) - turning(f) * at.x);
  }
  const std::vector<glm::vec2> shift_m2 = sum_up(rate);
  constexpr float kMost = 0.5F * element::kMostShiftM;  // curvature and scale: stance.hpp
  for (std::uint32_t i = 0; i < element::kShiftPhases; ++i) {
    const float at = static_cast<float>(i * frames) / static_cast<float>(element::kShiftPhases);
    const auto f = static_cast<std::size_t>(at);
    const float t = at - static_cast<float>(f);
    const glm::vec3 here(glm::mix(shift_m2[f], shift_m2[f + 1], t),
                         glm::mix(turn_m[f], turn_m[f + 1], t));
    if (!std::isfinite(here.x + here.y + here.z)) continue;
    shift[i] = glm::clamp(here, glm::vec3(-kMost, -kMost, -0.25F), glm::vec3(kMost, kMost, 0.25F));
  }
}

}  // namespace

void add_stance_shift(const Character& character, element::Gait& gait) {
  // a cast of clips alone, as some tests have, walks as it did
  if (character.position.empty() || character.joints.empty() ||
      character.joint_weight.size() < character.position.size()) {
    return;
  }
  const bool has_walk = gait.walk.frame_count != 0;
  fill(character, gait.run, gait.run_stride_m, gait.run_shift);
  fill(character, has_walk ? gait.walk : gait.run,
       has_walk ? gait.walk_stride_m : gait.run_stride_m, gait.walk_shift);
}

}  // namespace throng::render
