#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

namespace throng::server {

/// Output pictures of a batch, numbered from 1: "5", "1-100", "1-100x2,205"; `:` and `..` mean `-`.
/// A range that goes beyond `last` is cut there (the tail of a farm's last chunk does that).
/// InvalidArgument names the part that isn't understood. Sorted, each number once.
absl::StatusOr<std::vector<std::uint32_t>> parse_frame_numbers(const std::string& spec,
                                                               std::uint32_t last);

/// The part of `numbers` that shard `index` of `count` renders: contiguous, sizes differ by at
/// most 1.
std::vector<std::uint32_t> shard_of(const std::vector<std::uint32_t>& numbers, std::uint32_t index,
                                    std::uint32_t count);

struct Shard {
  std::uint32_t index = 0;  // from 0
  std::uint32_t count = 1;
};

/// "I/N" with I from 1 to N, or "auto": SLURM_ARRAY_TASK_ID / _COUNT / _MIN, else
/// JOB_COMPLETION_INDEX with JOB_COMPLETION_COUNT, else the whole.
absl::StatusOr<Shard> parse_shard(const std::string& text);

/// A file name with a place for the number: a run of `#`, `%0Nd` or `$FN`; or the name of one
/// picture, without a place. InvalidArgument: more than one place.
class NumberedPath {
 public:
  static absl::StatusOr<NumberedPath> parse(const std::string& pattern);
  bool numbered() const { return numbered_; }
  std::string at(std::uint32_t number) const;

 private:
  std::string before_, after_;
  std::size_t digits_ = 1;
  bool numbered_ = false;
};

}  // namespace throng::server
