#include "row_sorter.hpp"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <utility>

#include "support.hpp"

namespace throng::trajectory::detail {
namespace {

constexpr std::size_t kMaxKeys = 4u << 20;
constexpr std::size_t kMergeBytes = 64u << 20;
constexpr std::size_t kStreamRows = 4096;

bool before(const std::uint64_t* a, const std::uint64_t* b) {
  const auto key_a = static_cast<std::int64_t>(a[0]), key_b = static_cast<std::int64_t>(b[0]);
  if (key_a != key_b) return key_a < key_b;
  if (a[1] != b[1]) return a[1] < b[1];
  return a[2] < b[2];
}

std::string temporary_folder() {
  const char* set = std::getenv("TMPDIR");
  return set != nullptr && *set != '\0' ? set : "/var/tmp";
}

}  // namespace

struct RowSorter::Run {
  std::uint64_t begin = 0, end = 0;  // bytes of the file not yet read
  std::vector<std::uint64_t> buffer;
  std::size_t at = 0, filled = 0;  // words
  const std::uint64_t* head() const { return buffer.data() + at; }
};

RowSorter::RowSorter(std::size_t value_count, std::size_t memory_bytes)
    : stride_(3 + value_count),
      // four more bytes a row for the order; 32 bit indices
      rows_in_memory_(std::clamp<std::size_t>(memory_bytes / (8 * stride_ + 4), 16, 0xfffffff0u)) {}

RowSorter::~RowSorter() {
  if (file_ >= 0) ::close(file_);
}

absl::Status RowSorter::add(std::int64_t key, std::uint64_t id, std::uint64_t line,
                            std::span<const double> values) {
  return push(key, id, line, values);
}

absl::Status RowSorter::add_moment(std::int64_t key) {
  if (row_count_ > 0 && key == recent_key_) return absl::OkStatus();
  values_.assign(stride_ - 3, 0.0);
  return push(key, 0, 0, values_);
}

absl::Status RowSorter::push(std::int64_t key, std::uint64_t id, std::uint64_t line,
                             std::span<const double> values) {
  if (has_complete_ && key <= complete_key_) {
    return absl::OutOfRangeError("the row comes after rows of later times");
  }
  if (feed_ == nullptr && words_.size() >= rows_in_memory_ * stride_) {
    if (absl::Status status = spill(); !status.ok()) return status;
  }
  const std::size_t at = words_.size();
  words_.resize(at + stride_);
  std::uint64_t* row = words_.data() + at;
  row[0] = static_cast<std::uint64_t>(key);
  row[1] = id;
  row[2] = line;
  for (std::size_t i = 0; i < values.size(); ++i)
    row[3 + i] = std::bit_cast<std::uint64_t>(values[i]);
  if (in_order_ && at > 0 && before(row, row - stride_)) in_order_ = false;

  if (row_count_ == 0 || key < first_key_) first_key_ = key;
  if (row_count_ == 0 || key > last_key_) last_key_ = key;
  if (row_count_ > 0 && key < recent_key_) keys_rise_ = false;
  if (feed_ == nullptr && !too_many_keys_ && (row_count_ == 0 || key != recent_key_)) {
    key_set_.insert(key);
    if (key_set_.size() > kMaxKeys) {
      too_many_keys_ = true;
      key_set_ = {};
    }
  }
  recent_key_ = key;
  ++row_count_;
  return absl::OkStatus();
}

const std::uint64_t* RowSorter::memory_row(std::size_t index) const {
  return words_.data() + (order_.empty() ? index : order_[index]) * stride_;
}

void RowSorter::sort_memory() {
  order_.clear();
  if (in_order_) return;
  order_.resize(words_.size() / stride_);
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(), [this](std::uint32_t a, std::uint32_t b) {
    return before(words_.data() + a * stride_, words_.data() + b * stride_);
  });
}

absl::Status RowSorter::spill() {
  const std::string folder = temporary_folder();
  if (file_ < 0) {
    std::string name = folder + "/throng-XXXXXX";
    file_ = ::mkostemp(name.data(), O_CLOEXEC);
    if (file_ < 0) {
      return absl::ResourceExhaustedError(
          absl::StrCat("sort by time: cannot make a temporary file in ", folder, ": ",
                       std::strerror(errno), "; set TMPDIR to a folder with room"));
    }
    ::unlink(name.c_str());
  }
  sort_memory();
  auto run = std::make_unique<Run>();
  run->begin = file_bytes_;
  std::vector<std::uint64_t> block;
  const std::size_t rows = words_.size() / stride_;
  const std::size_t rows_per_block = std::max<std::size_t>(1, (1u << 17) / stride_);
  for (std::size_t first = 0; first < rows; first += rows_per_block) {
    const std::size_t last = std::min(rows, first + rows_per_block);
    block.clear();
    for (std::size_t i = first; i < last; ++i) {
      const std::uint64_t* row = memory_row(i);
      block.insert(block.end(), row, row + stride_);
    }
    const char* bytes = reinterpret_cast<const char*>(block.data());
    std::size_t left = block.size() * 8;
    while (left > 0) {
      const ssize_t written = ::pwrite(file_, bytes, left, static_cast<off_t>(file_bytes_));
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) {
        return absl::ResourceExhaustedError(
            absl::StrCat("sort by time: cannot write ", left, " bytes to a temporary file in ",
                         folder, " after ", file_bytes_, ": ", std::strerror(errno),
                         "; set TMPDIR to a folder with room"));
      }
      bytes += written;
      left -= static_cast<std::size_t>(written);
      file_bytes_ += static_cast<std::uint64_t>(written);
    }
  }
  run->end = file_bytes_;
  runs_.push_back(std::move(run));
  words_.clear();
  order_.clear();
  in_order_ = true;
  return absl::OkStatus();
}

absl::Status RowSorter::refill(Run& run) {
  run.at = run.filled = 0;
  const std::size_t want = std::min<std::uint64_t>(run.buffer.size() * 8, run.end - run.begin);
  char* to = reinterpret_cast<char*>(run.buffer.data());
  std::size_t got = 0;
  while (got < want) {
    const ssize_t count = ::pread(file_, to + got, want - got, static_cast<off_t>(run.begin + got));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      return absl::DataLossError(absl::StrCat("sort by time: cannot read the temporary file at ",
                                              run.begin + got, ": ", std::strerror(errno)));
    }
    got += static_cast<std::size_t>(count);
  }
  run.begin += want;
  run.filled = want / 8;
  return absl::OkStatus();
}

void RowSorter::sort_keys() {
  keys_.assign(key_set_.begin(), key_set_.end());
  key_set_ = {};
  std::sort(keys_.begin(), keys_.end());
}

void RowSorter::stream(std::function<absl::StatusOr<bool>()> feed) {
  sort_keys();
  feed_ = std::move(feed);
}

absl::Status RowSorter::refill_stream() {
  // What is left is of the last key, which is not complete yet.
  std::vector<std::uint64_t> left;
  for (std::size_t i = complete_rows_; i * stride_ < words_.size(); ++i) {
    const std::uint64_t* row = memory_row(i);
    left.insert(left.end(), row, row + stride_);
  }
  words_.swap(left);
  order_.clear();
  in_order_ = true;
  for (std::size_t at = stride_; at < words_.size() && in_order_; at += stride_) {
    in_order_ = !before(words_.data() + at, words_.data() + at - stride_);
  }
  next_memory_ = 0;
  const auto key_of = [this](std::size_t at) { return static_cast<std::int64_t>(words_[at]); };
  while (!fed_ && words_.size() / stride_ <= kMaxAgentsPerFrame &&
         (words_.size() < kStreamRows * stride_ || key_of(0) == recent_key_)) {
    absl::StatusOr<bool> more = feed_();
    if (!more.ok()) return more.status();
    fed_ = !*more;
  }
  sort_memory();
  complete_rows_ = words_.size() / stride_;
  // more of one key than may be is the reader's to refuse
  if (fed_ || complete_rows_ > kMaxAgentsPerFrame) return absl::OkStatus();
  const std::uint64_t last_key = *memory_row(complete_rows_ - 1);
  while (complete_rows_ > 0 && *memory_row(complete_rows_ - 1) == last_key) --complete_rows_;
  if (complete_rows_ > 0) {
    complete_key_ = static_cast<std::int64_t>(*memory_row(complete_rows_ - 1));
    has_complete_ = true;
  }
  return absl::OkStatus();
}

absl::Status RowSorter::finish() {
  sort_keys();
  if (runs_.empty()) {
    sort_memory();
    return absl::OkStatus();
  }
  if (!words_.empty()) {
    if (absl::Status status = spill(); !status.ok()) return status;
  }
  words_ = {};
  const std::size_t rows_per_run =
      std::max<std::size_t>(1, kMergeBytes / (runs_.size() * stride_ * 8));
  for (std::uint32_t i = 0; i < runs_.size(); ++i) {
    runs_[i]->buffer.resize(
        std::min<std::uint64_t>(rows_per_run * stride_, (runs_[i]->end - runs_[i]->begin) / 8));
    if (absl::Status status = refill(*runs_[i]); !status.ok()) return status;
    heap_.push_back(i);
  }
  const auto later = [this](std::uint32_t a, std::uint32_t b) {
    return before(runs_[b]->head(), runs_[a]->head());
  };
  std::make_heap(heap_.begin(), heap_.end(), later);
  return absl::OkStatus();
}

absl::StatusOr<bool> RowSorter::next(Row& row) {
  const auto give = [&](const std::uint64_t* words) {
    row.key = static_cast<std::int64_t>(words[0]);
    row.id = words[1];
    row.line = words[2];
    values_.resize(stride_ - 3);
    for (std::size_t i = 0; i < values_.size(); ++i)
      values_[i] = std::bit_cast<double>(words[3 + i]);
    row.values = values_;
  };
  while (feed_ != nullptr && next_memory_ == complete_rows_ && !fed_) {
    if (absl::Status status = refill_stream(); !status.ok()) return status;
  }
  if (feed_ != nullptr && next_memory_ == complete_rows_) return false;
  if (runs_.empty()) {
    if (next_memory_ * stride_ >= words_.size()) return false;
    give(memory_row(next_memory_++));
    return true;
  }
  if (heap_.empty()) return false;
  const auto later = [this](std::uint32_t a, std::uint32_t b) {
    return before(runs_[b]->head(), runs_[a]->head());
  };
  std::pop_heap(heap_.begin(), heap_.end(), later);
  Run& run = *runs_[heap_.back()];
  give(run.head());
  run.at += stride_;
  if (run.at >= run.filled && run.begin < run.end) {
    if (absl::Status status = refill(run); !status.ok()) return status;
  }
  if (run.at >= run.filled) {
    heap_.pop_back();
  } else {
    std::push_heap(heap_.begin(), heap_.end(), later);
  }
  return true;
}

}  // namespace throng::trajectory::detail
