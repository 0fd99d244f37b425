#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <unordered_map>
#include <vector>

#include "throng/trajectory/trajectory.hpp"

/// What the readers share: errors that name file and line, numbers, units, ids.
namespace throng::trajectory::detail {

/// Positions further out than this are broken values, not places: UTM northings reach 1e7 m.
inline constexpr double kMaxPositionM = 1e8;
/// Frame numbers are exact in a double up to here; producers write them as "1.0e+01" too.
inline constexpr double kMaxInteger = 9007199254740992.0;
/// Seconds, some 31,000 years: epoch stamps fit, and microseconds of it fit 64 bits.
inline constexpr double kMaxTimeS = 1e12;
inline constexpr double kMinFps = 1e-4;
inline constexpr double kMaxFps = 1e5;
inline constexpr std::size_t kMaxAgentsPerFrame = 1u << 24;
inline constexpr std::size_t kMaxNameBytes = 4096;
inline constexpr std::size_t kMaxColumns = 1024;
inline constexpr double kPi = 3.14159265358979323846;

/// InvalidArgument "FILE, line N: MESSAGE".
absl::Status fault(const std::string& path, std::uint64_t line, std::string_view message);
/// InvalidArgument "FILE: MESSAGE".
absl::Status fault(const std::string& path, std::string_view message);

/// A value of a file, quoted for a message: cut to 40 bytes, control characters replaced.
std::string quoted(std::string_view value);
/// "%g" with enough digits for a message.
std::string number_text(double value);

inline std::string_view trimmed(std::string_view text) {
  const char* blanks = " \t\r\n\v\f";
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

std::string lower(std::string_view text);

/// Whole text as a number; "nan" and "inf" parse too, callers check with isfinite.
inline bool parse_number(std::string_view text, double& value) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  if (text.empty()) return false;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  // Out of range leaves the value alone: an absurd exponent is a broken number, not zero.
  return error == std::errc() && end == text.data() + text.size();
}

/// An integer, also when written as "12.0" or "1.2e+01".
inline bool parse_integer(std::string_view text, std::int64_t& value) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size() && !text.empty()) return true;
  double number = 0.0;
  if (!parse_number(text, number) || !(std::abs(number) <= kMaxInteger)) return false;
  if (number != std::floor(number)) return false;
  value = static_cast<std::int64_t>(number);
  return true;
}

/// The first number inside a text, such as 25 of "# framerate: 25 fps".
std::optional<double> first_number(std::string_view text);

/// Splits at any run of blanks and tabs.
void split_blanks(std::string_view line, std::vector<std::string_view>& fields);

/// Metres of "m", "cm", "mm", "metres", ...; nothing for an unknown unit.
std::optional<double> unit_metres(std::string_view unit);

/// The frame rate that holds. Errors: contradiction, out of range, or known to nobody (`needed_for`
/// says what has no rate).
absl::StatusOr<double> resolve_fps(const std::string& path, std::optional<double> of_file,
                                   const ReadOptions& options, std::string_view needed_for);
/// The same for metres per unit of length.
absl::StatusOr<double> resolve_unit(const std::string& path, std::optional<double> of_file,
                                    const ReadOptions& options);
/// For formats that are metres by definition.
absl::Status require_metres(const std::string& path, const ReadOptions& options,
                            std::string_view format);

bool valid_fps(double fps);
/// Whether two rates are the same but for rounding.
bool same_rate(double a, double b);

/// Nominal rate of sorted distinct times in microseconds: 0 unless 9 of 10 gaps agree.
double regular_fps(const std::vector<std::int64_t>& times_us);

/// Ids of a file: plain integers stay, names are hashed and kept.
class IdTable {
 public:
  explicit IdTable(bool hash_everything) : hash_everything_(hash_everything) {}
  /// Errors (message only, the caller adds file and line): empty, too long, two names of one hash.
  absl::StatusOr<std::uint64_t> id(std::string_view text);
  std::string name(std::uint64_t id) const;
  bool has_names() const { return !names_.empty(); }
  /// Reader::agent_character; who was chosen first stays.
  void choose(std::uint64_t id, std::int32_t character) { characters_.try_emplace(id, character); }
  std::int32_t character(std::uint64_t id) const {
    const auto found = characters_.find(id);
    return found != characters_.end() ? found->second : -1;
  }

 private:
  bool hash_everything_;
  std::string last_text_;
  std::uint64_t last_id_ = 0;
  std::unordered_map<std::uint64_t, std::string> names_;  // of hashed ids
  std::unordered_map<std::uint64_t, std::int32_t> characters_;
};

/// Checks a position and applies the unit. `axis` is for the message.
absl::Status check_position(const std::string& path, std::uint64_t line, char axis, double value_m);

/// The sum of a list of counted things for Info::notes: "3 rows of vehicles skipped".
std::string counted(std::uint64_t count, std::string_view one, std::string_view many);

}  // namespace throng::trajectory::detail
