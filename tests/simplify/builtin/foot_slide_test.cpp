#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <optional>

#include "render/compute/element/advance.hpp"
#include "render/crowd/motion_graph.hpp"
#include "simplify/builtin/body.hpp"
#include "simplify/builtin/motion.hpp"
#include "throng/render/crowd.hpp"

namespace throng::builtin {
namespace {

/// A figure of the built-in cast, as far as its feet need it, in a crowd of one.
class Walker {
 public:
  explicit Walker(const Figure& figure) {
    const Body body = make_body(figure);
    rig_ = make_rig(figure, body.mesh);
    clips_ = make_clips(figure, rig_);
    render::Character character;
    std::uint32_t frames = 0;
    for (const simplify::SourceClip& clip : clips_) {
      const float duration_s = static_cast<float>(clip.frame_count) / clip.rate_hz;
      character.clips.push_back({clip.name, clip.kind, frames, clip.frame_count, clip.rate_hz,
                                 clip.loop, clip.stride_m, clip.stride_m / duration_s});
      for (std::uint32_t f = 0; f < clip.frame_count; ++f) frame_.push_back({&clip, f});
      frames += clip.frame_count;
    }
    for (int side = 0; side < 2; ++side) {
      const std::string s = side == 0 ? "left_" : "right_";
      const int foot = rig_.find(s + "foot"), toes = rig_.find(s + "toes");
      const glm::vec3 ankle = rig_.joints[foot].position, ball = rig_.joints[toes].position;
      soles_[side] = {{foot, {ankle.x - 0.06F, ankle.y, 0.0F}},
                      {foot, {ball.x - 0.03F, ball.y, 0.0F}},
                      {toes, {ball.x + 0.03F, ball.y, 0.0F}}};
    }
    give_soles(character);
    auto cast = std::make_shared<render::Cast>();
    cast->members.push_back({std::move(character), 1.0F});
    gait_ = render::gait_of(cast->members[0].character, render::motion_graph_of(*cast));
    render::add_stance_shift(cast->members[0].character, gait_);
    crowd_ = std::make_unique<render::Crowd>(std::move(cast), render::CrowdSettings{});
    membership_ = std::make_shared<render::Membership>(render::Membership{1, {11}, {}, {}});
  }

  void push(double time_s, glm::vec2 position_m, std::optional<float> heading_rad = {}) {
    render::AgentFrame frame;
    frame.time_us = std::llround(time_s * 1e6);
    frame.membership = membership_;
    frame.position_m = {{position_m, 0.0F}};
    if (heading_rad.has_value()) frame.heading_rad = {*heading_rad};
    ASSERT_TRUE(crowd_->push(frame).ok());
  }

  /// How far the feet on the ground slide from `from_s` to `to_s`, on the mean over both.
  double slide_m(double from_s, double to_s) const {
    constexpr double kStepS = 1.0 / 60.0;
    double sum_m = 0.0;
    std::vector<glm::vec3> before = soles_at(from_s);
    for (double t = from_s + kStepS; t < to_s; t += kStepS) {
      const std::vector<glm::vec3> now = soles_at(t);
      double moved_m = 0.0;
      int standing = 0;
      for (int side = 0; side < 2; ++side) {
        // the foot rolls: what is on the ground and moves least is what it stands on
        double least_m = 1.0;
        for (int i = 3 * side; i < 3 * side + 3; ++i) {
          if (before[i].z > kTouchM || now[i].z > kTouchM) continue;
          least_m =
              std::min(least_m, static_cast<double>(glm::length(glm::vec2(now[i] - before[i]))));
        }
        if (least_m == 1.0) continue;
        moved_m += least_m;
        ++standing;
      }
      if (standing > 0) sum_m += moved_m / standing;
      before = now;
    }
    return sum_m;
  }

  render::element::InstanceState state_at(double time_s) const {
    const std::int64_t time_us = std::llround(time_s * 1e6);
    const render::Bracket bracket = crowd_->bracket(time_us);
    const auto columns = [](const render::Snapshot& snapshot) {
      render::element::SnapshotColumns result;
      result.slots = 1;
      result.present = snapshot.present.data();
      result.position_m = snapshot.position_m.data();
      result.velocity_mps = snapshot.velocity_mps.data();
      result.heading_rad = snapshot.heading_rad.data();
      result.speed_mps = snapshot.speed_mps.data();
      result.turn_radps = snapshot.turn_radps.data();
      result.walked_cycles = snapshot.walked_cycles.data();
      result.id = snapshot.roster->id.data();
      result.character = snapshot.roster->character.data();
      result.scale = snapshot.roster->scale.data();
      result.seed = snapshot.roster->seed.data();
      return result;
    };
    render::element::Bracketed moment;
    moment.between =
        render::element::between(bracket.older->time_us, bracket.newer->time_us, time_us, 500'000);
    moment.shown = columns(moment.between.at_newer ? *bracket.newer : *bracket.older);
    moment.newer = columns(*bracket.newer);
    moment.same_roster = true;
    moment.scene_time_us = time_us;
    return render::element::advance_slot(moment, gait_, 0);
  }

 private:
  static constexpr float kTouchM = 0.004F;

  /// A mesh of the soles' points alone, with a palette.
  void give_soles(render::Character& character) {
    const std::size_t joints = rig_.joints.size();
    for (const auto& sole : soles_) {
      for (const SolePoint& point : sole) {
        position_.push_back(point.position_m);
        joint_index_.emplace_back(static_cast<std::uint8_t>(point.joint), 0, 0, 0);
        joint_weight_.emplace_back(255, 0, 0, 0);
      }
    }
    for (const auto& [clip, f] : frame_) {
      for (std::size_t j = 0; j < joints; ++j) {
        const glm::mat4 rows = glm::transpose(
            glm::translate(clip->model_from_joint[f * joints + j], -rig_.joints[j].position));
        palette_.push_back({{rows[0], rows[1], rows[2]}});
      }
    }
    character.position = position_;
    character.joint_index = joint_index_;
    character.joint_weight = joint_weight_;
    character.palette = palette_;
    character.joints.resize(joints);
    character.height_m = 1.75F;
  }
  struct SolePoint {
    int joint;
    glm::vec3 position_m;
  };

  std::vector<glm::vec3> soles_at(double time_s) const {
    const render::element::InstanceState state = state_at(time_s);
    std::vector<glm::vec3> result;
    for (const auto& sole : soles_) {
      for (const SolePoint& point : sole) {
        const glm::vec4 bind(point.position_m - rig_.joints[point.joint].position, 1.0F);
        const auto at = [&](std::uint32_t frame) {
          const auto& [clip, f] = frame_[frame];
          return glm::vec3(clip->model_from_joint[f * rig_.joints.size() + point.joint] * bind);
        };
        const render::element::Pose& pose = state.pose;
        glm::vec3 p = glm::mix(at(pose.a_frame0), at(pose.a_frame1), pose.a_t);
        p = glm::mix(p, glm::mix(at(pose.b_frame0), at(pose.b_frame1), pose.b_t), pose.b_weight);
        p = glm::mix(p, glm::mix(at(pose.c_frame0), at(pose.c_frame1), pose.c_t), pose.c_weight);
        const auto& placed = state.placement;
        result.push_back(render::element::drawn_at(state) +
                         glm::vec3(p.x * placed.cosine_scale - p.y * placed.sine_scale,
                                   p.x * placed.sine_scale + p.y * placed.cosine_scale,
                                   p.z * placed.scale));
      }
    }
    return result;
  }

  Rig rig_;
  std::vector<simplify::SourceClip> clips_;
  std::vector<std::pair<const simplify::SourceClip*, std::uint32_t>> frame_;
  std::vector<glm::vec3> position_;
  std::vector<glm::u8vec4> joint_index_, joint_weight_;
  std::vector<render::Affine> palette_;
  render::element::Gait gait_;
  std::unique_ptr<render::Crowd> crowd_;
  std::shared_ptr<const render::Membership> membership_;
  std::vector<SolePoint> soles_[2];
};

class FootSlideTest : public testing::TestWithParam<std::size_t> {
 protected:
  const Figure& figure() const { return figures()[GetParam()]; }
  void say(const char* what, double value) {
    RecordProperty(what, std::to_string(value));
    if (std::getenv("THRONG_SAY") != nullptr) {
      std::printf("%s %s: %.4f\n", figure().name.c_str(), what, value);
    }
  }
};

TEST_P(FootSlideTest, WalkingStraightOn) {
  Walker walker(figure());
  for (int i = 0; i <= 100; ++i) walker.push(0.1 * i, {0.13 * i, 0.0});
  const double slide = walker.slide_m(2.0, 8.0) / (1.3 * 6.0);
  say("straight, metres per metre", slide);
  EXPECT_LT(slide, 0.09);
}

TEST_P(FootSlideTest, WalkingAlongACurve) {
  const auto slide_of = [&](double radius_m, bool is_given) {
    Walker walker(figure());
    // at 1.3 m/s, to the left or (negative) to the right
    for (int i = 0; i <= 100; ++i) {
      const double angle = 0.13 * i / radius_m;
      std::optional<float> heading_rad;
      if (is_given) heading_rad = static_cast<float>(angle + std::copysign(1.5707963, radius_m));
      const double r = std::abs(radius_m);
      walker.push(0.1 * i, {r * std::cos(angle), r * std::sin(angle)}, heading_rad);
    }
    return walker.slide_m(2.0, 8.0) / (1.3 * 6.0);
  };
  Walker straight(figure());
  for (int i = 0; i <= 100; ++i) straight.push(0.1 * i, {0.13 * i, 0.0});
  const double straight_slide = straight.slide_m(2.0, 8.0) / (1.3 * 6.0);
  for (const double radius_m : {3.0, -3.0, 5.0}) {
    for (const bool is_given : {false, true}) {
      const double slide = slide_of(radius_m, is_given);
      say(("circle of " + std::to_string(radius_m) + (is_given ? " m, heading given" : " m") +
           ", metres per metre")
              .c_str(),
          slide);
      // without a shift of the body and a lead of the heading: 2.4 times at 3 m
      EXPECT_LT(slide, 1.33 * straight_slide) << radius_m;
    }
  }
}

TEST_P(FootSlideTest, NothingJumpsAsACurveBeginsAndEnds) {
  Walker walker(figure());
  // 3 m straight on, half a circle of 2 m, straight on
  for (int i = 0; i <= 120; ++i) {
    const double way = 0.13 * i, angle = std::clamp((way - 3.0) / 2.0, 0.0, 3.14159265);
    const double before = std::min(way, 3.0), after = std::max(0.0, way - 3.0 - 2.0 * 3.14159265);
    walker.push(0.1 * i, {before + 2.0 * std::sin(angle) - after, 2.0 - 2.0 * std::cos(angle)});
  }
  constexpr double kStepS = 1.0 / 240.0;
  float farthest_m = 0.0F, fastest_m = 0.0F, most_rad = 0.0F;
  render::element::InstanceState before = walker.state_at(1.0);
  for (double t = 1.0 + kStepS; t < 11.5; t += kStepS) {
    const render::element::InstanceState now = walker.state_at(t);
    farthest_m = std::max(farthest_m, glm::length(now.shift_m));
    fastest_m = std::max(fastest_m, glm::length(now.shift_m - before.shift_m));
    most_rad = std::max(
        most_rad, std::abs(render::element::wrap_angle(now.heading_rad - before.heading_rad)));
    before = now;
  }
  EXPECT_GT(farthest_m, 0.015F);
  EXPECT_LT(farthest_m, 0.06F);
  // 0.3 m/s and 2 rad/s: a foot's distance from the axis times the rate of turning
  EXPECT_LT(fastest_m, 0.3F * kStepS);
  EXPECT_LT(most_rad, 2.0F * kStepS);
  EXPECT_EQ(walker.state_at(1.5).shift_m, glm::vec2(0.0F));
}

TEST_P(FootSlideTest, WalkingBackwards) {
  Walker walker(figure());
  for (int i = 0; i <= 100; ++i) walker.push(0.1 * i, {-0.1 * i, 0.0}, 0.0F);
  const double slide = walker.slide_m(2.0, 8.0) / 6.0;
  say("backwards, metres per metre", slide);
  EXPECT_LT(slide, 0.10);
}

TEST_P(FootSlideTest, TurningOnTheSpot) {
  for (const float rate_radps : {0.8F, -1.6F}) {
    Walker walker(figure());
    for (int i = 0; i <= 100; ++i) {
      walker.push(0.1 * i, {0.0, 0.0}, rate_radps * 0.1F * static_cast<float>(i));
    }
    const double slide = walker.slide_m(2.0, 8.0) / (std::abs(rate_radps) * 6.0);
    say(rate_radps > 0.0F ? "turning left, metres per radian" : "turning right, metres per radian",
        slide);
    // without steps the soles slide by their distance from the axis, 0.1 m a radian
    EXPECT_LT(slide, 0.02);
  }
}

INSTANTIATE_TEST_SUITE_P(Cast, FootSlideTest, testing::Values<std::size_t>(0, 5, 10),
                         [](const auto& info) { return figures()[info.param].name; });

}  // namespace
}  // namespace throng::builtin
