#include "render/crowd/motion_graph.hpp"

#include <absl/strings/ascii.h>

#include <algorithm>
#include <array>

namespace throng::render {
namespace {

struct KnownNode {
  ClipKind kind;
  float blend_s;
  bool is_whole;
};
// Who is told to stand or to sit does so on whatever moves: an escalator, a bus.
constexpr std::array<KnownNode, 6> kKnown = {{{ClipKind::kIdle, 0.4F, true},
                                              {ClipKind::kSit, 0.9F, true},
                                              {ClipKind::kCheer, 0.35F, false},
                                              {ClipKind::kWave, 0.45F, false},
                                              {ClipKind::kTalk, 0.5F, false},
                                              {ClipKind::kPhone, 0.7F, false}}};

bool is_of(const Clip& clip, const MotionGraph::Node& node) {
  if (clip.frame_count == 0 || clip.kind != node.kind) return false;
  return clip.kind != ClipKind::kOther || absl::AsciiStrToLower(clip.name) == node.name;
}

/// Steps on the spot: its stride is the angle of a cycle, in radians.
bool is_turn(const Clip& clip) {
  return clip.kind == ClipKind::kOther && clip.stride_m > 0.0F &&
         absl::AsciiStrToLower(clip.name) == "turn";
}

}  // namespace

std::uint8_t MotionGraph::code_of(std::string_view name) const {
  const std::string lower = absl::AsciiStrToLower({name.data(), name.size()});
  if (lower.empty() || lower == "walk" || lower == "run") return 0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (nodes[i].is_had && nodes[i].name == lower) return static_cast<std::uint8_t>(i + 1);
  }
  return kUnknown;
}

MotionGraph motion_graph_of(const Cast& cast) {
  MotionGraph graph;
  const auto any = [&cast](const MotionGraph::Node& node) {
    return std::any_of(cast.members.begin(), cast.members.end(), [&](const CastMember& member) {
      const std::vector<Clip>& clips = member.character.clips;
      return std::any_of(clips.begin(), clips.end(),
                         [&](const Clip& clip) { return is_of(clip, node); });
    });
  };
  for (const KnownNode& known : kKnown) {
    MotionGraph::Node node{name_of(known.kind), known.kind, known.blend_s, known.is_whole};
    node.is_had = any(node);
    graph.nodes.push_back(std::move(node));
  }
  for (const CastMember& member : cast.members) {
    for (const Clip& clip : member.character.clips) {
      if (clip.kind != ClipKind::kOther || is_turn(clip) ||
          graph.nodes.size() == element::kMostActions)
        continue;
      std::string name = absl::AsciiStrToLower(clip.name);
      if (graph.code_of(name) != MotionGraph::kUnknown) continue;
      graph.nodes.push_back({std::move(name)});
    }
  }
  return graph;
}

element::Gait gait_of(const Character& character, const MotionGraph& graph) {
  element::Gait gait;
  const auto range_of = [](const Clip& clip) {
    return element::ClipRange{clip.first_frame, clip.frame_count, clip.rate_hz};
  };
  for (const Clip& clip : character.clips) {
    if (clip.frame_count == 0) continue;
    if (is_turn(clip) && gait.turn.frame_count == 0) {
      gait.turn = range_of(clip);
      gait.turn_rad = clip.stride_m;
    }
    if (clip.kind == ClipKind::kIdle && gait.idle.frame_count == 0) {
      gait.idle = range_of(clip);
    } else if (clip.kind == ClipKind::kWalk && gait.walk.frame_count == 0) {
      gait.walk = range_of(clip);
      if (clip.stride_m > 0.0F) gait.walk_stride_m = clip.stride_m;
      if (clip.speed_mps > 0.0F) gait.walk_speed_mps = clip.speed_mps;
    } else if (clip.kind == ClipKind::kRun && gait.run.frame_count == 0) {
      gait.run = range_of(clip);
      if (clip.stride_m > 0.0F) gait.run_stride_m = clip.stride_m;
      if (clip.speed_mps > 0.0F) gait.run_speed_mps = clip.speed_mps;
    }
  }
  if (gait.idle.frame_count + gait.walk.frame_count + gait.run.frame_count == 0) {
    gait.idle = character.clips.empty() || character.clips[0].frame_count == 0
                    ? element::ClipRange{0, 1, 1.0F}
                    : range_of(character.clips[0]);
  }
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    const MotionGraph::Node& node = graph.nodes[i];
    const auto clip = std::find_if(character.clips.begin(), character.clips.end(),
                                   [&](const Clip& each) { return is_of(each, node); });
    if (clip == character.clips.end()) continue;
    gait.action[i] = {range_of(*clip), node.blend_s, node.is_whole ? 1U : 0U};
  }
  return gait;
}

}  // namespace throng::render
