#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>
#include <vector>

#include "client/desktop/script.hpp"
#include "client/desktop/viewer.hpp"
#include "throng/client/connection.hpp"

namespace throng::client {

struct WindowSettings {
  ConnectionOptions connection;
  ViewerSettings viewer;
  std::uint32_t width_px = 1280, height_px = 720;
  double scale = 0.0;              // of text and buttons; 0: as fine as the screen is
  std::string pictures = ".";      // folder that P saves to
  std::string screenshot;          // PNG: a hidden window that ends once it is written
  std::vector<ScriptStep> script;  // a hidden window that ends after the last step
  double patience_s = 60.0;        // that a script, or the screenshot, waits for something
  bool prints_state = false;       // as a line of JSON, at the end
};

/// Shows the window until it is closed. Unavailable: no window can be had here; DeadlineExceeded:
/// what was waited for has not come.
absl::Status run_window(const WindowSettings& settings);

}  // namespace throng::client
