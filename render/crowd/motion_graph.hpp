#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "render/compute/element/gait.hpp"
#include "throng/render/asset.hpp"

namespace throng::render {

/// What the agents of a cast can be told to do, beside standing, walking and running by their
/// speed.
///
/// Nodes are clips by role: the known kinds (idle, sit, cheer, wave, talk, phone), then other clips
/// by their name, kMostActions in all; members that are added to the end of a cast change no code.
/// There is an edge from every node to every other and to locomotion; it takes the longer of the
/// two nodes' times.
struct MotionGraph {
  struct Node {
    std::string name;  // lower case, as producers say it
    ClipKind kind = ClipKind::kOther;
    float blend_s = 0.4F;
    bool is_whole = true;  // element::Action::is_whole
    bool is_had = true;    // by a member at least
  };
  std::vector<Node> nodes;  // code k is at k - 1

  static constexpr std::uint8_t kUnknown = 255;
  /// 0 for locomotion ("", "walk", "run"), kUnknown for a name that no member has. Letters may be
  /// of either case.
  std::uint8_t code_of(std::string_view name) const;
};

MotionGraph motion_graph_of(const Cast& cast);

/// The clips a character stands, walks, runs and acts with (its first of each kind or name) and
/// their strides. A character without any of the first three stands with its first clip; without a
/// clip, in its first frame.
element::Gait gait_of(const Character& character, const MotionGraph& graph = {});

/// Fills the shifts by which feet stay where they are put on curves (element/stance.hpp), from what
/// of the mesh is on the ground in each frame of the walk and the run. Takes milliseconds a
/// character: for what is drawn, not for each snapshot.
void add_stance_shift(const Character& character, element::Gait& gait);

}  // namespace throng::render
