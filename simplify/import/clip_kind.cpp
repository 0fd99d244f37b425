#include "simplify/import/clip_kind.hpp"

#include <absl/strings/ascii.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace throng::simplify::gltf {
namespace {

using render::ClipKind;

enum class CharClass { kNone, kLower, kUpper, kDigit };

CharClass class_of(char c) {
  if (absl::ascii_islower(static_cast<unsigned char>(c))) return CharClass::kLower;
  if (absl::ascii_isupper(static_cast<unsigned char>(c))) return CharClass::kUpper;
  if (absl::ascii_isdigit(static_cast<unsigned char>(c))) return CharClass::kDigit;
  return CharClass::kNone;
}

ClipKind kind_of(std::string_view word) {
  constexpr std::array<std::pair<std::string_view, ClipKind>, 19> kWords = {{
      {"idle", ClipKind::kIdle},     {"idling", ClipKind::kIdle},    {"stand", ClipKind::kIdle},
      {"standing", ClipKind::kIdle}, {"breathing", ClipKind::kIdle}, {"walk", ClipKind::kWalk},
      {"walking", ClipKind::kWalk},  {"walkcycle", ClipKind::kWalk}, {"stroll", ClipKind::kWalk},
      {"run", ClipKind::kRun},       {"running", ClipKind::kRun},    {"sprint", ClipKind::kRun},
      {"jog", ClipKind::kRun},       {"gallop", ClipKind::kRun},     {"sit", ClipKind::kSit},
      {"sitting", ClipKind::kSit},   {"cheer", ClipKind::kCheer},    {"cheering", ClipKind::kCheer},
      {"victory", ClipKind::kCheer},
  }};
  const auto* const found = std::find_if(kWords.begin(), kWords.end(),
                                         [&](const auto& entry) { return entry.first == word; });
  return found == kWords.end() ? ClipKind::kOther : found->second;
}

/// Words of poses that no crowd waits or walks in, and of changes from one pose to another.
bool is_special(std::string_view word) {
  constexpr std::array<std::string_view, 26> kSpecial = {
      "jump",     "jumping",  "fall", "falling", "lie",  "lying", "death",  "die",       "dead",
      "climb",    "climbing", "hang", "hanging", "swim", "fly",   "crouch", "crouching", "crawl",
      "crawling", "ride",     "to",   "down",    "up",   "start", "stop",   "wheelchair"};
  return std::find(kSpecial.begin(), kSpecial.end(), word) != kSpecial.end();
}

/// Words that say nothing about the manner: rigs, numbering, "loop".
bool is_filler(std::string_view word) {
  constexpr std::array<std::string_view, 26> kFiller = {
      "armature",  "human",  "man",  "woman",   "character", "rig",    "anim",
      "animation", "cycle",  "loop", "action",  "a",         "clip",   "base",
      "layer",     "mixamo", "com",  "forward", "default",   "normal", "male",
      "female",    "basic",  "take", "metarig", "in"};
  return std::find(kFiller.begin(), kFiller.end(), word) != kFiller.end() ||
         absl::ascii_isdigit(static_cast<unsigned char>(word.front()));
}

}  // namespace

std::vector<std::string> words_of(const std::string& name) {
  std::vector<std::string> words;
  std::string word;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const CharClass now = class_of(name[i]);
    const CharClass before = i == 0 ? CharClass::kNone : class_of(name[i - 1]);
    const CharClass after = i + 1 == name.size() ? CharClass::kNone : class_of(name[i + 1]);
    const bool begins =
        now != CharClass::kNone &&
        ((now == CharClass::kDigit) != (before == CharClass::kDigit) ||
         (now == CharClass::kUpper && before == CharClass::kLower) ||
         (now == CharClass::kUpper && before == CharClass::kUpper && after == CharClass::kLower));
    if ((now == CharClass::kNone || begins) && !word.empty())
      words.push_back(std::exchange(word, {}));
    if (now != CharClass::kNone)
      word.push_back(absl::ascii_tolower(static_cast<unsigned char>(name[i])));
  }
  if (!word.empty()) words.push_back(word);
  return words;
}

std::vector<ClipKind> kinds_of(const std::vector<std::string>& names) {
  struct Guess {
    ClipKind kind = ClipKind::kOther;
    std::size_t manner = 0;  // words beyond the one that names the kind
  };
  std::vector<Guess> guesses(names.size());
  std::array<std::size_t, 6> plainest;
  plainest.fill(SIZE_MAX);
  for (std::size_t i = 0; i < names.size(); ++i) {
    Guess& guess = guesses[i];
    bool is_mixed = false;
    bool is_ruled_out = false;
    for (const std::string& word : words_of(names[i])) {
      const ClipKind kind = kind_of(word);
      is_ruled_out = is_ruled_out || is_special(word);
      if (kind != ClipKind::kOther) {
        const bool is_second = guess.kind != ClipKind::kOther && guess.kind != kind;
        const bool is_seated = is_second &&
                               (kind == ClipKind::kSit || guess.kind == ClipKind::kSit) &&
                               (kind == ClipKind::kIdle || guess.kind == ClipKind::kIdle);
        is_mixed = is_mixed || (is_second && !is_seated);
        guess.kind = is_seated ? ClipKind::kSit : kind;
      } else if (!is_filler(word)) {
        ++guess.manner;
      }
    }
    if (is_mixed || is_ruled_out) guess.kind = ClipKind::kOther;
    std::size_t& least = plainest[static_cast<std::size_t>(guess.kind)];
    least = std::min(least, guess.manner);
  }
  std::vector<ClipKind> kinds;
  kinds.reserve(names.size());
  for (const Guess& guess : guesses) {
    const std::size_t least = plainest[static_cast<std::size_t>(guess.kind)];
    kinds.push_back(guess.manner == least ? guess.kind : ClipKind::kOther);
  }
  return kinds;
}

}  // namespace throng::simplify::gltf
