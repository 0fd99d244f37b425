#include "simplify/builtin/paint.hpp"

#include <algorithm>
#include <cmath>

namespace throng::builtin {
namespace {

constexpr float kPi = 3.14159265F;

float smooth_step(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

/// 1 within `half` of zero, with an edge of `soft`.
float band(float x, float half, float soft) {
  return 1.0F - smooth_step(half - soft, half + soft, std::abs(x));
}

float bell(float x, float width) {
  const float t = x / width;
  return t * t > 9.0F ? 0.0F : std::exp(-t * t);
}

/// Value noise in [0, 1]: random values at whole coordinates, smoothly interpolated.
float noise(const glm::vec3& p) {
  const float fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
  glm::vec3 t{p.x - fx, p.y - fy, p.z - fz};
  t = t * t * (3.0F - 2.0F * t);
  constexpr std::uint32_t kX = 0x8da6b343U, kY = 0xd8163841U, kZ = 0xcb1ab31fU;
  const std::uint32_t x0 = static_cast<std::uint32_t>(static_cast<int>(fx)) * kX, x1 = x0 + kX;
  const std::uint32_t y0 = static_cast<std::uint32_t>(static_cast<int>(fy)) * kY, y1 = y0 + kY;
  const std::uint32_t z0 = static_cast<std::uint32_t>(static_cast<int>(fz)) * kZ, z1 = z0 + kZ;
  const auto value = [](std::uint32_t h) {
    h ^= h >> 13;
    h *= 0x9e3779b1U;
    return static_cast<float>(h >> 16) * (1.0F / 65535.0F);
  };
  const float a = glm::mix(value(x0 ^ y0 ^ z0), value(x1 ^ y0 ^ z0), t.x);
  const float b = glm::mix(value(x0 ^ y1 ^ z0), value(x1 ^ y1 ^ z0), t.x);
  const float c = glm::mix(value(x0 ^ y0 ^ z1), value(x1 ^ y0 ^ z1), t.x);
  const float d = glm::mix(value(x0 ^ y1 ^ z1), value(x1 ^ y1 ^ z1), t.x);
  return glm::mix(glm::mix(a, b, t.y), glm::mix(c, d, t.y), t.z);
}

/// What is known of one texel.
struct Texel {
  glm::vec3 p{0.0F};  // canonical
  glm::vec3 n{0.0F};
  float sky = 1.0F;
  Region region = Region::kSkin;
  std::uint8_t chart = 0;
  std::uint8_t detail = 0;  // of the face's first vertex: 1 in ears
  Part part = Part::kTorso;
};

struct Paint {
  glm::vec3 color{0.5F};
  glm::vec4 tint{0.0F};
};

class Painter {
 public:
  explicit Painter(const Figure& figure) : f_(figure), land_(landmarks_of(figure)) {}

  Paint at(const Texel& t) const {
    Paint out;
    switch (t.region) {
      case Region::kSkin:
        out = t.part == Part::kHead ? head(t) : body_skin(t);
        break;
      case Region::kHair:
        out = hair(t);
        break;
      case Region::kTop:
        out = top(t);
        break;
      case Region::kBottom:
        out = bottom(t);
        break;
      case Region::kSock:
        out.color = sock(t);
        break;
      case Region::kShoe:
      case Region::kSole:
        out.color = shoe(t);
        break;
      case Region::kHat:
        out.color = hat(t);
        break;
      case Region::kBag:
        out.color = bag(t);
        break;
      case Region::kScarf:
        out.color = scarf(t);
        break;
      case Region::kLining:
        out = lining(t);
        break;
    }
    // soft occlusion; in skin some light comes through
    const float shade = 0.46F + 0.54F * t.sky;
    const float through = out.tint.r * (1.0F - shade) * 0.35F;
    out.color *= glm::vec3{shade + through, shade, shade};
    out.color = glm::clamp(out.color, 0.0F, 1.0F);
    return out;
  }

 private:
  float arm_along(const glm::vec3& p) const {
    return glm::dot(glm::vec3{p.x, std::abs(p.y), p.z} - land_.shoulder, land_.arm_direction);
  }
  static bool is_arm(const Texel& t) {
    return t.part == Part::kArmLeft || t.part == Part::kArmRight;
  }

  // --- skin ---

  glm::vec3 skin_tone(const Texel& t) const {
    const float mottle = noise(t.p * 90.0F) - 0.5F, fine = noise(t.p * 420.0F) - 0.5F;
    glm::vec3 c = f_.color.skin * (1.0F + 0.035F * mottle + 0.025F * fine);
    return c;
  }

  Paint body_skin(const Texel& t) const {
    Paint out;
    glm::vec3 c = skin_tone(t);
    const glm::vec3 flush = c * glm::vec3{1.02F, 0.86F, 0.82F};
    if (is_arm(t)) {
      const float a = arm_along(t.p);
      c = glm::mix(c, flush,
                   0.5F * bell(a - land_.elbow_m, 0.03F) * smooth_step(0.0F, -0.5F, t.n.x));
      if (a > land_.wrist_m - 0.01F) {
        // knuckles and the furrows between the bones of the hand
        c = glm::mix(c, flush, 0.55F * bell(a - land_.knuckle_m, 0.012F));
        c *= 1.0F -
             0.06F * band(std::sin((t.p.x) * 260.0F), 0.35F, 0.3F) * smooth_step(0.57F, 0.62F, a);
      }
    } else if (t.part == Part::kFinger) {
      const float a = arm_along(t.p);
      c = glm::mix(c, flush, 0.35F);
      c *= 1.0F - 0.10F * band(std::fmod(a * 100.0F, 2.6F) - 1.3F, 0.16F, 0.12F);
    } else if (t.part == Part::kLegLeft || t.part == Part::kLegRight) {
      c = glm::mix(c, flush, 0.45F * bell(t.p.z - 0.50F, 0.05F) * smooth_step(0.0F, 0.6F, t.n.x));
      c *= 1.0F - 0.07F * bell(t.p.z - 0.455F, 0.012F) * smooth_step(0.2F, 0.8F, t.n.x);
    } else if (t.p.z > 1.40F) {
      // collar bones and the hollow of the throat
      const float y = std::abs(t.p.y);
      c *= 1.0F - 0.10F * bell(t.p.z - (1.462F + 0.16F * y), 0.006F) *
                      smooth_step(0.012F, 0.03F, y) * smooth_step(0.0F, 0.4F, t.n.x);
      c *= 1.0F -
           0.10F * bell(y, 0.010F) * bell(t.p.z - 1.475F, 0.012F) * smooth_step(0.0F, 0.4F, t.n.x);
    }
    out.color = c;
    out.tint.r = 1.0F;
    return out;
  }

  // --- head ---

  Paint head(const Texel& t) const {
    Paint out = face(t);
    const glm::vec3 p = t.p;
    if (f_.hat == HatStyle::kHeadscarf) {
      const float cover = smooth_step(0.42F, 0.58F, hat_cover(f_, p));
      if (cover > 0.0F && p.z > 1.47F) {
        out.color = glm::mix(out.color * (1.0F - 0.35F * hat_cover(f_, p)), headscarf(t), cover);
        out.tint *= 1.0F - cover;
      }
      return out;
    }
    const bool ear = t.detail == 1;
    if (ear) {
      out.color = glm::mix(skin_tone(t), f_.color.skin * glm::vec3{1.0F, 0.80F, 0.76F}, 0.5F);
      out.color *= 0.82F + 0.22F * smooth_step(-0.2F, 0.8F, std::abs(t.n.y));
      // the hollow of the shell and the fold of its rim
      out.color *= 1.0F - 0.42F * bell((p.x + 0.003F) / 0.7F, 0.0075F) * bell(p.z - 1.643F, 0.012F);
      out.color *= 1.0F - 0.18F * band(std::hypot((p.x + 0.006F) / 0.62F, p.z - 1.648F) - 0.017F,
                                       0.0018F, 0.0015F);
      out.tint = {1.0F, 0.0F, 0.0F, 0.0F};
    } else if (f_.hair != HairStyle::kBald) {
      const float azimuth = std::atan2(p.y, p.x + 0.004F);
      const float strand = noise({azimuth * 42.0F, p.z * 30.0F, 3.0F});
      const glm::vec3 q = p + glm::vec3{0, 0, (strand - 0.5F) * 0.010F};
      const float cover = hair_cover(f_, q);
      const float solid = smooth_step(0.30F, 0.75F, cover);
      // shadow of the hairline on the skin
      out.color *=
          1.0F - 0.22F * smooth_step(0.0F, 0.3F, hair_cover(f_, p + glm::vec3{0, 0, 0.007F}));
      if (solid > 0.0F) {
        const Paint h = hair(t);
        out.color = glm::mix(out.color, h.color, solid);
        out.tint = glm::mix(out.tint, h.tint, solid);
      }
    }
    if (f_.hat != HatStyle::kNone) {
      const float cover = smooth_step(0.45F, 0.55F, hat_cover(f_, p));
      out.color *= 1.0F - 0.35F *
                              smooth_step(0.0F, 0.4F, hat_cover(f_, p + glm::vec3{0, 0, 0.012F})) *
                              (1.0F - cover);
      out.color = glm::mix(out.color, hat(t), cover);
      out.tint *= 1.0F - cover;
    }
    return out;
  }

  Paint face(const Texel& t) const {
    Paint out;
    out.tint.r = 1.0F;
    glm::vec3 c = skin_tone(t);
    const glm::vec3 skin = f_.color.skin;
    const float y = std::abs(t.p.y), z = t.p.z;
    const bool front = t.p.x > 0.03F;
    const bool old = f_.age > 0.6F;
    const bool child = f_.age < 0.1F;
    const glm::vec3 blush = skin * glm::vec3{1.06F, 0.83F, 0.80F};
    if (!front) {
      c = beard(t, c, out.tint);
      if (f_.glasses && t.p.x > -0.012F) {
        const float bar = band(z - 1.665F, 0.0016F, 0.0005F);
        c = glm::mix(c, glm::vec3{0.10F, 0.09F, 0.09F}, 0.92F * bar);
        out.tint.r *= 1.0F - bar;
      }
      out.color = c;
      return out;
    }
    c = glm::mix(c, blush,
                 (f_.feminine || child ? 0.55F : 0.38F) * bell(y - 0.042F, 0.020F) *
                     bell(z - 1.622F, 0.018F));
    c = glm::mix(c, blush, 0.35F * bell(y, 0.014F) * bell(z - 1.618F, 0.012F));
    c = glm::mix(c, blush, 0.20F * bell(y, 0.020F) * bell(z - 1.558F, 0.012F));
    // eye sockets, sides of the nose, under the lip: where a face is darker in any light
    c *= 1.0F - 0.20F * bell(y - 0.024F, 0.012F) * bell(z - 1.669F, 0.007F);
    c *= 1.0F - 0.13F * bell(y - 0.031F, 0.017F) * bell(z - 1.650F, 0.005F);
    c *= 1.0F - 0.16F * bell(y - 0.0135F, 0.004F) * bell(z - 1.633F, 0.022F);
    c *= 1.0F - 0.22F * bell(y - 0.0155F, 0.0035F) * bell(z - 1.612F, 0.006F);
    c *= 1.0F + 0.10F * bell(y, 0.004F) * bell(z - 1.640F, 0.020F);
    c *= 1.0F - 0.16F * bell(y, 0.016F) * bell(z - 1.5755F, 0.004F);
    c *= 1.0F - 0.10F * bell(y, 0.004F) * bell(z - 1.6025F, 0.005F);
    // fold from the nose to the corner of the mouth
    const float fold_y = 0.0175F + (1.612F - z) * 0.55F;
    const float fold =
        bell(y - fold_y, 0.0022F) * smooth_step(1.588F, 1.596F, z) * smooth_step(1.616F, 1.606F, z);
    c *= 1.0F - (old ? 0.26F : child ? 0.0F : 0.09F) * fold;
    if (old) {
      const float line = std::sin((z + 0.0025F * std::sin(y * 60.0F)) * 700.0F);
      c *= 1.0F - 0.07F * band(line, 0.25F, 0.3F) * smooth_step(1.692F, 1.70F, z) *
                      smooth_step(1.735F, 1.72F, z) * smooth_step(0.05F, 0.035F, y);
      c *= 1.0F - 0.12F * bell(y - 0.031F, 0.014F) * bell(z - 1.6465F, 0.0018F);
      c *= 1.0F - 0.10F * band(std::sin(z * 900.0F), 0.3F, 0.3F) * bell(y - 0.053F, 0.006F) *
                      bell(z - 1.661F, 0.010F);
    }
    // nostrils
    c = glm::mix(c, skin * 0.32F,
                 0.85F * band(std::hypot((y - 0.0072F) / 1.25F, z - 1.6085F), 0.0030F, 0.0010F));

    // mouth
    const float wide = child ? 0.019F : 0.0235F;
    const float m = 1.0F - (y / wide) * (y / wide);
    if (m > 0.0F) {
      const float line = 1.5912F + 0.0012F * (y / wide) * (y / wide);
      const float upper =
          line + 0.0072F * m * (1.0F - 0.22F * bell(y, 0.0045F)) * (old ? 0.75F : 1.0F);
      const float lower = line - 0.0090F * m * (old ? 0.8F : 1.0F);
      const float lips = smooth_step(upper + 0.0008F, upper - 0.0010F, z) *
                         smooth_step(lower - 0.0008F, lower + 0.0012F, z);
      glm::vec3 lip = glm::mix(skin * glm::vec3{0.90F, 0.64F, 0.62F}, f_.color.lip,
                               f_.feminine ? 0.75F : 0.25F);
      lip *= z > line ? 0.86F
                      : 1.0F + 0.14F * bell(y - 0.005F, 0.006F) *
                                   bell(z - (line + lower) * 0.5F, 0.0018F);
      c = glm::mix(c, lip, lips * (f_.feminine ? 0.95F : 0.75F));
      c = glm::mix(c, skin * glm::vec3{0.34F, 0.20F, 0.19F},
                   0.9F * band(z - line, 0.0008F + 0.0006F * m, 0.0006F));
      out.tint.r = 1.0F - 0.5F * lips;
    }
    c *= 1.0F - 0.25F * bell(y - wide, 0.0022F) * bell(z - 1.5918F, 0.0022F);

    c = beard(t, c, out.tint);

    // eyes
    const float ex = (y - 0.0310F) / (child ? 0.0165F : 0.0155F);
    const float zc = 1.6605F;
    const float open = (child ? 1.18F : f_.feminine ? 1.08F : old ? 0.86F : 1.0F);
    if (std::abs(ex) < 1.35F && std::abs(z - zc) < 0.016F) {
      const float arc = std::max(0.0F, 1.0F - ex * ex);
      const float tilt = 0.0010F * ex;  // the outer corner is a little higher
      const float lid_up = zc + tilt + 0.0074F * open * std::pow(arc, 0.75F);
      const float lid_low = zc + tilt - 0.0054F * open * std::pow(arc, 0.9F);
      const float inside = arc > 0.0F ? smooth_step(lid_up + 0.0004F, lid_up - 0.0006F, z) *
                                            smooth_step(lid_low - 0.0004F, lid_low + 0.0006F, z)
                                      : 0.0F;
      glm::vec3 eye{0.90F, 0.885F, 0.87F};
      eye = glm::mix(eye, glm::vec3{0.85F, 0.68F, 0.64F},
                     0.6F * smooth_step(0.75F, 1.0F, std::abs(ex)));
      const glm::vec2 d{y - 0.0305F, z - (zc + 0.0008F)};
      const float r = glm::length(d);
      const float iris_size = child ? 0.0072F : 0.0066F;
      glm::vec3 iris =
          f_.color.eye * (0.75F + 0.6F * smooth_step(0.0F, iris_size, -d.y + 0.4F * r));
      iris *= 1.0F - 0.55F * smooth_step(iris_size * 0.72F, iris_size, r);
      eye = glm::mix(eye, iris, smooth_step(iris_size + 0.0004F, iris_size - 0.0004F, r));
      eye = glm::mix(eye, glm::vec3{0.03F, 0.03F, 0.035F}, smooth_step(0.0031F, 0.0025F, r));
      const glm::vec2 gleam{t.p.y - (t.p.y > 0.0F ? 0.0305F : -0.0305F) - 0.0020F,
                            z - (zc + 0.0032F)};
      eye =
          glm::mix(eye, glm::vec3{1.0F}, 0.9F * smooth_step(0.0017F, 0.0010F, glm::length(gleam)));
      eye *= 1.0F - 0.35F * smooth_step(lid_up - 0.0045F, lid_up, z);
      c = glm::mix(c, eye, inside);
      out.tint.r *= 1.0F - inside;
      // lashes and lids
      const float corner = smooth_step(1.25F, 0.95F, std::abs(ex));
      const float lash = f_.feminine ? 0.0017F : 0.0012F;
      c = glm::mix(c, glm::vec3{0.09F, 0.065F, 0.06F},
                   (f_.feminine ? 0.95F : 0.8F) * corner *
                       band(z - lid_up - 0.0003F,
                            lash * (0.6F + 0.6F * smooth_step(-0.5F, 0.8F, ex)), 0.0006F));
      c = glm::mix(c, skin * 0.5F, 0.55F * corner * band(z - lid_low + 0.0002F, 0.0006F, 0.0005F));
      c *= 1.0F - 0.22F * corner * bell(z - lid_up - 0.0042F, 0.0012F);
      if (f_.feminine && !child)
        c = glm::mix(c, c * glm::vec3{0.86F, 0.74F, 0.74F},
                     0.6F * corner * smooth_step(lid_up, lid_up + 0.001F, z) *
                         smooth_step(lid_up + 0.007F, lid_up + 0.003F, z));
    }
    // brows
    const float by = (y - 0.0135F) / 0.0355F;
    if (by > -0.15F && by < 1.15F) {
      const float arch = 1.6795F + 0.0052F * std::sin(std::clamp(by, 0.0F, 1.0F) * 2.3F) -
                         0.0030F * smooth_step(0.6F, 1.0F, by) + (f_.feminine ? 0.0012F : 0.0F);
      const float thick = (f_.feminine ? 0.0021F
                           : child     ? 0.0022F
                                       : 0.0034F) *
                          (1.0F - 0.65F * by * by);
      const float strand = noise({t.p.y * 900.0F, z * 260.0F - y * 300.0F, 7.0F});
      const float cover = band(z - arch, thick, 0.0012F) * smooth_step(-0.08F, 0.06F, by) *
                          smooth_step(1.08F, 0.92F, by) * (0.62F + 0.38F * strand);
      c = glm::mix(c, f_.color.hair * 0.62F, 0.92F * cover);
      out.tint.r *= 1.0F - cover;
      out.tint.g = std::max(out.tint.g, cover);
    }
    if (f_.glasses) {
      const glm::vec2 d{(y - 0.0315F) / 1.22F, z - 1.658F};
      const float r =
          std::pow(std::pow(std::abs(d.x), 3.0F) + std::pow(std::abs(d.y), 3.0F), 1.0F / 3.0F);
      float frame = band(r - 0.0175F, 0.0013F, 0.0005F);
      frame = std::max(frame, band(z - 1.664F, 0.0014F, 0.0005F) * smooth_step(0.013F, 0.012F, y));
      frame =
          std::max(frame, band(z - 1.665F, 0.0016F, 0.0005F) * smooth_step(0.0515F, 0.0525F, y));
      const float glass = smooth_step(0.0175F, 0.0168F, r);
      c = glm::mix(c, c * 0.93F + glm::vec3{0.03F, 0.04F, 0.05F}, glass);
      c = glm::mix(c, glm::vec3{0.92F},
                   0.22F * glass * band(d.x * 0.8F + d.y - 0.006F, 0.0022F, 0.001F));
      c = glm::mix(c, glm::vec3{0.10F, 0.09F, 0.09F}, 0.92F * frame);
      out.tint.r *= 1.0F - frame;
    }
    out.color = c;
    return out;
  }

  glm::vec3 beard(const Texel& t, glm::vec3 c, glm::vec4& tint) const {
    if (f_.feminine || f_.age < 0.1F) return c;
    const float y = std::abs(t.p.y), z = t.p.z;
    const float azimuth = std::atan2(y, t.p.x + 0.004F);
    if (azimuth > 1.45F || z > 1.66F || z < 1.50F) return c;
    // from the sideburns along the jaw, below the cheeks, around the mouth
    const float line = 1.603F - 0.014F * bell(azimuth - 0.52F, 0.22F) +
                       0.055F * smooth_step(0.85F, 1.30F, azimuth);
    const float jaw = 1.520F + 0.060F * smooth_step(0.35F, 1.25F, azimuth);
    float cover = smooth_step(line + 0.007F, line - 0.007F, z) *
                  smooth_step(jaw - 0.012F, jaw + 0.014F, z) * smooth_step(1.46F, 1.22F, azimuth);
    const float lip = band(std::hypot(y / 0.0245F, (z - 1.5905F) / 0.0105F), 0.80F, 0.12F);
    cover *= 1.0F - lip;
    const float under_nose = 1.0F - band(std::hypot(y / 0.005F, (z - 1.604F) / 0.004F), 0.8F, 0.3F);
    const float grain = noise({t.p.y * 700.0F, t.p.x * 700.0F, z * 240.0F});
    const glm::vec3 hair_color = f_.color.hair * (0.62F + 0.5F * grain);
    float strength = 0.13F + 0.10F * grain;
    if (f_.beard) strength = 0.72F + 0.28F * grain;
    float amount = cover * under_nose * strength;
    if (f_.moustache) {
      const float arch = 1.6015F - 0.10F * y - 3.0F * y * y;
      amount = std::max(
          amount, band(z - arch, 0.0045F * (1.0F - 0.5F * smooth_step(0.01F, 0.03F, y)), 0.0016F) *
                      smooth_step(0.031F, 0.026F, y) * (0.75F + 0.25F * grain));
    }
    if (f_.beard || f_.moustache) {
      tint.r *= 1.0F - amount;
      tint.g = std::max(tint.g, amount);
    }
    return glm::mix(c, hair_color, amount);
  }

  Paint hair(const Texel& t) const {
    Paint out;
    const glm::vec3 p = t.p;
    const float azimuth = std::atan2(p.y, p.x + 0.004F);
    const auto strands = [&](const glm::vec3& flow, float& strand, float& lock) {
      strand = 0.6F * noise(flow) + 0.4F * noise(flow * 2.7F + 11.0F);
      lock = noise(flow * glm::vec3{0.22F, 0.6F, 0.5F} + 5.0F);
    };
    float strand = 0.0F, lock = 0.0F;
    if (f_.hair == HairStyle::kAfro) {
      strand = 0.5F * noise(p * 260.0F) + 0.5F * noise(p * 520.0F);
      lock = noise(p * 90.0F);
    } else if (t.region == Region::kHair) {
      const bool tail = f_.hair == HairStyle::kPonytail || f_.hair == HairStyle::kBun;
      strands(tail ? glm::vec3{p.y * 420.0F, p.z * 12.0F, p.x * 20.0F}
                   : glm::vec3{azimuth * 30.0F, p.z * 7.0F, 1.0F},
              strand, lock);
    } else {
      // falls at the sides; above it is combed from the parting, or back from the brow
      const float over = smooth_step(1.708F, 1.752F, p.z);
      if (over < 1.0F) strands({azimuth * 30.0F, p.z * 7.0F, 1.0F}, strand, lock);
      if (over > 0.0F) {
        float s = 0.0F, l = 0.0F;
        strands(f_.hair == HairStyle::kParted ? glm::vec3{p.x * 300.0F, p.y * 26.0F, 1.0F}
                                              : glm::vec3{p.y * 300.0F, p.x * 26.0F, 1.0F},
                s, l);
        strand = glm::mix(strand, s, over);
        lock = glm::mix(lock, l, over);
      }
    }
    const glm::vec3 flow = p * 60.0F;
    // a gloss where the head turns to the sky
    const float gloss = f_.hair == HairStyle::kAfro ? 0.0F : bell(t.n.z - 0.55F, 0.22F);
    glm::vec3 c = f_.color.hair * (0.66F + 0.46F * strand + 0.22F * (lock - 0.5F) +
                                   0.16F * gloss * (0.5F + strand)) +
                  glm::vec3{0.045F, 0.040F, 0.036F} * gloss * (0.4F + strand);
    if (f_.hair == HairStyle::kParted && t.region != Region::kHair) {
      c = glm::mix(c, f_.color.skin * 0.75F,
                   0.55F * band(p.y - 0.030F, 0.0012F, 0.0010F) * smooth_step(1.74F, 1.755F, p.z) *
                       smooth_step(-0.05F, -0.02F, p.x));
    }
    if (f_.hair == HairStyle::kLong || f_.hair == HairStyle::kBob) {
      if (t.region != Region::kHair)
        c *= 1.0F - 0.45F * band(p.y, 0.0012F, 0.0012F) * smooth_step(1.745F, 1.76F, p.z) *
                        smooth_step(-0.06F, -0.03F, p.x);
      c *= 1.0F - 0.25F * smooth_step(1.50F, 1.36F, p.z) * (1.0F - strand);
    }
    if (f_.age > 0.6F) {
      const float grey = smooth_step(0.35F, 0.65F, noise(flow * 0.5F + 3.0F) + 0.15F);
      c = glm::mix(c, glm::vec3{0.72F, 0.71F, 0.69F} * (0.75F + 0.35F * strand), 0.35F * grey);
    }
    out.color = c;
    out.tint.g = 1.0F;
    return out;
  }

  // --- cloth ---

  /// Brightness of creases in cloth: noise lit from above, stretched across the fall of the cloth.
  static float crease(const glm::vec3& p, const glm::vec3& stretch, float strength) {
    const glm::vec3 q = p * stretch;
    const glm::vec3 up{0.18F, 0.12F, 0.34F};
    const float low = noise(q) - noise(q + up);
    const float fine = noise(q * 2.3F + 17.0F) - noise(q * 2.3F + 17.0F + up);
    return 1.0F + strength * (0.42F * low + 0.40F * fine);
  }

  static float weave(const glm::vec3& p, float scale) {
    return 1.0F + 0.035F * (noise(p * scale) - 0.5F) +
           0.02F * (noise(p * scale * 2.1F + 9.0F) - 0.5F);
  }

  glm::vec3 pattern(const Texel& t, glm::vec3 c, float fall, float around) const {
    switch (f_.pattern) {
      case 1:
        return glm::mix(c, c * (f_.color.accent / glm::max(glm::vec3{0.05F}, f_.color.top)),
                        smooth_step(-0.06F, 0.06F, std::sin(fall * 150.0F)));
      case 2: {
        const float a = smooth_step(-0.1F, 0.1F, std::sin(fall * 110.0F)),
                    b = smooth_step(-0.1F, 0.1F, std::sin(around * 110.0F));
        return c * (1.0F - 0.16F * a) * (1.0F - 0.16F * b) *
               (1.0F - 0.10F * band(std::sin(fall * 55.0F), 0.10F, 0.05F));
      }
      case 3: {  // print on the chest
        const glm::vec2 d{t.p.y, t.p.z - 1.265F};
        if (t.n.x < 0.1F || is_arm(t)) return c;
        const float ring = band(glm::length(d) - 0.058F, 0.009F, 0.001F);
        const float bars = band(d.x, 0.045F, 0.001F) *
                           band(std::fmod(std::abs(d.y), 0.026F) - 0.010F, 0.0055F, 0.001F) *
                           smooth_step(0.052F, 0.051F, glm::length(d));
        return glm::mix(c, f_.color.accent, 0.85F * std::max(ring, bars));
      }
      case 4: {
        const glm::vec2 q{
            around * 26.0F,
            fall * 26.0F + (static_cast<int>(std::floor(around * 26.0F)) & 1 ? 0.5F : 0.0F)};
        const glm::vec2 r = q - glm::floor(q) - 0.5F;
        return glm::mix(c, f_.color.under, 0.85F * smooth_step(0.26F, 0.21F, glm::length(r)));
      }
      case 5:
        return fall > 1.33F ? glm::mix(c, f_.color.accent, 0.9F) : c;
      default:
        return c;
    }
  }

  Paint top(const Texel& t) const {
    Paint out;
    out.tint.b = 1.0F;
    const glm::vec3 p = t.p;
    const float y = std::abs(p.y), z = p.z;
    const bool arm = is_arm(t);
    const bool front = t.n.x > 0.0F && !arm;
    const float a = arm ? arm_along(p) : 0.0F;
    const float fall = arm ? 1.42F - a : z;
    const float around = arm ? p.x * 1.0F + 0.5F : std::atan2(p.y, p.x) * 0.135F;
    glm::vec3 c = f_.color.top;
    if (f_.top == TopStyle::kSafetyVest && !arm) c = f_.color.accent;
    c = pattern(t, c, fall, around);
    // cloth
    if (f_.top == TopStyle::kKnit) {
      const float rib = std::sin(around * 900.0F);
      c *= 0.94F + 0.07F * rib * rib + 0.05F * (noise(p * 320.0F) - 0.5F);
      if (front || arm)
        c *= 1.0F - 0.10F * band(std::sin(around * 120.0F), 0.25F, 0.2F) *
                        (0.6F + 0.4F * std::sin(fall * 190.0F));
    } else {
      c *= weave(p, f_.top == TopStyle::kSuit ? 700.0F : 480.0F);
    }
    float k = f_.top == TopStyle::kSuit ? 0.20F : f_.top == TopStyle::kKnit ? 0.22F : 0.34F;
    if (arm) {
      const float at_elbow = bell(a - land_.elbow_m, 0.07F), at_pit = bell(a - 0.03F, 0.06F),
                  at_cuff = bell(a - f_.sleeve_m + 0.03F, 0.05F);
      c *= crease({a, p.x, y * 0.3F}, {34.0F, 12.0F, 9.0F},
                  k * (0.45F + 1.0F * at_elbow + 0.5F * at_pit + 0.6F * at_cuff));
    } else {
      const float pit = bell(y - 0.16F, 0.06F) * bell(z - 1.35F, 0.08F),
                  waist = bell(z - 1.04F, 0.09F);
      c *= crease(p, {10.0F, 9.0F, 20.0F}, k * (0.55F + 0.55F * waist));
      c *= crease({p.y * 1.0F + (p.y > 0.0F ? p.z : -p.z) * 0.8F, p.x, p.z}, {22.0F, 7.0F, 9.0F},
                  k * 0.9F * pit);
      // a shade between the breasts and along the spine
      if (front)
        c *= 1.0F - (f_.feminine ? 0.10F : 0.05F) * bell(y, 0.03F) * bell(z - 1.30F, 0.07F);
      if (front)
        c *= 1.0F -
             (f_.feminine ? 0.12F : 0.04F) * bell(z - 1.225F, 0.018F) * bell(y - 0.07F, 0.06F);
      if (!front) c *= 1.0F - 0.07F * bell(y, 0.014F);
    }
    // seams: shoulder, sleeve, side, hem
    const auto seam = [&](float distance, float strength) {
      c *= 1.0F - strength * band(distance, 0.0012F, 0.0010F);
      c *= 1.0F + 0.5F * strength * band(distance - 0.003F, 0.0010F, 0.0010F);
    };
    const auto stitch = [&](float distance, float along) {
      c *= 1.0F - 0.22F * band(distance, 0.0008F, 0.0006F) *
                      smooth_step(-0.2F, 0.2F, std::sin(along * 1100.0F));
    };
    if (arm) {
      seam(a - 0.012F, 0.22F);
      if (f_.sleeve_m > 0.05F) {
        stitch(a - f_.sleeve_m + 0.022F, p.x + y);
        if (f_.top == TopStyle::kShirt || f_.top == TopStyle::kJacket ||
            f_.top == TopStyle::kHoodie) {
          seam(a - f_.sleeve_m + 0.05F, 0.25F);
          if (f_.top == TopStyle::kHoodie && a > f_.sleeve_m - 0.05F)
            c *= 0.90F + 0.07F * std::sin(p.x * 1400.0F);
        }
        if (f_.top == TopStyle::kSport)
          c = glm::mix(c, f_.color.accent,
                       0.85F * band(p.x - 0.01F, 0.012F, 0.001F) *
                           smooth_step(0.2F, 0.5F, t.n.z + std::abs(t.n.y)));
      }
    } else {
      seam(p.x + 0.004F - 0.02F * smooth_step(1.3F, 1.0F, z), z < 1.34F ? 0.14F : 0.0F);
      if (f_.hem_z < 1.0F) stitch(z - f_.hem_z - 0.020F, around * 8.0F);
      const float r = std::hypot((p.x + 0.012F) / 0.062F, p.y / 0.069F);
      if (f_.collar == CollarStyle::kCrew && z > 1.43F) {
        c *= 1.0F - 0.10F * smooth_step(1.30F, 1.26F, r) +
             0.05F * smooth_step(1.30F, 1.26F, r) * std::sin(std::atan2(p.y, p.x) * 90.0F);
        c *= 1.0F - 0.25F * band(r - 1.29F, 0.018F, 0.014F);
      }
    }
    style(t, c, out.tint, arm, front, a);
    out.color = c;
    return out;
  }

  void style(const Texel& t, glm::vec3& c, glm::vec4& tint, bool arm, bool front, float a) const {
    const glm::vec3 p = t.p;
    const float y = std::abs(p.y), z = p.z;
    const auto cover = [&](const glm::vec3& color, float amount) {
      c = glm::mix(c, color, amount);
      tint *= 1.0F - amount;
    };
    const auto button = [&](float cy, float cz, float radius, const glm::vec3& color) {
      const float r = std::hypot(p.y - cy, z - cz);
      c *= 1.0F - 0.35F * band(r - radius, 0.0015F, 0.0012F);
      cover(color * (1.0F - 0.4F * band(r - radius * 0.75F, 0.0007F, 0.0006F)),
            band(r, radius, 0.0007F));
    };
    const auto pocket = [&](float cy, float cz, float half_y, float half_z, float strength) {
      const float d = std::max(std::abs(p.y - cy) - half_y, std::abs(z - cz) - half_z);
      c *= 1.0F - strength * band(d, 0.0013F, 0.0010F);
      c *= 1.0F + 0.04F * smooth_step(0.001F, -0.001F, d);
      c *= 1.0F - strength * 0.8F * band(z - cz - half_z + 0.016F, 0.0010F, 0.0008F) *
                      smooth_step(0.0F, -0.002F, d);
    };
    const bool bag_strap = strap(t, c, tint, front, arm);
    if (bag_strap) return;
    switch (f_.top) {
      case TopStyle::kTee:
      case TopStyle::kKnit:
        break;
      case TopStyle::kSport:
        if (!arm)
          cover(f_.color.accent,
                0.9F * smooth_step(0.115F, 0.122F, y) * smooth_step(1.36F, 1.30F, z));
        break;
      case TopStyle::kShirt:
        if (front) {
          const float placket = band(y, 0.015F, 0.0005F);
          c *= 1.0F - 0.16F * band(y - 0.015F, 0.0010F, 0.0008F) - 0.02F * placket;
          for (int i = 0; i < 7; ++i)
            button(0.0F, 1.440F - 0.075F * static_cast<float>(i), 0.0048F, f_.color.under * 0.95F);
          pocket(0.075F, 1.275F, 0.034F, 0.040F, 0.20F);
        }
        if (!arm && z > 1.470F) c *= 1.0F - 0.10F * band(z - 1.484F, 0.0012F, 0.001F);
        break;
      case TopStyle::kJacket:
        if (front) {
          // worn open over a shirt
          const float open = 0.018F + 0.030F * smooth_step(1.20F, 1.46F, z) +
                             0.018F * smooth_step(1.05F, 0.86F, z);
          const float edge = y - open;
          const float inside = smooth_step(0.0008F, -0.0008F, edge);
          c *= 1.0F - 0.30F * band(edge - 0.0015F, 0.0012F, 0.001F);
          cover(glm::vec3{0.62F, 0.61F, 0.58F},
                0.8F * band(edge - 0.005F, 0.0014F, 0.0006F) *
                    smooth_step(-0.2F, 0.2F, std::sin(z * 1800.0F)));
          glm::vec3 shirt = f_.color.under * crease(p, {10.0F, 12.0F, 26.0F}, 0.35F);
          shirt *= 1.0F - 0.45F * smooth_step(-0.014F, 0.0F, edge);
          cover(shirt, inside);
          const float slant = (z - 1.06F) - (y - 0.085F) * 1.6F;
          if (inside < 0.5F) {
            c *= 1.0F - 0.35F * band(y - 0.095F - (z - 1.03F) * 0.35F, 0.0016F, 0.001F) *
                            band(z - 1.03F, 0.075F, 0.004F);
            c *= 1.0F - 0.14F * band(slant - 0.25F, 0.002F, 0.001F);
            pocket(p.y > 0 ? 0.085F : -0.085F, 1.285F, 0.036F, 0.036F, 0.15F);
          }
        }
        if (!arm) c *= 1.0F - 0.10F * band(z - f_.hem_z - 0.042F, 0.0015F, 0.001F);
        break;
      case TopStyle::kSuit:
      case TopStyle::kCoat: {
        const float low = f_.top == TopStyle::kSuit ? 1.125F : 1.20F;
        if (front && z > low - 0.01F) {
          const float v = std::max(0.0F, z - low) * 0.185F;
          const float edge = y - v;
          const float inside = smooth_step(0.0006F, -0.0006F, edge);
          // lapels
          const float lapel = v + 0.016F + 0.055F * smooth_step(low, 1.36F, z) -
                              0.05F * smooth_step(1.375F, 1.43F, z);
          const float notch = band(z - 1.385F - (y - v) * 0.35F, 0.0015F, 0.001F) *
                              smooth_step(v + 0.012F, v + 0.02F, y);
          if (z < 1.47F) {
            c *= 1.0F + 0.05F * smooth_step(lapel, lapel - 0.001F, y);
            c *= 1.0F - 0.32F * band(y - lapel, 0.0014F, 0.0012F);
            c *= 1.0F - 0.40F * notch * smooth_step(lapel, lapel - 0.002F, y);
          }
          c *= 1.0F - 0.35F * band(edge - 0.001F, 0.0012F, 0.001F);
          glm::vec3 shirt = f_.color.under * crease(p, {12.0F, 14.0F, 24.0F}, 0.2F);
          shirt *= 1.0F - 0.35F * smooth_step(-0.012F, 0.0F, edge);
          cover(shirt, inside);
          if (f_.top == TopStyle::kSuit && !f_.feminine) {
            const float tie_half =
                0.010F + 0.020F * smooth_step(1.46F, 1.20F, z) + 0.004F * bell(z - 1.455F, 0.010F);
            glm::vec3 tie = f_.color.accent *
                            (0.9F + 0.2F * smooth_step(-0.1F, 0.1F, std::sin((z + p.y) * 330.0F)));
            tie *= 1.0F - 0.3F * band(z - 1.440F, 0.0015F, 0.001F);
            const float on = smooth_step(tie_half + 0.0006F, tie_half - 0.0006F, y) * inside;
            cover(tie, on);
          } else if (inside > 0.0F) {
            c *= 1.0F - 0.2F * band(y, 0.001F, 0.0008F) * inside;
          }
        }
        if (front && z <= low + 0.01F) c *= 1.0F - 0.30F * band(p.y - 0.003F, 0.0014F, 0.001F);
        if (front) {
          const glm::vec3 horn = f_.color.top * 0.28F;
          if (f_.top == TopStyle::kSuit) {
            button(0.0F, 1.105F, 0.0070F, horn);
            button(0.0F, 1.020F, 0.0070F, horn);
            pocket(p.y > 0 ? 0.09F : -0.09F, 0.985F, 0.045F, 0.020F, 0.25F);
            cover(f_.color.under * 0.97F,
                  band(p.y - 0.088F, 0.020F, 0.0006F) *
                      band(z - 1.292F - 0.06F * (p.y - 0.088F), 0.0055F, 0.0008F));
          } else {
            for (int i = 0; i < 4; ++i) {
              button(0.040F, 1.17F - 0.10F * static_cast<float>(i), 0.0090F, horn);
              button(-0.040F, 1.17F - 0.10F * static_cast<float>(i), 0.0090F, horn);
            }
            pocket(p.y > 0 ? 0.095F : -0.095F, 0.965F, 0.048F, 0.012F, 0.28F);
          }
        }
        if (f_.belt && !arm) belt(t, c, tint, 1.065F, 0.020F);
        if (arm && a > f_.sleeve_m - 0.07F && t.n.x < 0.1F) {
          for (int i = 0; i < 3; ++i) {
            const float r = std::hypot(a - f_.sleeve_m + 0.022F + 0.016F * static_cast<float>(i),
                                       p.x + 0.012F - (a - land_.elbow_m) * 0.13F + 0.006F);
            cover(f_.color.top * 0.3F, band(r, 0.0045F, 0.0008F));
          }
        }
        break;
      }
      case TopStyle::kHoodie:
        if (front) {
          const float side = 0.125F - 0.45F * std::max(0.0F, z - 1.03F);
          const float d = std::max(y - side, std::max(0.955F - z, z - 1.125F));
          c *= 1.0F - 0.28F * band(d, 0.0016F, 0.0012F);
          c *= 1.0F + 0.03F * smooth_step(0.0F, -0.003F, d);
          // cords
          const float cord =
              std::max(band(y - 0.030F + 0.10F * (1.46F - z) * 0.2F, 0.0032F, 0.0008F) *
                           smooth_step(1.315F, 1.318F, z) * smooth_step(1.475F, 1.47F, z),
                       0.0F);
          cover(f_.color.under * (0.85F + 0.15F * std::sin(z * 1500.0F)), cord);
          c *= 1.0F - 0.2F * band(y - 0.0355F + 0.02F * (1.46F - z), 0.002F, 0.001F) *
                          smooth_step(1.315F, 1.32F, z) * smooth_step(1.475F, 1.47F, z);
        }
        if (!arm && z < f_.hem_z + 0.055F)
          c *= 0.88F + 0.06F * std::sin(std::atan2(p.y, p.x) * 150.0F);
        break;
      case TopStyle::kDress:
        if (!arm) belt(t, c, tint, 1.062F, f_.belt ? 0.016F : 0.0F);
        break;
      case TopStyle::kSafetyVest: {
        if (arm) {
          cover(f_.color.accent * weave(p, 500.0F), smooth_step(0.016F, 0.010F, a));
          break;
        }
        tint = glm::vec4{0.0F};
        const glm::vec3 silver{0.80F, 0.81F, 0.82F};
        const glm::vec3 trim = f_.color.under;
        const auto tape = [&](float d) {
          const float rim = band(d, 0.034F, 0.001F), core = band(d, 0.024F, 0.001F);
          c = glm::mix(c, trim, rim);
          c = glm::mix(c, silver * (0.92F + 0.10F * noise(p * 300.0F)), core);
        };
        tape(z - 1.010F);
        tape(z - 1.150F);
        if (z > 1.15F) tape(y - 0.098F + 0.16F * std::max(0.0F, z - 1.36F));
        if (front) {
          c *= 1.0F - 0.45F * band(p.y, 0.0022F, 0.001F);
          c = glm::mix(
              c, glm::vec3{0.18F},
              0.8F * band(p.y, 0.0014F, 0.0006F) * smooth_step(-0.2F, 0.2F, std::sin(z * 1500.0F)));
          // the neck opening shows the shirt
          const float v = std::max(0.0F, z - 1.36F) * 0.52F;
          const float inside = smooth_step(0.001F, -0.001F, y - v) * smooth_step(1.36F, 1.37F, z);
          c = glm::mix(c, f_.color.top * 0.92F, inside);
          tint.b = inside;
          c *= 1.0F - 0.35F * band(y - v, 0.003F, 0.001F) * smooth_step(1.37F, 1.38F, z);
        }
        break;
      }
    }
    if (f_.collar == CollarStyle::kScoop && !arm) {
      // neckline
      const float ahead = smooth_step(-0.4F, 0.4F, t.n.x);
      const float line = glm::mix(1.494F, 1.452F, ahead) + glm::mix(2.9F, 5.1F, ahead) * p.y * p.y;
      const float bare = smooth_step(line - 0.0008F, line + 0.0008F, z);
      c *= 1.0F - 0.25F * band(z - line + 0.004F, 0.0014F, 0.001F);
      const Paint skin = body_skin(t);
      c = glm::mix(c, skin.color * (1.0F - 0.25F * smooth_step(line + 0.010F, line, z)), bare);
      tint = glm::mix(tint, skin.tint, bare);
    }
    if (f_.belt && f_.hem_z > 1.0F && f_.top != TopStyle::kDress && !arm)
      belt(t, c, tint, 1.040F, 0.012F);
  }

  void belt(const Texel& t, glm::vec3& c, glm::vec4& tint, float height, float half) const {
    if (half <= 0.0F) return;
    const float d = t.p.z - height;
    const float on = band(d, half, 0.0008F);
    glm::vec3 leather = f_.color.shoe * (1.05F + 0.15F * (noise(t.p * 200.0F) - 0.5F));
    leather *= 1.0F - 0.3F * band(std::abs(d) - half * 0.8F, 0.0008F, 0.0006F);
    if (t.n.x > 0.3F) {
      const float r = std::max(std::abs(t.p.y) - 0.017F, std::abs(d) - half * 0.95F);
      leather =
          glm::mix(leather, glm::vec3{0.72F, 0.68F, 0.55F}, band(r + 0.002F, 0.0028F, 0.0006F));
    }
    c *= 1.0F - 0.3F * band(std::abs(d) - half - 0.002F, 0.002F, 0.0016F);
    c = glm::mix(c, leather, on);
    tint *= 1.0F - on;
  }

  /// Straps of the bag, painted over the top. True where the texel is covered.
  bool strap(const Texel& t, glm::vec3& c, glm::vec4& tint, bool front, bool arm) const {
    if (f_.bag == BagStyle::kNone || arm) return false;
    const glm::vec3 p = t.p;
    const float y = std::abs(p.y), z = p.z;
    float d = 1.0F, half = 0.018F;
    if (f_.bag == BagStyle::kBackpack) {
      // down the chest, then under the arm
      const float turn = std::max(0.0F, 1.27F - z);
      const float centre = 0.098F - 0.10F * std::max(0.0F, z - 1.38F) + 5.0F * turn * turn;
      if (front && z > 1.10F) d = (y - centre) / std::sqrt(1.0F + 100.0F * turn * turn);
      if (!front && z > 1.40F) d = y - centre;
      half = 0.020F;
    } else if (f_.bag == BagStyle::kMessenger) {
      // from the left shoulder to the right hip, in front and behind
      const float line = 0.085F - (1.46F - z) * 0.46F;
      if (z > 0.94F) d = (p.y - line) * 0.9F;
    } else {
      const float line = -0.110F - 0.02F * (1.45F - z);
      if (z > 1.05F) d = p.y - line;
      half = 0.010F;
    }
    const bool on_collar = z > 1.45F && std::hypot((p.x + 0.020F) / 0.095F, p.y / 0.088F) < 1.0F;
    if (std::abs(d) > half + 0.012F || (on_collar && f_.bag == BagStyle::kBackpack)) return false;
    c *= 1.0F - 0.40F * smooth_step(half + 0.010F, half, std::abs(d));
    glm::vec3 s = f_.color.bag * (0.95F + 0.14F * (noise(p * 350.0F) - 0.5F));
    s *= 1.0F - 0.25F * band(std::abs(d) - half * 0.78F, 0.0010F, 0.0008F);
    const float on = band(d, half, 0.0008F);
    c = glm::mix(c, s, on);
    tint *= 1.0F - on;
    return on > 0.5F;
  }

  Paint bottom(const Texel& t) const {
    Paint out;
    out.tint.a = 1.0F;
    const glm::vec3 p = t.p;
    const float z = p.z;
    glm::vec3 c = f_.color.bottom;
    const bool leg = t.part == Part::kLegLeft || t.part == Part::kLegRight;
    const float side = t.part == Part::kLegRight || (!leg && p.y < 0.0F) ? -1.0F : 1.0F;
    const float s =
        std::clamp((z - land_.ankle.z) / (land_.hip_joint.z - land_.ankle.z), 0.0F, 1.0F);
    const float axis_y = glm::mix(land_.ankle.y, land_.hip_joint.y, s);
    const glm::vec2 r{p.x - glm::mix(land_.ankle.x, land_.hip_joint.x, s), p.y * side - axis_y};
    const float phi = std::atan2(r.y, r.x);  // 0 front, pi/2 outside
    const auto line = [&](float angle, float strength) {
      const float d = std::remainder(phi - angle, 2.0F * kPi) * 0.075F;
      c *= 1.0F - strength * band(d, 0.0013F, 0.0010F);
      c *= 1.0F + 0.4F * strength * band(d - 0.0035F, 0.0010F, 0.0010F);
    };
    if (f_.bottom == BottomStyle::kSkirt) {
      const float azimuth = std::atan2(p.y, p.x);
      c *= weave(p, 520.0F);
      if (t.part == Part::kSkirt || !leg) {
        const float depth = smooth_step(1.0F, f_.skirt_z, z);
        const float ripple = noise({azimuth * 5.5F, z * 1.2F, 2.0F}) -
                             noise({azimuth * 5.5F + 0.5F, z * 1.2F, 2.0F});
        const float fine = noise({azimuth * 13.0F, z * 2.0F, 5.0F}) -
                           noise({azimuth * 13.0F + 0.5F, z * 2.0F, 5.0F});
        c *= 1.0F + depth * (0.26F * ripple + 0.14F * fine) * f_.skirt_flare;
        c *= 1.0F - 0.20F * band(z - f_.skirt_z - 0.016F, 0.0010F, 0.0010F);
        if (f_.top == TopStyle::kDress) c = pattern(t, c, z, azimuth * 0.17F);
        if (f_.belt && f_.top == TopStyle::kDress) belt(t, c, out.tint, 1.062F, 0.016F);
      } else {
        c *= crease(p, {14.0F, 14.0F, 30.0F}, 0.15F);  // leggings under a child's skirt
      }
      // one garment, one tint
      if (f_.top == TopStyle::kDress) {
        out.tint.b = out.tint.a;
        out.tint.a = 0.0F;
      }
      out.color = c;
      return out;
    }
    const float knee = bell(z - 0.50F, 0.09F), ankle = bell(z - 0.10F, 0.07F),
                crotch = bell(z - 0.83F, 0.07F);
    const float soft = f_.bottom == BottomStyle::kLeggings   ? 0.4F
                       : f_.bottom == BottomStyle::kTrousers ? 0.7F
                                                             : 1.0F;
    c *= crease({p.x, p.y, z}, {13.0F, 13.0F, 30.0F},
                0.34F * soft * (0.30F + 0.8F * knee + 1.0F * ankle + 0.5F * crotch));
    // creases run from the crotch to the hips
    c *= crease({z - std::abs(p.y) * 0.8F, p.x, p.y}, {36.0F, 6.0F, 6.0F},
                0.36F * soft * crotch * smooth_step(-0.2F, 0.5F, std::abs(t.n.x)));
    if (f_.bottom == BottomStyle::kJeans || f_.bottom == BottomStyle::kShorts) {
      const float twill = noise({(p.x + z) * 700.0F, (p.y + z) * 700.0F, 1.0F});
      c *= 0.95F + 0.10F * twill;
      if (f_.bottom == BottomStyle::kJeans) {
        // worn thighs and knees
        const float fade = (bell(z - 0.66F, 0.13F) + 0.6F * bell(z - 0.49F, 0.06F)) *
                           smooth_step(0.2F, 0.9F, t.n.x);
        c *= 1.0F + 0.16F * fade;
        c *= 1.0F - 0.14F * smooth_step(0.6F, 0.1F, std::abs(t.n.x)) * (leg ? 1.0F : 0.3F);
      }
      line(0.5F * kPi, 0.26F);
      line(-0.5F * kPi, 0.26F);
    } else if (f_.bottom == BottomStyle::kTrousers) {
      c *= weave(p, 640.0F);
      if (leg) {
        c *= 1.0F + 0.16F * band(phi * 0.07F, 0.0016F, 0.0014F) * smooth_step(0.80F, 0.70F, z);
        c *= 1.0F - 0.08F * bell(phi * 0.07F - 0.006F, 0.006F) * smooth_step(0.80F, 0.70F, z);
      }
      line(0.5F * kPi, 0.18F);
    } else {
      c *= weave(p, 420.0F);
      c = glm::mix(c, f_.color.accent,
                   (f_.top == TopStyle::kSport ? 0.8F : 0.0F) *
                       band(std::remainder(phi - 0.5F * kPi, 2.0F * kPi) * 0.06F, 0.007F, 0.001F));
    }
    c *= 1.0F - 0.18F * band(z - f_.trouser_z - 0.020F, 0.0010F, 0.0010F) * (leg ? 1.0F : 0.0F);
    // pockets, fly, waistband
    if (!leg && z > 0.85F) {
      const float y = std::abs(p.y);
      if (t.n.x > 0.1F) {
        c *= 1.0F - 0.30F *
                        band(std::hypot(y - 0.165F, (z - 1.03F) * 0.8F) - 0.075F, 0.0016F, 0.001F) *
                        smooth_step(1.02F, 1.0F, z);
        c *= 1.0F - 0.25F * band(p.y - 0.004F, 0.0014F, 0.001F) * smooth_step(0.86F, 0.87F, z);
        c *= 1.0F - 0.14F * band(p.y - 0.022F, 0.0009F, 0.0007F) * smooth_step(0.905F, 0.91F, z);
      } else if (t.n.x < -0.1F && f_.bottom != BottomStyle::kLeggings) {
        const float d = std::max(std::abs(y - 0.078F) - 0.045F, std::abs(z - 0.925F) - 0.050F);
        c *= 1.0F - 0.28F * band(d, 0.0015F, 0.001F);
        c *= 1.0F - 0.22F * band(p.y, 0.0015F, 0.001F);
      }
      c *= 1.0F - 0.22F * band(z - 0.992F, 0.0013F, 0.001F);
      if (f_.belt) belt(t, c, out.tint, 1.012F, 0.016F);
    }
    out.color = c;
    return out;
  }

  glm::vec3 sock(const Texel& t) const {
    glm::vec3 c = f_.shoe == ShoeStyle::kFlat && f_.bottom == BottomStyle::kSkirt ? f_.color.skin
                  : f_.shoe == ShoeStyle::kLeather ? glm::vec3{0.16F, 0.16F, 0.19F}
                                                   : glm::vec3{0.80F, 0.80F, 0.79F};
    return c * (0.93F + 0.09F * std::sin(std::atan2(std::abs(t.p.y) - land_.ankle.y,
                                                    t.p.x - land_.ankle.x) *
                                         40.0F));
  }

  glm::vec3 shoe(const Texel& t) const {
    const glm::vec3 p = t.p;
    const float y = std::abs(p.y) - land_.ankle.y - 0.008F * smooth_step(0.0F, 0.18F, p.x);
    const float z = p.z;
    glm::vec3 c = f_.color.shoe * (0.94F + 0.12F * noise(p * 160.0F));
    const float welt = f_.shoe == ShoeStyle::kSneaker ? 0.024F
                       : f_.shoe == ShoeStyle::kBoot  ? 0.022F
                                                      : 0.013F;
    const bool on_sole = z < welt || t.region == Region::kSole;
    const bool top_side = t.n.z > 0.15F;
    if (on_sole) {
      c = f_.color.sole * (0.95F + 0.08F * noise(p * 200.0F));
      if (t.n.z < -0.6F)
        c *= 0.62F - 0.12F * smooth_step(-0.2F, 0.2F, std::sin(p.x * 420.0F));
      else
        c *= 1.0F - 0.22F * band(z - welt * 0.55F, 0.0011F, 0.0008F);
      return c;
    }
    c *= 1.0F - 0.40F * band(z - welt - 0.001F, 0.0016F, 0.0012F);
    switch (f_.shoe) {
      case ShoeStyle::kSneaker: {
        // tongue and laces
        const float lace_zone = smooth_step(0.045F, 0.052F, p.x) *
                                smooth_step(0.138F, 0.130F, p.x) * (top_side ? 1.0F : 0.0F);
        const float half = 0.020F;
        c *= 1.0F - 0.35F * band(std::abs(y) - half, 0.0014F, 0.0010F) * lace_zone;
        const float in = smooth_step(half, half - 0.001F, std::abs(y)) * lace_zone;
        c = glm::mix(c, f_.color.shoe * 0.72F, 0.7F * in);
        const float stripe = std::remainder(p.x + 0.25F * std::abs(y), 0.0165F);
        c = glm::mix(c, f_.color.sole, 0.95F * in * band(stripe, 0.0036F, 0.0008F));
        // side mark, toe cap, heel tab
        c = glm::mix(c, f_.color.accent,
                     0.85F * band(p.x - 0.045F - (z - 0.045F) * 0.9F, 0.009F, 0.001F) *
                         smooth_step(0.070F, 0.066F, z) * smooth_step(0.5F, 0.7F, std::abs(t.n.y)));
        c *= 1.0F - 0.30F * band(p.x - 0.148F - y * y * 8.0F, 0.0014F, 0.001F);
        c = glm::mix(c, f_.color.sole * 0.9F,
                     0.5F * smooth_step(0.150F, 0.152F, p.x - y * y * 8.0F) *
                         smooth_step(0.040F, 0.036F, z));
        c = glm::mix(c, f_.color.accent, 0.7F * smooth_step(-0.072F, -0.076F, p.x));
        break;
      }
      case ShoeStyle::kLeather: {
        c *= 1.0F + 0.35F * bell(p.x - 0.165F, 0.020F) * smooth_step(0.3F, 0.9F, t.n.z);
        c *= 1.0F - 0.35F * band(p.x - 0.138F - y * y * 4.0F, 0.0014F, 0.001F);
        const float lace_zone = smooth_step(0.070F, 0.074F, p.x) *
                                smooth_step(0.126F, 0.122F, p.x) * (top_side ? 1.0F : 0.0F);
        c *= 1.0F - 0.35F * band(std::abs(y) - 0.012F, 0.0012F, 0.001F) * lace_zone;
        c = glm::mix(c, f_.color.shoe * 0.4F,
                     0.9F * lace_zone * smooth_step(0.012F, 0.011F, std::abs(y)) *
                         band(std::remainder(p.x, 0.013F), 0.0022F, 0.0008F));
        break;
      }
      case ShoeStyle::kBoot: {
        const float lace_zone = smooth_step(0.02F, 0.03F, p.x) * smooth_step(0.132F, 0.126F, p.x) *
                                smooth_step(0.3F, 0.5F, std::max(t.n.z, t.n.x));
        const float in = smooth_step(0.016F, 0.015F, std::abs(y)) * lace_zone;
        c = glm::mix(c, f_.color.shoe * 0.6F, 0.7F * in);
        c = glm::mix(c, glm::vec3{0.55F, 0.45F, 0.30F},
                     0.9F * in * band(std::remainder(p.x * 0.6F - z, 0.018F), 0.0026F, 0.0008F));
        c *= 1.0F - 0.3F * band(p.x - 0.145F - y * y * 6.0F, 0.0016F, 0.001F);
        c *= 1.0F - 0.3F * band(z - 0.112F, 0.0016F, 0.001F);
        break;
      }
      case ShoeStyle::kFlat: {
        // cut low: the instep is bare
        const float opening = std::hypot((p.x - 0.045F) / 0.078F, y / 0.036F);
        const float bare = smooth_step(1.02F, 0.98F, opening) * (t.n.z > -0.1F ? 1.0F : 0.0F) *
                           smooth_step(0.035F, 0.040F, z);
        const float ankle = smooth_step(0.064F, 0.067F, z + std::max(0.0F, -p.x - 0.02F) * 0.15F);
        const float open = std::max(bare, ankle);
        c *= 1.0F - 0.3F * band(opening - 1.03F, 0.03F, 0.02F);
        c = glm::mix(c, f_.color.skin * (0.92F + 0.05F * noise(p * 120.0F)), open);
        c = glm::mix(c, f_.color.accent,
                     (1.0F - open) * 0.9F * band(std::hypot(p.x - 0.140F, y), 0.009F, 0.001F) *
                         (t.n.z > 0.2F ? 1.0F : 0.0F));
        break;
      }
    }
    return c;
  }

  glm::vec3 hat(const Texel& t) const {
    const glm::vec3 p = t.p;
    glm::vec3 c = f_.color.hat;
    const float azimuth = std::atan2(p.y, p.x + 0.004F);
    switch (f_.hat) {
      case HatStyle::kNone:
        break;
      case HatStyle::kHeadscarf:
        c = headscarf(t);
        break;
      case HatStyle::kCap:
        c *= weave(p, 500.0F);
        if (p.z > 1.70F)
          c *= 1.0F - 0.25F * band(std::remainder(azimuth, kPi / 3.0F) * 0.08F, 0.0012F, 0.001F);
        c = glm::mix(c, f_.color.accent,
                     0.9F * band(std::hypot(p.y, p.z - 1.742F), 0.020F, 0.001F) *
                         (t.n.x > 0.3F ? 1.0F : 0.0F));
        c *= 1.0F - 0.5F * band(std::hypot(p.x + 0.002F, p.y), 0.006F, 0.001F) *
                        smooth_step(1.78F, 1.79F, p.z);
        if (t.region == Region::kHat)
          c *= 1.0F -
               0.12F * smooth_step(0.2F, 0.6F, std::sin((p.x + 0.3F * std::abs(p.y)) * 500.0F));
        break;
      case HatStyle::kBeanie:
        c *= 0.86F + 0.16F * std::abs(std::sin(azimuth * 34.0F)) +
             0.08F * (noise(p * 300.0F) - 0.5F);
        c *= 1.0F - 0.25F * band(p.z - 1.730F - 0.012F * std::cos(azimuth), 0.0022F, 0.0016F);
        c = p.z < 1.730F + 0.012F * std::cos(azimuth) ? c * 0.94F : c;
        break;
      case HatStyle::kHelmet:
        c *= 1.0F + 0.10F * bell(p.y, 0.012F) + 0.06F * bell(std::abs(p.y) - 0.035F, 0.006F);
        c *= 1.0F - 0.14F * band(std::abs(p.y) - 0.020F, 0.002F, 0.0015F);
        c = glm::mix(c, f_.color.accent,
                     0.9F * band(std::hypot(p.y, p.z - 1.755F), 0.016F, 0.001F) *
                         (t.n.x > 0.2F ? 1.0F : 0.0F));
        break;
      case HatStyle::kFlatCap: {
        const float a = std::sin(p.x * 260.0F), b = std::sin(p.y * 260.0F);
        c *= weave(p, 380.0F) * (1.0F - 0.07F * (a > 0.0F) - 0.07F * (b > 0.0F));
        break;
      }
      case HatStyle::kSunHat:
        c *= 0.90F + 0.10F * std::sin(p.z * 1600.0F) * std::sin(azimuth * 120.0F) +
             0.06F * (noise(p * 200.0F) - 0.5F);
        c = glm::mix(c, f_.color.accent,
                     0.9F * (t.region == Region::kHat ? 0.0F : band(p.z - 1.722F, 0.013F, 0.001F)));
        break;
    }
    return c;
  }

  glm::vec3 headscarf(const Texel& t) const {
    const float azimuth = std::atan2(t.p.y, t.p.x + 0.02F);
    glm::vec3 c = f_.color.scarf * weave(t.p, 520.0F);
    c *= crease({azimuth * 0.16F + t.p.z * 0.5F, t.p.z, t.p.x}, {40.0F, 20.0F, 6.0F}, 0.40F);
    return c;
  }

  glm::vec3 scarf(const Texel& t) const {
    if (f_.hat == HatStyle::kHeadscarf) return headscarf(t);
    const float azimuth = std::atan2(t.p.y, t.p.x + 0.015F);
    glm::vec3 c = f_.color.scarf * (0.92F + 0.10F * std::sin(azimuth * 160.0F)) *
                  (0.95F + 0.1F * noise(t.p * 300.0F));
    c *= crease({azimuth * 0.1F, t.p.z, t.p.x}, {30.0F, 60.0F, 10.0F}, 0.5F);
    return c *
           (1.0F - 0.25F * band(std::remainder(azimuth * 2.0F + t.p.z * 8.0F, 1.3F), 0.12F, 0.04F));
  }

  glm::vec3 bag(const Texel& t) const {
    const glm::vec3 p = t.p;
    glm::vec3 c = f_.color.bag * weave(p, 400.0F) * crease(p, {14.0F, 14.0F, 18.0F}, 0.22F);
    const auto seam = [&](float d) {
      c *= 1.0F - 0.30F * band(d, 0.0016F, 0.0012F);
      c *= 1.0F + 0.15F * band(d - 0.004F, 0.0012F, 0.001F);
    };
    if (f_.bag == BagStyle::kBackpack) {
      seam(std::abs(p.y) - 0.090F);
      if (t.n.x < -0.5F) {
        const float d = std::max(std::abs(p.y) - 0.072F, std::abs(p.z - 1.165F) - 0.068F);
        seam(d);
        c = glm::mix(c, glm::vec3{0.62F},
                     0.8F * band(p.z - 1.215F, 0.0022F, 0.0008F) *
                         smooth_step(0.066F, 0.064F, std::abs(p.y)));
        c = glm::mix(c, f_.color.accent,
                     0.85F * band(std::max(std::abs(p.y) - 0.016F, std::abs(p.z - 1.345F) - 0.012F),
                                  0.001F, 0.001F));
        c = glm::mix(
            c, f_.color.accent,
            0.85F * smooth_step(0.0F, -0.001F,
                                std::max(std::abs(p.y) - 0.016F, std::abs(p.z - 1.345F) - 0.012F)));
      }
      c = glm::mix(
          c, glm::vec3{0.62F},
          0.7F * band(std::abs(p.y) - 0.118F, 0.0018F, 0.0008F) * smooth_step(1.18F, 1.2F, p.z));
    } else {
      // flap with a clasp
      const float flap = f_.bag == BagStyle::kMessenger ? 0.965F : 1.005F;
      c *= p.z > flap ? 1.04F : 0.92F;
      c *= 1.0F - 0.45F * band(p.z - flap + 0.003F, 0.0022F, 0.0016F);
      seam(p.z - 0.875F);
      c = glm::mix(c, glm::vec3{0.75F, 0.68F, 0.48F},
                   0.9F * band(std::max(std::abs(p.x + 0.085F) - 0.010F,
                                        std::abs(p.z - flap - 0.006F) - 0.007F),
                               0.0015F, 0.0012F));
    }
    return c;
  }

  Paint lining(const Texel& t) const {
    Paint out;
    const bool leg = t.part == Part::kLegLeft || t.part == Part::kLegRight;
    const bool below = leg || (t.part == Part::kSkirt && f_.bottom == BottomStyle::kSkirt);
    out.color = (below ? f_.color.bottom : f_.color.top) * 0.55F;
    const bool collar = !below && !is_arm(t) && t.p.z > 1.45F;
    if (collar) {
      const bool shirt = f_.top == TopStyle::kSuit || f_.top == TopStyle::kCoat;
      out.color = (shirt ? f_.color.under : f_.color.top) * 0.86F;
      if (!shirt) out.tint.b = 1.0F;
    } else if (f_.top == TopStyle::kSafetyVest && !below && !is_arm(t)) {
      out.color = f_.color.accent * 0.6F;
    } else if (below && f_.top != TopStyle::kDress) {
      out.tint.a = 1.0F;
    } else {
      out.tint.b = 1.0F;
    }
    return out;
  }

  const Figure& f_;
  Landmarks land_;
};

/// Triangles in a tree of boxes, for short visibility rays.
class Occluders {
 public:
  Occluders(const Mesh& mesh, const std::vector<glm::vec3>& position) {
    for (const MeshFace& f : mesh.faces) {
      triangles_.push_back({position[f.corner[0]], position[f.corner[1]] - position[f.corner[0]],
                            position[f.corner[2]] - position[f.corner[0]]});
    }
    order_.resize(triangles_.size());
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<int>(i);
    split(0, static_cast<int>(order_.size()));
  }

  /// Distance to the first triangle along a unit ray, or `reach`.
  float distance(const glm::vec3& from, const glm::vec3& direction, float reach) const {
    const glm::vec3 inverse = 1.0F / direction;
    float best = reach;
    int stack[64];
    int top = 0;
    stack[top++] = 0;
    while (top > 0) {
      const Node& node = nodes_[stack[--top]];
      const glm::vec3 a = (node.low - from) * inverse, b = (node.high - from) * inverse;
      const glm::vec3 near = glm::min(a, b), far = glm::max(a, b);
      const float enter = std::max({near.x, near.y, near.z, 0.0F}),
                  leave = std::min({far.x, far.y, far.z, best});
      if (!(enter <= leave)) continue;
      if (node.count > 0) {
        for (int i = node.first; i < node.first + node.count; ++i) {
          const Triangle& t = triangles_[order_[i]];
          const glm::vec3 h = glm::cross(direction, t.e2);
          const float det = glm::dot(t.e1, h);
          if (std::abs(det) < 1e-12F) continue;
          const glm::vec3 s = from - t.p;
          const float u = glm::dot(s, h) / det;
          if (u < 0.0F || u > 1.0F) continue;
          const glm::vec3 q = glm::cross(s, t.e1);
          const float v = glm::dot(direction, q) / det;
          if (v < 0.0F || u + v > 1.0F) continue;
          const float along = glm::dot(t.e2, q) / det;
          if (along > 1e-4F && along < best) best = along;
        }
      } else {
        stack[top++] = node.first;
        stack[top++] = node.first + 1;
      }
    }
    return best;
  }

 private:
  struct Triangle {
    glm::vec3 p, e1, e2;
  };
  struct Node {
    glm::vec3 low{1e9F}, high{-1e9F};
    int first = 0, count = 0;  // count 0: children at first, first + 1
  };

  void split(int begin, int end) {
    nodes_.clear();
    nodes_.push_back({});
    build(0, begin, end);
  }

  void build(int index, int begin, int end) {
    Node node;
    glm::vec3 low{1e9F}, high{-1e9F};
    for (int i = begin; i < end; ++i) {
      const Triangle& t = triangles_[order_[i]];
      for (const glm::vec3& p : {t.p, t.p + t.e1, t.p + t.e2}) {
        node.low = glm::min(node.low, p);
        node.high = glm::max(node.high, p);
      }
      const glm::vec3 c = t.p + (t.e1 + t.e2) / 3.0F;
      low = glm::min(low, c);
      high = glm::max(high, c);
    }
    if (end - begin <= 6) {
      node.first = begin;
      node.count = end - begin;
      nodes_[index] = node;
      return;
    }
    const glm::vec3 size = high - low;
    const int axis = size.x > size.y && size.x > size.z ? 0 : size.y > size.z ? 1 : 2;
    const int middle = (begin + end) / 2;
    const auto key = [&](int i) {
      return triangles_[i].p[axis] + (triangles_[i].e1[axis] + triangles_[i].e2[axis]) / 3.0F;
    };
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](int a, int b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
    node.first = static_cast<int>(nodes_.size());
    nodes_[index] = node;
    nodes_.push_back({});
    nodes_.push_back({});
    build(node.first, begin, middle);
    build(node.first + 1, middle, end);
  }

  std::vector<Triangle> triangles_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

/// Fills texels that nothing covers from coarser and coarser means of their surroundings.
void fill_gaps(std::vector<std::uint8_t>& image, std::uint32_t size) {
  // r g b and coverage, 0 or 255
  std::vector<std::vector<std::uint8_t>> level{std::move(image)};
  std::uint32_t side = size;
  while (side > 1) {
    const std::uint32_t half = side / 2;
    std::vector<std::uint8_t> next(static_cast<std::size_t>(half) * half * 4, 0);
    const std::vector<std::uint8_t>& fine = level.back();
    for (std::uint32_t y = 0; y < half; ++y) {
      for (std::uint32_t x = 0; x < half; ++x) {
        unsigned sum[3] = {0, 0, 0}, count = 0;
        for (std::uint32_t k = 0; k < 4; ++k) {
          const std::uint8_t* t =
              &fine[(static_cast<std::size_t>(2 * y + k / 2) * side + 2 * x + k % 2) * 4];
          if (t[3] == 0) continue;
          for (int c = 0; c < 3; ++c) sum[c] += t[c];
          ++count;
        }
        if (count == 0) continue;
        std::uint8_t* out = &next[(static_cast<std::size_t>(y) * half + x) * 4];
        for (int c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>(sum[c] / count);
        out[3] = 255;
      }
    }
    level.push_back(std::move(next));
    side = half;
  }
  for (std::size_t i = level.size() - 1; i-- > 0;) {
    side = size >> i;
    const std::vector<std::uint8_t>& coarse = level[i + 1];
    std::vector<std::uint8_t>& fine = level[i];
    for (std::uint32_t y = 0; y < side; ++y) {
      for (std::uint32_t x = 0; x < side; ++x) {
        std::uint8_t* t = &fine[(static_cast<std::size_t>(y) * side + x) * 4];
        if (t[3] != 0) continue;
        std::copy_n(&coarse[(static_cast<std::size_t>(y / 2) * (side / 2) + x / 2) * 4], 4, t);
      }
    }
  }
  image = std::move(level[0]);
}

}  // namespace

std::vector<float> sky_visibility(const Mesh& mesh, const std::vector<glm::vec3>& position,
                                  const std::vector<glm::vec3>& normal) {
  const Occluders occluders(mesh, position);
  constexpr int kRays = 32;
  constexpr float kReach = 0.30F;
  std::vector<float> out(position.size());
  for (std::size_t v = 0; v < position.size(); ++v) {
    const glm::vec3 n = normal[v];
    const glm::vec3 side = glm::normalize(std::abs(n.z) < 0.9F ? glm::cross(n, glm::vec3{0, 0, 1})
                                                               : glm::cross(n, glm::vec3{1, 0, 0}));
    const glm::vec3 up = glm::cross(side, n);
    float sum = 0.0F;
    for (int i = 0; i < kRays; ++i) {
      // cosine-weighted spiral
      const float r = std::sqrt((static_cast<float>(i) + 0.5F) / kRays),
                  angle = 2.399963F * static_cast<float>(i);
      const glm::vec3 d = glm::normalize(side * (r * std::cos(angle)) + up * (r * std::sin(angle)) +
                                         n * std::sqrt(1.0F - r * r + 1e-4F) + 1e-5F);
      const float distance = occluders.distance(position[v] + n * 0.003F, d, kReach);
      sum += smooth_step(0.0F, 1.0F, distance / kReach);
    }
    out[v] = sum / kRays;
  }
  // single rays are noisy, the surface is smooth
  const std::vector<std::vector<int>> near = mesh.neighbours();
  std::vector<float> smooth(out.size());
  for (std::size_t v = 0; v < out.size(); ++v) {
    float mean = 0.0F;
    for (const int other : near[v]) mean += out[other];
    smooth[v] = 0.6F * out[v] + 0.4F * mean / static_cast<float>(near[v].size());
  }
  return smooth;
}

void paint(const Figure& figure, const Mesh& mesh, const std::vector<glm::vec3>& normal,
           const std::vector<float>& sky, const Unwrap& layout,
           simplify::SourceMaterial& material) {
  const Painter painter(figure);
  const std::size_t texels = static_cast<std::size_t>(kTextureSize) * kTextureSize;
  std::vector<std::uint8_t> color(texels * 4, 0);
  std::vector<glm::u8vec4> tint(texels, glm::u8vec4{0});
  const auto size = static_cast<float>(kTextureSize);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const MeshFace& face = mesh.faces[f];
    glm::vec2 q[3];
    for (int i = 0; i < 3; ++i) q[i] = layout.uv[layout.corner[f][i]] * size;
    const float area =
        (q[1].x - q[0].x) * (q[2].y - q[0].y) - (q[1].y - q[0].y) * (q[2].x - q[0].x);
    if (std::abs(area) < 1e-9F) continue;
    Texel t;
    t.region = face.region;
    t.chart = face.chart;
    // a strip belongs to the part that hangs on it
    t.part = mesh.vertices[face.corner[0]].part;
    t.detail = mesh.vertices[face.corner[0]].detail;
    for (int i = 1; i < 3; ++i) {
      const MeshVertex& v = mesh.vertices[face.corner[i]];
      if (t.part == Part::kTorso && v.part != Part::kTorso) t.part = v.part;
      if (t.part == Part::kHead && v.part == Part::kHead && v.detail == 1) t.detail = 1;
      if (v.part == Part::kHair && t.region == Region::kHair) t.part = Part::kHair;
      if (t.region == Region::kSkin && v.part == Part::kHead) t.part = Part::kHead;
    }
    const MeshVertex* v[3];
    for (int i = 0; i < 3; ++i) v[i] = &mesh.vertices[face.corner[i]];
    // texels just outside are painted too, so that filtering stays inside the chart
    constexpr float kSlack = 0.75F;
    const int x0 =
        std::max(0, static_cast<int>(std::floor(std::min({q[0].x, q[1].x, q[2].x}) - kSlack)));
    const int x1 =
        std::min(static_cast<int>(kTextureSize) - 1,
                 static_cast<int>(std::ceil(std::max({q[0].x, q[1].x, q[2].x}) + kSlack)));
    const int y0 =
        std::max(0, static_cast<int>(std::floor(std::min({q[0].y, q[1].y, q[2].y}) - kSlack)));
    const int y1 =
        std::min(static_cast<int>(kTextureSize) - 1,
                 static_cast<int>(std::ceil(std::max({q[0].y, q[1].y, q[2].y}) + kSlack)));
    const float inverse = 1.0F / area;
    const float margin[3] = {kSlack * glm::length(q[2] - q[1]) * std::abs(inverse),
                             kSlack * glm::length(q[0] - q[2]) * std::abs(inverse),
                             kSlack * glm::length(q[1] - q[0]) * std::abs(inverse)};
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const glm::vec2 c{static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F};
        float w[3];
        w[0] = ((q[1].x - c.x) * (q[2].y - c.y) - (q[1].y - c.y) * (q[2].x - c.x)) * inverse;
        w[1] = ((q[2].x - c.x) * (q[0].y - c.y) - (q[2].y - c.y) * (q[0].x - c.x)) * inverse;
        w[2] = 1.0F - w[0] - w[1];
        if (w[0] < -margin[0] || w[1] < -margin[1] || w[2] < -margin[2]) continue;
        const bool inside = w[0] >= 0.0F && w[1] >= 0.0F && w[2] >= 0.0F;
        const std::size_t index =
            static_cast<std::size_t>(y) * kTextureSize + static_cast<std::size_t>(x);
        std::uint8_t* out = &color[index * 4];
        if (!inside && out[3] != 0) continue;
        t.p = v[0]->position * w[0] + v[1]->position * w[1] + v[2]->position * w[2];
        t.n = normal[face.corner[0]] * w[0] + normal[face.corner[1]] * w[1] +
              normal[face.corner[2]] * w[2];
        t.n /= std::max(1e-6F, glm::length(t.n));
        t.sky =
            sky[face.corner[0]] * w[0] + sky[face.corner[1]] * w[1] + sky[face.corner[2]] * w[2];
        const Paint result = painter.at(t);
        for (int k = 0; k < 3; ++k) {
          out[k] = static_cast<std::uint8_t>(result.color[k] * 255.0F + 0.5F);
        }
        out[3] = 255;
        tint[index] = glm::u8vec4(glm::clamp(result.tint, 0.0F, 1.0F) * 255.0F + 0.5F);
      }
    }
  }
  std::vector<std::uint8_t> covered(texels);
  for (std::size_t i = 0; i < texels; ++i) covered[i] = color[i * 4 + 3] != 0 ? 1 : 0;
  fill_gaps(color, kTextureSize);
  material.base_color.width_px = material.base_color.height_px = kTextureSize;
  material.base_color.rgba = std::move(color);
  // the mask at half size: mean of what is covered, then spread by two texels
  constexpr std::uint32_t kRatio = kTextureSize / kMaskSize;
  material.tint_mask.width_px = material.tint_mask.height_px = kMaskSize;
  material.tint_mask.rgba.assign(static_cast<std::size_t>(kMaskSize) * kMaskSize * 4, 0);
  std::vector<std::uint8_t> known(static_cast<std::size_t>(kMaskSize) * kMaskSize, 0);
  for (std::uint32_t y = 0; y < kMaskSize; ++y) {
    for (std::uint32_t x = 0; x < kMaskSize; ++x) {
      int sum[4] = {0, 0, 0, 0}, count = 0;
      for (std::uint32_t k = 0; k < kRatio * kRatio; ++k) {
        const std::size_t i = static_cast<std::size_t>(y * kRatio + k / kRatio) * kTextureSize +
                              x * kRatio + k % kRatio;
        if (covered[i] == 0) continue;
        for (int c = 0; c < 4; ++c) sum[c] += tint[i][c];
        ++count;
      }
      const std::size_t i = static_cast<std::size_t>(y) * kMaskSize + x;
      if (count == 0) continue;
      known[i] = 1;
      for (int c = 0; c < 4; ++c)
        material.tint_mask.rgba[i * 4 + c] = static_cast<std::uint8_t>(sum[c] / count);
    }
  }
  for (int round = 0; round < 3; ++round) {
    std::vector<std::uint8_t> next = known;
    for (std::uint32_t y = 1; y + 1 < kMaskSize; ++y) {
      for (std::uint32_t x = 1; x + 1 < kMaskSize; ++x) {
        const std::size_t i = static_cast<std::size_t>(y) * kMaskSize + x;
        if (known[i] != 0) continue;
        for (const std::size_t j : {i - 1, i + 1, i - kMaskSize, i + kMaskSize}) {
          if (known[j] == 0) continue;
          std::copy_n(&material.tint_mask.rgba[j * 4], 4, &material.tint_mask.rgba[i * 4]);
          next[i] = 1;
          break;
        }
      }
    }
    known.swap(next);
  }
}

}  // namespace throng::builtin
