#include "server/batch/passes.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <algorithm>

#include "throng/render/encode.hpp"

namespace throng::server {

absl::StatusOr<PassSet> parse_passes(const std::string& text) {
  PassSet set{false, false, false};
  for (const absl::string_view name : absl::StrSplit(text, ',')) {
    bool* const pass = name == "color"   ? &set.color
                       : name == "depth" ? &set.depth
                       : name == "id"    ? &set.id
                                         : nullptr;
    if (pass == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat("--passes: '", name, "' is not one of color, depth, id"));
    }
    *pass = true;
  }
  return set;
}

absl::StatusOr<std::vector<std::uint8_t>> encode_depth(const render::FramePasses& passes) {
  const render::ExrChannel channel{"Z", std::span<const float>(passes.depth_m)};
  return render::encode_exr({&channel, 1}, passes.width_px, passes.height_px,
                            "Z: metres along the viewing axis, infinity: sky");
}

absl::StatusOr<std::vector<std::uint8_t>> encode_ids(const render::FramePasses& passes) {
  const std::size_t count = passes.instance.size();
  std::vector<std::uint32_t> kind(count, 0), low(count, 0), high(count, 0);
  for (std::size_t pixel = 0; pixel < count; ++pixel) {
    const std::uint32_t i = passes.instance[pixel];
    if (i == render::FramePasses::kNothing) continue;
    const render::SeenInstance& seen = passes.instances[i];
    kind[pixel] = seen.surrounding ? 2 : 1;
    low[pixel] = static_cast<std::uint32_t>(seen.agent_id);
    high[pixel] = static_cast<std::uint32_t>(seen.agent_id >> 32);
  }
  const render::ExrChannel channels[] = {{"class", std::span<const std::uint32_t>(kind)},
                                         {"id", std::span<const std::uint32_t>(low)},
                                         {"id_high", std::span<const std::uint32_t>(high)}};
  return render::encode_exr(channels, passes.width_px, passes.height_px,
                            "class: 0 sky or ground, 1 agent, 2 surroundings; "
                            "agent id: id + 2^32 * id_high");
}

std::string box_lines(std::uint32_t frame, const render::FramePasses& passes, BoxExtent extent) {
  std::vector<const render::SeenInstance*> agents;
  for (const render::SeenInstance& seen : passes.instances) {
    if (!seen.surrounding && seen.visible_px > 0) agents.push_back(&seen);
  }
  std::sort(agents.begin(), agents.end(),
            [](const auto* a, const auto* b) { return a->agent_id < b->agent_id; });
  std::string lines;
  for (const render::SeenInstance* agent : agents) {
    render::PixelBox box = agent->visible;
    if (extent == BoxExtent::kWhole) {
      // which is known a little less exactly than the pixels are
      const render::PixelBox& bounds = agent->bounds;
      box = {std::min(box.x_low, bounds.x_low), std::min(box.y_low, bounds.y_low),
             std::max(box.x_high, bounds.x_high), std::max(box.y_high, bounds.y_high)};
    }
    absl::StrAppend(&lines, frame, ",", agent->agent_id, ",", box.x_low + 1, ",", box.y_low + 1,
                    ",", box.x_high - box.x_low + 1, ",", box.y_high - box.y_low + 1,
                    ",1,-1,-1,-1\n");
  }
  return lines;
}

}  // namespace throng::server
