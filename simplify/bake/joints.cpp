#include "simplify/bake/joints.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace throng::simplify {

void quantize_weights(const SourcePoint& point, glm::u8vec4& joint, glm::u8vec4& weight) {
  struct Share {
    std::uint32_t joint;
    float weight;
    int units;
  };
  std::array<Share, 4> shares{};
  std::size_t count = 0;
  float sum = 0.0F;
  for (int i = 0; i < 4; ++i) {
    if (!(point.weight[i] > 0.0F)) continue;
    sum += point.weight[i];
    const auto same = std::find_if(shares.begin(), shares.begin() + count, [&](const Share& share) {
      return share.joint == point.joint[i];
    });
    if (same != shares.begin() + count) {
      same->weight += point.weight[i];
    } else {
      shares[count++] = {point.joint[i], point.weight[i], 0};
    }
  }
  if (count == 0) {
    shares[count++] = {point.joint[0], 1.0F, 0};
    sum = 1.0F;
  }
  int rest = 255;
  for (std::size_t i = 0; i < count; ++i) {
    shares[i].weight *= 255.0F / sum;
    shares[i].units = static_cast<int>(std::floor(shares[i].weight));
    rest -= shares[i].units;
  }
  for (; rest > 0; --rest) {
    const auto largest = std::max_element(
        shares.begin(), shares.begin() + count, [](const Share& a, const Share& b) {
          return a.weight - static_cast<float>(a.units) < b.weight - static_cast<float>(b.units);
        });
    ++largest->units;
  }
  for (; rest < 0; ++rest)
    --std::max_element(shares.begin(), shares.begin() + count, [](const Share& a, const Share& b) {
        return a.units < b.units;
      })->units;
  std::stable_sort(shares.begin(), shares.begin() + count,
                   [](const Share& a, const Share& b) { return a.units > b.units; });
  joint = glm::u8vec4(0);
  weight = glm::u8vec4(0);
  for (std::size_t i = 0; i < count; ++i) {
    if (shares[i].units == 0) break;
    joint[static_cast<int>(i)] = static_cast<std::uint8_t>(shares[i].joint);
    weight[static_cast<int>(i)] = static_cast<std::uint8_t>(shares[i].units);
  }
}

absl::Status limit_joints(SourceCharacter& source, std::vector<std::string>& notes) {
  constexpr std::size_t kLimit = 256;
  const std::size_t joints = source.joints.size();
  if (joints <= kLimit) return absl::OkStatus();
  std::vector<bool> is_used(joints, false);
  for (const SourcePoint& point : source.points) {
    for (int k = 0; k < 4; ++k) {
      if (point.weight[k] > 0.0F && point.joint[k] < joints) is_used[point.joint[k]] = true;
    }
  }
  const auto used = static_cast<std::size_t>(std::count(is_used.begin(), is_used.end(), true));
  if (used > kLimit) {
    return absl::InvalidArgumentError(
        absl::StrCat("the skin uses ", used, " joints, limit ", kLimit));
  }
  // palettes are in the model frame, so a joint doesn't need its parents
  std::vector<std::int32_t> kept(joints, -1);
  std::vector<SourceJoint> result;
  for (std::size_t j = 0; j < joints; ++j) {
    if (!is_used[j]) continue;
    kept[j] = static_cast<std::int32_t>(result.size());
    SourceJoint joint = source.joints[j];
    while (joint.parent >= 0 && kept[joint.parent] < 0)
      joint.parent = source.joints[joint.parent].parent;
    if (joint.parent >= 0) joint.parent = kept[joint.parent];
    result.push_back(std::move(joint));
  }
  for (SourceClip& clip : source.clips) {
    if (clip.model_from_joint.size() != std::size_t{clip.frame_count} * joints)
      continue;  // reported later
    std::vector<glm::mat4> matrices;
    for (std::size_t i = 0; i < clip.model_from_joint.size(); ++i) {
      if (is_used[i % joints]) matrices.push_back(clip.model_from_joint[i]);
    }
    clip.model_from_joint = std::move(matrices);
  }
  for (SourcePoint& point : source.points) {
    for (int k = 0; k < 4; ++k) {
      if (point.joint[k] >= joints) continue;
      const std::int32_t joint = kept[point.joint[k]];
      point.joint[k] = static_cast<std::uint16_t>(std::max(0, joint));
    }
  }
  source.joints = std::move(result);
  notes.push_back(absl::StrCat(joints - used, " joints that move nothing left out"));
  return absl::OkStatus();
}

void scale(SourceCharacter& source, float factor) {
  for (SourcePoint& point : source.points) point.position *= factor;
  glm::mat4 source_from_scaled(1.0F), scaled_from_source(1.0F);
  for (int i = 0; i < 3; ++i) {
    source_from_scaled[i][i] = 1.0F / factor;
    scaled_from_source[i][i] = factor;
  }
  for (SourceJoint& joint : source.joints)
    joint.joint_from_model = joint.joint_from_model * source_from_scaled;
  for (SourceClip& clip : source.clips) {
    for (glm::mat4& matrix : clip.model_from_joint) matrix = scaled_from_source * matrix;
    clip.stride_m *= factor;
  }
}

}  // namespace throng::simplify
