#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

namespace throng::client {

/// Something that a script does; one happens before each picture of the window.
struct ScriptStep {
  enum class Kind {
    kMove,  // x y: the pointer
    kDown,  // button 1 or 3 goes down at the pointer
    kUp,
    kWheel,    // x: notches, away is nearer
    kKeyDown,  // text: SDL's name of a key
    kKeyUp,
    kSize,        // x y: the window
    kWait,        // text: until NAME=VALUE, !=, > or <, of the state's JSON holds
    kScreenshot,  // text: a PNG of the window
    kState,       // text: adds the state's JSON as a line to this file
  };
  Kind kind = Kind::kMove;
  double x = 0, y = 0;
  int button = 1;
  bool shift = false;
  std::string text;
};

/// Lines such as these; `#` begins a comment, and a line is one or more steps:
///
///     wait frames>2            click 640 380        drag 100 100 300 120 right
///     wheel 3 640 380          key t                key Shift+W
///     press w                  release w            size 800 600
///     state out.jsonl          screenshot out.png
///
/// InvalidArgument names the line and what it may be.
absl::StatusOr<std::vector<ScriptStep>> parse_script(const std::string& text);

/// True if `condition`, as of `wait`, holds for a line of state. InvalidArgument for one that can't
/// be understood or names nothing of the state.
absl::StatusOr<bool> holds(const std::string& condition, const std::string& state_json);

}  // namespace throng::client
