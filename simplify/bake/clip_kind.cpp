#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

#include "simplify/bake/clips.hpp"

namespace throng::simplify {
namespace {

std::string lower(const std::string& text) {
  std::string result = text;
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

template <std::size_t N>
bool has_any(const std::string& text, const std::array<std::string_view, N>& words) {
  return std::any_of(words.begin(), words.end(),
                     [&](std::string_view word) { return text.find(word) != std::string::npos; });
}

}  // namespace

render::ClipKind kind_from_name(const std::string& name) {
  const std::string text = lower(name);
  constexpr std::array<std::string_view, 14> kNotAhead = {
      "back", "left", "right", "strafe", "crouch", "sneak", "jump",
      "turn", "swim", "slash", "shoot",  "attack", "carry", "hold"};
  const bool is_ahead = !has_any(text, kNotAhead);
  if (has_any(text, std::array<std::string_view, 1>{"walk"})) {
    return is_ahead ? render::ClipKind::kWalk : render::ClipKind::kOther;
  }
  if (has_any(text, std::array<std::string_view, 4>{"run", "jog", "sprint", "gallop"})) {
    return is_ahead ? render::ClipKind::kRun : render::ClipKind::kOther;
  }
  if (has_any(text, std::array<std::string_view, 4>{"idle", "breath", "standing", "survey"})) {
    return is_ahead ? render::ClipKind::kIdle : render::ClipKind::kOther;
  }
  if (has_any(text, std::array<std::string_view, 1>{"sit"})) return render::ClipKind::kSit;
  if (has_any(text, std::array<std::string_view, 4>{"cheer", "clap", "victory", "applau"})) {
    return render::ClipKind::kCheer;
  }
  return render::ClipKind::kOther;
}

bool is_generic_name(const std::string& name) {
  // whatever is left without these and digits says nothing
  std::string text = lower(name);
  for (const std::string_view word :
       {"armature", "mixamo.com", "mixamo", "animation", "anim", "take", "clip", "action",
        "skeleton", "scene", "layer0", "default", "unreal", "base", "untitled"}) {
    for (std::size_t at; (at = text.find(word)) != std::string::npos;) text.erase(at, word.size());
  }
  return std::none_of(text.begin(), text.end(),
                      [](unsigned char c) { return std::isalpha(c) != 0; });
}

}  // namespace throng::simplify
