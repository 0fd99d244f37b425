#include "simplify/builtin/motion.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/gtc/quaternion.hpp>

namespace throng::builtin {
namespace {

constexpr float kPi = 3.14159265F;
constexpr float kDegree = kPi / 180.0F;
constexpr float kRate = 30.0F;
constexpr float kTurnCycleRad = 0.5F * kPi;

float smooth_step(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

glm::quat about_x(float degrees) { return glm::angleAxis(degrees * kDegree, glm::vec3{1, 0, 0}); }
glm::quat about_y(float degrees) { return glm::angleAxis(degrees * kDegree, glm::vec3{0, 1, 0}); }
glm::quat about_z(float degrees) { return glm::angleAxis(degrees * kDegree, glm::vec3{0, 0, 1}); }

/// Reflection of a rotation in the plane y = 0.
glm::quat mirrored(const glm::quat& q) { return {q.w, -q.x, q.y, -q.z}; }

/// Mean and six harmonics (cosine, sine), degrees; argument in cycles.
using Harmonics = float[13];

float evaluate(const Harmonics& series, float cycles) {
  float sum = series[0];
  for (int i = 1; i <= 6; ++i) {
    const float angle = 2.0F * kPi * static_cast<float>(i) * cycles;
    sum += series[2 * i - 1] * std::cos(angle) + series[2 * i] * std::sin(angle);
  }
  return sum;
}

/// A planned gait for a leg of kUnit metres from hip to ankle; phase 0 is heel strike.
struct Gait {
  float duration_s;
  float stride_m;
  float hip_m;                    // mean height of the hip joint over the ground
  float bob_m;                    // amplitude, two a cycle
  float bob_phase;                // of a high point
  float reach_m;                  // ankle ahead of the hip at heel strike, foot flat
  float flat, heel_off, toe_off;  // phases
  float strike_rad, toe_rad;      // pitch of the foot at heel strike (toes up) and toe off (down)
  float shift;                    // of the captured curves, cycles
  Harmonics hip, knee;
  float pitch[4][2];  // phase, degrees: the foot in swing
};

constexpr float kUnit = 0.845F;

// Fitted to cmu_02_01_walk: stance differs from the capture by less than 7 degrees.
constexpr Gait kWalk = {1.10F,
                        1.233F,
                        0.8890F,
                        0.016F,
                        0.269F,
                        0.275F,
                        0.135F,
                        0.423F,
                        0.580F,
                        0.294F,
                        0.607F,
                        0.040F,
                        {11.76F, 22.70F, 3.81F, -3.30F, -4.58F, -0.47F, 2.26F, -0.25F, -0.22F,
                         -0.21F, 0.0F, 0.25F, 0.22F},
                        {35.86F, 9.14F, -14.17F, -17.72F, -3.86F, -2.12F, 5.49F, -1.79F, -0.16F,
                         -0.63F, 0.39F, 0.16F, 0.47F},
                        {{0.655F, -56.0F}, {0.76F, -46.0F}, {0.88F, -6.0F}, {0.955F, 14.0F}}};
// Fitted to cmu_02_03_run.
constexpr Gait kRun = {0.733F,
                       1.95F,
                       0.876F,
                       0.020F,
                       0.447F,
                       0.150F,
                       0.089F,
                       0.175F,
                       0.360F,
                       0.020F,
                       0.760F,
                       0.080F,
                       {13.50F, 22.91F, -13.23F, -7.16F, 0.48F, -1.68F, 0.04F, 0.27F, -0.19F, 0.16F,
                        -0.11F, 0.07F, 0.01F},
                       {57.75F, -0.70F, -32.53F, -18.77F, 7.47F, -2.04F, 0.22F, -0.32F, -0.11F,
                        -0.40F, 0.32F, 0.37F, 0.27F},
                       {{0.46F, -75.0F}, {0.62F, -82.0F}, {0.80F, -42.0F}, {0.93F, -6.0F}}};

struct Leg {
  float thigh_m, shin_m;
  glm::vec2 heel, ball, tip;  // sole, from the ankle, foot flat: forward, up
  glm::vec2 toe_joint;        // the toes bend here, a little above the sole
};

struct AnkleState {
  glm::vec2 ankle{0.0F};   // forward of the hip, above the ground
  float pitch_rad = 0.0F;  // toes up
  float toe_rad = 0.0F;    // bend of the toes against the foot
  float roll_m = 0.0F;     // how far the ankle has rolled forward over the resting point
};

glm::vec2 turned(const glm::vec2& v, float pitch) {
  const float c = std::cos(pitch), s = std::sin(pitch);
  return {v.x * c - v.y * s, v.x * s + v.y * c};
}

class LegPlan {
 public:
  LegPlan(const Gait& gait, const Leg& leg) : gait_(gait), leg_(leg) {
    scale_ = (leg.thigh_m + leg.shin_m) / kUnit;
    const glm::vec2 end = planar(stance(gait.toe_off), gait.toe_off);
    const glm::vec2 before = planar(stance(gait.toe_off - kStep), gait.toe_off - kStep);
    const glm::vec2 begin = planar(stance(0.0F), 0.0F);
    const glm::vec2 after = planar(stance(kStep), kStep);
    const auto capture = [&](float t) {
      return glm::vec2{evaluate(gait_.hip, t + gait_.shift), evaluate(gait_.knee, t + gait_.shift)};
    };
    off_[0] = end - capture(gait.toe_off);
    off_[1] = begin - capture(0.0F);
    const float span = 1.0F - gait.toe_off;
    slope_[0] =
        ((end - before) - (capture(gait.toe_off) - capture(gait.toe_off - kStep))) / kStep * span;
    slope_[1] = ((after - begin) - (capture(kStep) - capture(0.0F))) / kStep * span;
    // the foot lands without sliding; it may leave the ground with a small jerk of the knee
    slope_[0] = glm::clamp(slope_[0], glm::vec2{-12.0F}, glm::vec2{12.0F});
    slope_[1] = glm::clamp(slope_[1], glm::vec2{-60.0F}, glm::vec2{60.0F});
  }

  float stride_m() const { return gait_.stride_m * scale_; }

  float hip_height(float phase) const {
    return -leg_.heel.y +
           (gait_.hip_m - 0.085F + gait_.bob_m * std::cos(4.0F * kPi * (phase - gait_.bob_phase))) *
               scale_;
  }

  AnkleState at(float phase) const {
    phase -= std::floor(phase);
    if (phase <= gait_.toe_off) return stance(phase);
    const float s = (phase - gait_.toe_off) / (1.0F - gait_.toe_off);
    // captured angles plus what joins them to the stance at both ends (cubic Hermite)
    const float s2 = s * s, s3 = s2 * s;
    const glm::vec2 join = (2 * s3 - 3 * s2 + 1) * off_[0] + (s3 - 2 * s2 + s) * slope_[0] +
                           (3 * s2 - 2 * s3) * off_[1] + (s3 - s2) * slope_[1];
    const float hip = (evaluate(gait_.hip, phase + gait_.shift) + join.x) * kDegree;
    const float knee = std::max(2.0F, evaluate(gait_.knee, phase + gait_.shift) + join.y) * kDegree;
    AnkleState out;
    out.ankle = glm::vec2{
        std::sin(hip) * leg_.thigh_m + std::sin(hip - knee) * leg_.shin_m,
        hip_height(phase) - std::cos(hip) * leg_.thigh_m - std::cos(hip - knee) * leg_.shin_m};
    out.pitch_rad = swing_pitch(phase);
    const AnkleState end = stance(gait_.toe_off);
    out.toe_rad = end.toe_rad * (1.0F - smooth_step(0.0F, 0.55F, s));
    out.roll_m = glm::mix(end.roll_m, stance(0.0F).roll_m, smooth_step(0.0F, 1.0F, s));
    // the foot clears the ground
    float lowest = out.ankle.y + turned(leg_.heel, out.pitch_rad).y;
    for (const glm::vec2& point : {leg_.ball, leg_.tip}) {
      lowest = std::min(lowest, out.ankle.y + turned(leg_.toe_joint, out.pitch_rad).y +
                                    turned(point - leg_.toe_joint, out.pitch_rad + out.toe_rad).y);
    }
    const float clearance = 0.012F * std::sin(kPi * std::pow(s, 0.8F));
    if (lowest < clearance) out.ankle.y += clearance - lowest;
    return out;
  }

 private:
  static constexpr float kStep = 0.004F;

  AnkleState stance(float phase) const {
    AnkleState out;
    out.pitch_rad =
        gait_.strike_rad * (1.0F - smooth_step(0.0F, gait_.flat, phase)) -
        gait_.toe_rad *
            std::pow(
                std::clamp((phase - gait_.heel_off) / (gait_.toe_off - gait_.heel_off), 0.0F, 1.0F),
                1.8F);
    const float x = (gait_.reach_m - gait_.stride_m * phase) * scale_;
    const glm::vec2 pivot = out.pitch_rad >= 0.0F ? leg_.heel : leg_.toe_joint;
    const glm::vec2 from_pivot = pivot - turned(pivot, out.pitch_rad);
    out.ankle = glm::vec2{x, -leg_.heel.y} + from_pivot;
    out.roll_m = from_pivot.x;
    if (out.pitch_rad < 0.0F) out.toe_rad = -out.pitch_rad;
    return out;
  }

  /// Hip and knee angle that put the ankle there, degrees.
  glm::vec2 planar(const AnkleState& state, float phase) const {
    const float dx = state.ankle.x, dz = state.ankle.y - hip_height(phase);
    const float d = std::min(std::hypot(dx, dz), (leg_.thigh_m + leg_.shin_m) * 0.9995F);
    const float t = leg_.thigh_m, s = leg_.shin_m;
    const float knee =
        kPi - std::acos(std::clamp((t * t + s * s - d * d) / (2 * t * s), -1.0F, 1.0F));
    const float lift = std::acos(std::clamp((t * t + d * d - s * s) / (2 * t * d), -1.0F, 1.0F));
    return glm::vec2{std::atan2(dx, -dz) + lift, knee} / kDegree;
  }

  float swing_pitch(float phase) const {
    // through the keys with the slope of the neighbours
    float x[6], y[6];
    x[0] = gait_.toe_off;
    y[0] = -gait_.toe_rad / kDegree;
    for (int i = 0; i < 4; ++i) {
      x[i + 1] = gait_.pitch[i][0];
      y[i + 1] = gait_.pitch[i][1];
    }
    x[5] = 1.0F;
    y[5] = gait_.strike_rad / kDegree;
    int i = 0;
    while (i < 4 && phase > x[i + 1]) ++i;
    const auto slope = [&](int k) {
      if (k == 0) return 1.8F * y[0] / (gait_.toe_off - gait_.heel_off);
      if (k == 5) return 0.0F;
      return (y[k + 1] - y[k - 1]) / (x[k + 1] - x[k - 1]);
    };
    const float span = x[i + 1] - x[i];
    const float s = (phase - x[i]) / span, s2 = s * s, s3 = s2 * s;
    return ((2 * s3 - 3 * s2 + 1) * y[i] + (s3 - 2 * s2 + s) * span * slope(i) +
            (3 * s2 - 2 * s3) * y[i + 1] + (s3 - s2) * span * slope(i + 1)) *
           kDegree;
  }

  const Gait& gait_;
  Leg leg_;
  float scale_ = 1.0F;
  glm::vec2 off_[2], slope_[2];
};

/// One frame under construction.
class Pose {
 public:
  explicit Pose(const Rig& rig)
      : rig_(rig),
        local_(rig.joints.size(), glm::quat{1, 0, 0, 0}),
        world_(rig.joints.size()),
        has_world_(rig.joints.size(), false) {}

  void rotate(int joint, const glm::quat& rotation) {
    if (joint >= 0) local_[joint] = rotation;
  }
  /// The joint gets this rotation in the model frame, whatever its parents do.
  void fix(int joint, const glm::quat& rotation) {
    world_[joint] = rotation;
    has_world_[joint] = true;
  }

  glm::vec3 root_offset{0.0F};
  float skirt_behind_rad = -0.03F;  // how far a skirt stands off behind, at least

  void solve(std::vector<glm::vec3>& position, std::vector<glm::quat>& rotation) const {
    position.resize(rig_.joints.size());
    rotation.resize(rig_.joints.size());
    for (std::size_t j = 0; j < rig_.joints.size(); ++j) {
      const RigJoint& joint = rig_.joints[j];
      if (joint.parent < 0) {
        position[j] = joint.position + root_offset;
        rotation[j] = local_[j];
      } else {
        const RigJoint& parent = rig_.joints[joint.parent];
        position[j] =
            position[joint.parent] + rotation[joint.parent] * (joint.position - parent.position);
        rotation[j] = rotation[joint.parent] * local_[j];
      }
      if (has_world_[j]) rotation[j] = world_[j];
    }
  }

 private:
  const Rig& rig_;
  std::vector<glm::quat> local_, world_;
  std::vector<bool> has_world_;
};

class Animator {
 public:
  Animator(const Figure& figure, const Rig& rig) : figure_(figure), rig_(rig) {
    for (int side = 0; side < 2; ++side) {
      const std::string s = side == 0 ? "left_" : "right_";
      thigh_[side] = rig.find(s + "upper_leg");
      shin_[side] = rig.find(s + "lower_leg");
      foot_[side] = rig.find(s + "foot");
      toes_[side] = rig.find(s + "toes");
    }
    const glm::vec3 hip = at(thigh_[0]), knee = at(shin_[0]), ankle = at(foot_[0]),
                    ball = at(toes_[0]);
    leg_.thigh_m = glm::length(knee - hip);
    leg_.shin_m = glm::length(ankle - knee);
    const Landmarks land = landmarks_of(figure);
    const auto sole = [&](float x) {
      const glm::vec3 p = to_model(figure, {x, land.ankle.y, 0.0F}, Part::kLegLeft);
      return glm::vec2{p.x - ankle.x, -ankle.z};
    };
    leg_.heel = sole(-0.072F);
    leg_.ball = glm::vec2{ball.x - ankle.x, -ankle.z};
    leg_.toe_joint = glm::vec2{ball.x - ankle.x, ball.z - ankle.z};
    leg_.tip = sole(0.195F);
    leg_.tip.y += 0.010F;
  }

  simplify::SourceClip walk() {
    return cycle(
        "walk", render::ClipKind::kWalk, kWalk,
        kWalk.duration_s * std::sqrt(leg_.thigh_m + leg_.shin_m) / std::sqrt(kUnit) * figure_.pace);
  }
  simplify::SourceClip run() {
    return cycle("run", render::ClipKind::kRun, kRun,
                 kRun.duration_s * std::sqrt(leg_.thigh_m + leg_.shin_m) / std::sqrt(kUnit));
  }

  simplify::SourceClip idle() {
    simplify::SourceClip clip = start("idle", render::ClipKind::kIdle, 102, kRate);
    each_frame(clip, [&](Pose& pose, float t) { stand(pose, t); });
    return clip;
  }

  /// On a seat whose top is 0.45 m above the ground. The feet stand where the character stands, the
  /// pelvis is behind them, so that who sits down does not move its feet.
  simplify::SourceClip sit() {
    simplify::SourceClip clip = start("sit", render::ClipKind::kSit, 60, 12.0F);
    const float size = (leg_.thigh_m + leg_.shin_m) / kUnit;
    each_frame(clip, [&](Pose& pose, float t) {
      const float wave = std::sin(2.0F * kPi * t), breath = std::sin(6.0F * kPi * t);
      pose.skirt_behind_rad = 0.5F;  // it lies on the seat
      const float seat_m = 0.45F + 0.085F * size * figure_.thigh;
      pose.root_offset = {-0.96F * leg_.thigh_m - at(thigh_[0]).x, 0.006F * wave,
                          seat_m - at(thigh_[0]).z};
      pose.rotate(joint("hips"), about_y(-9.0F) * about_z(1.0F * wave));
      const float stoop = posture();
      pose.rotate(joint("spine1"), about_y(7.0F + stoop * 0.2F));
      pose.rotate(joint("spine2"), about_y(6.0F + stoop * 0.2F));
      pose.rotate(joint("spine3"), about_y(3.0F - 0.8F * breath + stoop * 0.2F));
      look_around(pose, t, 12.0F);
      for (int side = 0; side < 2; ++side) {
        const float s = side == 0 ? 1.0F : -1.0F;
        glm::vec3 ankle = at(foot_[side]);
        ankle.y += s * 0.02F;
        place_leg(pose, side, ankle, 0.0F, 0.0F, s * 10.0F);
      }
      std::vector<glm::vec3> position;
      std::vector<glm::quat> rotation;
      pose.solve(position, rotation);
      for (int side = 0; side < 2; ++side) {
        // the hands lie on the thighs, before the knees
        const glm::vec3 hip = position[thigh_[side]], knee = position[shin_[side]];
        glm::vec3 hand = glm::mix(hip, knee, 0.66F);
        hand.z += 0.115F * size;
        reach_arm(pose, side, hand, {-0.5F, 0.7F, -0.6F}, 12.0F);
      }
    });
    return clip;
  }

  /// Arms up, weight from toe to heel without leaving the ground.
  simplify::SourceClip cheer() {
    simplify::SourceClip clip = start("cheer", render::ClipKind::kCheer, 36, 20.0F);
    each_frame(clip, [&](Pose& pose, float t) {
      const float angle = 2.0F * kPi * t;
      stand(pose, t, 0.045F * (0.5F - 0.5F * std::cos(2.0F * angle)));
      pose.rotate(joint("spine3"), about_y(-6.0F) * about_z(4.0F * std::sin(angle)));
      pose.rotate(joint("head"), about_y(-9.0F) * about_z(-4.0F * std::sin(angle)));
      const float arm_m = arm_length();
      for (int side = 0; side < 2; ++side) {
        const float own = 2.0F * angle + (side == 0 ? 0.0F : 1.1F);
        const glm::vec3 to{(0.16F + 0.10F * std::sin(own)) * arm_m, 0.30F * arm_m,
                           (0.80F + 0.12F * std::cos(own)) * arm_m};
        reach_from_shoulder(pose, side, to, {-0.2F, 1.0F, -0.2F}, 34.0F);
      }
    });
    return clip;
  }

  simplify::SourceClip wave() {
    simplify::SourceClip clip = start("wave", render::ClipKind::kWave, 45, 15.0F);
    each_frame(clip, [&](Pose& pose, float t) {
      const float angle = 2.0F * kPi * t;
      stand(pose, t);
      const float arm_m = arm_length();
      const float swing = std::sin(4.0F * angle);
      reach_from_shoulder(
          pose, 1,
          {0.30F * arm_m, (0.34F + 0.22F * swing) * arm_m, (0.62F - 0.04F * swing * swing) * arm_m},
          {-0.1F, 1.0F, -0.9F}, 4.0F);
      pose.rotate(joint("head"), about_z(-8.0F + 3.0F * std::sin(angle)) * about_x(-3.0F));
    });
    return clip;
  }

  /// Both hands speak, one more than the other.
  simplify::SourceClip talk() {
    simplify::SourceClip clip = start("talk", render::ClipKind::kTalk, 72, 12.0F);
    each_frame(clip, [&](Pose& pose, float t) {
      const float angle = 2.0F * kPi * t;
      stand(pose, t);
      const float arm_m = arm_length();
      for (int side = 0; side < 2; ++side) {
        const float own = angle + (side == 0 ? 0.0F : 2.2F);
        // a beat now and then, not all the time
        const float beat = 0.5F + 0.5F * std::sin(own);
        const float up = 0.10F * beat * std::sin(5.0F * angle + (side == 0 ? 0.0F : 0.8F));
        const float out = 0.08F * std::sin(3.0F * own);
        const float lift = side == 0 ? 0.08F * std::sin(own) : 0.16F * std::sin(own);
        reach_from_shoulder(
            pose, side,
            {(0.56F + 0.08F * beat) * arm_m, (0.02F + out) * arm_m, (-0.50F + up + lift) * arm_m},
            {-0.6F, 0.6F, -1.0F}, 16.0F);
      }
      pose.rotate(joint("head"), about_z(6.0F * std::sin(angle - 0.6F)) *
                                     about_y(3.0F * std::sin(4.0F * angle) + 1.0F));
    });
    return clip;
  }

  /// Looks at something in the right hand.
  simplify::SourceClip phone() {
    simplify::SourceClip clip = start("phone", render::ClipKind::kPhone, 40, 8.0F);
    each_frame(clip, [&](Pose& pose, float t) {
      const float angle = 2.0F * kPi * t;
      stand(pose, t);
      const float stoop = posture();
      pose.rotate(joint("spine3"), about_y(5.0F + stoop * 0.4F));
      pose.rotate(joint("neck"), about_y(12.0F - stoop * 0.3F));
      pose.rotate(joint("head"), about_y(17.0F + 1.5F * std::sin(2.0F * angle) - stoop * 0.4F) *
                                     about_z(-4.0F + std::sin(angle)));
      const float arm_m = arm_length();
      reach_from_shoulder(
          pose, 1, {0.52F * arm_m, -0.16F * arm_m, (-0.28F + 0.01F * std::sin(angle)) * arm_m},
          {-0.5F, 0.5F, -1.0F}, 30.0F);
    });
    return clip;
  }

  /// Steps on the spot that turn to the left by `kTurnCycleRad` in a cycle: the foot on the ground
  /// turns back under the body just as far. Played backwards it turns to the right.
  simplify::SourceClip turn() {
    simplify::SourceClip clip = start("turn", render::ClipKind::kOther, 24, 20.0F);
    clip.stride_m = kTurnCycleRad;
    constexpr float kStance = 0.62F;  // share of the cycle that a foot is on the ground
    each_frame(clip, [&](Pose& pose, float t) {
      const float angle = 2.0F * kPi * t;
      const float size = (leg_.thigh_m + leg_.shin_m) / kUnit;
      stand(pose, 0.0F, 0.005F * size);
      // over the foot that stands
      pose.root_offset.y = 0.035F * size * std::cos(angle - kPi * kStance);
      pose.rotate(joint("head"), about_z(8.0F));
      for (int side = 0; side < 2; ++side) {
        const float s = side == 0 ? 1.0F : -1.0F;
        float own = t + (side == 0 ? 0.0F : 0.5F);
        own -= std::floor(own);
        const float half_rad = 0.5F * kStance * kTurnCycleRad;
        float yaw_rad = half_rad - own * kTurnCycleRad, up_m = 0.0F;
        if (own > kStance) {
          const float swing = (own - kStance) / (1.0F - kStance);
          yaw_rad = half_rad * (2.0F * smooth_step(0.0F, 1.0F, swing) - 1.0F);
          up_m = 0.055F * size * std::sin(kPi * swing);
        }
        const float c = std::cos(yaw_rad), r = std::sin(yaw_rad);
        const glm::vec3 rest = at(foot_[side]);
        place_leg(pose, side, {rest.x * c - rest.y * r, rest.x * r + rest.y * c, rest.z + up_m},
                  0.0F, 0.0F, yaw_rad / kDegree + s * 4.0F);
      }
    });
    return clip;
  }

 private:
  glm::vec3 at(int joint) const { return rig_.joints[joint].position; }
  int joint(const char* name) const { return rig_.find(name); }
  float posture() const { return figure_.age > 0.6F ? 26.0F * (figure_.age - 0.5F) : 0.0F; }

  /// Calls `fill` with each frame's pose and its time in cycles.
  template <typename Fill>
  void each_frame(simplify::SourceClip& clip, const Fill& fill) const {
    for (std::uint32_t frame = 0; frame < clip.frame_count; ++frame) {
      Pose pose(rig_);
      fill(pose, static_cast<float>(frame) / static_cast<float>(clip.frame_count));
      finish(clip, frame, pose);
    }
  }

  /// Standing at ease: sways once a cycle, breathes twice. `low_m` lower in the knees.
  void stand(Pose& pose, float t, float low_m = 0.0F) const {
    const float wave = std::sin(2.0F * kPi * t), breath = std::sin(4.0F * kPi * t);
    const float sway = 0.022F * figure_.calm * (leg_.thigh_m + leg_.shin_m) / kUnit;
    pose.root_offset = {-0.006F, sway * wave, -0.0025F - 0.003F * wave * wave - low_m};
    const float roll = -2.2F * wave * figure_.calm;
    const glm::quat pelvis = about_x(roll) * about_z(1.5F * wave);
    pose.rotate(joint("hips"), pelvis);
    const float stoop = posture();
    pose.rotate(joint("spine1"), about_x(-roll * 0.6F) * about_y(0.5F + stoop * 0.25F));
    pose.rotate(joint("spine2"), about_x(-roll * 0.5F) * about_y(stoop * 0.35F));
    pose.rotate(joint("spine3"), about_y(-0.8F * breath + stoop * 0.4F));
    pose.rotate(joint("neck"), about_y(0.4F * breath - stoop * 0.3F));
    look_around(pose, t, 7.0F);
    for (int side = 0; side < 2; ++side) {
      const float s = side == 0 ? 1.0F : -1.0F;
      arm(pose, side, 2.0F + 1.5F * wave * s, 11.0F + 3.0F * s * wave, -0.9F * breath);
      glm::vec3 ankle = at(foot_[side]);
      ankle.y += s * 0.004F;
      place_leg(pose, side, ankle, 0.0F, 0.0F, s * 6.0F);
    }
  }

  void look_around(Pose& pose, float t, float degrees) const {
    const float breath = std::sin(4.0F * kPi * t);
    const float look = std::sin(2.0F * kPi * t - 0.6F) + 0.35F * std::sin(6.0F * kPi * t);
    pose.rotate(joint("head"),
                about_z(degrees * look * figure_.calm) * about_y(1.0F * breath - posture() * 0.5F));
  }

  float arm_length() const {
    const glm::vec3 shoulder = at(joint("left_upper_arm")), elbow = at(joint("left_forearm")),
                    wrist = at(joint("left_hand"));
    return glm::length(elbow - shoulder) + glm::length(wrist - elbow);
  }

  /// `to` from the shoulder, in the model frame; y and `elbow`'s y count outwards.
  void reach_from_shoulder(Pose& pose, int side, const glm::vec3& to, const glm::vec3& elbow,
                           float curl) const {
    std::vector<glm::vec3> position;
    std::vector<glm::quat> rotation;
    pose.solve(position, rotation);
    const int upper = rig_.find(side == 0 ? "left_upper_arm" : "right_upper_arm");
    const float s = side == 0 ? 1.0F : -1.0F;
    reach_arm(pose, side, position[upper] + glm::vec3{to.x, s * to.y, to.z}, elbow, curl);
  }

  /// Two-bone inverse kinematics from the shoulder to the wrist at `wrist`; the elbow points to
  /// `elbow` (y outwards). Fingers bend by `curl` degrees.
  void reach_arm(Pose& pose, int side, const glm::vec3& wrist, const glm::vec3& elbow,
                 float curl) const {
    const std::string s = side == 0 ? "left_" : "right_";
    const int upper = rig_.find(s + "upper_arm"), fore = rig_.find(s + "forearm"),
              hand = rig_.find(s + "hand");
    std::vector<glm::vec3> position;
    std::vector<glm::quat> rotation;
    pose.solve(position, rotation);
    const glm::vec3 shoulder = position[upper];
    const float upper_m = glm::length(at(fore) - at(upper));
    const float fore_m = glm::length(at(hand) - at(fore));
    const glm::vec3 reach = wrist - shoulder;
    const float d = std::clamp(glm::length(reach), std::abs(upper_m - fore_m) * 1.05F,
                               (upper_m + fore_m) * 0.985F);
    const glm::vec3 along = glm::normalize(reach);
    const glm::vec3 pole{elbow.x, side == 0 ? elbow.y : -elbow.y, elbow.z};
    const glm::vec3 out = glm::normalize(pole - along * glm::dot(pole, along));
    const float cosine = std::clamp(
        (upper_m * upper_m + d * d - fore_m * fore_m) / (2.0F * upper_m * d), -1.0F, 1.0F);
    const glm::vec3 bent =
        shoulder + (along * cosine + out * std::sqrt(1.0F - cosine * cosine)) * upper_m;
    const glm::vec3 end = shoulder + along * d;
    // the forearm bends to the front of the arm
    pose.fix(upper, aim(at(fore) - at(upper), bent - shoulder, end - bent));
    pose.fix(fore, aim(at(hand) - at(fore), end - bent, shoulder - bent));
    for (const char* digit : {"index", "middle", "ring", "pinky"}) {
      for (int level = 1; level <= 3; ++level) {
        const glm::quat bend = about_x(-curl);
        pose.rotate(rig_.find(s + digit + std::to_string(level)),
                    side == 0 ? bend : mirrored(bend));
      }
    }
  }

  simplify::SourceClip start(const char* name, render::ClipKind kind, std::uint32_t frames,
                             float rate_hz) const {
    simplify::SourceClip clip;
    clip.name = name;
    clip.kind = kind;
    clip.rate_hz = rate_hz;
    clip.loop = true;
    clip.frame_count = frames;
    clip.model_from_joint.resize(static_cast<std::size_t>(frames) * rig_.joints.size());
    return clip;
  }

  simplify::SourceClip cycle(const char* name, render::ClipKind kind, const Gait& gait,
                             float duration_s) {
    const auto frames = static_cast<std::uint32_t>(std::lround(duration_s * kRate));
    simplify::SourceClip clip = start(name, kind, frames, kRate);
    const LegPlan plan(gait, leg_);
    clip.stride_m = plan.stride_m();
    const bool running = kind == render::ClipKind::kRun;
    const float size = (leg_.thigh_m + leg_.shin_m) / kUnit;
    const float hip_bind = at(thigh_[0]).z;
    const float calm = figure_.calm;
    for (std::uint32_t frame = 0; frame < frames; ++frame) {
      const float phase = static_cast<float>(frame) / static_cast<float>(frames);
      const float angle = 2.0F * kPi * phase;
      Pose pose(rig_);
      // the pelvis turns with the leading leg, drops on the side of the swinging one and shifts
      // over the standing one
      pose.root_offset = {0.0F,
                          (running ? 0.010F : 0.016F) * size * std::cos(angle - 2.0F * kPi * 0.30F),
                          plan.hip_height(phase) - hip_bind};
      const float yaw = -(running ? 6.0F : 5.5F) * std::cos(angle);
      const float hip_sway = figure_.feminine ? 3.6F : 2.4F;
      const float roll = (running ? 2.5F : hip_sway) * std::sin(angle - 0.35F);
      const float stoop = posture();
      const float lean = (running ? 8.0F : 1.5F) + stoop;
      pose.rotate(joint("hips"), about_z(yaw) * about_x(roll) * about_y(lean * 0.25F));
      const float counter = ((running ? 11.0F : 8.0F) * std::cos(angle)) * (0.6F + 0.4F * calm);
      for (const char* name : {"spine1", "spine2", "spine3"}) {
        pose.rotate(joint(name),
                    about_z((counter - yaw * 0.3F) / 3.0F) * about_x(-roll / 2.6F) *
                        about_y(lean * 0.25F + (running ? 0.8F : 0.6F) * std::sin(2.0F * angle)));
      }
      pose.rotate(joint("neck"), about_z(-(counter + yaw) * 0.45F) * about_y(-lean * 0.35F));
      pose.rotate(joint("head"), about_z(-(counter + yaw) * 0.45F) * about_x(roll * 0.2F) *
                                     about_y(-lean * 0.5F - 0.6F * std::sin(2.0F * angle - 0.5F)));
      for (int side = 0; side < 2; ++side) {
        const float own = phase + (side == 0 ? 0.0F : 0.5F);
        const float swing = std::cos(2.0F * kPi * (own - 0.02F));  // 1 at heel strike of this side
        if (running) {
          arm(pose, side, -14.0F - 33.0F * calm * swing, 92.0F - 10.0F * swing, 0.0F);
        } else {
          const float still = figure_.bag == BagStyle::kMessenger && side == 1 ? 0.6F : 1.0F;
          arm(pose, side, 1.0F - 19.0F * calm * still * swing,
              22.0F - 13.0F * calm * std::cos(2.0F * kPi * (own - 0.08F)), 0.0F);
        }
        const AnkleState state = plan.at(own);
        const glm::vec3 bind = at(foot_[side]);
        // a walker puts the feet nearer to the line of progress than the hips
        const float track = bind.y * (running ? 0.55F : 0.80F);
        // feet point a little outwards and roll along that line
        const float toe_out = (side == 0 ? 1.0F : -1.0F) * 4.0F;
        const float aside = state.roll_m * std::sin(toe_out * kDegree);
        place_leg(pose, side, {state.ankle.x + at(thigh_[side]).x, track + aside, state.ankle.y},
                  state.pitch_rad, state.toe_rad, toe_out);
      }
      const float bounce = std::sin(2.0F * angle);
      pose.rotate(joint("hair1"), about_y((running ? 7.0F : 2.5F) * bounce + lean * 0.5F) *
                                      about_x(2.0F * std::sin(angle)));
      pose.rotate(joint("hair2"), about_y((running ? 9.0F : 3.0F) * std::sin(2.0F * angle - 0.9F)) *
                                      about_x(3.0F * std::sin(angle - 0.6F)));
      pose.rotate(joint("bag"), about_y((running ? 1.5F : 0.6F) * bounce));
      finish(clip, frame, pose);
    }
    return clip;
  }

  /// Arm hanging from the A-pose: swing forward, elbow bend, shoulder lift, degrees.
  void arm(Pose& pose, int side, float swing, float elbow, float lift) const {
    const std::string s = side == 0 ? "left_" : "right_";
    const auto sided = [&](const glm::quat& q) { return side == 0 ? q : mirrored(q); };
    const float wide =
        24.0F -
        60.0F * (std::max(figure_.belly_m, 0.0F) + 0.3F * std::max(0.0F, figure_.waist - 1.0F)) -
        (figure_.bag != BagStyle::kNone && figure_.bag != BagStyle::kBackpack && side == 1 ? 7.0F
                                                                                           : 0.0F) -
        (has_skirt_joints(figure_) ? 4.0F : 0.0F) -
        120.0F * std::max(0.0F, figure_.cloth_m - 0.010F);
    pose.rotate(rig_.find(s + "clavicle"), sided(about_x(lift) * about_z(-swing * 0.06F)));
    const float twist = 10.0F;  // palms turn a little back
    pose.rotate(rig_.find(s + "upper_arm"),
                sided(about_z(0.35F * std::max(0.0F, swing)) * about_y(-swing) * about_x(-wide)));
    const glm::vec3 flex{0.0F, 0.9271839F, 0.3746066F};
    pose.rotate(rig_.find(s + "forearm"), sided(glm::angleAxis(-(elbow - 8.0F) * kDegree, flex)));
    const glm::vec3 along{0.0F, 0.5F, -0.8660254F};
    pose.rotate(rig_.find(s + "forearm_twist"),
                sided(glm::angleAxis(twist * 0.5F * kDegree, along)));
    pose.rotate(rig_.find(s + "hand"),
                sided(glm::angleAxis(twist * kDegree, along) * about_x(-4.0F)));
    const float curl = elbow > 60.0F ? 38.0F : 14.0F;
    for (const char* digit : {"index", "middle", "ring", "pinky"}) {
      for (int level = 1; level <= 3; ++level) {
        pose.rotate(rig_.find(s + digit + std::to_string(level)), sided(about_x(-curl)));
      }
    }
  }

  /// Two-bone inverse kinematics from where the hip is in `pose` to `ankle`.
  void place_leg(Pose& pose, int side, const glm::vec3& ankle, float pitch_rad, float toe_rad,
                 float toe_out) const {
    std::vector<glm::vec3> position;
    std::vector<glm::quat> rotation;
    pose.solve(position, rotation);
    const glm::vec3 hip = position[thigh_[side]];
    const glm::vec3 reach = ankle - hip;
    const float full = leg_.thigh_m + leg_.shin_m;
    const float d = std::min(glm::length(reach), full * 0.9995F);
    const glm::vec3 down = glm::normalize(reach);
    const glm::vec3 pole = about_z(toe_out) * glm::vec3{1.0F, 0.0F, 0.0F};
    const glm::vec3 forward = glm::normalize(pole - down * glm::dot(pole, down));
    const float cosine =
        std::clamp((leg_.thigh_m * leg_.thigh_m + d * d - leg_.shin_m * leg_.shin_m) /
                       (2.0F * leg_.thigh_m * d),
                   -1.0F, 1.0F);
    const float sine = std::sqrt(1.0F - cosine * cosine);
    const glm::vec3 knee = hip + (down * cosine + forward * sine) * leg_.thigh_m;
    const glm::vec3 end = hip + down * d;
    pose.fix(thigh_[side], aim(at(shin_[side]) - at(thigh_[side]), knee - hip, pole));
    pose.fix(shin_[side], aim(at(foot_[side]) - at(shin_[side]), end - knee, pole));
    const glm::quat heading = about_z(toe_out);
    pose.fix(foot_[side], heading * about_y(-pitch_rad / kDegree));
    pose.fix(toes_[side], heading * about_y(-(pitch_rad + toe_rad) / kDegree));
  }

  /// Rotation that takes the bone's bind direction to `to` and keeps its front towards `pole`.
  static glm::quat aim(const glm::vec3& from, const glm::vec3& to, const glm::vec3& pole) {
    const auto frame = [](const glm::vec3& axis, const glm::vec3& front) {
      const glm::vec3 z = glm::normalize(axis);
      const glm::vec3 x = glm::normalize(front - z * glm::dot(front, z));
      return glm::mat3(x, glm::cross(z, x), z);
    };
    return glm::normalize(
        glm::quat_cast(frame(to, pole) * glm::transpose(frame(from, glm::vec3{1.0F, 0.0F, 0.0F}))));
  }

  /// Cloth below the hips is pushed out by the legs.
  void hang_skirt(Pose& pose) const {
    const int first = rig_.find("skirt_front");
    if (first < 0) return;
    std::vector<glm::vec3> position;
    std::vector<glm::quat> rotation;
    pose.solve(position, rotation);
    const int hips = rig_.find("hips");
    const glm::quat to_hips = glm::conjugate(rotation[hips]);
    const bool skirt = figure_.bottom == BottomStyle::kSkirt;
    const float hem =
        to_model(figure_, {0, 0, skirt ? figure_.skirt_z : figure_.hem_z}, Part::kSkirt).z;
    const float size = (leg_.thigh_m + leg_.shin_m) / kUnit;
    struct Ball {
      glm::vec3 centre;
      float radius;
    };
    std::vector<Ball> balls;
    for (int side = 0; side < 2; ++side) {
      const glm::vec3 hip = position[thigh_[side]], knee = position[shin_[side]],
                      ankle = position[foot_[side]];
      for (const float t : {0.45F, 0.7F, 1.0F}) {
        balls.push_back(
            {glm::mix(hip, knee, t), glm::mix(0.088F, 0.064F, t) * size * figure_.thigh});
      }
      for (const float t : {0.35F, 0.7F})
        balls.push_back({glm::mix(knee, ankle, t), 0.062F * size});
    }
    for (int i = 0; i < 8; ++i) {
      const float azimuth = static_cast<float>(i) * kPi / 4.0F;
      const glm::vec3 out{std::cos(azimuth), std::sin(azimuth), 0.0F};
      const glm::vec3 pivot = at(first + i) - at(hips);
      const float depth = at(first + i).z - hem;
      const float rest = skirt ? (0.055F + 0.055F * figure_.skirt_flare) / 0.45F : 0.10F;
      float tilt = out.x < 0.3F ? pose.skirt_behind_rad : -0.03F;
      for (const Ball& ball : balls) {
        const glm::vec3 p = to_hips * (ball.centre - position[hips]);
        const float h = pivot.z - p.z;
        if (h < 0.1F * size || h > depth + 0.12F * size) continue;
        const glm::vec2 flat{p.x, p.y};
        // the nearest point of the ball in this direction
        const float along = glm::dot(flat, glm::vec2{out.x, out.y});
        const float across = std::abs(flat.x * out.y - flat.y * out.x);
        // beside the ray the cloth is nearer to the axis, so it has to go further out
        const float near = smooth_step(3.4F, 1.8F, across / ball.radius);
        if (near <= 0.0F) continue;
        const float bulge = ball.radius + 2.8F * across * across / size;
        const float distance = (along + bulge + 0.024F) * near -
                               glm::dot(glm::vec2{pivot.x, pivot.y}, glm::vec2{out.x, out.y});
        tilt = std::max(tilt, std::atan2(distance, h) - rest);
      }
      pose.rotate(first + i,
                  glm::angleAxis(std::min(tilt, 1.1F), glm::cross(out, glm::vec3{0, 0, 1})));
    }
  }

  void finish(simplify::SourceClip& clip, std::uint32_t frame, Pose& pose) const {
    hang_skirt(pose);
    std::vector<glm::vec3> position;
    std::vector<glm::quat> rotation;
    pose.solve(position, rotation);
    for (std::size_t j = 0; j < rig_.joints.size(); ++j) {
      glm::mat4 m = glm::mat4_cast(rotation[j]);
      m[3] = glm::vec4(position[j], 1.0F);
      clip.model_from_joint[frame * rig_.joints.size() + j] = m;
    }
  }

  const Figure& figure_;
  const Rig& rig_;
  Leg leg_{};
  int thigh_[2], shin_[2], foot_[2], toes_[2];
};

}  // namespace

std::vector<simplify::SourceClip> make_clips(const Figure& figure, const Rig& rig) {
  Animator animator(figure, rig);
  std::vector<simplify::SourceClip> clips;
  clips.push_back(animator.idle());
  clips.push_back(animator.walk());
  clips.push_back(animator.run());
  clips.push_back(animator.sit());
  clips.push_back(animator.cheer());
  clips.push_back(animator.wave());
  clips.push_back(animator.talk());
  clips.push_back(animator.phone());
  clips.push_back(animator.turn());
  return clips;
}

}  // namespace throng::builtin
