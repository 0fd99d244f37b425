#include "server/batch/frame_numbers.hpp"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>
#include <absl/strings/string_view.h>

#include <algorithm>
#include <cstdlib>
#include <optional>

namespace throng::server {
namespace {

constexpr std::uint32_t kMaxFrame = 100'000'000;

bool parse_number(absl::string_view text, std::uint32_t& number) {
  return absl::SimpleAtoi(text, &number) && number <= kMaxFrame;
}

std::optional<std::uint32_t> environment_number(const char* name) {
  const char* text = std::getenv(name);
  std::uint32_t number = 0;
  if (text == nullptr || !parse_number(text, number)) return std::nullopt;
  return number;
}

}  // namespace

absl::StatusOr<std::vector<std::uint32_t>> parse_frame_numbers(const std::string& spec,
                                                               std::uint32_t last) {
  std::vector<std::uint32_t> numbers;
  if (spec.empty()) {
    for (std::uint32_t number = 1; number <= last; ++number) numbers.push_back(number);
    return numbers;
  }
  for (absl::string_view part : absl::StrSplit(spec, ',')) {
    const std::string plain = absl::StrReplaceAll(part, {{"..", "-"}, {":", "-"}});
    std::uint32_t first = 0, end = 0, step = 1;
    const std::vector<std::string> stepped = absl::StrSplit(plain, 'x');
    const std::vector<std::string> ends = absl::StrSplit(stepped[0], '-');
    bool good = stepped.size() <= 2 && ends.size() <= 2 && parse_number(ends[0], first);
    end = first;
    if (good && ends.size() == 2) good = parse_number(ends[1], end);
    if (good && stepped.size() == 2) good = parse_number(stepped[1], step) && ends.size() == 2;
    if (!good || first == 0 || step == 0 || end < first) {
      return absl::InvalidArgumentError(
          absl::StrCat("--frames: '", part, "' is not a frame or range; use 5, 1-100 or 1-100x2, ",
                       "numbers from 1 to ", kMaxFrame));
    }
    for (std::uint64_t number = first; number <= std::min(end, last); number += step) {
      numbers.push_back(static_cast<std::uint32_t>(number));
    }
  }
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

std::vector<std::uint32_t> shard_of(const std::vector<std::uint32_t>& numbers, std::uint32_t index,
                                    std::uint32_t count) {
  const std::uint64_t size = numbers.size();
  const auto begin = static_cast<std::ptrdiff_t>(size * index / count);
  const auto end = static_cast<std::ptrdiff_t>(size * (index + 1) / count);
  return {numbers.begin() + begin, numbers.begin() + end};
}

absl::StatusOr<Shard> parse_shard(const std::string& text) {
  if (text == "auto") {
    if (const auto id = environment_number("SLURM_ARRAY_TASK_ID")) {
      const std::uint32_t first = environment_number("SLURM_ARRAY_TASK_MIN").value_or(0);
      const std::uint32_t count = environment_number("SLURM_ARRAY_TASK_COUNT").value_or(1);
      // an array with a step (0-30:10) numbers its tasks 0, 10, 20, 30
      const std::uint32_t step =
          std::max(1U, environment_number("SLURM_ARRAY_TASK_STEP").value_or(1));
      if (*id < first || (*id - first) / step >= count) {
        return absl::InvalidArgumentError(absl::StrCat("--shard auto: SLURM_ARRAY_TASK_ID is ", *id,
                                                       ", outside the array of ", count,
                                                       " tasks from ", first));
      }
      return Shard{(*id - first) / step, count};
    }
    if (const auto index = environment_number("JOB_COMPLETION_INDEX")) {
      const auto count = environment_number("JOB_COMPLETION_COUNT");
      if (!count || *index >= *count) {
        return absl::InvalidArgumentError(
            "--shard auto: JOB_COMPLETION_INDEX is set; set JOB_COMPLETION_COUNT to the number of "
            "completions, larger than the index");
      }
      return Shard{*index, *count};
    }
    return Shard{};
  }
  const std::vector<std::string> parts = absl::StrSplit(text, '/');
  std::uint32_t number = 0, count = 0;
  if (parts.size() != 2 || !parse_number(parts[0], number) || !parse_number(parts[1], count) ||
      number < 1 || number > count) {
    return absl::InvalidArgumentError(
        absl::StrCat("--shard: '", text, "' is not I/N with I from 1 to N, or auto"));
  }
  return Shard{number - 1, count};
}

absl::StatusOr<NumberedPath> NumberedPath::parse(const std::string& pattern) {
  NumberedPath path;
  std::size_t begin = std::string::npos, end = 0;
  const auto found = [&](std::size_t at, std::size_t length, std::size_t digits) {
    if (begin != std::string::npos) return false;
    begin = at;
    end = at + length;
    path.digits_ = digits;
    return true;
  };
  bool once = true;
  for (std::size_t i = 0; i < pattern.size() && once;) {
    if (pattern[i] == '#') {
      std::size_t stop = pattern.find_first_not_of('#', i);
      if (stop == std::string::npos) stop = pattern.size();
      once = found(i, stop - i, stop - i);
      i = stop;
    } else if (pattern[i] == '%' || (pattern[i] == '$' && pattern.compare(i, 2, "$F") == 0)) {
      const bool percent = pattern[i] == '%';
      std::size_t stop = i + (percent ? 1 : 2);
      std::size_t digits = 0;
      const std::size_t digits_begin = stop;
      while (stop < pattern.size() && pattern[stop] >= '0' && pattern[stop] <= '9' &&
             stop - digits_begin < 3) {
        digits = digits * 10 + static_cast<std::size_t>(pattern[stop++] - '0');
      }
      if (percent && (stop == pattern.size() || pattern[stop] != 'd')) {
        return absl::InvalidArgumentError(
            absl::StrCat("-o: '", pattern, "' has a % that is not %d or %0Nd"));
      }
      if (percent) ++stop;
      once = found(i, stop - i, std::clamp<std::size_t>(digits, 1, 20));
      i = stop;
    } else {
      ++i;
    }
  }
  if (!once) {
    return absl::InvalidArgumentError(
        absl::StrCat("-o: '", pattern, "' has more than one place for the frame number"));
  }
  path.numbered_ = begin != std::string::npos;
  if (!path.numbered_) begin = end = pattern.size();
  path.before_ = pattern.substr(0, begin);
  path.after_ = pattern.substr(end);
  return path;
}

std::string NumberedPath::at(std::uint32_t number) const {
  if (!numbered_) return before_;
  std::string digits = std::to_string(number);
  if (digits.size() < digits_) digits.insert(0, digits_ - digits.size(), '0');
  return before_ + digits + after_;
}

}  // namespace throng::server
