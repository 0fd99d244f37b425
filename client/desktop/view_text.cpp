#include "client/desktop/view_text.hpp"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <cmath>
#include <glm/gtc/constants.hpp>

namespace throng::client {
namespace {

std::optional<std::string> decoded(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i];
      continue;
    }
    std::uint32_t byte = 0;
    if (i + 2 >= text.size() ||
        !absl::SimpleHexAtoi(absl::string_view(text.data() + i + 1, 2), &byte)) {
      return std::nullopt;
    }
    out += static_cast<char>(byte);
    i += 2;
  }
  return out;
}

std::string encoded(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_' || c == '.';
    out += plain ? std::string(1, c) : absl::StrFormat("%%%02X", static_cast<unsigned char>(c));
  }
  return out;
}

/// As the page writes it: no zeros at the end.
std::string shortened(double value, int digits) {
  const double scale = std::pow(10.0, digits);
  // StrCat keeps six digits, which are metres of a position in UTM
  return absl::StrFormat("%.15g", std::round(value * scale) / scale);
}

bool read_numbers(const std::vector<std::string>& fields, std::size_t from, std::size_t count,
                  double* values) {
  for (std::size_t i = 0; i < count; ++i) {
    if (from + i >= fields.size() || !absl::SimpleAtod(fields[from + i], &values[i]) ||
        !std::isfinite(values[i])) {
      return false;
    }
  }
  return true;
}

bool read_part(const std::string& key, const std::string& value, ViewText& view) {
  const std::vector<std::string> fields = absl::StrSplit(value, ',');
  if (key == "crowd") {
    view.crowd = value;
    return !value.empty();
  }
  if (key == "follow") return absl::SimpleAtoi(value, &view.follow);
  if (key == "show") {
    view.show = fields;
    return true;
  }
  double numbers[6];
  if (key == "t") {
    if (fields.size() != 1 || !read_numbers(fields, 0, 1, numbers)) return false;
    view.time_us = std::llround(numbers[0] * 1e6);
    return std::abs(numbers[0]) <= 1e9;
  }
  if (key == "speed") {
    if (fields.size() != 1 || !read_numbers(fields, 0, 1, numbers)) return false;
    view.speed = numbers[0];
    return view.speed != 0.0 && std::abs(view.speed) <= 64.0;
  }
  if (key == "cam") {
    const bool is_ortho = fields.size() == 7 && fields[6] == "ortho";
    if ((fields.size() != 6 && !is_ortho) || !read_numbers(fields, 0, 6, numbers)) return false;
    OrbitCamera camera;
    camera.target_world = {numbers[0], numbers[1], numbers[2]};
    camera.distance_m = numbers[3];
    camera.yaw_rad = glm::radians(numbers[4]);
    camera.pitch_rad = 0.0;
    camera.orbit(0.0, glm::radians(numbers[5]));
    camera.ortho = is_ortho;
    view.camera = camera;
    return numbers[3] > 0.0;
  }
  if (key == "color") {
    std::vector<std::string> name = fields;
    if (fields.size() > 2 && read_numbers(fields, fields.size() - 2, 2, numbers)) {
      view.range = {numbers[0], numbers[1]};
      name.resize(fields.size() - 2);
      if (!(numbers[0] < numbers[1])) return false;
    }
    view.channel = absl::StrJoin(name, ",");
    return true;
  }
  if (key == "map") {
    const auto map = render::color_map_of(value);
    view.color_map = map.value_or(view.color_map);
    return map.has_value();
  }
  return false;
}

}  // namespace

absl::StatusOr<ViewText> parse_view_text(const std::string& text) {
  ViewText view;
  const std::size_t hash = text.find('#');
  const std::string state = hash == std::string::npos ? text : text.substr(hash + 1);
  for (const auto part : absl::StrSplit(state, '&', absl::SkipEmpty())) {
    const std::pair<std::string, std::string> fields =
        absl::StrSplit(part, absl::MaxSplits('=', 1));
    const std::optional<std::string> value = decoded(fields.second);
    if (!value.has_value() || !read_part(fields.first, *value, view)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "--view: '", std::string(part),
          "' makes no sense; it is what the page's address holds behind #: crowd, cam, "
          "follow, t, speed, color, map, show"));
    }
  }
  return view;
}

std::string format_view_text(const ViewText& view) {
  std::vector<std::string> parts;
  if (!view.crowd.empty()) parts.push_back(absl::StrCat("crowd=", encoded(view.crowd)));
  if (view.camera.has_value()) {
    const OrbitCamera& c = *view.camera;
    parts.push_back(absl::StrCat("cam=", shortened(c.target_world.x, 3), ",",
                                 shortened(c.target_world.y, 3), ",",
                                 shortened(c.target_world.z, 3), ",", shortened(c.distance_m, 3),
                                 ",", shortened(glm::degrees(c.yaw_rad), 2), ",",
                                 shortened(glm::degrees(c.pitch_rad), 2), c.ortho ? ",ortho" : ""));
  }
  if (view.follow != 0) parts.push_back(absl::StrCat("follow=", view.follow));
  if (view.time_us.has_value()) {
    parts.push_back(absl::StrCat("t=", shortened(1e-6 * static_cast<double>(*view.time_us), 3)));
  }
  if (view.speed != 1.0) parts.push_back(absl::StrCat("speed=", shortened(view.speed, 3)));
  if (!view.channel.empty()) {
    parts.push_back(absl::StrCat("color=", encoded(view.channel)));
    if (view.range.has_value()) {
      absl::StrAppend(&parts.back(), ",", shortened(view.range->first, 4), ",",
                      shortened(view.range->second, 4));
    }
    if (view.color_map != render::ColorMap::kViridis) {
      parts.push_back(absl::StrCat("map=", render::name_of(view.color_map)));
    }
  }
  if (!view.show.empty()) parts.push_back(absl::StrCat("show=", absl::StrJoin(view.show, ",")));
  return absl::StrJoin(parts, "&");
}

}  // namespace throng::client
