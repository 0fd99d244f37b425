#include "simplify/builtin/body.hpp"

#include <algorithm>
#include <cmath>

namespace throng::builtin {
namespace {

constexpr float kPi = 3.14159265F;
constexpr int kArmColumns = 12;  // rim of a patch of 4 x 2 faces of the trunk

float smooth_step(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

float bell(float x, float width) { return std::exp(-(x / width) * (x / width)); }

/// A table of rows sorted by their first column, read by Catmull-Rom interpolation.
template <std::size_t Columns, std::size_t Rows>
float look_up(const float (&table)[Rows][Columns], std::size_t column, float at) {
  std::size_t i = 0;
  const bool rising = table[Rows - 1][0] > table[0][0];
  while (i + 2 < Rows && (rising ? at > table[i + 1][0] : at < table[i + 1][0])) ++i;
  const float span = table[i + 1][0] - table[i][0];
  const float t = std::clamp((at - table[i][0]) / span, 0.0F, 1.0F);
  const float p1 = table[i][column], p2 = table[i + 1][column];
  const float m1 =
      i > 0 ? (p2 - table[i - 1][column]) / (table[i + 1][0] - table[i - 1][0]) * span : p2 - p1;
  const float m2 =
      i + 2 < Rows ? (table[i + 2][column] - p1) / (table[i + 2][0] - table[i][0]) * span : p2 - p1;
  const float t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * p1 + (t3 - 2 * t2 + t) * m1 + (3 * t2 - 2 * t3) * p2 +
         (t3 - t2) * m2;
}

/// One cross-section: its foremost, side and rearmost point, and how square it is between them.
struct Section {
  float xf = 0, zf = 0;          // front
  float xs = 0, ys = 0, zs = 0;  // side
  float xb = 0, zb = 0;          // back
  float power = 2.3F;            // 2 is an ellipse
  float dense = 0.0F;            // 1 gathers columns at the face
};

Section mix(const Section& a, const Section& b, float t) {
  Section out;
  const float* pa = &a.xf;
  const float* pb = &b.xf;
  float* po = &out.xf;
  for (int i = 0; i < 9; ++i) po[i] = pa[i] + (pb[i] - pa[i]) * t;
  return out;
}

glm::vec3 section_point(const Section& s, float column, int columns) {
  const float t = column / static_cast<float>(columns);
  const float warp = t - s.dense * 0.55F * std::sin(2.0F * kPi * t) / (2.0F * kPi);
  const float theta = 2.0F * kPi * warp;
  const float c = std::cos(theta), si = std::sin(theta);
  const float cp = std::copysign(std::pow(std::abs(c), 2.0F / s.power), c);
  const float sp = std::copysign(std::pow(std::abs(si), 2.0F / s.power), si);
  const bool front = c >= 0.0F;
  const float w = std::abs(cp);
  // the line of heights between side and end is eased, so that hems and jaws run smoothly
  const float wz = c * c;
  return {s.xs + ((front ? s.xf : s.xb) - s.xs) * w, s.ys * sp,
          s.zs + ((front ? s.zf : s.zb) - s.zs) * wz};
}

enum class Zone { kPelvis, kTrunk, kHead, kSkirt };

struct Key {
  Section section;
  Region region = Region::kTop;  // of the faces up to the next key
  Zone zone = Zone::kTrunk;
  int split = 0;  // rows up to the next key; 0: by length
};

// z, half breadth, front, back; a lean adult in the skin
constexpr float kTrunk[][4] = {{0.30F, 0.150F, 0.100F, -0.110F}, {0.60F, 0.162F, 0.096F, -0.108F},
                               {0.83F, 0.168F, 0.090F, -0.112F}, {0.88F, 0.173F, 0.098F, -0.120F},
                               {0.93F, 0.172F, 0.103F, -0.121F}, {0.98F, 0.163F, 0.103F, -0.109F},
                               {1.04F, 0.151F, 0.100F, -0.092F}, {1.10F, 0.145F, 0.099F, -0.086F},
                               {1.16F, 0.148F, 0.101F, -0.091F}, {1.22F, 0.157F, 0.107F, -0.102F},
                               {1.28F, 0.165F, 0.114F, -0.112F}, {1.345F, 0.166F, 0.114F, -0.117F}};

// along the arm, half height, half depth
constexpr float kArm[][3] = {{0.00F, 0.062F, 0.066F}, {0.04F, 0.057F, 0.060F},
                             {0.09F, 0.049F, 0.053F}, {0.15F, 0.044F, 0.049F},
                             {0.22F, 0.039F, 0.043F}, {0.285F, 0.036F, 0.039F},
                             {0.33F, 0.038F, 0.040F}, {0.39F, 0.036F, 0.037F},
                             {0.46F, 0.029F, 0.032F}, {0.535F, 0.022F, 0.028F}};

// z, front, back, half breadth about the axis of the leg
constexpr float kLeg[][4] = {{0.83F, 0.092F, -0.098F, 0.086F}, {0.78F, 0.090F, -0.093F, 0.083F},
                             {0.72F, 0.086F, -0.087F, 0.078F}, {0.64F, 0.078F, -0.078F, 0.071F},
                             {0.56F, 0.068F, -0.066F, 0.062F}, {0.50F, 0.062F, -0.056F, 0.056F},
                             {0.45F, 0.052F, -0.058F, 0.053F}, {0.38F, 0.043F, -0.070F, 0.056F},
                             {0.30F, 0.038F, -0.066F, 0.051F}, {0.22F, 0.034F, -0.053F, 0.042F},
                             {0.14F, 0.032F, -0.042F, 0.035F}, {0.09F, 0.034F, -0.044F, 0.035F}};

Section trunk(const Figure& figure, float z, float offset) {
  const float breadth = look_up(kTrunk, 1, z);
  const float hip = 1.0F - smooth_step(0.94F, 1.07F, z);
  const float chest = smooth_step(1.12F, 1.27F, z);
  const float waist = 1.0F - hip - chest;
  const float factor = hip * figure.hip + chest * figure.chest + waist * figure.waist;
  const float depth = 0.5F + 0.5F * factor;
  Section s;
  s.ys = breadth * factor;
  s.xf = look_up(kTrunk, 2, z) * depth;
  s.xb = look_up(kTrunk, 3, z) * depth;
  // a belly hangs forward and a little to the sides
  const float belly = figure.belly_m * bell(z - 1.07F, z < 1.07F ? 0.11F : 0.16F);
  s.xf += belly;
  s.ys += belly * 0.45F;
  s.xb -= belly * 0.15F;
  s.xf += offset;
  s.ys += offset;
  s.xb -= offset;
  s.xs = (s.xf + s.xb) * 0.35F;
  s.zf = s.zs = s.zb = z;
  return s;
}

/// The top hangs from the chest over the hips rather than following the waist.
Section draped(const Figure& figure, float z, float offset) {
  Section s = trunk(figure, z, offset);
  const Section high = trunk(figure, 1.30F, offset), low = trunk(figure, 0.92F, offset);
  const float t = std::clamp((1.30F - z) / 0.38F, 0.0F, 1.0F);
  const Section line = mix(high, low, t);
  const float drape = figure.drape * (z < 1.30F ? 1.0F : 0.0F);
  s.xf = glm::mix(s.xf, std::max(s.xf, line.xf), drape);
  s.ys = glm::mix(s.ys, std::max(s.ys, line.ys), drape);
  s.xb = glm::mix(s.xb, std::min(s.xb, line.xb), drape);
  return s;
}

Section lifted(Section s, float out, float up) {
  s.xf += out;
  s.xb -= out;
  s.ys += out;
  s.zf += up;
  s.zs += up;
  s.zb += up;
  return s;
}

bool has_skirt(const Figure& figure) { return figure.bottom == BottomStyle::kSkirt; }
bool is_tucked(const Figure& figure) { return figure.hem_z > 1.0F; }

/// Sections of the trunk from the crotch to the crown, bottom to top.
struct TrunkKeys {
  std::vector<Key> keys;
  std::size_t arm_low = 0;     // first of the three keys that the arm grows from
  std::size_t head_start = 0;  // first key of the head chart
};

TrunkKeys trunk_keys(const Figure& figure) {
  TrunkKeys out;
  const auto add = [&](const Section& s, Region region, Zone zone, int split = 0) {
    out.keys.push_back({s, region, zone, split});
  };
  const float cloth = figure.cloth_m;
  const bool skirt = has_skirt(figure);
  const Region under = skirt ? Region::kLining : Region::kBottom;
  const float fit = skirt ? 0.0F : 0.006F;

  // crotch: higher in front and at the sides than between the legs
  Section crotch = trunk(figure, 0.875F, fit);
  crotch.zf = 0.890F;
  crotch.zb = 0.868F;
  add(crotch, under, skirt ? Zone::kSkirt : Zone::kPelvis);

  if (skirt) {
    // inside of the skirt goes down to the hem, outside comes back up
    const float z = figure.skirt_z, flare = figure.skirt_flare;
    Section hem = trunk(figure, z, 0.0F);
    const float spread = 0.020F + 0.055F * flare * (0.93F - z) / 0.45F;
    hem.ys = 0.172F * figure.hip + spread * 0.8F;
    hem.xf = 0.103F + spread * 1.25F;
    hem.xb = -0.121F - spread * 1.15F;
    Section mid = mix(crotch, hem, 0.5F);
    add(lifted(mid, 0.004F, 0.0F), Region::kLining, Zone::kSkirt, 1);
    add(lifted(hem, -0.008F, 0.004F), Region::kLining, Zone::kSkirt, 1);
    add(hem, Region::kBottom, Zone::kSkirt, 1);
    add(lifted(mix(hem, trunk(figure, 0.93F, 0.012F), 0.06F), 0.001F, 0.0F), Region::kBottom,
        Zone::kSkirt);
    const int steps = 3;
    for (int i = 1; i < steps; ++i) {
      const float t = static_cast<float>(i) / steps;
      Section s = mix(hem, trunk(figure, 0.93F, 0.012F), t);
      // the cloth falls from the hips, so it is fuller there than a cone
      s = lifted(s, 0.012F * std::sin(t * kPi), 0.0F);
      add(s, Region::kBottom, Zone::kSkirt);
    }
    add(trunk(figure, 0.94F, 0.012F), Region::kBottom, Zone::kSkirt);
    if (is_tucked(figure)) {
      add(trunk(figure, 1.01F, 0.010F), Region::kBottom, Zone::kSkirt);
      add(trunk(figure, 1.055F, 0.010F), Region::kBottom, Zone::kSkirt, 1);
      add(trunk(figure, 1.062F, 0.006F + cloth * 0.3F), Region::kTop, Zone::kTrunk, 1);
    } else {
      add(trunk(figure, figure.hem_z + 0.03F, 0.010F), Region::kBottom, Zone::kSkirt, 1);
      add(draped(figure, figure.hem_z + 0.002F, 0.012F), Region::kLining, Zone::kTrunk, 1);
      add(draped(figure, figure.hem_z, cloth + 0.014F), Region::kTop, Zone::kTrunk, 1);
      add(draped(figure, figure.hem_z + 0.025F, cloth + 0.010F), Region::kTop, Zone::kTrunk);
    }
  } else if (is_tucked(figure)) {
    add(trunk(figure, 0.93F, fit), Region::kBottom, Zone::kPelvis);
    add(trunk(figure, 0.98F, fit), Region::kBottom, Zone::kPelvis);
    add(trunk(figure, 1.03F, 0.008F), Region::kBottom, Zone::kPelvis, 1);
    add(trunk(figure, 1.036F, 0.004F + cloth * 0.4F), Region::kTop, Zone::kTrunk, 1);
    add(draped(figure, 1.065F, cloth + 0.006F), Region::kTop, Zone::kTrunk);
  } else {
    const float hem = figure.hem_z;
    const float fall = std::max(0.0F, 0.86F - hem);  // a coat clears the thighs
    const float flare = 0.10F * fall + (fall > 0.0F ? 0.008F : 0.0F);
    add(trunk(figure, std::max(0.935F, hem + 0.05F), fit + 0.002F), Region::kLining, Zone::kPelvis,
        1);
    if (fall > 0.1F) {
      add(lifted(draped(figure, hem + 0.16F, fit + 0.010F), flare * 0.6F, 0.0F), Region::kLining,
          Zone::kTrunk, 1);
    }
    add(lifted(draped(figure, hem + 0.004F, cloth + 0.004F), flare, 0.0F), Region::kLining,
        Zone::kTrunk, 1);
    add(lifted(draped(figure, hem, cloth + 0.012F), flare, 0.0F), Region::kTop, Zone::kTrunk, 1);
    add(lifted(draped(figure, hem + 0.024F, cloth + 0.009F), flare * 0.97F, 0.0F), Region::kTop,
        Zone::kTrunk);
    if (fall > 0.05F) {
      add(lifted(draped(figure, hem + 0.5F * (0.92F - hem), cloth + 0.007F), flare * 0.6F, 0.0F),
          Region::kTop, Zone::kTrunk);
      add(draped(figure, 0.93F, cloth + 0.005F), Region::kTop, Zone::kTrunk);
    }
  }
  const float start = out.keys.back().section.zf;
  for (const float z : {0.985F, 1.04F, 1.10F, 1.16F, 1.22F, 1.285F}) {
    if (z > start + 0.02F) add(draped(figure, z, cloth), Region::kTop, Zone::kTrunk);
  }

  // shoulders: the side of the section climbs over the joint and runs to the neck
  const float sh = figure.shoulder, chest = figure.chest;
  out.arm_low = out.keys.size();
  Section arm0 = draped(figure, 1.345F, cloth);
  arm0.zs = 1.352F;
  arm0.ys = 0.168F * std::max(chest, sh) + cloth;
  add(arm0, Region::kTop, Zone::kTrunk, 1);
  Section arm1;
  arm1.xf = 0.106F * (0.5F + 0.5F * chest) + cloth;
  arm1.xb = -0.119F * (0.5F + 0.5F * chest) - cloth;
  arm1.ys = 0.176F * sh + cloth;
  arm1.xs = -0.008F;
  arm1.zf = 1.395F;
  arm1.zs = 1.425F;
  arm1.zb = 1.402F;
  arm1.power = 2.5F;
  add(arm1, Region::kTop, Zone::kTrunk, 1);
  Section arm2 = arm1;
  arm2.xf = 0.090F * (0.5F + 0.5F * chest) + cloth;
  arm2.xb = -0.112F * (0.5F + 0.5F * chest) - cloth;
  arm2.ys = 0.152F * sh;
  arm2.zf = 1.432F;
  arm2.zs = 1.476F + cloth;
  arm2.zb = 1.455F;
  arm2.xs = -0.012F;
  add(arm2, Region::kTop, Zone::kTrunk, 1);
  Section trapezius = arm2;
  trapezius.xf = 0.074F + cloth;
  trapezius.xb = -0.092F - cloth;
  trapezius.ys = 0.104F * (0.4F + 0.6F * sh);
  trapezius.zf = 1.458F;
  trapezius.zs = 1.500F + cloth;
  trapezius.zb = 1.492F;
  trapezius.xs = -0.018F;
  trapezius.dense = 0.2F;
  trapezius.power = 2.2F;
  add(trapezius, Region::kTop, Zone::kTrunk, 1);

  const float neck = figure.neck;
  Section base;
  base.xf = 0.050F;
  base.xb = -0.072F * neck;
  base.ys = 0.067F * neck;
  base.xs = -0.016F;
  base.zf = 1.474F;
  base.zs = 1.514F;
  base.zb = 1.525F;
  base.power = 2.0F;
  base.dense = 0.45F;
  Section throat = base;
  throat.xf = 0.046F;
  throat.xb = -0.064F * neck;
  throat.ys = 0.058F * neck;
  throat.xs = -0.010F;
  throat.zf = 1.500F;
  throat.zs = 1.540F;
  throat.zb = 1.552F;
  throat.dense = 0.6F;

  const float g = cloth * 0.6F;
  switch (figure.collar) {
    case CollarStyle::kScoop:  // bare neck, the painter draws the neckline
    case CollarStyle::kCrew: {
      const float drop = figure.collar == CollarStyle::kScoop ? 0.0F : 0.004F;
      add(lifted(base, g + drop * 0.5F, 0.0F), Region::kTop, Zone::kTrunk, 1);
      add(lifted(base, -0.001F, drop), Region::kSkin, Zone::kTrunk, 1);
      break;
    }
    case CollarStyle::kShirt:
    case CollarStyle::kJacket: {
      const float tall = figure.collar == CollarStyle::kShirt ? 0.026F : 0.036F;
      const float thick = figure.collar == CollarStyle::kShirt ? 0.006F : 0.011F;
      add(lifted(base, g + 0.002F, -0.004F), Region::kTop, Zone::kTrunk, 1);
      add(lifted(base, g + thick + 0.004F, 0.008F), Region::kTop, Zone::kTrunk, 1);
      Section top = lifted(base, g + thick, tall);
      top.zf -= 0.012F;
      add(top, Region::kTop, Zone::kTrunk, 1);
      Section inner = lifted(top, -thick, -0.002F);
      add(inner, Region::kLining, Zone::kTrunk, 1);
      Section deep = lifted(base, 0.002F, tall - 0.018F);
      deep.zf -= 0.004F;
      add(deep, Region::kSkin, Zone::kTrunk, 1);
      break;
    }
    case CollarStyle::kHood: {
      // a hood that lies on the back: the collar's rear is drawn out and down
      add(lifted(base, g + 0.006F, -0.006F), Region::kTop, Zone::kTrunk, 1);
      Section low = lifted(base, g + 0.022F, 0.006F);
      low.xb -= 0.040F;
      low.zb -= 0.020F;
      add(low, Region::kTop, Zone::kTrunk, 1);
      Section out_most = lifted(base, g + 0.026F, 0.026F);
      out_most.xb -= 0.048F;
      out_most.zb += 0.002F;
      out_most.zf -= 0.014F;
      add(out_most, Region::kTop, Zone::kTrunk, 1);
      Section lip = lifted(base, g + 0.014F, 0.034F);
      lip.xb -= 0.026F;
      lip.zf -= 0.014F;
      add(lip, Region::kLining, Zone::kTrunk, 1);
      add(lifted(base, 0.002F, 0.010F), Region::kSkin, Zone::kTrunk, 1);
      break;
    }
    case CollarStyle::kScarf: {
      add(lifted(base, g + 0.002F, -0.004F), Region::kScarf, Zone::kTrunk, 1);
      add(lifted(base, g + 0.026F, 0.002F), Region::kScarf, Zone::kTrunk, 1);
      add(lifted(base, g + 0.034F, 0.020F), Region::kScarf, Zone::kTrunk, 1);
      add(lifted(throat, 0.030F, 0.004F), Region::kScarf, Zone::kTrunk, 1);
      add(lifted(throat, 0.014F, 0.014F), Region::kScarf, Zone::kTrunk, 1);
      add(lifted(throat, 0.002F, 0.002F), Region::kSkin, Zone::kTrunk, 1);
      break;
    }
  }
  out.head_start = out.keys.size() - 1;
  if (figure.collar != CollarStyle::kScarf) add(throat, Region::kSkin, Zone::kHead, 1);

  // z of front, side, back; x of front and back; half breadth. Below the brow the sections tilt,
  // so that the jaw's underside, the cheeks and the nape are all on the tube.
  static constexpr float kHead[][7] = {
      {1.531F, 1.566F, 1.580F, 0.049F, -0.070F, 0.0580F, 0.002F},
      {1.5425F, 1.580F, 1.594F, 0.071F, -0.078F, 0.0625F, 0.006F},
      {1.5490F, 1.589F, 1.607F, 0.0895F, -0.084F, 0.0668F, 0.009F},
      {1.557F, 1.598F, 1.618F, 0.0965F, -0.088F, 0.0690F, 0.010F},
      {1.567F, 1.606F, 1.628F, 0.0975F, -0.091F, 0.0705F, 0.010F},
      {1.5765F, 1.613F, 1.636F, 0.0965F, -0.093F, 0.0715F, 0.009F},
      {1.5850F, 1.620F, 1.643F, 0.0980F, -0.0945F, 0.0725F, 0.008F},
      {1.5915F, 1.626F, 1.649F, 0.0985F, -0.0955F, 0.0733F, 0.006F},
      {1.5985F, 1.632F, 1.654F, 0.0990F, -0.0960F, 0.0740F, 0.004F},
      {1.6070F, 1.638F, 1.659F, 0.0990F, -0.0965F, 0.0745F, 0.002F},
      {1.6150F, 1.643F, 1.664F, 0.0990F, -0.0970F, 0.0750F, 0.000F},
      {1.6235F, 1.648F, 1.669F, 0.0985F, -0.0972F, 0.0755F, -0.002F},
      {1.6340F, 1.654F, 1.674F, 0.0975F, -0.0972F, 0.0758F, -0.004F},
      {1.6460F, 1.661F, 1.679F, 0.0965F, -0.0970F, 0.0762F, -0.005F},
      {1.6580F, 1.669F, 1.684F, 0.0965F, -0.0967F, 0.0766F, -0.005F},
      {1.6690F, 1.678F, 1.690F, 0.0985F, -0.0960F, 0.0770F, -0.005F},
      {1.6810F, 1.688F, 1.697F, 0.1010F, -0.0945F, 0.0772F, -0.005F},
      {1.6960F, 1.701F, 1.706F, 0.0995F, -0.0920F, 0.0765F, -0.005F},
      {1.7140F, 1.716F, 1.718F, 0.0950F, -0.0885F, 0.0740F, -0.005F},
      {1.7320F, 1.732F, 1.732F, 0.0865F, -0.0830F, 0.0680F, -0.005F},
      {1.7490F, 1.748F, 1.747F, 0.0735F, -0.0730F, 0.0590F, -0.004F},
      {1.7635F, 1.7620F, 1.760F, 0.0540F, -0.0560F, 0.0455F, -0.003F},
      {1.7740F, 1.7735F, 1.772F, 0.0290F, -0.0320F, 0.0260F, -0.002F}};
  for (const auto& row : kHead) {
    Section s;
    s.zf = row[0];
    s.zs = row[1];
    s.zb = row[2];
    s.xf = row[3];
    s.xb = row[4];
    s.ys = row[5];
    s.xs = row[6];
    if (s.zf < 1.645F) s.ys *= glm::mix(figure.jaw, 1.0F, smooth_step(1.56F, 1.645F, s.zf));
    if (s.zf < 1.55F) s.ys = std::max(s.ys, 0.058F * figure.neck);
    s.power = s.zf < 1.55F ? 2.0F : 2.12F;
    s.dense = s.zf < 1.54F ? 0.8F : glm::mix(1.0F, 0.5F, smooth_step(1.72F, 1.77F, s.zf));
    add(s, Region::kSkin, Zone::kHead, 1);
  }
  return out;
}

/// Features of the face as relief on the tube of the head.
glm::vec3 shape_face(const Figure& figure, glm::vec3 p) {
  if (p.x < 0.02F || p.z < 1.53F || p.z > 1.73F) return p;
  const float y = std::abs(p.y), z = p.z;
  const float child = figure.age < 0.1F ? 0.85F : 1.0F;
  float x = 0.0F;
  static constexpr float kNose[][2] = {{1.600F, 0.0F},     {1.6070F, 0.008F}, {1.6150F, 0.021F},
                                       {1.6235F, 0.0225F}, {1.634F, 0.0175F}, {1.646F, 0.0125F},
                                       {1.658F, 0.0085F},  {1.670F, 0.006F},  {1.682F, 0.002F},
                                       {1.690F, 0.0F}};
  const float wide = glm::mix(0.0115F, 0.0075F, smooth_step(1.612F, 1.655F, z));
  const float height = z > 1.60F && z < 1.69F ? look_up(kNose, 1, z) : 0.0F;
  x += height * figure.nose * child * bell(y, wide);
  x -= 0.0085F * bell(y - 0.030F, 0.015F) * bell(z - 1.660F, 0.010F);          // eye sockets
  x += 0.0040F * child * bell(y - 0.026F, 0.020F) * bell(z - 1.681F, 0.007F);  // brows
  x += 0.0050F * bell(y - 0.040F, 0.016F) * bell(z - 1.630F, 0.017F);          // cheeks
  x -= 0.0030F * bell(y - 0.040F, 0.012F) * bell(z - 1.598F, 0.014F);
  x += 0.0050F * bell(y, 0.019F) * bell(z - 1.5975F, 0.006F);  // upper lip
  x += 0.0055F * bell(y, 0.017F) * bell(z - 1.5850F, 0.005F);  // lower lip
  x -= 0.0025F * bell(y, 0.024F) * bell(z - 1.5765F, 0.004F);
  x += 0.0060F * bell(y, 0.017F) * bell(z - 1.5600F, 0.010F);  // chin
  p.x += x * smooth_step(0.02F, 0.06F, p.x);
  return p;
}

glm::vec3 shape_trunk(const Figure& figure, glm::vec3 p) {
  const float y = std::abs(p.y);
  if (p.x > 0.0F) {
    p.x += figure.bust_m * bell(y - 0.070F, 0.052F) *
           bell(p.z - 1.285F, p.z < 1.285F ? 0.050F : 0.075F);
    if (!figure.feminine) {
      p.x += 0.006F * bell(y - 0.075F, 0.06F) * bell(p.z - 1.33F, 0.05F);
    }
  } else {
    p.x -= 0.010F * bell(y - 0.080F, 0.05F) * bell(p.z - 1.37F, 0.07F);  // shoulder blades
    p.x += 0.008F * bell(y, 0.035F) * bell(p.z - 1.25F, 0.14F);          // spine
    if (!has_skirt(figure)) {
      const float seat = figure.feminine ? 0.020F : 0.013F;
      p.x -= seat * bell(y - 0.075F, 0.055F) * bell(p.z - 0.905F, 0.055F);
    }
  }
  return p;
}

float hair_thickness(const Figure& figure, const glm::vec3& p) {
  const float top = smooth_step(1.68F, 1.76F, p.z);
  const float back = smooth_step(0.02F, -0.08F, p.x);
  const float front = smooth_step(0.02F, 0.08F, p.x);
  const bool hat = figure.hat != HatStyle::kNone;
  float depth = 0.0F;
  switch (figure.hair) {
    case HairStyle::kBald:
      return 0.0F;
    case HairStyle::kReceding:
      depth = 0.006F + 0.004F * back;
      break;
    case HairStyle::kShort:
      depth = 0.008F + 0.014F * top + 0.010F * top * front;
      break;
    case HairStyle::kParted:
      depth = 0.010F + 0.020F * top + 0.008F * top * smooth_step(-0.02F, 0.05F, p.y);
      break;
    case HairStyle::kBob:
      depth = 0.020F + 0.010F * top;
      break;
    case HairStyle::kLong:
      depth = 0.017F + 0.010F * top;
      break;
    case HairStyle::kPonytail:
    case HairStyle::kBun:
      depth = 0.010F + 0.010F * top;
      break;
    case HairStyle::kAfro:
      depth = 0.046F + 0.012F * top;
      break;
  }
  if (hat) depth = std::min(depth, 0.009F);
  return depth;
}

glm::vec3 dress_head(const Figure& figure, const glm::vec3& p) {
  const float hat = hat_cover(figure, p);
  float hair = hair_cover(figure, p);
  if (figure.hair == HairStyle::kBob || figure.hair == HairStyle::kLong) {
    // lies close at the temples
    const float azimuth = std::atan2(std::abs(p.y), p.x + 0.004F);
    hair *= glm::mix(smooth_step(0.75F, 1.35F, azimuth), 1.0F, smooth_step(1.69F, 1.73F, p.z));
  }
  glm::vec3 centre{-0.004F, 0.0F, 1.668F};
  glm::vec3 direction = p - centre;
  if (direction.z < 0.0F) direction.z *= 0.25F;  // outwards, not down, at the nape
  direction = glm::normalize(direction);
  // thin where it begins, full further up
  const float above = p.z - hair_line(figure, p);
  const float full = figure.hair == HairStyle::kAfro
                         ? smooth_step(-0.004F, 0.060F, above)
                         : 0.30F + 0.70F * smooth_step(0.0F, 0.030F, above);
  float depth = hair * full * hair_thickness(figure, p);
  if (figure.hat == HatStyle::kHeadscarf) {
    depth = hat * (0.013F + 0.008F * smooth_step(0.0F, -0.09F, p.x));
  } else if (hat > 0.0F) {
    const float top = smooth_step(1.70F, 1.77F, p.z);
    float crown = 0.014F;
    if (figure.hat == HatStyle::kHelmet) crown = 0.024F + 0.016F * top;
    if (figure.hat == HatStyle::kBeanie) crown = 0.015F + 0.020F * top;
    if (figure.hat == HatStyle::kSunHat) crown = 0.014F + 0.030F * top;
    if (figure.hat == HatStyle::kFlatCap) crown = 0.014F + 0.022F * smooth_step(-0.1F, 0.1F, p.x);
    if (figure.hat == HatStyle::kCap) crown = 0.013F + 0.010F * top;
    depth = glm::mix(depth, crown, hat);
  }
  return p + direction * depth;
}

struct Grid {
  std::vector<Ring> rings;              // bottom to top
  std::vector<std::vector<int>> faces;  // [row][column]
};

int mirror(int column, int columns) { return (columns - column) % columns; }

class Modeller {
 public:
  explicit Modeller(const Figure& figure)
      : figure_(figure), land_(landmarks_of(figure)), columns_(figure.columns) {}

  Body build() {
    build_trunk();
    for (const float side : {1.0F, -1.0F}) {
      build_leg(side);
      build_arm(side);
    }
    blend_joints();
    dress();
    build_ears();
    build_hair();
    build_hat();
    build_bag();
    // first where an opening is natural: side seams, sleeves
    std::vector<std::vector<int>> order = leg_slits_;
    order.insert(order.end(), arm_slits_.begin(), arm_slits_.end());
    order.insert(order.end(), body_.slits.begin(), body_.slits.end());
    body_.slits = std::move(order);
    mesh().compact(body_.slits);
    return std::move(body_);
  }

 private:
  Mesh& mesh() { return body_.mesh; }

  void build_trunk() {
    const TrunkKeys trunk = trunk_keys(figure_);
    struct Row {
      Section section;
      Region region;
      Zone zone;
    };
    std::vector<Row> rows;
    for (std::size_t i = 0; i < trunk.keys.size(); ++i) {
      const Key& key = trunk.keys[i];
      if (i == trunk.arm_low) arm_row_ = static_cast<int>(rows.size());
      if (i == trunk.head_start) head_row_ = static_cast<int>(rows.size());
      rows.push_back({key.section, key.region, key.zone});
      if (i + 1 == trunk.keys.size() || key.split == 1) continue;
      const Section &a = key.section, &b = trunk.keys[i + 1].section;
      const float length = std::hypot(a.zs - b.zs, a.ys - b.ys);
      const int count = std::max(1, static_cast<int>(std::lround(length * figure_.rows / 0.055F)));
      for (int k = 1; k < count; ++k) {
        rows.push_back(
            {mix(a, b, static_cast<float>(k) / static_cast<float>(count)), key.region, key.zone});
      }
    }
    for (const Row& row : rows) {
      Ring ring;
      const bool is_head = static_cast<int>(grid_.rings.size()) >= head_row_;
      for (int j = 0; j < columns_; ++j) {
        const glm::vec3 p = section_point(row.section, static_cast<float>(j), columns_);
        // a coat swings like a skirt
        const bool tail =
            row.zone == Zone::kTrunk && figure_.hem_z < 0.76F && row.section.zs < 0.90F;
        ring.push_back(mesh().add_vertex(p, row.zone == Zone::kSkirt || tail ? Part::kSkirt
                                            : is_head                        ? Part::kHead
                                                                             : Part::kTorso));
      }
      grid_.rings.push_back(ring);
    }
    for (std::size_t row = 0; row + 1 < rows.size(); ++row) {
      std::vector<int> made;
      for (int j = 0; j < columns_; ++j) {
        const int next = (j + 1) % columns_;
        const bool in_arm = static_cast<int>(row) >= arm_row_ &&
                            static_cast<int>(row) < arm_row_ + 2 &&
                            (is_arm_column(j) || is_arm_column(columns_ - 1 - j));
        if (in_arm) {
          made.push_back(-1);
          continue;
        }
        const Ring &a = grid_.rings[row], &b = grid_.rings[row + 1];
        made.push_back(mesh().add_face({a[j], a[next], b[next], b[j]}, rows[row].region,
                                       chart_of(static_cast<int>(row), j, rows[row].zone)));
      }
      grid_.faces.push_back(made);
    }
    // crown
    const Ring& last = grid_.rings.back();
    const int pole = mesh().add_vertex({-0.002F, 0.0F, 1.7780F}, Part::kHead);
    for (int j = 0; j < columns_; ++j) {
      mesh().add_face({last[j], last[(j + 1) % columns_], pole, -1}, Region::kSkin, kChartHead);
    }
    // the head opens along the nape
    const int back = columns_ / 2;
    std::vector<int> nape;
    for (std::size_t row = head_row_; row + 2 < grid_.rings.size(); ++row) {
      nape.push_back(grid_.rings[row][back]);
    }
    mesh().cut_path(nape);
    // optional slits: front closing and back seam of the top
    int first = 0;
    while (rows[first].zone != Zone::kTrunk) ++first;
    for (const int column : {back, 0}) {
      std::vector<int> path;
      for (int row = first; row + 2 < head_row_; ++row) path.push_back(grid_.rings[row][column]);
      body_.slits.push_back(path);
    }
    trunk_first_ = first;
  }

  bool is_arm_column(int j) const { return j >= columns_ / 4 - 2 && j < columns_ / 4 + 2; }

  std::uint8_t chart_of(int row, int j, Zone zone) const {
    const bool back = j >= columns_ / 4 && j < columns_ - columns_ / 4;
    if (row >= head_row_) return kChartHead;
    if (zone == Zone::kPelvis) return j < columns_ / 2 ? kChartLegLeft : kChartLegRight;
    if (zone == Zone::kSkirt) return back ? kChartSkirtBack : kChartSkirtFront;
    return back ? kChartTorsoBack : kChartTorsoFront;
  }

  // --- legs ---

  void build_leg(float side) {
    const bool flip = side < 0.0F;
    const int half = columns_ / 2;
    const int count = half + 4;
    const std::uint8_t chart = flip ? kChartLegRight : kChartLegLeft;
    const Part part = flip ? Part::kLegRight : Part::kLegLeft;
    if (crotch_.empty()) {
      for (const glm::vec3& p :
           {glm::vec3{-0.062F, 0.0F, 0.846F}, {-0.004F, 0.0F, 0.832F}, {0.048F, 0.0F, 0.848F}}) {
        crotch_.push_back(mesh().add_vertex(p, Part::kTorso));
      }
    }
    Ring ring;
    for (int j = 0; j <= half; ++j) {
      ring.push_back(grid_.rings[0][flip ? mirror(j, columns_) : j]);
    }
    ring.insert(ring.end(), crotch_.begin(), crotch_.end());

    struct LegRow {
      float z, xf, xb, ry;
      Region region;
    };
    std::vector<LegRow> rows;
    const bool skirt = has_skirt(figure_);
    const bool shorts = figure_.bottom == BottomStyle::kShorts;
    const bool bare = skirt && figure_.age > 0.05F;
    const float hem = skirt ? 2.0F : figure_.trouser_z;
    const float boot = figure_.shoe == ShoeStyle::kBoot ? 0.22F : 0.0F;
    const float girth = figure_.thigh;
    const auto skin_row = [&](float z, float offset, Region region) {
      const float g = glm::mix(girth, 0.5F + 0.5F * girth, smooth_step(0.5F, 0.2F, z));
      return LegRow{z, look_up(kLeg, 1, z) * g + offset, look_up(kLeg, 2, z) * g - offset,
                    look_up(kLeg, 3, z) * g + offset, region};
    };
    const auto cloth_row = [&](float z, Region region) {
      // trousers hang from the seat and the knee instead of following the calf
      const float loose = figure_.bottom == BottomStyle::kLeggings ? 0.0F : figure_.trouser_wide;
      LegRow row = skin_row(z, 0.006F, region);
      const float front = glm::mix(0.088F, 0.056F, smooth_step(0.85F, 0.05F, z));
      const float back = glm::mix(-0.092F, -0.066F, smooth_step(0.85F, 0.05F, z));
      const float wide = glm::mix(0.084F, 0.056F, smooth_step(0.85F, 0.05F, z));
      row.xf =
          glm::mix(row.xf, std::max(row.xf, front * girth * 0.98F + 0.004F), std::min(loose, 1.0F));
      row.xb =
          glm::mix(row.xb, std::min(row.xb, back * girth * 0.98F - 0.004F), std::min(loose, 1.0F));
      row.ry =
          glm::mix(row.ry, std::max(row.ry, wide * girth * 0.98F + 0.004F), std::min(loose, 1.0F));
      if (loose > 1.0F) {
        const float extra = (loose - 1.0F) * 0.05F * smooth_step(0.80F, 0.55F, z);
        row.xf += extra;
        row.xb -= extra;
        row.ry += extra * 0.8F;
      }
      return row;
    };
    const float step = 0.055F / figure_.rows;
    const Region cloth = Region::kBottom;
    const auto fill = [&](float from, float to, bool in_cloth, Region region) {
      const int n = std::max(1, static_cast<int>(std::lround((from - to) / step)));
      for (int i = 1; i <= n; ++i) {
        const float z = from + (to - from) * static_cast<float>(i) / static_cast<float>(n);
        rows.push_back(in_cloth ? cloth_row(z, region) : skin_row(z, 0.0F, region));
      }
    };
    const float shaft = boot > 0.0F ? boot : 0.115F;
    if (!skirt) {
      first_leg_region_ = cloth;
      if (hem > shaft + 0.05F) {  // shorts, or trousers that end above the shoe
        fill(0.835F, hem + 0.016F, true, cloth);
        LegRow edge = cloth_row(hem, Region::kLining);
        rows.push_back(edge);
        const Region inside = shorts ? Region::kSkin : Region::kSock;
        LegRow inner = skin_row(hem + 0.012F, 0.002F, inside);
        rows.push_back(inner);
        fill(hem + 0.004F, shaft + 0.03F, false, inside);
        rows.push_back(skin_row(shaft + 0.012F, 0.0F, Region::kSock));
      } else {
        fill(0.835F, hem + 0.018F, true, cloth);
        LegRow edge = cloth_row(hem, Region::kLining);
        edge.xf += 0.006F;  // breaks on the shoe
        rows.push_back(edge);
        rows.push_back(skin_row(std::max(hem + 0.030F, 0.115F), 0.002F, Region::kSock));
      }
    } else {
      first_leg_region_ = bare ? Region::kSkin : Region::kBottom;
      fill(0.825F, shaft + 0.03F, false, first_leg_region_);
      rows.push_back(skin_row(shaft + 0.012F, 0.0F, Region::kSock));
    }

    const float delta = 2.0F * kPi / static_cast<float>(count);
    const auto axis = [&](float z) {
      // the leg leans: hip, knee and ankle are not on one vertical
      const glm::vec3 hip = land_.hip_joint, knee = land_.knee, ankle = land_.ankle;
      const float t = std::clamp((z - knee.z) / (hip.z - knee.z), 0.0F, 1.0F);
      const float u = std::clamp((z - ankle.z) / (knee.z - ankle.z), 0.0F, 1.0F);
      return z > knee.z ? glm::mix(knee, hip, t) : glm::mix(ankle, knee, u);
    };
    std::vector<int> inseam{crotch_[1]}, outseam{ring[half / 2]};
    Region region = first_leg_region_;
    const auto attach = [&](const std::vector<glm::vec3>& points, std::uint8_t chart_id) {
      Ring next;
      for (const glm::vec3& p : points)
        next.push_back(mesh().add_vertex({p.x, p.y * side, p.z}, part));
      // legs grow downwards, so the winding is the reverse of the trunk's
      const std::vector<int> made = mesh().bridge(ring, next, region, chart_id, !flip);
      ring = next;
      return made;
    };
    for (const LegRow& row : rows) {
      const glm::vec3 c = axis(row.z);
      std::vector<glm::vec3> points;
      for (int j = 0; j < count; ++j) {
        const float phi = 1.5F * kPi + delta * static_cast<float>(j - (half + 2));
        const float cosine = std::cos(phi), sine = std::sin(phi);
        const float power = 2.0F / 2.15F;
        const float cp = std::copysign(std::pow(std::abs(cosine), power), cosine);
        const float sp = std::copysign(std::pow(std::abs(sine), power), sine);
        glm::vec3 p{c.x + (cosine >= 0.0F ? row.xf : -row.xb) * cp, c.y + row.ry * sp, row.z};
        // thighs meet at the top instead of running through each other
        p.y = std::max(p.y, 0.0035F + 0.012F * smooth_step(0.80F, 0.60F, row.z));
        points.push_back(p);
      }
      attach(points, chart);
      inseam.push_back(ring[half + 2]);
      outseam.push_back(ring[half / 2]);
      region = row.region;
    }
    mesh().cut_path(inseam);
    outseam.resize(outseam.size() - 2);
    if (!skirt) outseam.erase(outseam.begin());
    leg_slits_.push_back(outseam);
    build_shoe(side, ring, count, shaft);
  }

  void build_shoe(float side, Ring ring, int count, float shaft) {
    const bool flip = side < 0.0F;
    const Part part = flip ? Part::kLegRight : Part::kLegLeft;
    const std::uint8_t upper = flip ? kChartShoeRight : kChartShoeLeft;
    const std::uint8_t sole = flip ? kChartSoleRight : kChartSoleLeft;
    const int half = columns_ / 2;
    const float delta = 2.0F * kPi / static_cast<float>(count);
    struct FootRow {
      float xf, zf, xb, zb, ry, zs, power;
    };
    // top point, bottom point, half breadth and height of the side; heel to toe
    static constexpr FootRow kFoot[] = {{0.034F, 0.108F, -0.066F, 0.096F, 0.038F, 0.102F, 2.0F},
                                        {0.054F, 0.094F, -0.080F, 0.066F, 0.0405F, 0.074F, 2.1F},
                                        {0.074F, 0.084F, -0.0865F, 0.030F, 0.0415F, 0.048F, 2.3F},
                                        {0.090F, 0.076F, -0.084F, 0.003F, 0.042F, 0.030F, 2.6F},
                                        {0.106F, 0.069F, -0.055F, 0.000F, 0.0425F, 0.026F, 2.8F},
                                        {0.126F, 0.060F, 0.000F, 0.001F, 0.0435F, 0.024F, 2.8F},
                                        {0.146F, 0.053F, 0.052F, 0.001F, 0.0475F, 0.023F, 2.8F},
                                        {0.164F, 0.047F, 0.098F, 0.000F, 0.0500F, 0.022F, 2.8F},
                                        {0.182F, 0.042F, 0.142F, 0.002F, 0.0455F, 0.021F, 2.6F},
                                        {0.197F, 0.034F, 0.178F, 0.007F, 0.0330F, 0.020F, 2.3F}};
    std::vector<FootRow> rows;
    if (figure_.shoe == ShoeStyle::kBoot) {
      const float g = 0.5F + 0.5F * figure_.thigh;
      const auto at = [&](float z, float offset) {
        return FootRow{land_.ankle.x + 0.016F + look_up(kLeg, 1, z) * g + offset,
                       z,
                       land_.ankle.x + 0.004F + look_up(kLeg, 2, z) * g - offset,
                       z,
                       look_up(kLeg, 3, z) * g + offset,
                       z,
                       2.0F};
      };
      rows.push_back(at(shaft, 0.013F));
      rows.push_back(at(0.165F, 0.011F));
    } else {
      FootRow rim = kFoot[0];
      rim.zf += 0.004F;
      rim.zb += 0.006F;
      rim.zs -= 0.006F;
      rim.ry += 0.002F;
      rim.xf += 0.002F;
      rim.xb -= 0.001F;
      rows.push_back(rim);
    }
    for (std::size_t i = figure_.shoe == ShoeStyle::kBoot ? 0 : 1; i < std::size(kFoot); ++i) {
      rows.push_back(kFoot[i]);
      const bool low = figure_.shoe == ShoeStyle::kFlat;
      if (low) {  // cut out over the instep
        rows.back().zf -= 0.012F * smooth_step(0.02F, 0.06F, kFoot[i].zf - 0.03F);
        rows.back().xf -= 0.004F;
      }
    }
    if (figure_.shoe == ShoeStyle::kFlat) {
      rows[0].zb -= 0.020F;
      rows[0].zs -= 0.026F;
    }
    std::vector<int> heel{ring[back_column(half, count)]};
    // the first strip is the sock above a low shoe
    Region region = figure_.shoe == ShoeStyle::kBoot ? Region::kShoe : Region::kSock;
    const int back = back_column(half, count);
    std::vector<int> faces;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const FootRow& row = rows[i];
      Ring next;
      for (int j = 0; j < count; ++j) {
        const float phi = 1.5F * kPi + delta * static_cast<float>(j - (half + 2));
        const float cosine = std::cos(phi), sine = std::sin(phi);
        const float pw = 2.0F / row.power;
        const float cp = std::copysign(std::pow(std::abs(cosine), pw), cosine);
        const float sp = std::copysign(std::pow(std::abs(sine), pw), sine);
        const float xs = glm::mix(row.xb, row.xf, 0.5F);
        const float toe_in = 0.008F * smooth_step(0.0F, 0.18F, xs);
        glm::vec3 p{xs + (cosine >= 0.0F ? row.xf - xs : xs - row.xb) * cp,
                    land_.ankle.y + toe_in + row.ry * sp,
                    row.zs + (cosine >= 0.0F ? row.zf - row.zs : row.zs - row.zb) * cp};
        next.push_back(mesh().add_vertex({p.x, p.y * side, p.z}, part));
      }
      const std::vector<int> made = mesh().bridge(ring, next, region, upper, !flip);
      region = Region::kShoe;
      for (int j = 0; j < count; ++j) {
        const int from_back = std::min(std::abs(j - back), std::abs(j + 1 - back));
        if (row.zb < 0.02F && i > 0 && rows[i - 1].zb < 0.02F && from_back <= 2) {
          mesh().faces[made[j]].chart = sole;
          mesh().faces[made[j]].region = Region::kSole;
        }
      }
      if (row.zb >= 0.02F || rows[i - 1].zb >= 0.02F) heel.push_back(next[back]);
      ring = next;
    }
    mesh().cut_path(heel);
    const int tip = mesh().add_vertex({0.2045F, (land_.ankle.y + 0.008F) * side, 0.019F}, part);
    for (int j = 0; j < count; ++j) {
      const int next = (j + 1) % count;
      std::array<int, 4> corner{ring[next], ring[j], tip, -1};
      if (flip) std::swap(corner[0], corner[1]);
      mesh().add_face(corner, Region::kShoe, upper);
    }
  }

  int back_column(int half, int count) const {
    // the column whose angle is nearest to straight back
    const float delta = 2.0F * kPi / static_cast<float>(count);
    return half + 2 - static_cast<int>(std::lround(0.5F * kPi / delta));
  }

  // --- arms ---

  void build_arm(float side) {
    const bool flip = side < 0.0F;
    const Part part = flip ? Part::kArmRight : Part::kArmLeft;
    const std::uint8_t chart = flip ? kChartArmRight : kChartArmLeft;
    const int c0 = columns_ / 4 - 2;
    const auto at = [&](int row, int column) {
      return grid_.rings[arm_row_ + row][flip ? mirror(column, columns_) : column];
    };
    Ring ring;
    for (int j = 0; j <= 4; ++j) ring.push_back(at(0, c0 + j));
    ring.push_back(at(1, c0 + 4));
    for (int j = 4; j >= 0; --j) ring.push_back(at(2, c0 + j));
    ring.push_back(at(1, c0));

    const glm::vec3 d = land_.arm_direction;
    const glm::vec3 u{0.0F, -d.z, d.y};  // away from the trunk
    const glm::vec3 f{1.0F, 0.0F, 0.0F};
    const auto centre = [&](float a) {
      // the forearm is carried a little forward
      const float bend = std::max(0.0F, a - land_.elbow_m);
      return land_.shoulder + d * a + f * (bend * 0.13F - 0.006F * bell(a - 0.2F, 0.12F));
    };
    struct ArmRow {
      float a, ru, rf;
      Region region;
    };
    std::vector<ArmRow> rows;
    const float sleeve = figure_.sleeve_m;
    const auto bare = [&](float a, float offset, Region region) {
      const float g =
          glm::mix(figure_.arm, 0.5F + 0.5F * figure_.arm, smooth_step(0.25F, 0.53F, a));
      return ArmRow{a, look_up(kArm, 1, a) * g + offset, look_up(kArm, 2, a) * g + offset, region};
    };
    const auto clothed = [&](float a) {
      ArmRow row = bare(a, figure_.cloth_m * 0.8F, Region::kTop);
      const float loose = (figure_.sleeve_wide - 1.0F) * 0.03F * smooth_step(0.05F, 0.2F, a);
      const float straight = glm::mix(0.052F, 0.037F, a / 0.53F) * figure_.arm;
      row.ru = std::max(row.ru, straight) + loose;
      row.rf = std::max(row.rf, straight) + loose;
      return row;
    };
    const float step = 0.048F / figure_.rows;
    const auto fill = [&](float from, float to, bool cloth) {
      const int n = std::max(1, static_cast<int>(std::lround((to - from) / step)));
      for (int i = 1; i <= n; ++i) {
        const float a = from + (to - from) * static_cast<float>(i) / static_cast<float>(n);
        rows.push_back(cloth ? clothed(a) : bare(a, 0.0F, Region::kSkin));
      }
    };
    const Region first = sleeve > 0.03F ? Region::kTop : Region::kSkin;
    if (sleeve > 0.03F) {
      rows.push_back(clothed(0.035F));
      fill(0.035F, sleeve - 0.014F, true);
      ArmRow edge = clothed(sleeve);
      edge.region = Region::kLining;
      rows.push_back(edge);
      rows.push_back(bare(std::min(sleeve - 0.006F, 0.530F), 0.0015F, Region::kSkin));
      if (sleeve < 0.48F) fill(sleeve, 0.535F, false);
    } else {
      rows.push_back(bare(0.035F, 0.0F, Region::kSkin));
      fill(0.035F, 0.535F, false);
    }
    std::vector<int> under{ring[2]}, outer;
    Region region = first;
    for (const ArmRow& row : rows) {
      Ring next;
      for (int k = 0; k < kArmColumns; ++k) {
        const float psi = static_cast<float>(k - 2) * kPi / 6.0F;
        const glm::vec3 p =
            centre(row.a) - u * (std::cos(psi) * row.ru) - f * (std::sin(psi) * row.rf);
        next.push_back(mesh().add_vertex({p.x, p.y * side, p.z}, part));
      }
      mesh().bridge(ring, next, region, chart, flip);
      ring = next;
      region = row.region;
      under.push_back(ring[2]);
      outer.push_back(ring[8]);
    }
    mesh().cut_path(under);
    std::reverse(outer.begin(), outer.end());
    outer.resize(outer.size() - 1);
    arm_slits_.push_back(outer);
    build_hand(side, ring);
  }

  void build_hand(float side, Ring ring) {
    const bool flip = side < 0.0F;
    const Part part = flip ? Part::kArmRight : Part::kArmLeft;
    const std::uint8_t back_chart = flip ? kChartHandRight : kChartHandLeft;
    const std::uint8_t palm_chart = flip ? kChartPalmRight : kChartPalmLeft;
    const glm::vec3 d = land_.arm_direction;
    const glm::vec3 u{0.0F, -d.z, d.y};
    const glm::vec3 f{1.0F, 0.0F, 0.0F};
    const float size = 0.6F + 0.4F * figure_.arm;
    // across the hand (to the thumb) and towards its back, in half breadths
    static constexpr float kShape[kArmColumns][2] = {
        {0.80F, -0.85F},  {0.40F, -1.0F}, {0.0F, -1.0F},   {-0.40F, -1.0F},
        {-0.80F, -0.85F}, {-1.0F, 0.0F},  {-0.80F, 0.85F}, {-0.40F, 1.0F},
        {0.0F, 1.05F},    {0.40F, 1.0F},  {0.80F, 0.85F},  {1.0F, 0.0F}};
    static constexpr float kRows[][3] = {{0.553F, 0.029F, 0.0195F},
                                         {0.574F, 0.035F, 0.0185F},
                                         {0.604F, 0.0395F, 0.0160F},
                                         {0.634F, 0.0400F, 0.0135F}};
    const auto place = [&](const glm::vec3& p) { return glm::vec3{p.x, p.y * side, p.z}; };
    const auto centre = [&](float a) {
      return land_.shoulder + d * a + f * ((a - land_.elbow_m) * 0.13F);
    };
    std::vector<std::vector<int>> strips;
    for (const auto& row : kRows) {
      Ring next;
      const glm::vec3 c = centre(row[0]);
      for (int k = 0; k < kArmColumns; ++k) {
        // the edges of the hand end where the outer fingers begin
        const float across =
            kShape[k][0] * (&row == &kRows[3] && std::abs(kShape[k][0]) > 0.9F ? 0.84F : 1.0F);
        const glm::vec3 p = c + f * (across * row[1] * size) + u * (kShape[k][1] * row[2] * size);
        next.push_back(mesh().add_vertex(place(p), part));
      }
      strips.push_back(mesh().bridge(ring, next, Region::kSkin, back_chart, flip));
      for (const int k : {11, 0, 1, 2, 3, 4}) mesh().faces[strips.back()[k]].chart = palm_chart;
      ring = next;
    }
    // end of the palm: one quad for each finger
    const auto cap = [&](std::array<int, 4> k) {
      std::array<int, 4> corner{ring[k[0]], ring[k[1]], ring[k[2]], k[3] < 0 ? -1 : ring[k[3]]};
      if (flip) std::reverse(corner.begin(), corner.begin() + (k[3] < 0 ? 3 : 4));
      return mesh().add_face(corner, Region::kSkin, back_chart);
    };
    cap({10, 11, 0, -1});
    cap({4, 5, 6, -1});
    static constexpr float kLength[4] = {0.080F, 0.089F, 0.083F, 0.066F};
    for (int finger = 0; finger < 4; ++finger) {
      const int bottom = finger, top = 10 - finger;
      int face = cap({bottom, bottom + 1, top - 1, top});
      if (finger < 3) mesh().cut(ring[bottom + 1], ring[top - 1]);
      const float spread = (1.5F - static_cast<float>(finger)) * 0.055F;
      grow_digit(face, side, d + f * (0.13F + spread), -u, kLength[finger] * size, 1 + finger,
                 back_chart, palm_chart, flip ? 2 : 0);
    }
    // thumb, from the edge of the palm
    const glm::vec3 thumb = glm::normalize(f * 0.72F + d * 0.85F - u * 0.30F);
    grow_digit(strips[2][11], side, thumb, glm::normalize(d * 0.4F - u * 0.6F), 0.060F * size, 0,
               back_chart, palm_chart, 0);
  }

  /// Extrudes one quad to a tapering, slightly curled finger. `palm_wall` is the wall that belongs
  /// to the palm's chart.
  void grow_digit(int face, float side, const glm::vec3& direction, const glm::vec3& curl,
                  float length, int finger, std::uint8_t back_chart, std::uint8_t palm_chart,
                  int palm_wall) {
    static constexpr float kAt[3] = {0.42F, 0.80F, 1.0F};
    static constexpr float kScale[3] = {0.86F, 0.90F, 0.62F};
    float before = 0.0F;
    for (int step = 0; step < 3; ++step) {
      glm::vec3 middle{0.0F};
      for (int i = 0; i < 4; ++i)
        middle += mesh().vertices[mesh().faces[face].corner[i]].position * 0.25F;
      const float bend = 0.12F + 0.22F * static_cast<float>(step);
      glm::vec3 along = glm::normalize(direction + curl * bend) * (length * (kAt[step] - before));
      along.y *= side;
      before = kAt[step];
      const float scale = kScale[step] * (finger == 0 && step == 0 ? 0.74F : 1.0F);
      // digit, phalanx and side, for the skeleton
      const auto detail = static_cast<std::uint8_t>((side < 0.0F ? 64 : 0) + finger * 4 + step);
      const std::vector<int> walls = mesh().extrude(
          {face}, [&](const glm::vec3& p) { return middle + (p - middle) * scale + along; },
          Part::kFinger, detail, Region::kSkin, back_chart);
      mesh().faces[walls[palm_wall]].chart = palm_chart;
    }
  }

  // --- surface ---

  void blend_joints() {
    std::vector<float> amount(mesh().vertices.size(), 0.0F);
    for (std::size_t v = 0; v < mesh().vertices.size(); ++v) {
      const MeshVertex& vertex = mesh().vertices[v];
      const glm::vec3 p{vertex.position.x, std::abs(vertex.position.y), vertex.position.z};
      const bool arm = vertex.part == Part::kArmLeft || vertex.part == Part::kArmRight;
      if (arm || vertex.part == Part::kTorso) {
        amount[v] =
            std::max(amount[v], 0.6F * smooth_step(0.125F, 0.06F, glm::length(p - land_.shoulder)));
      }
      const bool leg = vertex.part == Part::kLegLeft || vertex.part == Part::kLegRight;
      if (!has_skirt(figure_) && (leg || (vertex.part == Part::kTorso && p.z < 0.9F))) {
        const bool own = is_tucked(figure_) || p.z > figure_.hem_z + 0.01F || leg;
        if (own)
          amount[v] = std::max(amount[v], 0.5F * smooth_step(0.10F, 0.03F, std::abs(p.z - 0.845F)));
      }
    }
    mesh().smooth(amount, 3);
  }

  void dress() {
    for (MeshVertex& vertex : mesh().vertices) {
      if (vertex.part == Part::kTorso) vertex.position = shape_trunk(figure_, vertex.position);
      if (vertex.part == Part::kSkirt && vertex.position.z > 0.93F) {
        vertex.position = shape_trunk(figure_, vertex.position);
      }
      if (vertex.part == Part::kHead) {
        vertex.position = dress_head(figure_, shape_face(figure_, vertex.position));
      }
    }
  }

  /// Row of the head whose front point is nearest to `z`.
  int head_row(float z) const {
    int best = head_row_;
    for (std::size_t row = head_row_; row < grid_.rings.size(); ++row) {
      const auto height = [&](int r) { return body_.mesh.vertices[grid_.rings[r][0]].position.z; };
      if (std::abs(height(static_cast<int>(row)) - z) < std::abs(height(best) - z))
        best = static_cast<int>(row);
    }
    return best;
  }

  int side_row(float z, int column) const {
    int best = head_row_;
    for (std::size_t row = head_row_; row < grid_.rings.size(); ++row) {
      const auto height = [&](int r) {
        return body_.mesh.vertices[grid_.rings[r][column]].position.z;
      };
      if (std::abs(height(static_cast<int>(row)) - z) < std::abs(height(best) - z))
        best = static_cast<int>(row);
    }
    return best;
  }

  int column_at(float angle) const {
    int best = 0;
    float error = 10.0F;
    const int row = head_row(1.66F);
    for (int j = 0; j <= columns_ / 2; ++j) {
      const glm::vec3 p = body_.mesh.vertices[grid_.rings[row][j]].position;
      const float difference = std::abs(std::atan2(p.y, p.x + 0.004F) - angle);
      if (difference < error) {
        error = difference;
        best = j;
      }
    }
    return best;
  }

  void build_ears() {
    const bool hidden = figure_.hair == HairStyle::kBob || figure_.hair == HairStyle::kLong ||
                        figure_.hair == HairStyle::kAfro || figure_.hat == HatStyle::kHeadscarf;
    if (hidden) return;
    const int column = column_at(88.0F * kPi / 180.0F);
    const int low = side_row(1.618F, column), high = side_row(1.674F, column);
    for (const float side : {1.0F, -1.0F}) {
      std::vector<int> patch;
      for (int row = low; row < high; ++row) {
        patch.push_back(grid_.faces[row][side > 0.0F ? column : columns_ - 1 - column]);
      }
      glm::vec3 middle{0.0F};
      for (const int face : patch) {
        for (int i = 0; i < 4; ++i) {
          middle += mesh().vertices[mesh().faces[face].corner[i]].position /
                    (4.0F * static_cast<float>(patch.size()));
        }
      }
      // the root is narrow at both ends
      for (const int row : {low, high}) {
        const Ring& ring = grid_.rings[row];
        const int front = side > 0.0F ? column : mirror(column, columns_);
        const int rear = side > 0.0F ? column + 1 : mirror(column + 1, columns_);
        glm::vec3& p = mesh().vertices[ring[rear]].position;
        p = glm::mix(p, mesh().vertices[ring[front]].position, 0.62F);
      }
      constexpr float half = 0.028F;
      mesh().extrude(
          patch,
          [&](const glm::vec3& p) {
            const glm::vec3 r = p - middle;
            // a shell that opens backwards: its front edge lies on the head, its round rear stands
            // off
            const float rear = smooth_step(0.004F, -0.004F, r.x);
            const float h = std::clamp(r.z / half, -1.0F, 1.0F);
            const float round =
                std::sqrt(std::max(0.0F, 1.0F - 0.97F * h * h)) * (1.0F + 0.18F * h);
            return middle +
                   glm::vec3{glm::mix(0.006F * (1.0F - h * h), -0.017F * round, rear) - 0.004F * h,
                             r.y + side * (0.004F + 0.012F * rear * round), r.z * 1.02F + 0.002F};
          },
          Part::kHead, 1, Region::kSkin, kChartHead);
    }
  }

  std::vector<int> back_strip(int row, int from_column) const {
    std::vector<int> patch;
    for (int j = from_column; j < columns_ - from_column; ++j) patch.push_back(grid_.faces[row][j]);
    return patch;
  }

  void build_hair() {
    if (figure_.hat == HatStyle::kHeadscarf) return;
    if (figure_.hair == HairStyle::kBob || figure_.hair == HairStyle::kLong) {
      // a curtain from ear to ear: one strip of the nape is lifted off, then its lower walls are
      // drawn down again and again
      const int column = column_at(64.0F * kPi / 180.0F);
      const int row = side_row(1.640F, column_at(100.0F * kPi / 180.0F));
      constexpr int kTall = 4;
      std::vector<int> patch;
      for (int r = 0; r < kTall; ++r) {
        for (const int face : back_strip(row + r, column)) patch.push_back(face);
      }
      const int strip = columns_ - 2 * column;
      std::vector<std::pair<glm::vec3, int>> rows;
      for (int r = 0; r <= kTall; ++r) {
        for (const int v : grid_.rings[row + r]) rows.push_back({mesh().vertices[v].position, r});
      }
      std::vector<int> walls = mesh().extrude(
          patch,
          [&](const glm::vec3& p) {
            const glm::vec2 out = glm::normalize(glm::vec2{p.x + 0.004F, p.y});
            int r = 0;
            for (const auto& [q, index] : rows) {
              if (glm::length(q - p) < 1e-6F) r = index;
            }
            // grows out of the scalp above and out of the temple in front
            const float t = static_cast<float>(kTall - r) / kTall;
            const float temple = smooth_step(0.95F, 1.6F, std::atan2(std::abs(p.y), p.x + 0.004F));
            const float off = 0.0010F + 0.0065F * t * t * (0.15F + 0.85F * temple);
            return glm::vec3{p.x + out.x * off, p.y + out.y * off, p.z};
          },
          Part::kHair, 0, Region::kHair, kChartHair);
      // walls follow the rim of the patch: pick those below, in column order
      const auto lower_walls = [&](const std::vector<int>& made) {
        std::vector<int> out;
        for (const int wall : made) {
          const MeshFace& f = mesh().faces[wall];
          const glm::vec3 e =
              mesh().vertices[f.corner[1]].position - mesh().vertices[f.corner[0]].position;
          const glm::vec3 n = glm::cross(
              e, mesh().vertices[f.corner[3]].position - mesh().vertices[f.corner[0]].position);
          if (n.z < -0.8F * glm::length(n)) out.push_back(wall);
        }
        return out;
      };
      std::vector<int> lower = lower_walls(walls);
      const float end = figure_.hair == HairStyle::kBob ? 1.535F : 1.36F;
      const float start = 1.64F;
      const int steps = figure_.hair == HairStyle::kBob ? 3 : 6;
      for (int step = 1; step <= steps && static_cast<int>(lower.size()) == strip; ++step) {
        const float t = static_cast<float>(step) / static_cast<float>(steps);
        const float drop = (start - end) / static_cast<float>(steps);
        const bool last = step == steps;
        mesh().extrude(
            lower,
            [&](const glm::vec3& p) {
              const float azimuth = std::atan2(std::abs(p.y), p.x + 0.004F);
              const float back = smooth_step(1.1F, 2.4F, azimuth);
              glm::vec3 q = p;
              q.z -= drop * glm::mix(figure_.hair == HairStyle::kBob ? 0.92F : 0.72F, 1.0F, back);
              // in to the neck, then over the shoulders
              const float inwards =
                  figure_.hair == HairStyle::kBob
                      ? 0.0F
                      : 0.035F * (t < 0.5F ? 1.0F : -0.35F) / static_cast<float>(steps);
              q.y *= 1.0F - inwards * 6.0F;
              q.x = (q.x + 0.004F) * (1.0F - inwards * 1.5F) - 0.004F;
              if (figure_.hair == HairStyle::kLong) {
                const float clear = -0.125F + 0.02F * smooth_step(0.05F, 0.12F, std::abs(p.y));
                if (q.z < 1.50F && q.x < -0.03F)
                  q.x = std::min(q.x, glm::mix(q.x, clear - (p.x < -0.11F ? 0.018F : 0.0F), 0.6F));
              }
              if (last) {
                q.z -= 0.004F;
                q.x *= 0.985F;
              }
              return q;
            },
            Part::kHair, static_cast<std::uint8_t>(step), Region::kHair, kChartHair);
      }
    } else if (figure_.hair == HairStyle::kPonytail || figure_.hair == HairStyle::kBun) {
      const int middle = columns_ / 2;
      const int row = side_row(1.695F, middle);
      std::vector<int> patch;
      for (int r = row; r < row + 2; ++r) {
        patch.push_back(grid_.faces[r][middle - 1]);
        patch.push_back(grid_.faces[r][middle]);
      }
      struct Step {
        glm::vec3 centre;
        float radius;
        glm::vec3 normal;
      };
      std::vector<Step> steps;
      if (figure_.hair == HairStyle::kPonytail) {
        steps = {{{-0.116F, 0, 1.712F}, 0.017F, {-1, 0, 0.3F}},
                 {{-0.135F, 0, 1.715F}, 0.024F, {-1, 0, -0.2F}},
                 {{-0.160F, 0, 1.690F}, 0.031F, {-0.5F, 0, -1}},
                 {{-0.166F, 0, 1.640F}, 0.030F, {-0.1F, 0, -1}},
                 {{-0.162F, 0, 1.585F}, 0.026F, {0.05F, 0, -1}},
                 {{-0.157F, 0, 1.53F}, 0.020F, {0.05F, 0, -1}},
                 {{-0.156F, 0, 1.49F}, 0.008F, {0, 0, -1}}};
      } else {
        steps = {{{-0.108F, 0, 1.712F}, 0.026F, {-1, 0, 0.35F}},
                 {{-0.117F, 0, 1.715F}, 0.037F, {-1, 0, 0.35F}},
                 {{-0.131F, 0, 1.720F}, 0.042F, {-1, 0, 0.35F}},
                 {{-0.146F, 0, 1.725F}, 0.038F, {-1, 0, 0.35F}},
                 {{-0.157F, 0, 1.729F}, 0.026F, {-1, 0, 0.35F}},
                 {{-0.162F, 0, 1.731F}, 0.012F, {-1, 0, 0.35F}}};
      }
      glm::vec3 old_centre{0.0F};
      for (const int face : patch) {
        for (int i = 0; i < 4; ++i)
          old_centre += mesh().vertices[mesh().faces[face].corner[i]].position / 16.0F;
      }
      glm::vec3 old_normal = glm::normalize(glm::vec3{-1.0F, 0.0F, 0.3F});
      std::uint8_t level = 1;
      for (const Step& step : steps) {
        const glm::vec3 normal = glm::normalize(step.normal);
        const glm::vec3 old_up = glm::cross(glm::vec3{0, 1, 0}, old_normal),
                        up = glm::cross(glm::vec3{0, 1, 0}, normal);
        const bool first = level == 1;
        mesh().extrude(
            patch,
            [&](const glm::vec3& p) {
              glm::vec2 r{p.y, glm::dot(p - old_centre, old_up)};
              const float length = glm::length(r);
              // the rim becomes a circle; the middle of the patch stays in the middle, a bit ahead
              const bool inner = length < 0.006F || (first && length < 0.004F);
              if (!inner) r *= step.radius / length;
              return step.centre + glm::vec3{0, 1, 0} * r.x + up * r.y +
                     normal * (inner ? step.radius * 0.12F : 0.0F);
            },
            Part::kHair, level++, Region::kHair, kChartHair);
        old_centre = step.centre;
        old_normal = normal;
      }
    }
  }

  void build_hat() {
    const HatStyle hat = figure_.hat;
    if (hat == HatStyle::kNone || hat == HatStyle::kBeanie || hat == HatStyle::kHeadscarf) return;
    const int row = hat_row();
    const bool whole = hat == HatStyle::kSunHat || hat == HatStyle::kHelmet;
    std::vector<int> patch;
    const int reach = column_at((hat == HatStyle::kFlatCap ? 62.0F : 52.0F) * kPi / 180.0F);
    for (int j = 0; j < columns_; ++j) {
      if (whole || j < reach || j >= columns_ - reach) patch.push_back(grid_.faces[row][j]);
    }
    float base = 0.0F;
    for (const int face : patch)
      base += mesh().vertices[mesh().faces[face].corner[0]].position.z /
              static_cast<float>(patch.size());
    const int steps = hat == HatStyle::kSunHat ? 3 : 2;
    for (int step = 1; step <= steps; ++step) {
      const float t = static_cast<float>(step) / static_cast<float>(steps);
      mesh().extrude(
          patch,
          [&](const glm::vec3& p) {
            const glm::vec2 out = glm::normalize(glm::vec2{p.x + 0.004F, p.y});
            const float front = std::max(0.0F, out.x);
            float reach_m = 0.0F, drop = 0.0F;
            if (hat == HatStyle::kSunHat) {
              reach_m = 0.085F / 3.0F;
              drop = 0.010F * t;
            } else if (hat == HatStyle::kHelmet) {
              reach_m = (0.010F + 0.022F * front * front) / 2.0F;
              drop = 0.003F;
            } else if (hat == HatStyle::kFlatCap) {
              reach_m = 0.036F * smooth_step(0.35F, 0.85F, front) / 2.0F + 0.002F;
              drop = 0.006F * front;
            } else {
              reach_m = 0.070F * smooth_step(0.50F, 0.92F, front) / 2.0F + 0.002F;
              drop = 0.007F * front + 0.002F;
            }
            // thin: the two edges of the strip are drawn together
            const float thin = step == 1 ? 0.35F : 0.7F;
            return glm::vec3{p.x + out.x * reach_m, p.y + out.y * reach_m,
                             base + (p.z - base) * thin - drop};
          },
          Part::kHead, 2, Region::kHat, kChartHat);
      base -= 0.004F;
    }
  }

  int hat_row() const {
    for (std::size_t row = head_row_; row + 1 < grid_.rings.size(); ++row) {
      const glm::vec3 p = body_.mesh.vertices[grid_.rings[row][0]].position;
      if (hat_cover(figure_, p) > 0.5F) return static_cast<int>(row);
    }
    return head_row_;
  }

  void build_bag() {
    if (figure_.bag == BagStyle::kNone) return;
    const auto rows_between = [&](float low, float high, int column) {
      std::vector<int> out;
      for (int row = trunk_first_; row + 1 < head_row_; ++row) {
        const glm::vec3 a = mesh().vertices[grid_.rings[row][column]].position;
        const glm::vec3 b = mesh().vertices[grid_.rings[row + 1][column]].position;
        const bool outer = mesh().faces[grid_.faces[row][column]].region == Region::kTop ||
                           mesh().faces[grid_.faces[row][column]].region == Region::kBottom;
        if (outer && a.z > low && b.z < high && b.z > a.z) out.push_back(row);
      }
      return out;
    };
    std::vector<int> patch;
    if (figure_.bag == BagStyle::kBackpack) {
      const int middle = columns_ / 2;
      const int half = 4;
      for (const int row : rows_between(1.06F, 1.45F, middle)) {
        for (int j = middle - half; j < middle + half; ++j) {
          if (grid_.faces[row][j] >= 0) patch.push_back(grid_.faces[row][j]);
        }
      }
      const glm::vec3 centre{-0.12F, 0.0F, 1.255F};
      static constexpr float kDepth[] = {0.012F, 0.050F, 0.110F, 0.135F};
      static constexpr float kSize[] = {1.06F, 1.12F, 1.06F, 0.80F};
      for (int step = 0; step < 4; ++step) {
        mesh().extrude(
            patch,
            [&](const glm::vec3& p) {
              glm::vec3 r = p - centre;
              const float scale = kSize[step] / (step == 0 ? 1.0F : kSize[step - 1]);
              glm::vec3 q = centre + glm::vec3{r.x, r.y * scale, r.z * scale};
              // from the curve of the back to a flat front
              const float target = -0.135F - kDepth[step];
              const float flat = step == 0 ? 0.0F : 0.75F;
              q.x = glm::mix(p.x - (kDepth[step] - (step > 0 ? kDepth[step - 1] : 0.0F)), target,
                             flat);
              // fuller at the bottom
              q.x -= step >= 2 ? 0.010F * smooth_step(0.10F, -0.14F, r.z) : 0.0F;
              return q;
            },
            Part::kBag, 0, Region::kBag, kChartBag);
      }
      return;
    }
    // a bag at the right hip, towards the back so that the hand swings past it
    const bool hand = figure_.bag == BagStyle::kHandbag;
    const int c0 = columns_ - columns_ / 4 - (hand ? 3 : 4);
    const int wide = hand ? 3 : 4;
    const float low = hand ? 0.86F : 0.84F, high = hand ? 1.12F : 1.12F;
    for (const int row : rows_between(low, high, c0)) {
      for (int j = c0; j < c0 + wide; ++j) patch.push_back(grid_.faces[row][j]);
    }
    if (patch.empty()) return;
    glm::vec3 centre{0.0F}, normal{0.0F};
    for (const int face : patch) {
      const MeshFace& f = mesh().faces[face];
      glm::vec3 p[4];
      for (int i = 0; i < 4; ++i) {
        p[i] = mesh().vertices[f.corner[i]].position;
        centre += p[i] / (4.0F * static_cast<float>(patch.size()));
      }
      normal += glm::cross(p[2] - p[0], p[3] - p[1]);
    }
    normal.z = 0.0F;
    normal = glm::normalize(normal);
    static constexpr float kDepth[] = {0.004F, 0.026F, 0.058F, 0.066F};
    static constexpr float kSize[] = {1.08F, 1.16F, 1.10F, 0.84F};
    for (int step = 0; step < 4; ++step) {
      mesh().extrude(
          patch,
          [&](const glm::vec3& p) {
            const glm::vec3 r = p - centre;
            const float depth = glm::dot(r, normal);
            const glm::vec3 flat = r - normal * depth;
            const float scale = kSize[step] / (step == 0 ? 1.0F : kSize[step - 1]);
            const float flatten = step == 0 ? 0.8F : 0.3F;
            const float extra = kDepth[step] - (step > 0 ? kDepth[step - 1] : 0.0F);
            return centre + flat * scale +
                   normal * (step == 0 ? depth * flatten + extra
                                       : glm::mix(depth, kDepth[step], 1.0F - flatten));
          },
          Part::kBag, 1, Region::kBag, kChartBag);
    }
  }

  const Figure& figure_;
  Landmarks land_;
  int columns_;
  Body body_;
  Grid grid_;
  int arm_row_ = 0;
  int head_row_ = 1 << 20;
  int trunk_first_ = 0;
  Ring crotch_;
  Region first_leg_region_ = Region::kBottom;
  std::vector<std::vector<int>> leg_slits_, arm_slits_;
};

}  // namespace

Landmarks landmarks_of(const Figure& figure) {
  Landmarks land;
  land.shoulder.y *= figure.shoulder;
  land.hip_joint.y *= figure.hip;
  land.knee.y *= 0.5F + 0.5F * figure.hip;
  return land;
}

float hair_line(const Figure& figure, const glm::vec3& position) {
  // azimuth in degrees from the face, height of the hairline
  static constexpr float kCropped[][2] = {{0, 1.724F},   {25, 1.727F},  {42, 1.719F}, {58, 1.697F},
                                          {70, 1.664F},  {79, 1.640F},  {87, 1.648F}, {100, 1.642F},
                                          {113, 1.606F}, {135, 1.586F}, {180, 1.578F}};
  static constexpr float kPinned[][2] = {{0, 1.725F},   {25, 1.724F},  {42, 1.711F}, {58, 1.688F},
                                         {70, 1.664F},  {79, 1.655F},  {88, 1.660F}, {100, 1.640F},
                                         {115, 1.602F}, {140, 1.580F}, {180, 1.574F}};
  static constexpr float kFalling[][2] = {{0, 1.732F},  {10, 1.729F}, {22, 1.716F}, {34, 1.698F},
                                          {43, 1.676F}, {50, 1.645F}, {54, 1.605F}, {59, 1.555F},
                                          {75, 1.530F}, {180, 1.530F}};
  static constexpr float kThin[][2] = {{0, 1.757F},   {25, 1.760F},  {42, 1.746F}, {58, 1.712F},
                                       {70, 1.668F},  {79, 1.642F},  {87, 1.648F}, {100, 1.642F},
                                       {113, 1.606F}, {135, 1.586F}, {180, 1.578F}};
  const float azimuth = std::atan2(std::abs(position.y), position.x + 0.004F) * 180.0F / kPi;
  float line = 0.0F;
  switch (figure.hair) {
    case HairStyle::kBob:
    case HairStyle::kLong:
      line = look_up(kFalling, 1, azimuth);
      break;
    case HairStyle::kPonytail:
    case HairStyle::kBun:
      line = look_up(kPinned, 1, azimuth);
      break;
    case HairStyle::kReceding:
      line = look_up(kThin, 1, azimuth);
      break;
    default:
      line = look_up(kCropped, 1, azimuth);
      break;
  }
  // an afro hides the ears
  if (figure.hair == HairStyle::kAfro && azimuth > 72.0F) line = std::min(line, 1.606F);
  return line;
}

float hair_cover(const Figure& figure, const glm::vec3& position) {
  if (figure.hair == HairStyle::kBald || figure.hat == HatStyle::kHeadscarf) return 0.0F;
  return smooth_step(-0.004F, 0.006F, position.z - hair_line(figure, position));
}

float hat_cover(const Figure& figure, const glm::vec3& position) {
  const float azimuth = std::atan2(std::abs(position.y), position.x + 0.004F);
  const float front = std::cos(azimuth);
  float line = 10.0F;
  switch (figure.hat) {
    case HatStyle::kNone:
      return 0.0F;
    case HatStyle::kCap:
      line = 1.692F + 0.016F * front;
      break;
    case HatStyle::kBeanie:
      line = 1.682F + 0.020F * front;
      break;
    case HatStyle::kHelmet:
      line = 1.699F + 0.004F * front;
      break;
    case HatStyle::kFlatCap:
      line = 1.695F + 0.014F * front;
      break;
    case HatStyle::kSunHat:
      line = 1.699F + 0.002F * front;
      break;
    case HatStyle::kHeadscarf: {
      // everything but an oval around the face
      if (position.x < 0.0F) return 1.0F;
      const float r = std::hypot(position.y / 0.063F, (position.z - 1.632F) / 0.090F);
      return std::max(smooth_step(0.93F, 1.02F, r), smooth_step(0.03F, 0.0F, position.x));
    }
  }
  return smooth_step(-0.005F, 0.003F, position.z - line);
}

Body make_body(const Figure& figure) { return Modeller(figure).build(); }

glm::vec3 to_model(const Figure& figure, const glm::vec3& canonical, Part part) {
  constexpr float kCrotch = 0.83F, kNeck = 1.55F, kTop = 1.778F;
  const float shift = kCrotch * (figure.leg - 1.0F);
  glm::vec3 p = canonical;
  if (part == Part::kHair || part == Part::kHead || part == Part::kTorso) {
    const float weight = part == Part::kHair ? 1.0F : smooth_step(1.475F, 1.56F, p.z);
    const glm::vec3 pivot{-0.01F, 0.0F, kNeck};
    p += (p - pivot) * ((figure.head - 1.0F) * weight);
  }
  p.z = p.z < kCrotch ? p.z * figure.leg : p.z + shift;
  const float top = kNeck + figure.head * (kTop - kNeck) + shift;
  return p * (figure.height_m / top);
}

}  // namespace throng::builtin
