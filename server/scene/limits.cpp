#include "server/scene/limits.hpp"

#include <absl/strings/str_cat.h>

namespace throng::server {

absl::Status check_crowd_name(const std::string& name) {
  constexpr std::size_t kLongest = 100;
  if (name.empty() || name.size() > kLongest) {
    return absl::InvalidArgumentError(
        absl::StrCat("crowd_name: it has ", name.size(), " characters, must have 1 to ", kLongest));
  }
  for (const char c : name) {
    const bool good = (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ||
                      c == '_' || c == '.' || c == '-';
    if (!good) {
      return absl::InvalidArgumentError(absl::StrCat(
          "crowd_name: byte 0x", absl::Hex(static_cast<unsigned char>(c), absl::kZeroPad2),
          " is not one of A-Z a-z 0-9 _ . -"));
    }
  }
  return absl::OkStatus();
}

absl::Status check_scene_time(const char* field, std::int64_t time_us) {
  constexpr std::int64_t kLimit = 100'000'000'000'000'000;
  if (time_us < -kLimit || time_us > kLimit) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": it is ", time_us, ", must be within +-", kLimit));
  }
  return absl::OkStatus();
}

}  // namespace throng::server
