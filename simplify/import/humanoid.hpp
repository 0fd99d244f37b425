#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "simplify/import/animation.hpp"
#include "simplify/import/document.hpp"
#include "simplify/import/scene.hpp"

namespace throng::simplify::gltf {

/// The nodes of a human skeleton, kNone where there is none. Index 0 is left, 1 right.
struct Humanoid {
  std::int32_t hips = kNone;
  std::int32_t spine = kNone;
  std::int32_t upper_leg[2] = {kNone, kNone};
  std::int32_t lower_leg[2] = {kNone, kNone};
  std::int32_t foot[2] = {kNone, kNone};
  std::int32_t upper_arm[2] = {kNone, kNone};
  std::int32_t lower_arm[2] = {kNone, kNone};
  std::int32_t hand[2] = {kNone, kNone};
};

/// Finds it by the joint names of the usual tools (Mixamo, Rigify, Biped, VRM, Unreal, Quaternius,
/// KayKit). Nothing unless both legs have two joints and stand below the hips.
std::optional<Humanoid> find_humanoid(const Document& document, const Scene& scene);

/// A walk on the spot and an idle clip for a skeleton without clips. The joint angles are smooth
/// curves through the landmarks of normal gait (Perry & Burnfield 2010, chapters 3 to 6: hip 30
/// degrees of flexion to 10 of extension, knee 15 in loading and 60 in swing, ankle 10 up and 20
/// down); arms hang and swing against the legs, and the hips rise and sink so that the lower foot
/// stays on the ground.
std::vector<Motion> make_default_motions(const Scene& scene, const Humanoid& humanoid);

}  // namespace throng::simplify::gltf
