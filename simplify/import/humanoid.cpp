#include "simplify/import/humanoid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>

#include "simplify/import/clip_kind.hpp"

namespace throng::simplify::gltf {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kDegree = std::numbers::pi / 180.0;

enum class Part {
  kNone,
  kHips,
  kSpine,
  kUpperLeg,
  kLeg,
  kLowerLeg,
  kFoot,
  kUpperArm,
  kArm,
  kLowerArm,
  kHand
};

Part part_of(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, Part>, 34> kParts = {{
      {"hips", Part::kHips},         {"hip", Part::kHips},          {"pelvis", Part::kHips},
      {"spine", Part::kSpine},       {"torso", Part::kSpine},       {"chest", Part::kSpine},
      {"abdomen", Part::kSpine},     {"upleg", Part::kUpperLeg},    {"upperleg", Part::kUpperLeg},
      {"thigh", Part::kUpperLeg},    {"legupper", Part::kUpperLeg}, {"hipside", Part::kUpperLeg},
      {"leg", Part::kLeg},           {"lowerleg", Part::kLowerLeg}, {"loleg", Part::kLowerLeg},
      {"leglower", Part::kLowerLeg}, {"shin", Part::kLowerLeg},     {"calf", Part::kLowerLeg},
      {"knee", Part::kLowerLeg},     {"foot", Part::kFoot},         {"ankle", Part::kFoot},
      {"upperarm", Part::kUpperArm}, {"uparm", Part::kUpperArm},    {"armupper", Part::kUpperArm},
      {"arm", Part::kArm},           {"forearm", Part::kLowerArm},  {"lowerarm", Part::kLowerArm},
      {"loarm", Part::kLowerArm},    {"armlower", Part::kLowerArm}, {"elbow", Part::kLowerArm},
      {"hand", Part::kHand},         {"wrist", Part::kHand},        {"palm", Part::kHand},
      {"body", Part::kSpine},
  }};
  const auto* const found = std::find_if(kParts.begin(), kParts.end(),
                                         [&](const auto& entry) { return entry.first == name; });
  return found == kParts.end() ? Part::kNone : found->second;
}

struct Label {
  Part part = Part::kNone;
  int side = -1;  // 0 left, 1 right
};

Label label_of(const std::string& name) {
  constexpr std::array<std::string_view, 12> kPrefixes = {
      "mixamorig", "bip", "biped", "j", "jnt", "joint", "bone", "def", "c", "rig", "human", "b"};
  Label label;
  std::string rest;
  for (const std::string& word : words_of(name)) {
    if (word == "l" || word == "left") {
      label.side = 0;
    } else if (word == "r" || word == "right") {
      label.side = 1;
    } else if (std::find(kPrefixes.begin(), kPrefixes.end(), word) == kPrefixes.end() &&
               (word.front() < '0' || word.front() > '9')) {
      rest += word;
    }
  }
  // "leftupleg" written as one word
  for (const auto& [prefix, side] : {std::pair("left", 0), std::pair("right", 1)}) {
    if (label.side < 0 && rest.starts_with(prefix)) {
      label.side = side;
      rest.erase(0, std::string_view(prefix).size());
    }
  }
  label.part = part_of(rest);
  if (label.side >= 0 && label.part == Part::kHips) label.part = Part::kUpperLeg;
  return label;
}

glm::dvec3 place(const std::vector<glm::dmat4>& world, std::int32_t node) {
  return glm::dvec3(world[static_cast<std::size_t>(node)][3]);
}

glm::dquat about_x(double angle_deg) {
  return glm::angleAxis(angle_deg * kDegree, glm::dvec3(1, 0, 0));
}

/// A smooth bump of height 1 around `center` in a cycle of 1.
double bump(double phase, double center, double width) {
  double distance = phase - center;
  distance -= std::round(distance);
  return std::exp(-0.5 * distance * distance / (width * width));
}

/// Joint angles of one leg in degrees; 0 is its heel strike.
struct LegAngles {
  double hip, knee, ankle;
};

LegAngles leg_at(double phase) {
  return {9.0 + 20.0 * std::cos(kTurn * (phase + 0.06)),
          4.0 + 13.0 * bump(phase, 0.14, 0.06) + 57.0 * bump(phase, 0.73, 0.085),
          -5.0 * bump(phase, 0.07, 0.035) + 10.0 * bump(phase, 0.43, 0.10) -
              20.0 * bump(phase, 0.63, 0.05)};
}

glm::dquat shortest_arc(const glm::dvec3& from, const glm::dvec3& to) {
  if (glm::length(from) < 1e-9) return glm::dquat(1, 0, 0, 0);
  const glm::dvec3 a = glm::normalize(from);
  const glm::dvec3 axis = glm::cross(a, to);
  const double sine = glm::length(axis);
  if (sine < 1e-9) return glm::dquat(1, 0, 0, 0);
  return glm::angleAxis(std::atan2(sine, glm::dot(a, to)), axis / sine);
}

/// Everything about a skeleton's rest pose that its poses are made from.
struct Rig {
  Scene scene;
  Humanoid humanoid;
  std::vector<glm::dmat4> rest_world;
  std::vector<glm::dquat> rest_rotation;  // of the root frame, scales left out
  double shank = 1.0;                     // length of a lower leg
  double ground = 0.0;                    // height of the soles, from the ankles

  void pose(const std::vector<std::pair<std::int32_t, glm::dquat>>& turns, bool keep_on_ground,
            std::vector<Local>& locals) const {
    // turns are in the root frame, on top of the rest pose; joints without one keep their local
    // rest
    std::vector<std::int32_t> turn_of(locals.size(), kNone);
    for (std::size_t i = 0; i < turns.size(); ++i) {
      if (turns[i].first != kNone)
        turn_of[static_cast<std::size_t>(turns[i].first)] = static_cast<std::int32_t>(i);
    }
    std::vector<glm::dquat> world(locals.size());
    for (const std::uint32_t node : scene.order) {
      const std::int32_t parent = scene.parent[node];
      const glm::dquat base =
          parent == kNone ? glm::dquat(1, 0, 0, 0) : world[static_cast<std::size_t>(parent)];
      Local local = decomposed(locals[node]);
      const glm::dquat own(local.rotation.w, local.rotation.x, local.rotation.y, local.rotation.z);
      world[node] = base * own;
      if (turn_of[node] == kNone) continue;
      world[node] = turns[static_cast<std::size_t>(turn_of[node])].second * rest_rotation[node];
      const glm::dquat turned = glm::inverse(base) * world[node];
      local.rotation = glm::dvec4(turned.x, turned.y, turned.z, turned.w);
      locals[node] = local;
    }
    attach_feet(turns, locals);
    if (keep_on_ground) lower_hips(locals);
  }

  /// Rigs for inverse kinematics keep the feet outside the legs: they are put back where the legs
  /// end.
  void attach_feet(const std::vector<std::pair<std::int32_t, glm::dquat>>& turns,
                   std::vector<Local>& locals) const {
    for (int side = 0; side < 2; ++side) {
      const std::int32_t foot = humanoid.foot[side];
      if (foot == kNone || is_below(foot, humanoid.lower_leg[side])) continue;
      const std::vector<glm::dmat4> world = world_of(scene, locals);
      const std::size_t leg = static_cast<std::size_t>(humanoid.lower_leg[side]);
      const std::size_t at = static_cast<std::size_t>(foot);
      glm::dmat4 wanted = world[leg] * glm::inverse(rest_world[leg]) * rest_world[at];
      for (const auto& [node, turn] : turns) {
        if (node != foot) continue;
        const glm::dvec4 ankle = wanted[3];
        wanted = glm::mat4_cast(turn) * rest_world[at];
        wanted[3] = ankle;
      }
      const std::int32_t parent = scene.parent[at];
      Local& local = locals[at];
      local.is_matrix = true;
      local.matrix =
          parent == kNone ? wanted : glm::inverse(world[static_cast<std::size_t>(parent)]) * wanted;
    }
  }

  bool is_below(std::int32_t node, std::int32_t ancestor) const {
    while (node != kNone && node != ancestor) node = scene.parent[static_cast<std::size_t>(node)];
    return node == ancestor;
  }

  void lower_hips(std::vector<Local>& locals) const {
    const std::vector<glm::dmat4> world = world_of(scene, locals);
    double lowest = std::numeric_limits<double>::infinity();
    for (int side = 0; side < 2; ++side) {
      const bool has_foot = humanoid.foot[side] != kNone;
      const std::size_t end =
          static_cast<std::size_t>(has_foot ? humanoid.foot[side] : humanoid.lower_leg[side]);
      const glm::dmat4 now_from_rest = world[end] * glm::inverse(rest_world[end]);
      const glm::dvec3 ankle = glm::dvec3(rest_world[end][3]);
      // heel, ball and toe of a foot of usual length (0.15 of the height; the shank is 0.25 of it)
      for (const double forward : {-0.16, 0.30, 0.42}) {
        const glm::dvec4 sole(ankle.x, ground, ankle.z + forward * shank, 1.0);
        lowest = std::min(lowest, (now_from_rest * sole).y);
      }
    }
    const std::size_t hips = static_cast<std::size_t>(humanoid.hips);
    const std::int32_t parent = scene.parent[hips];
    Local local = decomposed(locals[hips]);
    const glm::dvec3 down(0.0, ground - lowest, 0.0);
    local.translation +=
        parent == kNone ? down
                        : glm::inverse(glm::dmat3(world[static_cast<std::size_t>(parent)])) * down;
    locals[hips] = local;
    // feet outside the legs and the hips move along
    for (int side = 0; side < 2; ++side) {
      const std::int32_t foot = humanoid.foot[side];
      if (foot == kNone || is_below(foot, humanoid.hips)) continue;
      const std::int32_t above = scene.parent[static_cast<std::size_t>(foot)];
      const glm::dvec3 shift =
          above == kNone ? down
                         : glm::inverse(glm::dmat3(world[static_cast<std::size_t>(above)])) * down;
      Local& at = locals[static_cast<std::size_t>(foot)];
      if (at.is_matrix) {
        at.matrix[3] += glm::dvec4(shift, 0.0);
      } else {
        at.translation += shift;
      }
    }
  }

  /// Arms that hang down whatever the rest pose is, with this much swing forward and bend.
  void turn_arm(int side, double swing_deg, double bend_deg,
                std::vector<std::pair<std::int32_t, glm::dquat>>& turns) const {
    const std::int32_t upper = humanoid.upper_arm[side];
    const std::int32_t lower = humanoid.lower_arm[side];
    if (upper == kNone || lower == kNone) return;
    const double outward = side == 0 ? 1.0 : -1.0;
    const glm::dvec3 hanging = glm::normalize(glm::dvec3(0.12 * outward, -1.0, 0.0));
    const glm::dquat swing = about_x(-swing_deg);
    const glm::dquat hang =
        shortest_arc(place(rest_world, lower) - place(rest_world, upper), hanging);
    turns.emplace_back(upper, swing * hang);
    const std::int32_t hand = humanoid.hand[side];
    const glm::dvec3 forearm = hand == kNone ? place(rest_world, lower) - place(rest_world, upper)
                                             : place(rest_world, hand) - place(rest_world, lower);
    turns.emplace_back(lower, swing * about_x(-bend_deg) * shortest_arc(forearm, hanging));
  }
};

}  // namespace

std::optional<Humanoid> find_humanoid(const Document& document, const Scene& scene) {
  Humanoid found;
  std::int32_t leg[2] = {kNone, kNone};
  std::int32_t arm[2] = {kNone, kNone};
  const auto take = [](std::int32_t& slot, std::uint32_t node) {
    if (slot == kNone) slot = static_cast<std::int32_t>(node);
  };
  for (const std::uint32_t node : scene.order) {
    if (document.nodes[node].mesh != kNone) continue;
    const Label label = label_of(document.nodes[node].name);
    if (label.side < 0) {
      if (label.part == Part::kHips) take(found.hips, node);
      if (label.part == Part::kSpine) take(found.spine, node);
      continue;
    }
    switch (label.part) {
      case Part::kUpperLeg:
        take(found.upper_leg[label.side], node);
        break;
      case Part::kLeg:
        take(leg[label.side], node);
        break;
      case Part::kLowerLeg:
        take(found.lower_leg[label.side], node);
        break;
      case Part::kFoot:
        take(found.foot[label.side], node);
        break;
      case Part::kUpperArm:
        take(found.upper_arm[label.side], node);
        break;
      case Part::kArm:
        take(arm[label.side], node);
        break;
      case Part::kLowerArm:
        take(found.lower_arm[label.side], node);
        break;
      case Part::kHand:
        take(found.hand[label.side], node);
        break;
      default:
        break;
    }
  }
  for (int side = 0; side < 2; ++side) {
    // "leg" is the upper one beside a shin and the lower one beside a thigh; "arm" likewise
    if (found.upper_leg[side] == kNone) {
      found.upper_leg[side] = leg[side];
    } else if (found.lower_leg[side] == kNone) {
      found.lower_leg[side] = leg[side];
    }
    if (found.upper_arm[side] == kNone) found.upper_arm[side] = arm[side];
    if (found.upper_leg[side] == kNone || found.lower_leg[side] == kNone) return std::nullopt;
  }
  if (found.hips == kNone) {
    // what carries both legs
    std::int32_t above = scene.parent[static_cast<std::size_t>(found.upper_leg[0])];
    const auto carries = [&](std::int32_t ancestor, std::int32_t node) {
      while (node != kNone && node != ancestor) node = scene.parent[static_cast<std::size_t>(node)];
      return node == ancestor;
    };
    while (above != kNone && !carries(above, found.upper_leg[1]))
      above = scene.parent[static_cast<std::size_t>(above)];
    if (above == kNone) return std::nullopt;
    found.hips = above;
  }
  const std::vector<glm::dmat4> world = world_of(scene, scene.rest);
  for (int side = 0; side < 2; ++side) {
    const double knee = place(world, found.lower_leg[side]).y;
    if (place(world, found.upper_leg[side]).y <= knee) return std::nullopt;
    if (found.foot[side] != kNone && place(world, found.foot[side]).y >= knee) return std::nullopt;
  }
  return found;
}

std::vector<Motion> make_default_motions(const Scene& scene, const Humanoid& humanoid) {
  auto rig = std::make_shared<Rig>();
  rig->scene = scene;
  rig->humanoid = humanoid;
  rig->rest_world = world_of(scene, scene.rest);
  rig->rest_rotation.resize(scene.rest.size());
  for (const std::uint32_t node : scene.order) {
    const glm::dvec4 own = decomposed(scene.rest[node]).rotation;
    const std::int32_t parent = scene.parent[node];
    const glm::dquat base = parent == kNone ? glm::dquat(1, 0, 0, 0)
                                            : rig->rest_rotation[static_cast<std::size_t>(parent)];
    rig->rest_rotation[node] = base * glm::dquat(own.w, own.x, own.y, own.z);
  }
  const glm::dvec3 knee = place(rig->rest_world, humanoid.lower_leg[0]);
  rig->shank =
      glm::length(knee - place(rig->rest_world, humanoid.foot[0] == kNone ? humanoid.upper_leg[0]
                                                                          : humanoid.foot[0]));
  rig->ground = humanoid.foot[0] == kNone
                    ? knee.y - rig->shank
                    : place(rig->rest_world, humanoid.foot[0]).y - 0.16 * rig->shank;

  std::vector<std::uint32_t> moved;
  for (const std::int32_t node :
       {humanoid.hips, humanoid.spine, humanoid.upper_leg[0], humanoid.upper_leg[1],
        humanoid.lower_leg[0], humanoid.lower_leg[1], humanoid.foot[0], humanoid.foot[1],
        humanoid.upper_arm[0], humanoid.upper_arm[1], humanoid.lower_arm[0],
        humanoid.lower_arm[1]}) {
    if (node != kNone) moved.push_back(static_cast<std::uint32_t>(node));
  }

  constexpr double kWalkSeconds = 1.1;
  Motion walk{"walk", kWalkSeconds, moved, [rig](double time_s, std::vector<Local>& locals) {
                const double cycle = time_s / kWalkSeconds;
                std::vector<std::pair<std::int32_t, glm::dquat>> turns;
                if (rig->humanoid.spine != rig->humanoid.hips) {
                  // shoulders turn against the step
                  turns.emplace_back(
                      rig->humanoid.spine,
                      glm::angleAxis(4.0 * kDegree * std::cos(kTurn * cycle), glm::dvec3(0, 1, 0)));
                }
                for (int side = 0; side < 2; ++side) {
                  const double phase = cycle + 0.5 * side;
                  const LegAngles leg = leg_at(phase - std::floor(phase));
                  turns.emplace_back(rig->humanoid.upper_leg[side], about_x(-leg.hip));
                  turns.emplace_back(rig->humanoid.lower_leg[side], about_x(leg.knee - leg.hip));
                  turns.emplace_back(rig->humanoid.foot[side],
                                     about_x(leg.knee - leg.hip - leg.ankle));
                  const double swing = std::cos(kTurn * phase);
                  rig->turn_arm(side, 2.0 - 18.0 * swing, 20.0 - 10.0 * swing, turns);
                }
                rig->pose(turns, true, locals);
              }};
  constexpr double kIdleSeconds = 3.0;
  Motion idle{"idle", kIdleSeconds, moved, [rig](double time_s, std::vector<Local>& locals) {
                const double breath = std::sin(kTurn * time_s / kIdleSeconds);
                std::vector<std::pair<std::int32_t, glm::dquat>> turns;
                if (rig->humanoid.spine != rig->humanoid.hips) {
                  turns.emplace_back(rig->humanoid.spine, about_x(0.8 * breath));
                }
                for (int side = 0; side < 2; ++side)
                  rig->turn_arm(side, 1.0 + breath, 12.0 + breath, turns);
                rig->pose(turns, false, locals);
              }};
  return {std::move(idle), std::move(walk)};
}

}  // namespace throng::simplify::gltf
