#include <algorithm>

#include "render/compute/element/motion.hpp"
#include "render/crowd/derive.hpp"
#include "render/crowd/motion_graph.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kMostToldNames = 256;

std::int64_t blend_us(const MotionGraph& graph, std::uint32_t from, std::uint32_t to) {
  const auto blend_s = [&graph](std::uint32_t code) {
    return code == 0 ? 0.0F : graph.nodes[code - 1].blend_s;
  };
  return static_cast<std::int64_t>(1e6F * std::max(blend_s(from), blend_s(to)));
}

}  // namespace

std::vector<std::uint32_t> Crowd::Derive::motion(Crowd& crowd, const AgentFrame& frame,
                                                 const Roster& roster, const Snapshot* before) {
  const std::size_t slots = roster.id.size();
  if (frame.motion.empty() && (before == nullptr || before->motion.empty())) return {};

  std::vector<std::uint8_t> code{0};
  for (const std::string& name : frame.motion_names) {
    std::uint8_t known = crowd.motions_->code_of(name);
    if (known == MotionGraph::kUnknown) {
      known = 0;
      std::vector<std::string>& told = crowd.told_motions_;
      if (told.size() < kMostToldNames && std::find(told.begin(), told.end(), name) == told.end()) {
        told.push_back(name);
        crowd.unknown_motions_.push_back(name);
      }
    }
    code.push_back(known);
  }

  std::vector<std::uint32_t> result(slots);
  crowd.motion_since_us_.resize(slots);
  for (std::size_t c = 0; c < frame.position_m.size(); ++c) {
    const std::uint32_t slot = crowd.slot_of_column_[c];
    const std::uint32_t wanted = frame.motion.empty() ? 0 : code[frame.motion[c]];
    std::int64_t& since_us = crowd.motion_since_us_[slot];
    const bool is_known = before != nullptr && slot < before->present.size() &&
                          before->present[slot] != 0 && before->roster->id[slot] == roster.id[slot];
    if (!is_known) {
      result[slot] = element::pack_motion(wanted, wanted, element::kMostAgeMs);
      continue;
    }
    const std::uint32_t packed = slot < before->motion.size()
                                     ? before->motion[slot]
                                     : element::pack_motion(0, 0, element::kMostAgeMs);
    const std::uint32_t age_before_ms = packed >> 16;
    std::uint32_t now = packed & 0xffU, old = packed >> 8 & 0xffU;
    const std::int64_t blending_us = blend_us(*crowd.motions_, old, now);
    const bool is_blending =
        now != old && age_before_ms < element::kMostAgeMs && frame.time_us - since_us < blending_us;
    bool is_changed = age_before_ms < element::kMostAgeMs;
    if (wanted != now && !is_blending) {
      old = now;
      now = wanted;
      since_us = frame.time_us;
      is_changed = true;
    } else if (wanted != now && wanted == old) {
      // back to where it came from: on from the same mixture
      std::swap(now, old);
      since_us = frame.time_us - (blending_us - (frame.time_us - since_us));
    }  // anything else waits until this blend is over
    const std::int64_t age_us = is_changed ? frame.time_us - since_us : 0;
    const std::uint32_t age_ms = is_changed && age_us < 1000 * std::int64_t{element::kMostAgeMs}
                                     ? static_cast<std::uint32_t>(age_us / 1000)
                                     : element::kMostAgeMs;
    result[slot] = element::pack_motion(now, age_ms < element::kMostAgeMs ? old : now, age_ms);
  }
  return result;
}

}  // namespace throng::render
