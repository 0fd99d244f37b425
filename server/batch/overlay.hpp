#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "throng/render/camera.hpp"
#include "throng/render/raster.hpp"

namespace throng::server {

/// What is written into every picture of a batch.
struct OverlayItems {
  bool time = false;    // lower left: scene time
  bool agents = false;  // beside it: how many there are
  bool scale = false;   // lower right: a bar of a round length, where the camera looks
  bool legend = false;  // upper right: the channel's name, colours and range
  std::string title{};  // upper left; empty: none
  bool any() const { return time || agents || scale || legend || !title.empty(); }
};

/// "time,scale": names of items, or "all". InvalidArgument names what is not known.
absl::StatusOr<OverlayItems> parse_overlay(const std::string& text);

/// What the items tell of one picture.
struct OverlayFacts {
  std::int64_t scene_time_us = 0;
  std::uint32_t agents = 0;
  render::Camera camera{};
  std::string channel{};  // empty: the legend is left out
  double channel_low = 0.0, channel_high = 1.0;
  render::ColorMap color_map = render::ColorMap::kViridis;
};

/// Draws the items over a picture, sized by its height; the same pixels on every machine.
void draw_overlay(const OverlayItems& items, const OverlayFacts& facts, render::Picture& picture);

}  // namespace throng::server
