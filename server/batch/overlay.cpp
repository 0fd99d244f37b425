#include "server/batch/overlay.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "render/raster/element/color.hpp"
#include "server/batch/font.hpp"
#include "throng/render/srgb.hpp"

namespace throng::server {
namespace {

using render::Picture;

/// Colours are sRGB, as the eye blends type.
struct Ink {
  std::uint8_t r, g, b;
};
constexpr Ink kText{245, 246, 248}, kPlate{22, 25, 30};
constexpr double kPlateOpacity = 0.62;

struct Box {
  int left, top, right, bottom;  // right and bottom excluded
};

void blend(Picture& picture, int x, int y, Ink ink, double opacity) {
  if (x < 0 || y < 0 || x >= static_cast<int>(picture.width_px) ||
      y >= static_cast<int>(picture.height_px)) {
    return;
  }
  std::uint8_t* pixel =
      &picture
           .rgbx[4 * (static_cast<std::size_t>(y) * picture.width_px + static_cast<unsigned>(x))];
  const std::uint8_t to[3] = {ink.r, ink.g, ink.b};
  for (int c = 0; c < 3; ++c) {
    pixel[c] = static_cast<std::uint8_t>(std::lround(pixel[c] + opacity * (to[c] - pixel[c])));
  }
}

void fill(Picture& picture, const Box& box, Ink ink, double opacity) {
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) blend(picture, x, y, ink, opacity);
  }
}

/// A dark plate with round corners, so that text is read over anything.
void plate(Picture& picture, const Box& box, double radius_px) {
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) {
      const double dx =
          std::max({box.left + radius_px - x - 0.5, x + 0.5 - box.right + radius_px, 0.0});
      const double dy =
          std::max({box.top + radius_px - y - 0.5, y + 0.5 - box.bottom + radius_px, 0.0});
      const double inside = std::clamp(radius_px + 0.5 - std::hypot(dx, dy), 0.0, 1.0);
      blend(picture, x, y, kPlate, kPlateOpacity * inside);
    }
  }
}

void write(Picture& picture, const Font& font, std::string_view text, int x, int baseline,
           Ink ink) {
  font.draw(text, x, baseline,
            [&](int px, int py, double coverage) { blend(picture, px, py, ink, coverage); });
}

Ink map_ink(render::ColorMap map, double t) {
  const glm::vec3 linear = render::element::map_color(map, static_cast<float>(t));
  const auto code = [](float value) {
    const double v = std::clamp(static_cast<double>(value), 0.0, 1.0);
    return static_cast<std::uint8_t>(std::lround(255 * render::linear_to_srgb(v)));
  };
  return {code(linear.r), code(linear.g), code(linear.b)};
}

/// 0:12.40, 1:02:03.00
std::string clock_text(std::int64_t time_us) {
  // Divided before it is rounded and negated: any 64-bit time is a time that a file may hold.
  const std::int64_t hundredths = std::llabs((time_us / 1'000 + (time_us < 0 ? -5 : 5)) / 10);
  const std::int64_t seconds = hundredths / 100;
  const char* sign = time_us < 0 ? "-" : "";
  if (seconds >= 3600) {
    return absl::StrFormat("%s%d:%02d:%02d.%02d", sign, seconds / 3600, seconds / 60 % 60,
                           seconds % 60, hundredths % 100);
  }
  return absl::StrFormat("%s%d:%02d.%02d", sign, seconds / 60, seconds % 60, hundredths % 100);
}

/// 30000 -> "30 000"
std::string grouped(std::uint32_t number) {
  const std::string digits = std::to_string(number);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text += ' ';
    text += digits[i];
  }
  return text;
}

/// 1, 2 or 5 times a power of ten, at most `most`.
double round_length(double most) {
  const double power = std::pow(10.0, std::floor(std::log10(most)));
  for (const double digit : {5.0, 2.0}) {
    if (digit * power <= most) return digit * power;
  }
  return power;
}

std::string length_text(double metres) {
  if (metres >= 1000) return absl::StrFormat("%g km", metres / 1000);
  return metres >= 1 ? absl::StrFormat("%g m", metres) : absl::StrFormat("%g cm", metres * 100);
}

double metres_per_pixel(const render::Camera& camera, const Picture& picture) {
  const double distance_m = glm::length(camera.target_world - camera.eye_world);
  const double height_m = camera.ortho_height_m > 0.0
                              ? camera.ortho_height_m
                              : 2.0 * distance_m * std::tan(0.5 * camera.fov_y_rad);
  return height_m / picture.height_px;
}

/// Sizes of everything, from the picture's height.
struct Layout {
  explicit Layout(const Picture& picture)
      : type_px(std::max(11.0, picture.height_px / 36.0)),
        margin(static_cast<int>(type_px)),
        padding(static_cast<int>(0.55 * type_px)),
        line(static_cast<int>(1.35 * type_px)) {}
  double type_px;
  int margin, padding, line;
};

void draw_label(Picture& picture, const Font& font, const Layout& layout, std::string_view text,
                bool bottom) {
  const int width = font.width(text) + 2 * layout.padding;
  const int height = layout.line + layout.padding;
  const int top =
      bottom ? static_cast<int>(picture.height_px) - layout.margin - height : layout.margin;
  plate(picture, {layout.margin, top, layout.margin + width, top + height}, 0.4 * layout.type_px);
  write(picture, font, text, layout.margin + layout.padding,
        top + height / 2 + static_cast<int>(0.36 * layout.type_px), kText);
}

void draw_scale(Picture& picture, const Font& font, const Layout& layout,
                const render::Camera& camera) {
  const double per_px = metres_per_pixel(camera, picture);
  if (!(per_px > 0.0) || !std::isfinite(per_px)) return;
  const double length_m = round_length(0.18 * picture.width_px * per_px);
  const int bar = std::max(2, static_cast<int>(std::lround(length_m / per_px)));
  // in perspective a length is one length at one distance only
  const std::string text =
      length_text(length_m) + (camera.ortho_height_m > 0.0 ? "" : " at centre");
  const int width = std::max(bar, font.width(text)) + 2 * layout.padding;
  const int thick = std::max(2, static_cast<int>(0.16 * layout.type_px));
  const int height = layout.line + 2 * layout.padding + thick;
  const int left = static_cast<int>(picture.width_px) - layout.margin - width;
  const int top = static_cast<int>(picture.height_px) - layout.margin - height;
  plate(picture, {left, top, left + width, top + height}, 0.4 * layout.type_px);
  write(picture, font, text, left + (width - font.width(text)) / 2,
        top + layout.padding + static_cast<int>(0.85 * layout.type_px), kText);
  const int bar_left = left + (width - bar) / 2, bar_top = top + height - layout.padding - thick;
  fill(picture, {bar_left, bar_top, bar_left + bar, bar_top + thick}, kText, 1.0);
  for (const int x : {bar_left, bar_left + bar - thick}) {
    fill(picture, {x, bar_top - 2 * thick, x + thick, bar_top}, kText, 1.0);
  }
}

void draw_legend(Picture& picture, const Font& font, const Layout& layout,
                 const OverlayFacts& facts) {
  const std::string low = absl::StrFormat("%g", facts.channel_low);
  const std::string high = absl::StrFormat("%g", facts.channel_high);
  const int bar = std::max({static_cast<int>(9 * layout.type_px), font.width(facts.channel),
                            font.width(low) + font.width(high) + layout.margin});
  const int thick = static_cast<int>(0.7 * layout.type_px);
  const int width = bar + 2 * layout.padding;
  const int height = 2 * layout.line + thick + 2 * layout.padding;
  const int left = static_cast<int>(picture.width_px) - layout.margin - width, top = layout.margin;
  plate(picture, {left, top, left + width, top + height}, 0.4 * layout.type_px);
  const int ascent = static_cast<int>(0.85 * layout.type_px);
  const int x = left + layout.padding;
  write(picture, font, facts.channel, x, top + layout.padding + ascent, kText);
  const int bar_top = top + layout.padding + layout.line;
  for (int i = 0; i < bar; ++i) {
    fill(picture, {x + i, bar_top, x + i + 1, bar_top + thick},
         map_ink(facts.color_map, (i + 0.5) / static_cast<double>(bar)), 1.0);
  }
  const int baseline = bar_top + thick + static_cast<int>(0.25 * layout.type_px) + ascent;
  write(picture, font, low, x, baseline, kText);
  write(picture, font, high, x + bar - font.width(high), baseline, kText);
}

}  // namespace

absl::StatusOr<OverlayItems> parse_overlay(const std::string& text) {
  OverlayItems items;
  for (const absl::string_view word : absl::StrSplit(text, ',', absl::SkipEmpty())) {
    const bool all = word == "all";
    if (!all && word != "time" && word != "agents" && word != "scale" && word != "legend") {
      return absl::InvalidArgumentError(absl::StrCat(
          "--overlay: '", word, "' is not one of time, agents, scale, legend and all"));
    }
    items.time |= all || word == "time";
    items.agents |= all || word == "agents";
    items.scale |= all || word == "scale";
    items.legend |= all || word == "legend";
  }
  return items;
}

void draw_overlay(const OverlayItems& items, const OverlayFacts& facts, Picture& picture) {
  const Layout layout(picture);
  const Font font(layout.type_px);
  std::string label = items.time ? clock_text(facts.scene_time_us) : "";
  if (items.agents) {
    absl::StrAppend(&label, label.empty() ? "" : "   ", grouped(facts.agents),
                    facts.agents == 1 ? " agent" : " agents");
  }
  if (!label.empty()) draw_label(picture, font, layout, label, /*bottom=*/true);
  if (!items.title.empty()) draw_label(picture, font, layout, items.title, /*bottom=*/false);
  if (items.scale) draw_scale(picture, font, layout, facts.camera);
  if (items.legend && !facts.channel.empty()) draw_legend(picture, font, layout, facts);
}

}  // namespace throng::server
