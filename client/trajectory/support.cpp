#include "support.hpp"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstdio>

namespace throng::trajectory::detail {

absl::Status fault(const std::string& path, std::uint64_t line, std::string_view message) {
  return absl::InvalidArgumentError(
      absl::StrCat(path, ", line ", line, ": ", absl::string_view(message.data(), message.size())));
}

absl::Status fault(const std::string& path, std::string_view message) {
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": ", absl::string_view(message.data(), message.size())));
}

std::string quoted(std::string_view value) {
  std::string text = "'";
  const bool cut = value.size() > 40;
  for (const char c : value.substr(0, 40)) {
    text += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  if (cut) text += "...";
  return text + "'";
}

std::string number_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return result;
}

std::optional<double> first_number(std::string_view text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool digit = text[i] >= '0' && text[i] <= '9';
    if (!digit) continue;
    const bool negative = i > 0 && text[i - 1] == '-';
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data() + i, text.data() + text.size(), value);
    if (error != std::errc()) return std::nullopt;
    return negative ? -value : value;
  }
  return std::nullopt;
}

void split_blanks(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  std::size_t i = 0;
  while (i < line.size()) {
    while (i < line.size() && (line[i] == ' ' || line[i] == '\t')) ++i;
    const std::size_t begin = i;
    while (i < line.size() && line[i] != ' ' && line[i] != '\t') ++i;
    if (i > begin) fields.push_back(line.substr(begin, i - begin));
    // One more than allowed is enough for the caller's complaint.
    if (fields.size() > kMaxColumns) return;
  }
}

std::optional<double> unit_metres(std::string_view unit) {
  const std::string name = lower(trimmed(unit));
  if (name == "m" || name == "metre" || name == "metres" || name == "meter" || name == "meters") {
    return 1.0;
  }
  if (name == "cm" || name == "centimetre" || name == "centimetres" || name == "centimeter" ||
      name == "centimeters") {
    return 0.01;
  }
  if (name == "mm" || name == "millimetre" || name == "millimetres" || name == "millimeter" ||
      name == "millimeters") {
    return 0.001;
  }
  return std::nullopt;
}

bool valid_fps(double fps) { return fps >= kMinFps && fps <= kMaxFps; }

bool same_rate(double a, double b) { return std::abs(a - b) <= 0.01 * std::max(a, b); }

absl::StatusOr<double> resolve_fps(const std::string& path, std::optional<double> of_file,
                                   const ReadOptions& options, std::string_view needed_for) {
  if (options.source_fps && !valid_fps(*options.source_fps)) {
    return fault(path, absl::StrCat("--source-fps is ", number_text(*options.source_fps),
                                    ", must be between 0.0001 and 100000 frames per second"));
  }
  if (of_file && !valid_fps(*of_file)) {
    return fault(path, absl::StrCat("frame rate of the file is ", number_text(*of_file),
                                    ", must be between 0.0001 and 100000 frames per second; "
                                    "correct it in the file"));
  }
  if (of_file && options.source_fps && !same_rate(*of_file, *options.source_fps)) {
    return fault(path, absl::StrCat("--source-fps is ", number_text(*options.source_fps),
                                    " but the file says ", number_text(*of_file),
                                    " frames per second; leave --source-fps out or correct the "
                                    "file"));
  }
  if (of_file) return *of_file;
  if (options.source_fps) return *options.source_fps;
  return fault(path, absl::StrCat(absl::string_view(needed_for.data(), needed_for.size()),
                                  "; give the frames per second with --source-fps, "
                                  "e.g. --source-fps 25"));
}

absl::StatusOr<double> resolve_unit(const std::string& path, std::optional<double> of_file,
                                    const ReadOptions& options) {
  if (options.source_unit_m && !(*options.source_unit_m > 0.0 && *options.source_unit_m <= 1e6)) {
    return fault(path, absl::StrCat("--source-unit is ", number_text(*options.source_unit_m),
                                    " metres, must be above 0 and at most 1000000"));
  }
  if (of_file && options.source_unit_m && !same_rate(*of_file, *options.source_unit_m)) {
    return fault(path, absl::StrCat("--source-unit says ", number_text(*options.source_unit_m),
                                    " m per unit but the file says ", number_text(*of_file),
                                    " m; leave --source-unit out or correct the file"));
  }
  if (of_file) return *of_file;
  if (options.source_unit_m) return *options.source_unit_m;
  return fault(path,
               "the file does not say whether positions are metres or centimetres; give "
               "--source-unit m or --source-unit cm, or the metres of one unit");
}

absl::Status require_metres(const std::string& path, const ReadOptions& options,
                            std::string_view format) {
  if (options.source_unit_m && !same_rate(*options.source_unit_m, 1.0)) {
    return fault(path,
                 absl::StrCat("--source-unit says ", number_text(*options.source_unit_m),
                              " m per unit but ", absl::string_view(format.data(), format.size()),
                              " files are in metres; leave --source-unit out"));
  }
  return absl::OkStatus();
}

double regular_fps(const std::vector<std::int64_t>& times_us) {
  if (times_us.size() < 2) return 0.0;
  std::vector<std::int64_t> gaps(times_us.size() - 1);
  for (std::size_t i = 0; i < gaps.size(); ++i) gaps[i] = times_us[i + 1] - times_us[i];
  const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::nth_element(gaps.begin(), middle, gaps.end());
  const double median_us = static_cast<double>(*middle);
  if (median_us <= 0.0) return 0.0;
  // Times are often printed with three decimals: 33, 33, 34 ms are 30 frames per second.
  const double tolerance_us = std::max(1001.0, 0.01 * median_us);
  double sum_us = 0.0;
  std::size_t agreeing = 0;
  for (const std::int64_t gap : gaps) {
    if (std::abs(static_cast<double>(gap) - median_us) > tolerance_us) continue;
    sum_us += static_cast<double>(gap);
    ++agreeing;
  }
  if (agreeing * 10 < gaps.size() * 9 && gaps.size() - agreeing > 1) return 0.0;
  return 1e6 * static_cast<double>(agreeing) / sum_us;
}

absl::StatusOr<std::uint64_t> IdTable::id(std::string_view text) {
  if (text.empty()) return absl::InvalidArgumentError("id is empty, must be an integer or a name");
  if (text == last_text_) return last_id_;
  std::uint64_t value = 0;
  if (!hash_everything_) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    // "007" is a name: two spellings of one number must not become one agent.
    const bool canonical = text.size() == 1 || text.front() != '0';
    if (error == std::errc() && end == text.data() + text.size() && canonical) {
      last_text_.assign(text);
      last_id_ = value;
      return value;
    }
    std::int64_t integer = 0;  // "12.0", as data frames export integer columns
    if (text.find('.') != std::string_view::npos && parse_integer(text, integer) && integer >= 0) {
      last_text_.assign(text);
      last_id_ = static_cast<std::uint64_t>(integer);
      return last_id_;
    }
  }
  if (text.size() > kMaxNameBytes) {
    return absl::InvalidArgumentError(absl::StrCat("id is ", text.size(), " bytes long, at most ",
                                                   kMaxNameBytes, " are allowed"));
  }
  std::string name(text);
  value = hash_id(name);
  const auto [entry, fresh] = names_.try_emplace(value, name);
  if (!fresh && entry->second != name) {
    return absl::InvalidArgumentError(absl::StrCat("ids ", quoted(entry->second), " and ",
                                                   quoted(name),
                                                   " have the same hash; rename one of them"));
  }
  last_text_ = std::move(name);
  last_id_ = value;
  return value;
}

std::string IdTable::name(std::uint64_t id) const {
  const auto entry = names_.find(id);
  return entry == names_.end() ? std::string() : entry->second;
}

absl::Status check_position(const std::string& path, std::uint64_t line, char axis,
                            double value_m) {
  if (std::isfinite(value_m) && std::abs(value_m) <= kMaxPositionM) return absl::OkStatus();
  return fault(path, line,
               absl::StrCat(std::string(1, axis), " is ", number_text(value_m),
                            " m, must be a number between -1e8 and 1e8 m; correct or remove it"));
}

std::string counted(std::uint64_t count, std::string_view one, std::string_view many) {
  return absl::StrCat(count, " ", count == 1 ? std::string(one) : std::string(many));
}

}  // namespace throng::trajectory::detail

namespace throng::trajectory {

absl::StatusOr<double> parse_unit(const std::string& text) {
  if (text == "m") return 1.0;
  if (text == "cm") return 0.01;
  if (text == "mm") return 0.001;
  double metres = 0.0;
  if (absl::SimpleAtod(text, &metres) && metres > 0.0 && metres <= 1e6) return metres;
  return absl::InvalidArgumentError(
      absl::StrCat("--source-unit: '", text,
                   "' is none of m, cm, mm, and no number of metres above 0 and at most 1000000"));
}

}  // namespace throng::trajectory

namespace throng::trajectory {

std::vector<std::int32_t> chosen_characters(const Reader& reader, const Frame& frame,
                                            std::size_t member_count) {
  std::vector<std::int32_t> members(frame.ids.size(), -1);
  bool any = false;
  for (std::size_t i = 0; i < frame.ids.size(); ++i) {
    const std::int32_t chosen = reader.agent_character(frame.ids[i]);
    if (chosen < 0 || static_cast<std::size_t>(chosen) >= member_count) continue;
    members[i] = chosen;
    any = true;
  }
  if (!any) members.clear();
  return members;
}

}  // namespace throng::trajectory
