#include "simplify/builtin/rig.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace throng::builtin {
namespace {

constexpr float kPi = 3.14159265F;
constexpr const char* kSides[2] = {"left_", "right_"};
constexpr const char* kDigits[5] = {"thumb", "index", "middle", "ring", "pinky"};
// counter-clockwise from the front
constexpr const char* kSkirt[8] = {"skirt_front",     "skirt_left_front", "skirt_left",
                                   "skirt_left_back", "skirt_back",       "skirt_right_back",
                                   "skirt_right",     "skirt_right_front"};

float smooth_step(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

bool has_hair_joints(const Figure& figure) {
  return figure.hat != HatStyle::kHeadscarf &&
         (figure.hair == HairStyle::kPonytail || figure.hair == HairStyle::kLong);
}

/// Middle of the vertices of one phalanx.
glm::vec3 digit_centre(const Mesh& mesh, int side, int digit, int phalanx) {
  glm::vec3 sum{0.0F};
  int count = 0;
  for (const MeshVertex& v : mesh.vertices) {
    if (v.part != Part::kFinger) continue;
    if (v.detail == static_cast<std::uint8_t>(side * 64 + digit * 4 + phalanx)) {
      sum += v.position;
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<float>(count) : sum;
}

using Weights = std::map<int, float>;  // ordered, so that sums do not depend on hashing

}  // namespace

int Rig::find(std::string_view name) const {
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (joints[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

bool has_skirt_joints(const Figure& figure) {
  return figure.bottom == BottomStyle::kSkirt || figure.hem_z < 0.76F;
}

Rig make_rig(const Figure& figure, const Mesh& mesh) {
  const Landmarks land = landmarks_of(figure);
  Rig rig;
  const auto add = [&](const std::string& name, const std::string& parent, glm::vec3 canonical,
                       Part part = Part::kTorso) {
    rig.joints.push_back(
        {name, parent.empty() ? -1 : rig.find(parent), to_model(figure, canonical, part)});
  };
  const auto sided = [](glm::vec3 p, int side) {
    return glm::vec3{p.x, side == 0 ? p.y : -p.y, p.z};
  };
  const auto arm_point = [&](float a, int side) {
    const float bend = std::max(0.0F, a - land.elbow_m);
    return sided(land.shoulder + land.arm_direction * a + glm::vec3{bend * 0.13F, 0.0F, 0.0F},
                 side);
  };

  add("hips", "", land.hips);
  add("spine1", "hips", land.spine1);
  add("spine2", "spine1", land.spine2);
  add("spine3", "spine2", land.spine3);
  add("neck", "spine3", land.neck);
  add("head", "neck", land.head);
  for (int side = 0; side < 2; ++side) {
    const std::string s = kSides[side];
    add(s + "clavicle", "spine3", sided({-0.005F, 0.030F, 1.455F}, side));
    add(s + "upper_arm", s + "clavicle", arm_point(0.0F, side));
    add(s + "upper_arm_twist", s + "upper_arm", arm_point(land.elbow_m * 0.5F, side));
    add(s + "forearm", s + "upper_arm", arm_point(land.elbow_m, side));
    add(s + "forearm_twist", s + "forearm", arm_point((land.elbow_m + land.wrist_m) * 0.5F, side));
    add(s + "hand", s + "forearm", arm_point(land.wrist_m, side));
  }
  for (int side = 0; side < 2; ++side) {
    const std::string s = kSides[side];
    add(s + "upper_leg", "hips", sided(land.hip_joint, side));
    add(s + "lower_leg", s + "upper_leg", sided(land.knee, side));
    add(s + "foot", s + "lower_leg", sided(land.ankle, side));
    add(s + "toes", s + "foot", sided(land.ball, side));
  }

  // cloth, hair and bag are needed by whoever wears them
  if (has_skirt_joints(figure)) {
    for (int i = 0; i < 8; ++i) {
      const float azimuth = static_cast<float>(i) * kPi / 4.0F;
      add(kSkirt[i], "hips",
          {0.085F * std::cos(azimuth) - 0.008F, 0.145F * figure.hip * std::sin(azimuth), 0.955F});
    }
  }
  if (has_hair_joints(figure)) {
    const bool tail = figure.hair == HairStyle::kPonytail;
    add("hair1", "head", tail ? glm::vec3{-0.115F, 0.0F, 1.71F} : glm::vec3{-0.09F, 0.0F, 1.62F},
        Part::kHair);
    add("hair2", "hair1", tail ? glm::vec3{-0.165F, 0.0F, 1.64F} : glm::vec3{-0.11F, 0.0F, 1.50F},
        Part::kHair);
  }
  if (figure.bag != BagStyle::kNone) {
    const bool pack = figure.bag == BagStyle::kBackpack;
    add("bag", pack ? "spine3" : "hips",
        pack ? glm::vec3{-0.14F, 0.0F, 1.36F} : glm::vec3{-0.08F, -0.16F, 1.06F});
  }

  // the rest in order of use, in pairs; the single ones make the count even
  const auto left = [&] { return figure.joint_count - static_cast<int>(rig.joints.size()); };
  if (left() % 2 != 0) add("jaw", "head", {0.03F, 0.0F, 1.60F}, Part::kHead);
  const auto pair = [&](const std::string& name, const std::string& parent, bool sided_parent,
                        glm::vec3 l, glm::vec3 r, Part part) {
    if (left() < 2) return;
    for (int side = 0; side < 2; ++side) {
      add(kSides[side] + name, sided_parent ? kSides[side] + parent : parent, side == 0 ? l : r,
          part);
    }
  };
  for (int level = 0; level < 3; ++level) {
    for (int digit = 0; digit < 5; ++digit) {
      glm::vec3 p[2];
      for (int side = 0; side < 2; ++side) {
        const glm::vec3 first = digit_centre(mesh, side, digit, 0),
                        second = digit_centre(mesh, side, digit, 1);
        p[side] = level == 0 ? first - (second - first) * 1.1F : level == 1 ? first : second;
      }
      const std::string base = kDigits[digit];
      pair(base + std::to_string(level + 1), level == 0 ? "hand" : base + std::to_string(level),
           true, p[0], p[1], Part::kFinger);
    }
    if (level == 0) {
      pair("eye", "head", false, {0.082F, 0.031F, 1.660F}, {0.082F, -0.031F, 1.660F}, Part::kHead);
    }
    if (level == 1) {
      const glm::vec3 thigh = (land.hip_joint + land.knee) * 0.5F,
                      shin = (land.knee + land.ankle) * 0.5F;
      pair("upper_leg_twist", "upper_leg", true, thigh, sided(thigh, 1), Part::kLegLeft);
      pair("lower_leg_twist", "lower_leg", true, shin, sided(shin, 1), Part::kLegLeft);
    }
  }
  pair("toes_end", "toes", true, {0.200F, land.ball.y, 0.015F}, {0.200F, -land.ball.y, 0.015F},
       Part::kLegLeft);
  pair("heel", "foot", true, {-0.080F, land.ankle.y, 0.010F}, {-0.080F, -land.ankle.y, 0.010F},
       Part::kLegLeft);
  pair("brow", "head", false, {0.100F, 0.028F, 1.680F}, {0.100F, -0.028F, 1.680F}, Part::kHead);
  pair("cheek", "head", false, {0.085F, 0.040F, 1.625F}, {0.085F, -0.040F, 1.625F}, Part::kHead);
  pair("lip_corner", "head", false, {0.095F, 0.022F, 1.592F}, {0.095F, -0.022F, 1.592F},
       Part::kHead);
  pair("shoulder_blade", "spine3", false, {-0.10F, 0.09F, 1.36F}, {-0.10F, -0.09F, 1.36F},
       Part::kTorso);
  pair("breast_pocket", "spine3", false, {0.10F, 0.07F, 1.32F}, {0.10F, -0.07F, 1.32F},
       Part::kTorso);
  return rig;
}

std::vector<Skin> make_skin(const Figure& figure, const Mesh& mesh, const Rig& rig) {
  const Landmarks land = landmarks_of(figure);
  const std::size_t count = mesh.vertices.size();
  const int hips = rig.find("hips"), spine1 = rig.find("spine1"), spine2 = rig.find("spine2"),
            spine3 = rig.find("spine3"), neck = rig.find("neck"), head = rig.find("head");
  int clavicle[2], upper_arm[2], upper_twist[2], forearm[2], forearm_twist[2], hand[2],
      upper_leg[2], lower_leg[2], foot[2], toes[2];
  for (int side = 0; side < 2; ++side) {
    const std::string s = kSides[side];
    clavicle[side] = rig.find(s + "clavicle");
    upper_arm[side] = rig.find(s + "upper_arm");
    upper_twist[side] = rig.find(s + "upper_arm_twist");
    forearm[side] = rig.find(s + "forearm");
    forearm_twist[side] = rig.find(s + "forearm_twist");
    hand[side] = rig.find(s + "hand");
    upper_leg[side] = rig.find(s + "upper_leg");
    lower_leg[side] = rig.find(s + "lower_leg");
    foot[side] = rig.find(s + "foot");
    toes[side] = rig.find(s + "toes");
  }
  const int bag = rig.find("bag"), hair1 = rig.find("hair1"), hair2 = rig.find("hair2");
  const bool skirt = has_skirt_joints(figure);
  int skirt_joint[8];
  for (int i = 0; i < 8; ++i) skirt_joint[i] = rig.find(kSkirt[i]);

  const auto chain = [](Weights& out, float at,
                        std::initializer_list<std::pair<float, int>> stops) {
    const std::pair<float, int>* before = stops.begin();
    if (at <= before->first) {
      out[before->second] += 1.0F;
      return;
    }
    for (const std::pair<float, int>* stop = before + 1; stop != stops.end(); ++stop) {
      if (at <= stop->first) {
        const float t = smooth_step(before->first, stop->first, at);
        out[before->second] += 1.0F - t;
        out[stop->second] += t;
        return;
      }
      before = stop;
    }
    out[before->second] += 1.0F;
  };
  const auto add_skirt = [&](Weights& out, const glm::vec3& p, float amount) {
    const float azimuth = std::atan2(p.y / (1.45F * figure.hip), p.x + 0.008F);
    const float at = (azimuth < 0.0F ? azimuth + 2.0F * kPi : azimuth) / (kPi / 4.0F);
    const int low = static_cast<int>(at) % 8;
    const float t = at - std::floor(at);
    out[skirt_joint[low]] += amount * (1.0F - t);
    out[skirt_joint[(low + 1) % 8]] += amount * t;
  };

  std::vector<Weights> first(count);
  for (std::size_t v = 0; v < count; ++v) {
    const MeshVertex& vertex = mesh.vertices[v];
    const glm::vec3 p = vertex.position;
    Weights& w = first[v];
    const int side = p.y >= 0.0F ? 0 : 1;
    switch (vertex.part) {
      case Part::kTorso:
      case Part::kSkirt: {
        Weights spine;
        chain(spine, p.z,
              {{1.00F, hips},
               {1.11F, spine1},
               {1.235F, spine2},
               {1.38F, spine3},
               {1.47F, spine3},
               {1.535F, neck}});
        // what lies over a skirt moves with it; the crotch inside does not
        const bool cloth =
            vertex.part == Part::kSkirt || (figure.bottom == BottomStyle::kSkirt && p.z > 0.86F);
        const float hanging = cloth && skirt ? smooth_step(0.985F, 0.90F, p.z) : 0.0F;
        const float leg = hanging > 0.0F ? 0.0F : 0.8F * smooth_step(0.975F, 0.80F, p.z);
        const float distance = glm::length(glm::vec3{p.x, std::abs(p.y), p.z} - land.shoulder);
        const float arm = 0.45F * smooth_step(0.13F, 0.04F, distance);
        const float collar = (1.0F - arm) * 0.6F * smooth_step(0.21F, 0.07F, distance);
        const float rest = (1.0F - hanging) * (1.0F - leg) * (1.0F - arm - collar);
        for (const auto& [joint, weight] : spine) w[joint] += weight * rest;
        if (hanging > 0.0F) add_skirt(w, p, hanging);
        if (leg > 0.0F) {
          const float left = smooth_step(-0.055F, 0.055F, p.y);
          w[upper_leg[0]] += leg * left;
          w[upper_leg[1]] += leg * (1.0F - left);
        }
        if (arm > 0.0F) w[upper_arm[side]] += arm;
        if (collar > 0.0F) w[clavicle[side]] += collar;
        break;
      }
      case Part::kHead: {
        const float t = smooth_step(1.500F, 1.568F, p.z + 0.25F * std::clamp(p.x, -0.1F, 0.1F));
        w[head] += t;
        w[neck] += 1.0F - t;
        break;
      }
      case Part::kHair: {
        if (hair1 < 0) {
          w[head] = 1.0F;
        } else if (figure.hair == HairStyle::kPonytail) {
          chain(w, -p.z, {{-1.72F, head}, {-1.69F, hair1}, {-1.63F, hair1}, {-1.57F, hair2}});
        } else {
          chain(w, -p.z, {{-1.62F, head}, {-1.55F, hair1}, {-1.50F, hair1}, {-1.42F, hair2}});
          // the ends lie on the shoulders and the back
          const float lying = 0.7F * smooth_step(1.56F, 1.46F, p.z);
          for (auto& [joint, weight] : w) weight *= 1.0F - lying;
          w[spine3] += lying;
        }
        break;
      }
      case Part::kBag:
        w[bag] = 1.0F;
        break;
      case Part::kArmLeft:
      case Part::kArmRight: {
        const int s = vertex.part == Part::kArmLeft ? 0 : 1;
        const float a =
            glm::dot(glm::vec3{p.x, std::abs(p.y), p.z} - land.shoulder, land.arm_direction);
        chain(w, a,
              {{-0.03F, clavicle[s]},
               {0.055F, upper_arm[s]},
               {0.11F, upper_arm[s]},
               {0.20F, upper_twist[s]},
               {0.245F, upper_twist[s]},
               {0.325F, forearm[s]},
               {0.36F, forearm[s]},
               {0.46F, forearm_twist[s]},
               {0.515F, forearm_twist[s]},
               {0.560F, hand[s]}});
        break;
      }
      case Part::kFinger: {
        const int s = vertex.detail >= 64 ? 1 : 0;
        const int digit = (vertex.detail % 64) / 4, phalanx = vertex.detail % 4;
        int joint = hand[s];
        for (int level = 1; level <= phalanx + 1; ++level) {
          const int found =
              rig.find(std::string(kSides[s]) + kDigits[digit] + std::to_string(level));
          if (found >= 0) joint = found;
        }
        w[joint] = 1.0F;
        break;
      }
      case Part::kLegLeft:
      case Part::kLegRight: {
        const int s = vertex.part == Part::kLegLeft ? 0 : 1;
        chain(w, -p.z,
              {{-0.93F, hips},
               {-0.80F, upper_leg[s]},
               {-0.56F, upper_leg[s]},
               {-0.45F, lower_leg[s]},
               {-0.15F, lower_leg[s]},
               {-0.095F, foot[s]}});
        const float toe = smooth_step(0.082F, 0.128F, p.x);
        if (p.z < 0.09F && toe > 0.0F) {
          w.clear();
          w[foot[s]] = 1.0F - toe;
          w[toes[s]] = toe;
        }
        break;
      }
    }
  }

  // spreading closes the steps where limbs meet; what must stay stiff is left out
  const std::vector<std::vector<int>> near = mesh.neighbours();
  for (int round = 0; round < 2; ++round) {
    std::vector<Weights> next = first;
    for (std::size_t v = 0; v < count; ++v) {
      const Part part = mesh.vertices[v].part;
      const bool shoe = (part == Part::kLegLeft || part == Part::kLegRight) &&
                        mesh.vertices[v].position.z < 0.13F;
      if (part == Part::kFinger || part == Part::kBag || part == Part::kHead ||
          part == Part::kHair || shoe)
        continue;
      Weights mean;
      const float share = 0.5F / static_cast<float>(near[v].size());
      for (const auto& [joint, weight] : first[v]) mean[joint] += weight * 0.5F;
      for (const int other : near[v]) {
        for (const auto& [joint, weight] : first[other]) mean[joint] += weight * share;
      }
      next[v] = mean;
    }
    first.swap(next);
  }

  std::vector<Skin> out(count);
  for (std::size_t v = 0; v < count; ++v) {
    std::vector<std::pair<float, int>> list;
    for (const auto& [joint, weight] : first[v]) {
      if (weight > 0.004F) list.push_back({weight, joint});
    }
    std::stable_sort(list.begin(), list.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    if (list.size() > 4) list.resize(4);
    float sum = 0.0F;
    for (const auto& [weight, joint] : list) sum += weight;
    out[v].weight = {0.0F, 0.0F, 0.0F, 0.0F};
    for (std::size_t i = 0; i < list.size(); ++i) {
      out[v].joint[i] = list[i].second;
      out[v].weight[i] = list[i].first / sum;
    }
  }
  return out;
}

}  // namespace throng::builtin
