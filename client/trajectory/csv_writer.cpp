#include <absl/strings/str_cat.h>

#include <cmath>

#include "writers.hpp"

namespace throng::trajectory::detail {
namespace {

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",;\t \"#\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) {
    if (c == '"') field += '"';
    field += c == '\n' || c == '\r' ? ' ' : c;
  }
  return field + '"';
}

class CsvWriter final : public Writer {
 public:
  absl::Status open(const std::string& path, const WriteSpec& spec) {
    path_ = path;
    spec_ = spec;
    if (absl::Status s = file_.open(path); !s.ok()) return s;
    std::string header = "time_s,id,x_m,y_m";
    if (spec.has_z) header += ",z_m";
    if (spec.has_heading) header += ",heading_rad";
    if (!spec.motion_names.empty()) header += ",motion";
    if (spec.has_characters) header += ",character";
    for (const std::string& name : spec.channel_names)
      absl::StrAppend(&header, ",", csv_field(name));
    return file_.put(header + "\n");
  }

  absl::Status write(const Frame& frame, const std::vector<std::string>& names,
                     const std::vector<std::int32_t>& characters) override {
    if (absl::Status s = check_columns(path_, spec_, frame, names); !s.ok()) return s;
    if (!characters.empty() && characters.size() != frame.ids.size()) {
      return fault(path_, absl::StrCat("write: ", characters.size(), " characters of ",
                                       frame.ids.size(), " agents"));
    }
    std::string time;
    append_seconds(time, frame.time_us, 6);
    text_.clear();
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      text_ += time;
      text_ += ',';
      text_ +=
          names.empty() || names[i].empty() ? std::to_string(frame.ids[i]) : csv_field(names[i]);
      for (const double value : {frame.x_m[i], frame.y_m[i]}) {
        text_ += ',';
        append(text_, value);
      }
      if (spec_.has_z) {
        text_ += ',';
        append(text_, frame.z_m.empty() ? 0.0 : frame.z_m[i]);
      }
      if (spec_.has_heading) {
        text_ += ',';
        if (heading_known(frame, i)) append(text_, frame.heading_rad[i]);
      }
      if (!spec_.motion_names.empty()) {
        text_ += ',';
        const std::size_t code = frame.motion.empty() ? 0 : frame.motion[i];
        if (code > 0 && code <= spec_.motion_names.size()) {
          text_ += csv_field(spec_.motion_names[code - 1]);
        }
      }
      if (spec_.has_characters) {
        text_ += ',';
        if (!characters.empty() && characters[i] >= 0) append(text_, characters[i]);
      }
      for (const auto& channel : frame.channels) {
        text_ += ',';
        if (std::isfinite(channel[i])) append(text_, channel[i]);
      }
      text_ += '\n';
    }
    return file_.put(text_);
  }

  absl::Status close() override { return file_.close(); }

 private:
  std::string path_;
  WriteSpec spec_;
  OutputFile file_;
  std::string text_;
};

}  // namespace

WriterOr write_csv(const std::string& path, const WriteSpec& spec) {
  return opened<CsvWriter>(path, spec);
}

}  // namespace throng::trajectory::detail
