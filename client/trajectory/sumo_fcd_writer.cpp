#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "writers.hpp"

namespace throng::trajectory::detail {
namespace {

/// Bytes of the UTF-8 character that a text begins with, 0 where XML 1.0 has none such.
std::size_t character_bytes(std::string_view text) {
  const auto at = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const std::size_t size = at(0) < 0x80   ? 1
                           : at(0) < 0xC2 ? 0
                           : at(0) < 0xE0 ? 2
                           : at(0) < 0xF0 ? 3
                           : at(0) < 0xF5 ? 4
                                          : 0;
  if (size == 0 || size > text.size()) return 0;
  if (size == 1) return at(0) >= 0x20 || text[0] == '\t' || text[0] == '\n' || text[0] == '\r';
  std::uint32_t code = at(0) & (0x7Fu >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((at(i) & 0xC0u) != 0x80u) return 0;
    code = code << 6 | (at(i) & 0x3Fu);
  }
  const bool overlong = (size == 3 && code < 0x800) || (size == 4 && code < 0x10000);
  const bool surrogate = code >= 0xD800 && code < 0xE000;
  const bool no_character = code == 0xFFFE || code == 0xFFFF || code > 0x10FFFF;
  return overlong || surrogate || no_character ? 0 : size;
}

/// Appends a name as an attribute's value; false: XML cannot hold it.
bool append_attribute(std::string& text, std::string_view name) {
  while (!name.empty()) {
    const std::size_t size = character_bytes(name);
    if (size == 0) return false;
    switch (name.front()) {
      case '&':
        text += "&amp;";
        break;
      case '<':
        text += "&lt;";
        break;
      case '"':
        text += "&quot;";
        break;
      case '\t':
      case '\n':
      case '\r':  // else read as blanks
        absl::StrAppend(&text, "&#", static_cast<int>(name.front()), ";");
        break;
      default:
        text.append(name.substr(0, size));
    }
    name.remove_prefix(size);
  }
  return true;
}

/// SUMO's floating car data: everybody is a person, angles in degrees clockwise from north.
class FcdWriter final : public Writer {
 public:
  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    const auto& channels = spec.channel_names;
    speed_ = static_cast<std::size_t>(std::find(channels.begin(), channels.end(), "speed") -
                                      channels.begin());
    if (absl::Status s = file_.open(path); !s.ok()) return s;
    return file_.put("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fcd-export>\n");
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>&) override {
    if (absl::Status s = check_columns(path_, spec_, frame, names); !s.ok()) return s;
    text_ = "    <timestep time=\"";
    append_seconds(text_, frame.time_us, 2);
    text_ += frame.ids.empty() ? "\"/>\n" : "\">\n";
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      text_ += "        <person id=\"";
      if (names.empty() || names[i].empty()) {
        append(text_, frame.ids[i]);
      } else if (!append_attribute(text_, names[i])) {
        return fault(path_, absl::StrCat("write: the id ", quoted(names[i]),
                                         " is no text that XML holds (UTF-8 without control "
                                         "characters); rename it"));
      }
      text_ += '"';
      put("x", frame.x_m[i]);
      put("y", frame.y_m[i]);
      if (spec_.has_z) put("z", frame.z_m.empty() ? 0.0 : frame.z_m[i]);
      if (heading_known(frame, i)) {
        const double north_deg = 90.0 - static_cast<double>(frame.heading_rad[i]) * 180.0 / kPi;
        const auto angle_deg =
            static_cast<float>(north_deg - 360.0 * std::floor(north_deg / 360.0));
        put("angle", angle_deg < 360.0f ? angle_deg : 0.0f);
      }
      if (speed_ < frame.channels.size() && std::isfinite(frame.channels[speed_][i])) {
        put("speed", frame.channels[speed_][i]);
      }
      text_ += "/>\n";
    }
    if (!frame.ids.empty()) text_ += "    </timestep>\n";
    return file_.put(text_);
  }

  absl::Status close() override {
    if (absl::Status s = file_.put("</fcd-export>\n"); !s.ok()) return s;
    return file_.close();
  }

 private:
  template <typename Number>
  void put(const char* name, Number value) {
    absl::StrAppend(&text_, " ", name, "=\"");
    append(text_, value);
    text_ += '"';
  }

  std::string path_;
  WriteSpec spec_;
  OutputFile file_;
  std::string text_;
  std::size_t speed_ = 0;  // channel; behind the last: none
};

}  // namespace

WriterOr write_sumo_fcd(const std::string& path, const WriteSpec& spec) {
  return opened<FcdWriter>(path, spec);
}

}  // namespace throng::trajectory::detail
