#include "client/desktop/script.hpp"

#include <absl/strings/ascii.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace throng::client {
namespace {

using Kind = ScriptStep::Kind;

ScriptStep at(Kind kind, double x, double y, int button = 1) {
  ScriptStep step;
  step.kind = kind;
  step.x = x;
  step.y = y;
  step.button = button;
  return step;
}

ScriptStep with(Kind kind, std::string text) {
  ScriptStep step;
  step.kind = kind;
  step.text = std::move(text);
  return step;
}

ScriptStep key(Kind kind, const std::string& name) {
  absl::string_view plain = name;
  const bool shift = name.size() > 6 && absl::ConsumePrefix(&plain, "Shift+");
  ScriptStep step = with(kind, std::string(plain));
  step.shift = shift;
  return step;
}

/// The steps of one line; false: not understood.
bool add_line(const std::vector<std::string>& words, std::vector<ScriptStep>& steps) {
  const std::string& verb = words[0];
  std::vector<double> numbers;
  for (std::size_t i = 1; i < words.size(); ++i) {
    double value = 0;
    if (!absl::SimpleAtod(words[i], &value) || !(std::abs(value) < 1e5)) break;
    numbers.push_back(value);
  }
  const std::size_t arguments = words.size() - 1;
  if (verb == "click" && numbers.size() == 2 && arguments == 2) {
    steps.push_back(at(Kind::kMove, numbers[0], numbers[1]));
    steps.push_back(at(Kind::kDown, numbers[0], numbers[1]));
    steps.push_back(at(Kind::kUp, numbers[0], numbers[1]));
  } else if (verb == "move" && numbers.size() == 2 && arguments == 2) {
    steps.push_back(at(Kind::kMove, numbers[0], numbers[1]));
  } else if (verb == "drag" && numbers.size() == 4 &&
             (arguments == 4 || (arguments == 5 && words[5] == "right"))) {
    const int button = arguments == 5 ? 3 : 1;
    steps.push_back(at(Kind::kMove, numbers[0], numbers[1]));
    steps.push_back(at(Kind::kDown, numbers[0], numbers[1], button));
    constexpr int kMoves = 4;
    for (int i = 1; i <= kMoves; ++i) {
      const double t = double{1} * i / kMoves;
      steps.push_back(at(Kind::kMove, numbers[0] + (numbers[2] - numbers[0]) * t,
                         numbers[1] + (numbers[3] - numbers[1]) * t));
    }
    steps.push_back(at(Kind::kUp, numbers[2], numbers[3], button));
  } else if (verb == "wheel" && numbers.size() == 3 && arguments == 3) {
    steps.push_back(at(Kind::kMove, numbers[1], numbers[2]));
    steps.push_back(at(Kind::kWheel, numbers[0], 0));
  } else if (verb == "size" && numbers.size() == 2 && arguments == 2 && numbers[0] >= 64 &&
             numbers[1] >= 64 && numbers[0] <= 8192 && numbers[1] <= 8192) {
    steps.push_back(at(Kind::kSize, numbers[0], numbers[1]));
  } else if (verb == "key" && arguments == 1) {
    steps.push_back(key(Kind::kKeyDown, words[1]));
    steps.push_back(key(Kind::kKeyUp, words[1]));
  } else if (verb == "press" && arguments == 1) {
    steps.push_back(key(Kind::kKeyDown, words[1]));
  } else if (verb == "release" && arguments == 1) {
    steps.push_back(key(Kind::kKeyUp, words[1]));
  } else if (verb == "wait" && arguments == 1) {
    steps.push_back(with(Kind::kWait, words[1]));
  } else if (verb == "screenshot" && arguments == 1) {
    steps.push_back(with(Kind::kScreenshot, words[1]));
  } else if (verb == "state" && arguments == 1) {
    steps.push_back(with(Kind::kState, words[1]));
  } else {
    return false;
  }
  return true;
}

}  // namespace

absl::StatusOr<std::vector<ScriptStep>> parse_script(const std::string& text) {
  std::vector<ScriptStep> steps;
  std::size_t number = 0;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    ++number;
    const absl::string_view plain = line.substr(0, line.find('#'));
    const std::vector<std::string> words =
        absl::StrSplit(plain, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (words.empty() || add_line(words, steps)) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "line ", number, ": '", absl::StripAsciiWhitespace(plain),
        "' is none of: move X Y, click X Y, drag X Y X2 Y2 [right], wheel N X Y, key NAME, ",
        "press NAME, release NAME, size W H, wait NAME=VALUE, state FILE, screenshot FILE"));
  }
  return steps;
}

absl::StatusOr<bool> holds(const std::string& condition, const std::string& state_json) {
  const std::size_t sign = condition.find_first_of("=!<>");
  const auto wrong = [&] {
    return absl::InvalidArgumentError(absl::StrCat("wait: '", condition,
                                                   "' must be NAME=VALUE, NAME!=VALUE, NAME>NUMBER "
                                                   "or NAME<NUMBER with a name of the state"));
  };
  if (sign == std::string::npos || sign == 0) return wrong();
  const bool differs = condition.compare(sign, 2, "!=") == 0;
  if (condition[sign] == '!' && !differs) return wrong();
  const std::string name = condition.substr(0, sign);
  const std::string value = condition.substr(sign + (differs ? 2 : 1));
  const auto state = nlohmann::json::parse(state_json, nullptr, /*allow_exceptions=*/false);
  if (!state.is_object() || !state.contains(name)) return wrong();
  const auto& now = state[name];
  if (condition[sign] == '<' || condition[sign] == '>') {
    double limit = 0;
    if (!now.is_number() || !absl::SimpleAtod(value, &limit)) return wrong();
    return condition[sign] == '<' ? now.get<double>() < limit : now.get<double>() > limit;
  }
  const std::string text = now.is_string() ? now.get<std::string>() : now.dump();
  return (text == value) != differs;
}

}  // namespace throng::client
