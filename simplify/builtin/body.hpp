#pragma once

#include <vector>

#include "simplify/builtin/figure.hpp"
#include "simplify/builtin/mesh.hpp"

namespace throng::builtin {

/// Charts of the texture. Left and right have their own texels.
enum Chart : std::uint8_t {
  kChartHead,
  kChartTorsoFront,
  kChartTorsoBack,
  kChartArmLeft,
  kChartArmRight,
  kChartHandLeft,
  kChartHandRight,
  kChartPalmLeft,
  kChartPalmRight,
  kChartLegLeft,
  kChartLegRight,
  kChartShoeLeft,
  kChartShoeRight,
  kChartSoleLeft,
  kChartSoleRight,
  kChartSkirtFront,
  kChartSkirtBack,
  kChartHair,
  kChartHat,
  kChartBag,
  kChartCount,
};

/// Landmarks of the canonical figure (1.78 m, A-pose), metres.
struct Landmarks {
  glm::vec3 hips{0.0F, 0.0F, 0.95F};
  glm::vec3 spine1{-0.012F, 0.0F, 1.05F};
  glm::vec3 spine2{-0.018F, 0.0F, 1.17F};
  glm::vec3 spine3{-0.022F, 0.0F, 1.30F};
  glm::vec3 neck{-0.018F, 0.0F, 1.49F};
  glm::vec3 head{0.002F, 0.0F, 1.575F};
  glm::vec3 shoulder{-0.008F, 0.178F, 1.435F};
  glm::vec3 arm_direction{0.0F, 0.5F, -0.8660254F};  // 60 degrees below the horizontal
  float elbow_m = 0.285F;                            // along the arm from the shoulder joint
  float wrist_m = 0.535F;
  float knuckle_m = 0.632F;
  glm::vec3 hip_joint{0.0F, 0.092F, 0.93F};
  glm::vec3 knee{0.008F, 0.090F, 0.50F};
  glm::vec3 ankle{-0.022F, 0.086F, 0.085F};
  glm::vec3 ball{0.105F, 0.094F, 0.022F};
};

struct Body {
  Mesh mesh;                            // canonical
  std::vector<std::vector<int>> slits;  // vertex paths that start on a seam; optional extra cuts
};

Landmarks landmarks_of(const Figure& figure);

/// Height of the hairline in the direction of canonical `position` from the axis of the head.
float hair_line(const Figure& figure, const glm::vec3& position);

/// How much of the head at canonical `position` is under hair, under the hat or under a headscarf,
/// in [0, 1]. Shared by the modeller (relief) and the painter (colour), so that both agree.
float hair_cover(const Figure& figure, const glm::vec3& position);
float hat_cover(const Figure& figure, const glm::vec3& position);

/// Models the figure as one closed surface: trunk, head, limbs, hands and shoes are tubes of rings;
/// hems and cuffs are folds of a tube; ears, fingers, hair, hat brims and bags are extruded.
Body make_body(const Figure& figure);

/// Canonical position to model position: leg length, head size and height of the figure.
glm::vec3 to_model(const Figure& figure, const glm::vec3& canonical, Part part);

}  // namespace throng::builtin
