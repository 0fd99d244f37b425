#pragma once

#include <glm/glm.hpp>
#include <span>
#include <string>

namespace throng::builtin {

enum class HairStyle { kShort, kParted, kReceding, kBald, kBob, kLong, kPonytail, kBun, kAfro };
enum class HatStyle { kNone, kCap, kBeanie, kHelmet, kFlatCap, kSunHat, kHeadscarf };
enum class CollarStyle { kCrew, kShirt, kJacket, kHood, kScarf, kScoop };
enum class TopStyle {
  kTee,
  kShirt,
  kJacket,
  kSuit,
  kHoodie,
  kCoat,
  kKnit,
  kDress,
  kSafetyVest,
  kSport
};
enum class BottomStyle { kJeans, kTrousers, kShorts, kSkirt, kLeggings };
enum class ShoeStyle { kSneaker, kLeather, kBoot, kFlat };
enum class BagStyle { kNone, kBackpack, kMessenger, kHandbag };

/// Colours are sRGB in [0, 1].
struct Palette {
  glm::vec3 skin{0.78F, 0.58F, 0.47F};
  glm::vec3 hair{0.36F, 0.26F, 0.19F};
  glm::vec3 top{0.74F, 0.74F, 0.74F};     // tinted at run time, so a light neutral
  glm::vec3 under{0.85F, 0.84F, 0.81F};   // shirt under a jacket; not tinted
  glm::vec3 accent{0.55F, 0.20F, 0.18F};  // tie, stripe, belt buckle, print
  glm::vec3 bottom{0.66F, 0.66F, 0.68F};  // tinted at run time
  glm::vec3 shoe{0.22F, 0.20F, 0.19F};
  glm::vec3 sole{0.80F, 0.79F, 0.76F};
  glm::vec3 hat{0.30F, 0.33F, 0.42F};
  glm::vec3 bag{0.30F, 0.25F, 0.20F};
  glm::vec3 scarf{0.62F, 0.30F, 0.28F};
  glm::vec3 eye{0.28F, 0.20F, 0.14F};
  glm::vec3 lip{0.72F, 0.43F, 0.38F};
};

/// Everything that makes one member of the cast differ from the others. Lengths are metres on a
/// canonical figure 1.78 m tall; factors multiply the canonical measure.
struct Figure {
  std::string name;
  // the row of Dong & Peng (2019), table 1, that the mesh and the skeleton follow
  int vertex_count = 0;
  int uv_count = 0;
  int joint_count = 0;

  // build
  float height_m = 1.78F;
  float leg = 1.0F;       // length below the crotch
  float head = 1.0F;      // size of the head
  float shoulder = 1.0F;  // breadth
  float chest = 1.0F;
  float waist = 1.0F;
  float hip = 1.0F;
  float belly_m = 0.0F;
  float bust_m = 0.0F;
  float arm = 1.0F;    // thickness
  float thigh = 1.0F;  // thickness of the leg
  float neck = 1.0F;
  float jaw = 1.0F;  // breadth of the lower face
  float nose = 1.0F;
  float age = 0.3F;  // 0 child, 0.3 adult, 1 old: lines, grey, posture
  bool feminine = false;

  // clothes
  TopStyle top = TopStyle::kTee;
  CollarStyle collar = CollarStyle::kCrew;
  BottomStyle bottom = BottomStyle::kJeans;
  ShoeStyle shoe = ShoeStyle::kSneaker;
  HairStyle hair = HairStyle::kShort;
  HatStyle hat = HatStyle::kNone;
  BagStyle bag = BagStyle::kNone;
  float cloth_m = 0.008F;  // stand-off of the top
  float drape = 0.35F;     // 0 follows the waist, 1 hangs straight
  float hem_z = 0.86F;     // lower edge of the top; above 1.0: tucked in
  float sleeve_m = 0.20F;  // length from the shoulder joint; 0 none, 0.53 to the wrist
  float sleeve_wide = 1.0F;
  float trouser_z = 0.062F;  // lower edge of the trousers or shorts
  float trouser_wide = 1.0F;
  float skirt_z = 0.48F;
  float skirt_flare = 1.0F;
  bool beard = false;
  bool moustache = false;
  bool glasses = false;
  bool belt = false;
  int pattern = 0;  // of the top: 0 plain, 1 stripes, 2 checks, 3 print, 4 dots, 5 yoke

  Palette color;

  // mesh
  int columns = 28;   // around the trunk; even
  float rows = 1.0F;  // density along tubes
  float calm = 1.0F;  // amplitude of arms and trunk in the clips
  float pace = 1.0F;  // stretches the duration of the walk
};

/// The cast, in the order of the table.
std::span<const Figure> figures();

}  // namespace throng::builtin
