#pragma once

#include <glm/glm.hpp>

struct ImDrawList;
struct ImFont;

namespace throng::client {

class Viewer;

/// Room that the panels take of the window, px.
struct Insets {
  double top = 0, right = 0, bottom = 0, left = 0;
};

/// What lies over the picture: density, grid, trails, the followed agent's ring, ids, scale bar,
/// time stamp, legends; as the browser's page draws them.
void draw_overlays(const Viewer& viewer, const glm::dvec2& window_px, const Insets& insets,
                   ImFont* font, ImDrawList& list);

/// The largest of 1, 2, 5 times a power of ten that is not over `value` > 0.
double nice_below(double value);

}  // namespace throng::client
