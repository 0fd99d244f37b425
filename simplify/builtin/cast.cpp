#include <array>

#include "simplify/builtin/figure.hpp"

namespace throng::builtin {
namespace {

/// A woman's build; what differs from it is set by the member itself.
Figure woman(const char* name) {
  Figure f;
  f.name = name;
  f.feminine = true;
  f.height_m = 1.68F;
  f.shoulder = 0.86F;
  f.chest = 0.88F;
  f.waist = 0.87F;
  f.hip = 1.0F;
  f.bust_m = 0.026F;
  f.arm = 0.84F;
  f.thigh = 0.95F;
  f.neck = 0.85F;
  f.jaw = 0.90F;
  f.nose = 0.8F;
  f.head = 0.97F;
  return f;
}

Figure man(const char* name) {
  Figure f;
  f.name = name;
  return f;
}

Figure child(const char* name) {
  Figure f;
  f.name = name;
  f.age = 0.0F;
  f.height_m = 1.30F;
  f.leg = 0.93F;
  f.head = 1.26F;
  f.shoulder = 0.86F;
  f.chest = 0.90F;
  f.waist = 1.02F;
  f.hip = 0.92F;
  f.arm = 0.92F;
  f.thigh = 0.94F;
  f.neck = 0.90F;
  f.jaw = 0.94F;
  f.nose = 0.6F;
  f.calm = 1.15F;
  return f;
}

void follow(Figure& f, int vertices, int uvs, int joints) {
  f.vertex_count = vertices;
  f.uv_count = uvs;
  f.joint_count = joints;
}

std::array<Figure, 14> make_figures() {
  std::array<Figure, 14> out;
  {
    Figure f = man("commuter");
    follow(f, 2975, 3494, 62);  // Devourer
    f.height_m = 1.79F;
    f.top = TopStyle::kJacket;
    f.collar = CollarStyle::kJacket;
    f.cloth_m = 0.013F;
    f.drape = 0.75F;
    f.hem_z = 0.86F;
    f.sleeve_m = 0.528F;
    f.sleeve_wide = 1.1F;
    f.bottom = BottomStyle::kJeans;
    f.shoe = ShoeStyle::kSneaker;
    f.bag = BagStyle::kMessenger;
    f.hair = HairStyle::kShort;
    f.color.top = {0.70F, 0.70F, 0.70F};
    f.color.bottom = {0.60F, 0.62F, 0.66F};
    f.color.under = {0.30F, 0.34F, 0.42F};
    f.color.bag = {0.36F, 0.26F, 0.18F};
    out[0] = f;
  }
  {
    Figure f = woman("teacher");
    follow(f, 3047, 3746, 44);  // Bug
    f.height_m = 1.67F;
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
    f.belt = true;
    f.pattern = 4;
    f.color.top = f.color.bottom = {0.76F, 0.74F, 0.73F};
    f.color.under = {0.93F, 0.92F, 0.90F};
    f.color.hair = {0.40F, 0.26F, 0.16F};
    f.color.shoe = {0.33F, 0.20F, 0.17F};
    f.color.accent = {0.75F, 0.62F, 0.35F};
    out[1] = f;
  }
  {
    Figure f = man("builder");
    follow(f, 2762, 3257, 49);  // Pangolin
    f.height_m = 1.83F;
    f.shoulder = 1.06F;
    f.chest = 1.08F;
    f.waist = 1.12F;
    f.belly_m = 0.025F;
    f.arm = 1.10F;
    f.jaw = 1.06F;
    f.neck = 1.08F;
    f.hat = HatStyle::kHelmet;
    f.top = TopStyle::kSafetyVest;
    f.collar = CollarStyle::kCrew;
    f.sleeve_m = 0.528F;
    f.cloth_m = 0.012F;
    f.hem_z = 0.85F;
    f.drape = 0.8F;
    f.bottom = BottomStyle::kTrousers;
    f.shoe = ShoeStyle::kBoot;
    f.trouser_z = 0.085F;
    f.trouser_wide = 1.2F;
    f.beard = true;
    f.color.hair = {0.26F, 0.18F, 0.12F};
    f.color.hat = {0.90F, 0.72F, 0.16F};
    f.color.accent = {0.88F, 0.42F, 0.12F};
    f.color.under = {0.82F, 0.84F, 0.32F};
    f.color.shoe = {0.45F, 0.32F, 0.20F};
    f.color.sole = {0.25F, 0.23F, 0.22F};
    f.color.bottom = {0.58F, 0.58F, 0.57F};
    f.rows = 0.9F;
    out[2] = f;
  }
  {
    Figure f = man("manager");
    follow(f, 2936, 3374, 38);  // Spider
    f.height_m = 1.86F;
    f.shoulder = 1.03F;
    f.top = TopStyle::kSuit;
    f.collar = CollarStyle::kShirt;
    f.cloth_m = 0.011F;
    f.drape = 0.6F;
    f.hem_z = 0.845F;
    f.sleeve_m = 0.525F;
    f.bottom = BottomStyle::kTrousers;
    f.shoe = ShoeStyle::kLeather;
    f.hair = HairStyle::kParted;
    f.glasses = true;
    f.color.skin = {0.56F, 0.39F, 0.30F};
    f.color.hair = {0.12F, 0.10F, 0.09F};
    f.color.top = f.color.bottom = {0.62F, 0.63F, 0.66F};
    f.color.under = {0.90F, 0.91F, 0.93F};
    f.color.accent = {0.50F, 0.14F, 0.16F};
    f.color.shoe = {0.16F, 0.11F, 0.09F};
    f.color.sole = {0.12F, 0.10F, 0.09F};
    out[3] = f;
  }
  {
    Figure f = woman("student");
    follow(f, 3328, 4087, 55);  // Daemon
    f.height_m = 1.70F;
    f.age = 0.2F;
    f.hair = HairStyle::kPonytail;
    f.top = TopStyle::kHoodie;
    f.collar = CollarStyle::kHood;
    f.cloth_m = 0.013F;
    f.drape = 0.65F;
    f.hem_z = 0.885F;
    f.sleeve_m = 0.53F;
    f.sleeve_wide = 1.2F;
    f.bag = BagStyle::kBackpack;
    f.bottom = BottomStyle::kLeggings;
    f.shoe = ShoeStyle::kSneaker;
    f.trouser_z = 0.135F;
    f.color.skin = {0.86F, 0.68F, 0.57F};
    f.color.hair = {0.72F, 0.55F, 0.33F};
    f.color.eye = {0.30F, 0.42F, 0.50F};
    f.color.top = {0.74F, 0.74F, 0.75F};
    f.color.bottom = {0.52F, 0.52F, 0.55F};
    f.color.bag = {0.26F, 0.38F, 0.40F};
    f.color.accent = {0.85F, 0.62F, 0.25F};
    f.color.shoe = {0.82F, 0.82F, 0.82F};
    f.columns = 30;
    out[4] = f;
  }
  {
    Figure f = man("grandfather");
    follow(f, 2265, 2649, 46);  // Mutant
    f.height_m = 1.70F;
    f.age = 0.95F;
    f.shoulder = 0.95F;
    f.chest = 0.97F;
    f.waist = 1.10F;
    f.belly_m = 0.030F;
    f.arm = 0.92F;
    f.thigh = 0.92F;
    f.nose = 1.2F;
    f.calm = 0.55F;
    f.pace = 1.08F;
    f.hair = HairStyle::kReceding;
    f.hat = HatStyle::kFlatCap;
    f.moustache = true;
    f.glasses = true;
    f.top = TopStyle::kKnit;
    f.collar = CollarStyle::kShirt;
    f.cloth_m = 0.010F;
    f.drape = 0.7F;
    f.hem_z = 0.875F;
    f.sleeve_m = 0.528F;
    f.bottom = BottomStyle::kTrousers;
    f.shoe = ShoeStyle::kLeather;
    f.color.skin = {0.82F, 0.64F, 0.55F};
    f.color.hair = {0.70F, 0.69F, 0.67F};
    f.color.top = {0.68F, 0.66F, 0.62F};
    f.color.bottom = {0.60F, 0.58F, 0.55F};
    f.color.hat = {0.42F, 0.38F, 0.33F};
    f.color.shoe = {0.30F, 0.19F, 0.12F};
    f.color.sole = {0.15F, 0.12F, 0.10F};
    f.columns = 24;
    f.rows = 0.6F;
    out[5] = f;
  }
  {
    Figure f = woman("grandmother");
    follow(f, 3426, 3990, 45);  // Nasty
    f.height_m = 1.58F;
    f.age = 0.9F;
    f.waist = 1.12F;
    f.hip = 1.10F;
    f.chest = 0.98F;
    f.belly_m = 0.022F;
    f.thigh = 1.05F;
    f.jaw = 0.98F;
    f.nose = 1.0F;
    f.calm = 0.6F;
    f.pace = 1.06F;
    f.hair = HairStyle::kBun;
    f.glasses = true;
    f.top = TopStyle::kKnit;
    f.collar = CollarStyle::kCrew;
    f.cloth_m = 0.010F;
    f.drape = 0.6F;
    f.hem_z = 0.90F;
    f.sleeve_m = 0.50F;
    f.bottom = BottomStyle::kSkirt;
    f.skirt_z = 0.34F;
    f.skirt_flare = 0.6F;
    f.shoe = ShoeStyle::kLeather;
    f.bag = BagStyle::kHandbag;
    f.color.skin = {0.86F, 0.70F, 0.62F};
    f.color.hair = {0.78F, 0.77F, 0.76F};
    f.color.lip = {0.72F, 0.42F, 0.40F};
    f.color.top = {0.74F, 0.72F, 0.74F};
    f.color.bottom = {0.58F, 0.57F, 0.60F};
    f.color.shoe = {0.22F, 0.16F, 0.15F};
    f.color.sole = {0.14F, 0.12F, 0.11F};
    f.color.bag = {0.36F, 0.16F, 0.16F};
    f.columns = 30;
    out[6] = f;
  }
  {
    Figure f = child("schoolboy");
    follow(f, 2555, 2960, 50);  // Fat
    f.height_m = 1.32F;
    f.hat = HatStyle::kCap;
    f.hair = HairStyle::kShort;
    f.top = TopStyle::kTee;
    f.pattern = 1;
    f.cloth_m = 0.010F;
    f.drape = 0.8F;
    f.hem_z = 0.86F;
    f.sleeve_m = 0.22F;
    f.sleeve_wide = 1.3F;
    f.bottom = BottomStyle::kShorts;
    f.trouser_z = 0.50F;
    f.trouser_wide = 1.3F;
    f.shoe = ShoeStyle::kSneaker;
    f.color.skin = {0.84F, 0.64F, 0.52F};
    f.color.hair = {0.50F, 0.34F, 0.20F};
    f.color.hat = {0.24F, 0.36F, 0.60F};
    f.color.top = {0.82F, 0.82F, 0.81F};
    f.color.accent = {0.55F, 0.55F, 0.57F};
    f.color.bottom = {0.60F, 0.60F, 0.59F};
    f.color.shoe = {0.28F, 0.36F, 0.52F};
    f.columns = 24;
    f.rows = 0.7F;
    out[7] = f;
  }
  {
    Figure f = child("schoolgirl");
    follow(f, 2846, 3334, 64);  // Alien
    f.height_m = 1.24F;
    f.feminine = true;
    f.hair = HairStyle::kBob;
    f.top = TopStyle::kDress;
    f.collar = CollarStyle::kCrew;
    f.cloth_m = 0.006F;
    f.drape = 0.2F;
    f.hem_z = 1.04F;
    f.sleeve_m = 0.16F;
    f.sleeve_wide = 1.4F;
    f.bottom = BottomStyle::kSkirt;
    f.skirt_z = 0.58F;
    f.skirt_flare = 1.4F;
    f.shoe = ShoeStyle::kSneaker;
    f.color.skin = {0.70F, 0.50F, 0.38F};
    f.color.hair = {0.16F, 0.11F, 0.09F};
    f.color.top = {0.80F, 0.78F, 0.78F};
    f.color.bottom = {0.80F, 0.78F, 0.78F};
    f.color.accent = {0.70F, 0.36F, 0.42F};
    f.color.shoe = {0.74F, 0.42F, 0.48F};
    f.columns = 26;
    f.rows = 0.8F;
    out[8] = f;
  }
  {
    Figure f = woman("runner");
    follow(f, 2483, 2851, 67);  // Creepy
    f.height_m = 1.73F;
    f.waist = 0.84F;
    f.thigh = 0.98F;
    f.hair = HairStyle::kPonytail;
    f.top = TopStyle::kSport;
    f.collar = CollarStyle::kScoop;
    f.cloth_m = 0.006F;
    f.drape = 0.15F;
    f.hem_z = 0.90F;
    f.sleeve_m = 0.0F;
    f.bottom = BottomStyle::kLeggings;
    f.trouser_z = 0.20F;
    f.shoe = ShoeStyle::kSneaker;
    f.calm = 1.1F;
    f.color.skin = {0.46F, 0.31F, 0.23F};
    f.color.hair = {0.10F, 0.08F, 0.07F};
    f.color.lip = {0.48F, 0.25F, 0.24F};
    f.color.top = {0.78F, 0.78F, 0.78F};
    f.color.bottom = {0.50F, 0.50F, 0.54F};
    f.color.accent = {0.86F, 0.50F, 0.20F};
    f.color.shoe = {0.86F, 0.45F, 0.25F};
    f.columns = 24;
    f.rows = 0.75F;
    out[9] = f;
  }
  {
    Figure f = man("tourist");
    follow(f, 2594, 3103, 62);  // Rock
    f.height_m = 1.74F;
    f.shoulder = 1.04F;
    f.chest = 1.14F;
    f.waist = 1.30F;
    f.hip = 1.12F;
    f.belly_m = 0.085F;
    f.arm = 1.18F;
    f.thigh = 1.15F;
    f.neck = 1.18F;
    f.jaw = 1.12F;
    f.hair = HairStyle::kReceding;
    f.hat = HatStyle::kSunHat;
    f.top = TopStyle::kShirt;
    f.collar = CollarStyle::kShirt;
    f.pattern = 2;
    f.cloth_m = 0.010F;
    f.drape = 0.9F;
    f.hem_z = 0.85F;
    f.sleeve_m = 0.23F;
    f.sleeve_wide = 1.4F;
    f.bottom = BottomStyle::kShorts;
    f.trouser_z = 0.48F;
    f.trouser_wide = 1.25F;
    f.shoe = ShoeStyle::kSneaker;
    f.color.skin = {0.85F, 0.62F, 0.52F};
    f.color.hair = {0.45F, 0.32F, 0.22F};
    f.color.hat = {0.82F, 0.74F, 0.56F};
    f.color.accent = {0.28F, 0.24F, 0.22F};
    f.color.top = {0.80F, 0.80F, 0.79F};
    f.color.bottom = {0.64F, 0.61F, 0.56F};
    f.color.shoe = {0.55F, 0.48F, 0.38F};
    f.columns = 24;
    f.rows = 0.7F;
    out[10] = f;
  }
  {
    Figure f = woman("pharmacist");
    follow(f, 3261, 3867, 45);  // Titan
    f.height_m = 1.65F;
    f.hat = HatStyle::kHeadscarf;
    f.collar = CollarStyle::kScarf;
    f.top = TopStyle::kCoat;
    f.cloth_m = 0.012F;
    f.drape = 0.3F;
    f.hem_z = 0.42F;
    f.sleeve_m = 0.53F;
    f.belt = true;
    f.bottom = BottomStyle::kTrousers;
    f.trouser_wide = 1.1F;
    f.shoe = ShoeStyle::kFlat;
    f.color.skin = {0.76F, 0.57F, 0.45F};
    f.color.hair = {0.14F, 0.10F, 0.08F};
    f.color.scarf = {0.30F, 0.42F, 0.50F};
    f.color.top = {0.74F, 0.72F, 0.69F};
    f.color.under = {0.85F, 0.83F, 0.80F};
    f.color.bottom = {0.48F, 0.48F, 0.50F};
    f.color.shoe = {0.20F, 0.17F, 0.17F};
    f.columns = 30;
    out[11] = f;
  }
  {
    Figure f = man("musician");
    follow(f, 2489, 2982, 48);  // Ripper Dog
    f.height_m = 1.92F;
    f.shoulder = 0.98F;
    f.chest = 0.94F;
    f.waist = 0.94F;
    f.arm = 0.92F;
    f.thigh = 0.92F;
    f.leg = 1.04F;
    f.hair = HairStyle::kAfro;
    f.top = TopStyle::kTee;
    f.pattern = 3;
    f.collar = CollarStyle::kScarf;
    f.cloth_m = 0.009F;
    f.drape = 0.5F;
    f.hem_z = 0.88F;
    f.sleeve_m = 0.525F;
    f.bottom = BottomStyle::kJeans;
    f.trouser_wide = 0.8F;
    f.shoe = ShoeStyle::kLeather;

    f.color.skin = {0.40F, 0.27F, 0.20F};
    f.color.hair = {0.11F, 0.085F, 0.07F};
    f.color.lip = {0.42F, 0.24F, 0.23F};
    f.color.scarf = {0.66F, 0.50F, 0.24F};
    f.color.accent = {0.30F, 0.30F, 0.32F};
    f.color.top = {0.74F, 0.74F, 0.74F};
    f.color.bottom = {0.54F, 0.55F, 0.59F};
    f.color.shoe = {0.20F, 0.16F, 0.14F};
    f.color.sole = {0.14F, 0.12F, 0.11F};
    f.columns = 24;
    f.rows = 0.7F;
    out[12] = f;
  }
  {
    Figure f = woman("clerk");
    follow(f, 2481, 2939, 55);  // Troll
    f.height_m = 1.71F;
    f.hair = HairStyle::kBun;
    f.top = TopStyle::kSuit;
    f.collar = CollarStyle::kShirt;
    f.cloth_m = 0.009F;
    f.drape = 0.1F;
    f.hem_z = 0.92F;
    f.sleeve_m = 0.50F;
    f.bottom = BottomStyle::kTrousers;
    f.trouser_wide = 0.6F;
    f.shoe = ShoeStyle::kFlat;
    f.color.skin = {0.82F, 0.63F, 0.50F};
    f.color.hair = {0.09F, 0.075F, 0.07F};
    f.color.top = {0.68F, 0.67F, 0.68F};
    f.color.under = {0.90F, 0.88F, 0.86F};
    f.color.bottom = {0.60F, 0.59F, 0.60F};
    f.color.shoe = {0.18F, 0.14F, 0.14F};
    f.color.accent = {0.70F, 0.60F, 0.40F};
    f.columns = 24;
    f.rows = 0.7F;
    out[13] = f;
  }
  return out;
}

}  // namespace

std::span<const Figure> figures() {
  static const auto kFigures = make_figures();
  return kFigures;
}

}  // namespace throng::builtin
