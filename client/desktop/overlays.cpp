#include "client/desktop/overlays.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/desktop/panels.hpp"
#include "client/desktop/viewer.hpp"
#include "render/raster/element/color.hpp"

namespace throng::client {
namespace {

constexpr ImU32 kWhite = IM_COL32(244, 248, 251, 255), kPlate = IM_COL32(15, 22, 32, 158),
                kDim = IM_COL32(207, 217, 226, 255), kEdge = IM_COL32(10, 16, 24, 184),
                kChosen = IM_COL32(255, 205, 110, 255);

/// As the server colours agents.
ImU32 map_ink(render::ColorMap map, double t) {
  const std::uint32_t rgb =
      render::element::color_map_sample(map, static_cast<int>(std::clamp(t * 17.0, 0.0, 16.0)));
  return IM_COL32(rgb >> 16, rgb >> 8 & 255U, rgb & 255U, 255);
}

/// Density: quiet blue to red.
ImU32 heat(double level) {
  static constexpr double kStops[5][4] = {{70, 130, 220, 0},
                                          {70, 180, 220, 0.34},
                                          {110, 205, 120, 0.46},
                                          {250, 205, 70, 0.56},
                                          {235, 80, 50, 0.68}};
  const double at = std::clamp(level, 0.0, 0.9999) * 4.0;
  const auto low = static_cast<std::size_t>(at);
  const auto mix = [&](std::size_t k) {
    return kStops[low][k] + (kStops[low + 1][k] - kStops[low][k]) * (at - static_cast<double>(low));
  };
  return IM_COL32(static_cast<int>(mix(0)), static_cast<int>(mix(1)), static_cast<int>(mix(2)),
                  static_cast<int>(255.0 * mix(3)));
}

ImU32 with_alpha(int r, int g, int b, double alpha) {
  return IM_COL32(r, g, b, static_cast<int>(255.0 * std::clamp(alpha, 0.0, 1.0)));
}

class Painter {
 public:
  Painter(const Viewer& viewer, const glm::dvec2& window_px, const Insets& insets, ImFont* font,
          ImDrawList& list)
      : viewer_(viewer),
        camera_(viewer.shown_camera()),
        at_(viewer.placement()),
        projector_(camera_, at_.size_px),
        window_px_(window_px),
        insets_(insets),
        font_(font),
        k_(font->FontSize / kFontPx),
        list_(list) {}

  void draw() {
    const v1::StreamViewResponse& message = viewer_.frame()->message;
    const bool has_density = viewer_.shows(Overlay::kDensity) && message.has_density();
    if (has_density) draw_density(message.density());
    if (viewer_.shows(Overlay::kGrid)) draw_grid();
    if (viewer_.shows(Overlay::kTrails)) draw_trails();
    if (viewer_.followed() != 0) draw_followed();
    if (viewer_.shows(Overlay::kIds)) draw_ids();
    double bottom = window_px_.y - insets_.bottom;
    if (viewer_.shows(Overlay::kScale)) bottom = draw_scale(bottom);
    if (viewer_.shows(Overlay::kTime)) draw_time(bottom);
    double legend = window_px_.y - insets_.bottom;
    if (!viewer_.channel().empty()) {
      const v1::Channel* const channel = viewer_.current_channel();
      legend = draw_legend(legend, viewer_.channel(), channel != nullptr ? channel->unit() : "",
                           viewer_.low(), viewer_.high(),
                           [this](double t) { return map_ink(viewer_.color_map(), t); });
    }
    if (has_density) {
      draw_legend(legend, "density", "people / m\xc2\xb2", 0.0, density_top(message.density()),
                  heat);
    }
  }

 private:
  ImVec2 on_window(const glm::dvec2& px) const {
    return {static_cast<float>(px.x + at_.corner_px.x), static_cast<float>(px.y + at_.corner_px.y)};
  }
  static ImVec2 vec(double x, double y) { return {static_cast<float>(x), static_cast<float>(y)}; }
  glm::dvec2 size_of(const std::string& text, float height_px) const {
    const ImVec2 size = font_->CalcTextSizeA(height_px, 1e6F, 0.0F, text.c_str());
    return {double{size.x}, double{size.y}};
  }
  void write(double x, double y, float height_px, ImU32 color, const std::string& text) {
    list_.AddText(font_, height_px, vec(std::round(x), std::round(y)), color, text.c_str());
  }
  /// Centred, with a dark edge.
  void label(const std::string& text, const ImVec2& middle, ImU32 color) {
    const float height_px = 13.0F * k_;
    const glm::dvec2 size = size_of(text, height_px);
    const double x = double{middle.x} - size.x / 2, y = double{middle.y} - size.y / 2;
    for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
      write(x + dx, y + dy, height_px, kEdge, text);
    }
    write(x, y, height_px, color, text);
  }
  void plate(double x, double y, double width, double height) {
    list_.AddRectFilled(vec(x, y), vec(x + width, y + height), kPlate, 8.0F);
  }
  void stroke(const std::optional<Projector::Line>& line, ImU32 color, double width_px) {
    if (!line) return;
    list_.AddLine(on_window(line->from_px), on_window(line->to_px), color,
                  static_cast<float>(width_px));
  }

  /// The range of the heat map: it rests while the densest spot changes a little.
  static double density_top(const v1::DensityGrid& grid) {
    return std::max(1.0, std::ceil(grid.highest()));
  }

  void draw_density(const v1::DensityGrid& grid) {
    const std::string& levels = grid.levels();
    if (grid.columns() == 0 || !(grid.cell_m() > 0.0)) return;
    const std::size_t columns = grid.columns(), rows = levels.size() / columns;
    const double scale = grid.highest() / 255.0 / density_top(grid), z = grid.ground_z() + 0.02;
    const auto corner = [&](std::size_t row, std::size_t column) {
      return projector_.project({grid.low_x() + (static_cast<double>(column) - 0.5) * grid.cell_m(),
                                 grid.low_y() + (static_cast<double>(row) - 0.5) * grid.cell_m(),
                                 z});
    };
    const ImDrawListFlags flags = list_.Flags;
    list_.Flags &= ~ImDrawListFlags_AntiAliasedFill;  // cells touch: no seams
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t column = 0; column < columns; ++column) {
        const double level =
            static_cast<double>(static_cast<std::uint8_t>(levels[row * columns + column])) * scale;
        if (level < 0.02) continue;
        const auto a = corner(row, column), b = corner(row, column + 1),
                   c = corner(row + 1, column + 1), d = corner(row + 1, column);
        if (!a || !b || !c || !d) continue;
        list_.AddQuadFilled(on_window(a->px), on_window(b->px), on_window(c->px), on_window(d->px),
                            heat(level));
      }
    }
    list_.Flags = flags;
  }

  void draw_grid() {
    const double step_m = nice_below(std::max(0.5, camera_.height_at_target_m() / 5.0));
    const double z = viewer_.ground_z_m() + 0.01;
    constexpr int kLines = 14;
    const glm::dvec2 middle = glm::round(glm::dvec2(camera_.target_world) / step_m);
    const glm::dvec2 from = (middle - double{kLines}) * step_m,
                     to = (middle + double{kLines}) * step_m;
    for (int i = -kLines; i <= kLines; ++i) {
      const glm::dvec2 value = (middle + static_cast<double>(i)) * step_m;
      const double fade = 1.0 - std::abs(i) / (kLines + 1.0);
      const auto one = [&](double at, const auto& line, const glm::dvec3& place, const char* axis) {
        const bool is_axis = std::abs(at) < step_m / 2;
        stroke(line,
               is_axis ? with_alpha(120, 225, 205, 0.9 * fade)
                       : with_alpha(255, 255, 255, 0.42 * fade),
               is_axis ? 1.6 : 1.0);
        if (i % 2 != 0 && !is_axis) return;
        const auto on = projector_.project(place);
        if (!on || on->px_per_m * step_m < 34.0) return;
        label(absl::StrCat(axis, " ", format_number(at)), on_window(on->px),
              with_alpha(235, 245, 250, std::max(0.5, fade)));
      };
      one(value.x, projector_.line({value.x, from.y, z}, {value.x, to.y, z}),
          {value.x, camera_.target_world.y, z}, "x");
      one(value.y, projector_.line({from.x, value.y, z}, {to.x, value.y, z}),
          {camera_.target_world.x, value.y, z}, "y");
    }
  }

  void draw_trails() {
    for (const Agent& agent : viewer_.agents()) {
      const Trails::Trail* const trail = viewer_.trails().of(agent.id);
      if (trail == nullptr) continue;
      const bool strong = agent.id == viewer_.followed();
      const auto count = static_cast<double>(trail->size() + 1);
      for (std::size_t i = 0; i < trail->size(); ++i) {
        const glm::dvec3 lift(0.0, 0.0, 0.03);
        const glm::dvec3 a = (*trail)[i].position_world + lift;
        const glm::dvec3 b =
            (i + 1 < trail->size() ? (*trail)[i + 1].position_world : agent.position_world) + lift;
        if (glm::length(b - a) > 3.0) continue;  // a jump is no way
        const double age = static_cast<double>(i + 1) / count;
        stroke(projector_.line(a, b),
               strong ? with_alpha(255, 205, 110, 0.15 + 0.8 * age)
                      : with_alpha(110, 230, 205, 0.05 + 0.6 * age),
               (strong ? 3.0 : 1.8) * (0.4 + 0.6 * age));
      }
    }
  }

  const Agent* followed() const {
    for (const Agent& agent : viewer_.agents()) {
      if (agent.id == viewer_.followed()) return &agent;
    }
    return nullptr;
  }

  /// A ring on the ground.
  void draw_followed() {
    const Agent* const agent = followed();
    if (agent == nullptr) return;
    std::vector<ImVec2> ring;
    for (int i = 0; i < 32; ++i) {
      const double angle_rad = i / 16.0 * std::numbers::pi;
      const auto on =
          projector_.project(agent->position_world + glm::dvec3(0.42 * std::cos(angle_rad),
                                                                0.42 * std::sin(angle_rad), 0.02));
      if (!on) return;
      ring.push_back(on_window(on->px));
    }
    for (const auto& [color, width_px] : {std::pair{kEdge, 5.0F}, {kChosen, 2.5F}}) {
      list_.AddPolyline(ring.data(), static_cast<int>(ring.size()), color, ImDrawFlags_Closed,
                        width_px);
    }
  }

  /// Labels that do not cover each other, nearest first.
  void draw_ids() {
    struct Placed {
      const Agent* agent;
      Projector::Place at;
      bool chosen;
    };
    std::vector<Placed> placed;
    for (const Agent& agent : viewer_.agents()) {
      const auto on = projector_.project(agent.position_world + glm::dvec3(0.0, 0.0, 2.0));
      if (!on || on->px.x < 0 || on->px.y < 0 || on->px.x > at_.size_px.x ||
          on->px.y > at_.size_px.y) {
        continue;
      }
      placed.push_back({&agent, *on, agent.id == viewer_.followed()});
    }
    std::sort(placed.begin(), placed.end(), [](const Placed& a, const Placed& b) {
      return a.chosen != b.chosen ? a.chosen : a.at.px_per_m > b.at.px_per_m;
    });
    constexpr double kCellPx = 16.0;
    std::set<std::pair<int, int>> taken;
    for (const Placed& one : placed) {
      std::string text = absl::StrCat(one.agent->id);
      if (text.size() > 8) text = absl::StrCat("..", text.substr(text.size() - 6));
      const double half_px = static_cast<double>(text.size()) * 4.0 * k_ + 3.0;
      const int row = static_cast<int>(std::lround(one.at.px.y / kCellPx));
      const int first = static_cast<int>(std::floor((one.at.px.x - half_px) / kCellPx)),
                last = static_cast<int>(std::floor((one.at.px.x + half_px) / kCellPx));
      bool is_free = true;
      for (int c = first; c <= last; ++c) is_free &= taken.count({c, row}) == 0;
      if (!is_free) continue;
      for (int c = first; c <= last; ++c) taken.insert({c, row});
      label(text, on_window(one.at.px), one.chosen ? kChosen : kWhite);
    }
  }

  /// How long a metre is at the middle of the view. Returns what is left above.
  double draw_scale(double bottom) {
    const auto on = projector_.project(camera_.target_world);
    if (!on) return bottom;
    const double length_m = nice_below(std::min(140.0 * k_, window_px_.x / 4) / on->px_per_m);
    const double length_px = length_m * on->px_per_m, x = insets_.left, y = bottom - 36 * k_;
    plate(x, y, length_px + 24 * k_, 36 * k_);
    const std::string text = length_m >= 1000 ? absl::StrCat(length_m / 1000, " km")
                             : length_m < 1   ? absl::StrCat(std::round(length_m * 100), " cm")
                                              : absl::StrCat(length_m, " m");
    write(x + 12 * k_ + (length_px - size_of(text, 14 * k_).x) / 2, y + 4 * k_, 14 * k_, kWhite,
          text);
    const ImVec2 bar[] = {vec(x + 12 * k_, y + 22 * k_), vec(x + 12 * k_, y + 28 * k_),
                          vec(x + 12 * k_ + length_px, y + 28 * k_),
                          vec(x + 12 * k_ + length_px, y + 22 * k_)};
    list_.AddPolyline(bar, 4, kWhite, 0, 1.6F * k_);
    return y - 8;
  }

  void draw_time(double bottom) {
    const std::string text = format_time(viewer_.frame()->message.scene_time_us());
    const std::string& crowd = viewer_.crowd();
    const std::string detail = crowd.size() > 24 ? absl::StrCat(crowd.substr(0, 22), "..") : crowd;
    const double wide = size_of(text, 17 * k_).x, wider = size_of(detail, 14 * k_).x;
    const double x = insets_.left, y = bottom - 30 * k_;
    plate(x, y, wide + wider + 34 * k_, 30 * k_);
    write(x + 12 * k_, y + 6 * k_, 17 * k_, kWhite, text);
    write(x + 22 * k_ + wide, y + 8 * k_, 14 * k_, IM_COL32(185, 198, 211, 255), detail);
  }

  /// Returns where the next one ends.
  double draw_legend(double bottom, const std::string& name, const std::string& unit, double low,
                     double high, const std::function<ImU32(double)>& color_at) {
    const double width = 172 * k_, height = 58 * k_, bar = width - 24 * k_;
    const double x = window_px_.x - insets_.right - width, y = bottom - height;
    plate(x, y, width, height);
    write(x + 12 * k_, y + 5 * k_, 14 * k_, kWhite,
          unit.empty() ? name : absl::StrCat(name, " (", unit, ")"));
    for (int i = 0; i < static_cast<int>(bar); ++i) {
      list_.AddRectFilled(vec(x + 12 * k_ + i, y + 26 * k_), vec(x + 12 * k_ + i + 1, y + 36 * k_),
                          color_at(i / bar));
    }
    const std::string texts[] = {format_number(low), format_number((low + high) / 2),
                                 format_number(high)};
    for (int i = 0; i < 3; ++i) {
      const double wide = size_of(texts[i], 13 * k_).x;
      write(x + 12 * k_ + (bar - wide) * i / 2.0, y + 39 * k_, 13 * k_, kDim, texts[i]);
    }
    return y - 8;
  }

  const Viewer& viewer_;
  const OrbitCamera& camera_;
  const Viewer::Placement at_;
  const Projector projector_;
  const glm::dvec2 window_px_;
  const Insets insets_;
  ImFont* const font_;
  const float k_;  // of sizes, as the font is
  ImDrawList& list_;
};

}  // namespace

double nice_below(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  const double lead = value / power;
  return (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * power;
}

void draw_overlays(const Viewer& viewer, const glm::dvec2& window_px, const Insets& insets,
                   ImFont* font, ImDrawList& list) {
  if (viewer.frame() == nullptr) return;
  Painter(viewer, window_px, insets, font, list).draw();
}

}  // namespace throng::client
