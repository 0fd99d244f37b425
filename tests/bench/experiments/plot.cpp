#include "bench/experiments/plot.hpp"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "bench/experiments/report.hpp"
#include "simplify/report/canvas.hpp"

namespace throng::bench {
namespace {

using simplify::Canvas;

constexpr int kWidth = 900, kHeight = 460;
constexpr int kLeft = 84, kRight = 230, kTop = 48, kBottom = 64;
constexpr glm::u8vec3 kPaper{255, 255, 255}, kInk{40, 42, 46}, kGrid{222, 224, 228};
constexpr glm::u8vec3 kColors[] = {{31, 119, 180}, {214, 69, 65}, {44, 140, 60},  {230, 145, 30},
                                   {130, 90, 170}, {120, 85, 70}, {20, 160, 165}, {110, 110, 110}};

/// One axis: where a value lies between 0 and 1, and the values that are written beside it.
struct Axis {
  double low = 0.0, high = 1.0;
  bool is_log = false;
  std::vector<double> ticks;

  Axis(double least, double most, bool log) : is_log(log) {
    if (!(least <= most)) least = most = 1.0;
    if (log) {
      low = std::pow(10.0, std::floor(std::log10(std::max(least, 1e-9))));
      high = std::pow(10.0, std::ceil(std::log10(std::max(most, 1e-9)) - 1e-9));
      if (high <= low) high = 10.0 * low;
      for (double tick = low; tick <= 1.001 * high; tick *= 10.0) ticks.push_back(tick);
      return;
    }
    if (least > 0.0 && least < 0.5 * most) least = 0.0;
    if (most <= least) most = least + std::max(1.0, std::abs(least));
    const double rough = (most - least) / 6.0;
    const double unit = std::pow(10.0, std::floor(std::log10(rough)));
    const double share = rough / unit;
    const double step = unit * (share < 1.5 ? 1.0 : share < 3.5 ? 2.0 : share < 7.5 ? 5.0 : 10.0);
    low = step * std::floor(least / step + 1e-9);
    high = step * std::ceil(most / step - 1e-9);
    for (int k = 0; low + k * step <= high + 0.01 * step; ++k) ticks.push_back(low + k * step);
  }
  float at(double value) const {
    if (is_log) {
      value = std::max(value, low);
      return static_cast<float>(std::log10(value / low) / std::log10(high / low));
    }
    return static_cast<float>((value - low) / (high - low));
  }
};

std::string label_of(double value) {
  if (value >= 1e6 && std::fmod(value, 1e5) == 0.0) return absl::StrFormat("%gM", value / 1e6);
  if (value >= 1e4 && std::fmod(value, 1e2) == 0.0) return absl::StrFormat("%gk", value / 1e3);
  return absl::StrFormat("%.4g", value);
}

void draw_plot(const Plot& plot, int top, Canvas& canvas) {
  double x_low = std::numeric_limits<double>::infinity(), x_high = -x_low;
  double y_low = x_low, y_high = -x_low;
  for (const Series& series : plot.series) {
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (!std::isfinite(series.y[i])) continue;
      x_low = std::min(x_low, series.x[i]);
      x_high = std::max(x_high, series.x[i]);
      y_low = std::min(y_low, series.y[i]);
      y_high = std::max(y_high, series.y[i]);
    }
  }
  const Axis x(x_low, x_high, plot.log_x), y(y_low, y_high, plot.log_y);
  const auto left = static_cast<float>(kLeft), right = static_cast<float>(kWidth - kRight);
  const auto high = static_cast<float>(top + kTop),
             low = static_cast<float>(top + kHeight - kBottom);
  const auto px = [&](double value) { return left + (right - left) * x.at(value); };
  const auto py = [&](double value) { return low - (low - high) * y.at(value); };
  canvas.write(plot.title, {left, high - 18.0F}, 12.0F, kInk);
  for (const double tick : y.ticks) {
    canvas.stroke({left, py(tick)}, {right, py(tick)}, 1.0F, kGrid);
    const std::string text = label_of(tick);
    canvas.write(text, {left - 8.0F - Canvas::width_of(text, 9.0F), py(tick) + 4.5F}, 9.0F, kInk);
  }
  for (const double tick : x.ticks) {
    canvas.stroke({px(tick), low}, {px(tick), low + 5.0F}, 1.0F, kInk);
    const std::string text = label_of(tick);
    canvas.write(text, {px(tick) - 0.5F * Canvas::width_of(text, 9.0F), low + 20.0F}, 9.0F, kInk);
  }
  canvas.stroke({left, low}, {right, low}, 1.5F, kInk);
  canvas.stroke({left, high}, {left, low}, 1.5F, kInk);
  canvas.write(plot.x_label,
               {0.5F * (left + right) - 0.5F * Canvas::width_of(plot.x_label, 10.0F), low + 44.0F},
               10.0F, kInk);
  // upright letters only: beside the title's line, over its axis
  canvas.write(plot.y_label, {8.0F, high - 18.0F - 16.0F}, 10.0F, kInk);
  int number = 0;
  for (const Series& series : plot.series) {
    const glm::u8vec3& color = kColors[static_cast<std::size_t>(number) % std::size(kColors)];
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (!std::isfinite(series.y[i])) continue;
      const glm::vec2 here(px(series.x[i]), py(series.y[i]));
      if (i > 0 && std::isfinite(series.y[i - 1])) {
        canvas.stroke({px(series.x[i - 1]), py(series.y[i - 1])}, here, 2.0F, color);
      }
      if (series.x.size() <= 24) canvas.stroke(here, here, 6.0F, color);
    }
    const float line = high + 6.0F + 20.0F * static_cast<float>(number);
    canvas.stroke({right + 14.0F, line}, {right + 34.0F, line}, 3.0F, color);
    canvas.write(series.name, {right + 42.0F, line + 4.5F}, 9.0F, kInk);
    ++number;
  }
}

}  // namespace

absl::Status write_plots(const std::string& file, const std::vector<Plot>& plots) {
  Canvas canvas(kWidth,
                static_cast<std::uint32_t>(kHeight) *
                    static_cast<std::uint32_t>(std::max<std::size_t>(plots.size(), 1)),
                kPaper);
  for (std::size_t i = 0; i < plots.size(); ++i) {
    draw_plot(plots[i], kHeight * static_cast<int>(i), canvas);
  }
  return write_png(file, canvas.picture());
}

std::string plot_file(const std::string& json_file) {
  return std::filesystem::path(json_file).replace_extension(".png").string();
}

}  // namespace throng::bench
