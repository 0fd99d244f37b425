#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>

// What the points of a far crowd (FarCrowd) are made of, as backends take it. GLM only: .cu files
// include it.
namespace throng::render {

struct Roster;  // crowd.hpp

/// A point of FarFigures: of a figure a metre high, feet at the origin, facing +X. 40 bytes.
struct FarFigurePoint {
  glm::vec3 position;
  float radius;           // upright; negative: without a side, as it goes round the figure
  glm::vec3 normal;       // mean: the shorter, the more it goes round
  float squeeze;          // of what has no side: level extent by the upright one
  std::uint32_t base;     // colour before tints, as Splat::base
  std::uint32_t regions;  // tint mask, 8 bits each
};
static_assert(sizeof(FarFigurePoint) == 40);

/// An agent and how many points of the cloud it gets.
struct FarShare {
  std::uint32_t agent;
  std::uint32_t points;
  float radius;  // of its points: what theirs is multiplied with
};
static_assert(sizeof(FarShare) == 12);

/// A far crowd of one frame for a backend that makes its points itself (ViewWork::far). Budgets are
/// the processor's; who has none is not listed. Shapes: S shares, A agents by slot of `roster`.
///
/// What is behind the spans of one version never changes, so that it is copied to a device once.
struct FarPoints {
  std::span<const FarShare> shares;  // [S]
  std::uint64_t most_points = 0;     // their sum
  std::uint64_t shares_version = 0;

  // FarFigures, or else CrowdCloud
  std::span<const FarFigurePoint> figure;
  std::span<const std::uint32_t> block;  // by member of the cast
  std::span<const glm::vec3> cloud_position, cloud_normal;
  std::span<const std::uint8_t> cloud_region;
  std::uint64_t shape_version = 0;

  std::shared_ptr<const Roster> roster;   // who has gone since is not drawn
  std::span<const float> height_m;        // [A]
  std::span<const std::uint32_t> colors;  // [4 A] FarAgents::tints of figures, colors of the cloud
  std::span<const std::uint16_t> member;  // [A]
  std::uint64_t agents_version = 0;

  float least_m = 0.0F;  // who is nearer to the eye is drawn as something else
};

}  // namespace throng::render
