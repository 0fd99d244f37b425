#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <map>
#include <sstream>

#include "simplify/builtin/body.hpp"
#include "simplify/builtin/motion.hpp"
#include "support/data_dir.hpp"

namespace throng::builtin {
namespace {

constexpr float kDegree = 3.14159265F / 180.0F;

struct Moving {
  Body body;
  Rig rig;
  std::vector<Skin> skin;
  std::vector<glm::vec3> position;
  std::vector<simplify::SourceClip> clips;

  explicit Moving(const Figure& figure)
      : body(make_body(figure)), rig(make_rig(figure, body.mesh)) {
    skin = make_skin(figure, body.mesh, rig);
    for (const MeshVertex& v : body.mesh.vertices)
      position.push_back(to_model(figure, v.position, v.part));
    clips = make_clips(figure, rig);
  }

  std::vector<glm::vec3> posed(const simplify::SourceClip& clip, std::uint32_t frame) const {
    std::vector<glm::vec3> out;
    for (std::size_t v = 0; v < position.size(); ++v) {
      glm::vec3 p{0.0F};
      for (int i = 0; i < 4; ++i) {
        const int j = skin[v].joint[i];
        const glm::mat4& m = clip.model_from_joint[frame * rig.joints.size() + j];
        p += skin[v].weight[i] *
             glm::vec3(m * glm::vec4(position[v] - rig.joints[j].position, 1.0F));
      }
      out.push_back(p);
    }
    return out;
  }

  glm::vec3 joint(const simplify::SourceClip& clip, std::uint32_t frame, const char* name) const {
    return glm::vec3(clip.model_from_joint[frame * rig.joints.size() + rig.find(name)][3]);
  }
};

class BuiltinMotionTest : public testing::TestWithParam<std::size_t> {
 protected:
  const Figure& figure() const { return figures()[GetParam()]; }
};

TEST_P(BuiltinMotionTest, HasIdleWalkAndRunAtThirtyHertz) {
  const Moving m(figure());
  ASSERT_GE(m.clips.size(), 3U);
  const render::ClipKind kinds[] = {render::ClipKind::kIdle, render::ClipKind::kWalk,
                                    render::ClipKind::kRun};
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(m.clips[i].kind, kinds[i]);
    EXPECT_EQ(m.clips[i].rate_hz, 30.0F);
    EXPECT_TRUE(m.clips[i].loop);
    EXPECT_EQ(m.clips[i].model_from_joint.size(), m.clips[i].frame_count * m.rig.joints.size());
  }
  EXPECT_GT(m.clips[1].stride_m, 0.8F);
  EXPECT_GT(m.clips[2].stride_m, m.clips[1].stride_m);
}

TEST_P(BuiltinMotionTest, FeetStayOnTheGround) {
  const Moving m(figure());
  for (const auto& clip : m.clips) {
    for (std::uint32_t frame = 0; frame < clip.frame_count; ++frame) {
      float lowest = 10.0F;
      for (const glm::vec3& p : m.posed(clip, frame)) lowest = std::min(lowest, p.z);
      EXPECT_GE(lowest, -0.005F) << clip.name << " " << frame;
      if (clip.kind != render::ClipKind::kRun) {
        EXPECT_LE(lowest, 0.006F) << clip.name << " " << frame;
      }
    }
  }
}

TEST_P(BuiltinMotionTest, SoleOfTheStandingFootMovesBackAtTheStrideRate) {
  const Moving m(figure());
  for (const int which : {1, 2}) {
    const auto& clip = m.clips[which];
    const float step_m = clip.stride_m / static_cast<float>(clip.frame_count);
    int touching = 0;
    for (std::uint32_t frame = 0; frame < clip.frame_count; ++frame) {
      const auto now = m.posed(clip, frame), then = m.posed(clip, (frame + 1) % clip.frame_count);
      for (std::size_t v = 0; v < now.size(); ++v) {
        if (now[v].z > 0.0015F || then[v].z > 0.0015F) continue;
        ++touching;
        ASSERT_NEAR(now[v].x - then[v].x, step_m, 0.005F)
            << clip.name << " " << frame << " vertex " << v;
        ASSERT_NEAR(now[v].y, then[v].y, 0.004F) << clip.name << " " << frame;
      }
    }
    EXPECT_GT(touching, 20) << clip.name;
  }
}

TEST_P(BuiltinMotionTest, LoopsWithoutAJump) {
  const Moving m(figure());
  for (const auto& clip : m.clips) {
    float usual = 0.0F;
    const std::size_t joints = m.rig.joints.size();
    const auto jump = [&](std::uint32_t a, std::uint32_t b) {
      float most = 0.0F;
      for (std::size_t j = 0; j < joints; ++j) {
        most = std::max(most, glm::length(glm::vec3(clip.model_from_joint[a * joints + j][3] -
                                                    clip.model_from_joint[b * joints + j][3])));
      }
      return most;
    };
    for (std::uint32_t frame = 1; frame < clip.frame_count; ++frame)
      usual = std::max(usual, jump(frame - 1, frame));
    EXPECT_LE(jump(clip.frame_count - 1, 0), usual * 1.05F + 1e-4F) << clip.name;
    EXPECT_LT(usual, 0.25F) << clip.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Cast, BuiltinMotionTest, testing::Range<std::size_t>(0, 14),
                         [](const auto& info) { return figures()[info.param].name; });

// --- against motion capture ---

/// Acclaim skeleton and motion, as far as the legs need it.
struct Acclaim {
  struct Bone {
    glm::vec3 direction{0.0F};
    float length = 0.0F;
    glm::quat axis{1, 0, 0, 0};
    std::vector<std::string> dof;
  };
  std::map<std::string, Bone> bones;
  std::map<std::string, std::string> parent;
  std::vector<std::map<std::string, std::vector<float>>> frames;

  static glm::quat euler(const glm::vec3& degrees) {
    return glm::angleAxis(degrees.z * kDegree, glm::vec3{0, 0, 1}) *
           glm::angleAxis(degrees.y * kDegree, glm::vec3{0, 1, 0}) *
           glm::angleAxis(degrees.x * kDegree, glm::vec3{1, 0, 0});
  }

  bool read(const std::string& asf, const std::string& amc) {
    std::ifstream skeleton(asf), motion(amc);
    if (!skeleton || !motion) return false;
    std::string line, section, current;
    while (std::getline(skeleton, line)) {
      std::istringstream in(line);
      std::string word;
      if (!(in >> word)) continue;
      if (word[0] == ':') {
        section = word;
      } else if (section == ":bonedata") {
        if (word == "name") {
          in >> current;
        } else if (word == "direction") {
          glm::vec3& d = bones[current].direction;
          in >> d.x >> d.y >> d.z;
        } else if (word == "length") {
          in >> bones[current].length;
        } else if (word == "axis") {
          glm::vec3 a{0.0F};
          in >> a.x >> a.y >> a.z;
          bones[current].axis = euler(a);
        } else if (word == "dof") {
          while (in >> word) bones[current].dof.push_back(word);
        }
      } else if (section == ":hierarchy" && word != "begin" && word != "end") {
        std::string child;
        while (in >> child) parent[child] = word;
      }
    }
    while (std::getline(motion, line)) {
      std::istringstream in(line);
      std::string word;
      if (!(in >> word)) continue;
      if (std::isdigit(static_cast<unsigned char>(word[0])) != 0) {
        frames.emplace_back();
      } else if (!frames.empty() && word[0] != ':') {
        float value = 0.0F;
        while (in >> value) frames.back()[word].push_back(value);
      }
    }
    return !frames.empty() && bones.count("lfemur") > 0;
  }

  glm::quat rotation(const std::map<std::string, std::vector<float>>& frame,
                     const std::string& name) const {
    if (name == "root") {
      const auto& r = frame.at("root");
      return euler({r[3], r[4], r[5]});
    }
    const Bone& bone = bones.at(name);
    glm::vec3 angle{0.0F};
    const auto values = frame.find(name);
    if (values != frame.end()) {
      for (std::size_t i = 0; i < bone.dof.size(); ++i)
        angle[bone.dof[i][1] - 'x'] = values->second[i];
    }
    return rotation(frame, parent.at(name)) * bone.axis * euler(angle) * glm::conjugate(bone.axis);
  }

  /// Direction of a bone; the capture walks along +z with +y up.
  glm::vec3 along(std::size_t frame, const std::string& name) const {
    const Bone& bone = bones.at(name);
    const glm::vec3 d = rotation(frames[frame], name) * bone.direction;
    return {d.z, d.x, d.y};
  }
};

struct Curves {
  std::vector<float> hip, knee;  // degrees
};

Curves curves_of(const std::vector<std::pair<glm::vec3, glm::vec3>>& thigh_and_shin) {
  Curves out;
  for (const auto& [thigh, shin] : thigh_and_shin) {
    out.hip.push_back(std::atan2(thigh.x, -thigh.z) / kDegree);
    out.knee.push_back(
        std::acos(std::clamp(glm::dot(glm::normalize(thigh), glm::normalize(shin)), -1.0F, 1.0F)) /
        kDegree);
  }
  return out;
}

float at(const std::vector<float>& curve, float cycles) {
  const float x = (cycles - std::floor(cycles)) * static_cast<float>(curve.size());
  const auto i = static_cast<std::size_t>(x) % curve.size();
  const float t = x - std::floor(x);
  return curve[i] * (1.0F - t) + curve[(i + 1) % curve.size()] * t;
}

/// Share of the way from a to b at which it meets a triangle, or above 1 where it doesn't.
float meets(const glm::vec3& a, const glm::vec3& b, const std::array<glm::vec3, 3>& triangle) {
  constexpr float kNever = 2.0F;
  const glm::vec3 way = b - a, e1 = triangle[1] - triangle[0], e2 = triangle[2] - triangle[0];
  const glm::vec3 p = glm::cross(way, e2);
  const float determinant = glm::dot(e1, p);
  if (std::abs(determinant) < 1e-12F) return kNever;
  const glm::vec3 from = a - triangle[0], q = glm::cross(from, e1);
  const float u = glm::dot(from, p) / determinant, v = glm::dot(way, q) / determinant;
  if (u < 0.0F || v < 0.0F || u + v > 1.0F) return kNever;
  const float t = glm::dot(e2, q) / determinant;
  return t < 0.0F ? kNever : t;
}

TEST(BuiltinSkirtTest, CoversThighsAndKneesInEveryFrameOfTheRun) {
  for (const Figure& figure : figures()) {
    if (figure.bottom != BottomStyle::kSkirt) continue;
    const Moving m(figure);
    const std::vector<MeshVertex>& vertices = m.body.mesh.vertices;
    std::vector<std::array<int, 3>> cloth;  // outside
    for (const MeshFace& face : m.body.mesh.faces) {
      bool is_skirt = face.region == Region::kBottom;
      for (int k = 0; k < face.size(); ++k) {
        is_skirt = is_skirt && vertices[face.corner[k]].part == Part::kSkirt;
      }
      if (!is_skirt) continue;
      cloth.push_back({face.corner[0], face.corner[1], face.corner[2]});
      if (face.size() == 4) cloth.push_back({face.corner[0], face.corner[2], face.corner[3]});
    }
    ASSERT_FALSE(cloth.empty()) << figure.name;
    const auto& run = m.clips[2];
    const float knee_m = m.rig.joints[m.rig.find("left_lower_leg")].position.z - 0.05F;
    std::size_t covered = 0;
    for (std::uint32_t frame = 0; frame < run.frame_count; ++frame) {
      const std::vector<glm::vec3> at = m.posed(run, frame);
      // a leg that shows is beyond the cloth, seen from the middle at the same height
      const glm::vec3 hips = m.joint(run, frame, "hips");
      for (std::size_t v = 0; v < at.size(); ++v) {
        const Part part = vertices[v].part;
        if (part != Part::kLegLeft && part != Part::kLegRight) continue;
        if (m.position[v].z < knee_m) continue;
        const glm::vec3 middle(hips.x, hips.y, at[v].z);
        const float reach_m = glm::distance(middle, at[v]);
        for (const std::array<int, 3>& corner : cloth) {
          const float t = meets(middle, at[v], {at[corner[0]], at[corner[1]], at[corner[2]]});
          if (t > 1.5F) continue;  // beyond: under the hem, or not this triangle
          ++covered;
          EXPECT_GT((t - 1.0F) * reach_m, -0.003F)
              << figure.name << " frame " << frame << " vertex " << v << " at " << at[v].x << " "
              << at[v].y << " " << at[v].z;
        }
      }
    }
    EXPECT_GT(covered, 300U) << figure.name;  // or nothing was looked at
  }
}

TEST(BuiltinWalkTest, HipAndKneeStayWithinTenDegreesOfACapturedWalk) {
  const std::string folder = test::data_dir() + "/motions";
  Acclaim capture;
  if (!capture.read(folder + "/cmu_02.asf", folder + "/cmu_02_01_walk.amc")) {
    GTEST_SKIP() << "no motions/cmu_02_01_walk.amc in the data folder";
  }
  // three cycles of 131 to 133 frames, from one forward-most ankle to the next
  constexpr int kSamples = 60;
  Curves mean;
  mean.hip.assign(kSamples, 0.0F);
  mean.knee.assign(kSamples, 0.0F);
  struct Cycle {
    const char *thigh, *shin;
    float from, to;
  };
  for (const Cycle& cycle : {Cycle{"lfemur", "ltibia", 133, 264},
                             {"rfemur", "rtibia", 67, 200},
                             {"rfemur", "rtibia", 200, 331}}) {
    std::vector<std::pair<glm::vec3, glm::vec3>> bones;
    for (int i = 0; i < kSamples; ++i) {
      const auto frame = static_cast<std::size_t>(
          std::lround(cycle.from + (cycle.to - cycle.from) * static_cast<float>(i) / kSamples));
      bones.push_back({capture.along(frame, cycle.thigh), capture.along(frame, cycle.shin)});
    }
    const Curves one = curves_of(bones);
    for (int i = 0; i < kSamples; ++i) {
      mean.hip[i] += one.hip[i] / 3.0F;
      mean.knee[i] += one.knee[i] / 3.0F;
    }
  }
  for (const Figure& figure : figures()) {
    const Moving m(figure);
    const auto& walk = m.clips[1];
    std::vector<std::pair<glm::vec3, glm::vec3>> bones;
    for (std::uint32_t frame = 0; frame < walk.frame_count; ++frame) {
      const glm::vec3 hip = m.joint(walk, frame, "left_upper_leg"),
                      knee = m.joint(walk, frame, "left_lower_leg"),
                      ankle = m.joint(walk, frame, "left_foot");
      bones.push_back({knee - hip, ankle - knee});
    }
    const Curves ours = curves_of(bones);
    float best = 1e9F;
    for (int shift = 0; shift < 100; ++shift) {
      float most = 0.0F;
      for (int i = 0; i < kSamples; ++i) {
        const float t = static_cast<float>(i) / kSamples,
                    s = t + static_cast<float>(shift) / 100.0F;
        most = std::max({most, std::abs(at(ours.hip, t) - at(mean.hip, s)),
                         std::abs(at(ours.knee, t) - at(mean.knee, s))});
      }
      best = std::min(best, most);
    }
    EXPECT_LT(best, 10.0F) << figure.name;
    RecordProperty(figure.name, std::to_string(best));
  }
}

}  // namespace
}  // namespace throng::builtin
