#pragma once

#include <string>

#include "client/desktop/overlays.hpp"

namespace throng::client {

inline constexpr float kFontPx = 16.0F;  // on a screen of 96 dots an inch

class Viewer;

/// What of the panels is open, and what their buttons ask of the window.
struct Panels {
  bool display = false, numbers = false, help = false;
  bool wants_picture = false, wants_recording = false;
  bool recording = false;  // of the window
};

/// Colours, rounding and room of all panels; once.
void set_style();

/// Crowd, tools, player, banner and the open panels, for this ImGui frame.
void draw_panels(Viewer& viewer, Panels& panels);

/// What the panels cover at the window's edges.
Insets panel_insets();

}  // namespace throng::client
