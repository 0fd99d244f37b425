#include <array>

#include "simplify/builtin/figure.hpp"

namespace throng::builtin {
namespace {

std::array<Figure, 3> make_figures() {
  std::array<Figure, 3> out;
  {
    Figure& f = out[0];  // table 1: Spider
    f.name = "neighbour";
    f.vertex_count = 2936;
    f.uv_count = 3374;
    f.joint_count = 38;
    f.color.top = {0.72F, 0.72F, 0.73F};
    f.hem_z = 0.875F;
    f.drape = 0.6F;
  }
  {
    Figure& f = out[1];  // table 1: Fat
    f.name = "teacher";
    f.vertex_count = 2555;
    f.uv_count = 2960;
    f.joint_count = 50;
    f.feminine = true;
    f.height_m = 1.68F;
    f.shoulder = 0.86F;
    f.chest = 0.88F;
    f.waist = 0.86F;
    f.hip = 1.0F;
    f.bust_m = 0.026F;
    f.arm = 0.84F;
    f.thigh = 0.94F;
    f.neck = 0.86F;
    f.jaw = 0.90F;
    f.nose = 0.8F;
    f.head = 0.97F;
    f.hair = HairStyle::kLong;
    f.top = TopStyle::kDress;
    f.collar = CollarStyle::kScoop;
    f.bottom = BottomStyle::kSkirt;
    f.shoe = ShoeStyle::kFlat;
    f.hem_z = 1.04F;
    f.cloth_m = 0.005F;
    f.drape = 0.0F;
    f.sleeve_m = 0.12F;
    f.skirt_z = 0.50F;
    f.columns = 26;
    f.rows = 0.7F;
  }
  {
    Figure& f = out[2];  // table 1: Mutant
    f.name = "builder";
    f.vertex_count = 2265;
    f.uv_count = 2649;
    f.joint_count = 46;
    f.height_m = 1.82F;
    f.shoulder = 1.06F;
    f.chest = 1.08F;
    f.waist = 1.12F;
    f.belly_m = 0.03F;
    f.arm = 1.10F;
    f.hat = HatStyle::kHelmet;
    f.top = TopStyle::kSafetyVest;
    f.collar = CollarStyle::kCrew;
    f.sleeve_m = 0.53F;
    f.cloth_m = 0.012F;
    f.hem_z = 0.84F;
    f.drape = 0.8F;
    f.shoe = ShoeStyle::kBoot;
    f.trouser_z = 0.10F;
    f.trouser_wide = 1.2F;
    f.columns = 24;
    f.rows = 0.62F;
    f.beard = true;
    f.color.hat = {0.88F, 0.70F, 0.16F};
    f.color.accent = {0.86F, 0.40F, 0.12F};
    f.color.under = {0.80F, 0.82F, 0.30F};
    f.color.shoe = {0.45F, 0.32F, 0.20F};
  }
  return out;
}

}  // namespace

std::span<const Figure> figures() {
  static const auto kFigures = make_figures();
  return kFigures;
}

}  // namespace throng::builtin
