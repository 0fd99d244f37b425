#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <unordered_set>
#include <vector>

namespace throng::trajectory::detail {

/// Rows of a file in order of time, however the file is sorted.
///
/// Archive files are sorted by agent, so their first frame is known only at the end of the file.
/// Rows are kept in memory up to `memory_bytes`; beyond that, sorted runs go to an unlinked
/// temporary file ($TMPDIR, else /var/tmp) and are merged while they are read. A run that is in
/// order already is not sorted again. Of a file in order of time, `stream` gives rows while it is
/// read.
class RowSorter {
 public:
  struct Row {
    std::int64_t key = 0;  // frame number or microseconds
    std::uint64_t id = 0;
    std::uint64_t line = 0;  // of the file; 0 for a moment with nobody
    std::span<const double> values;
  };

  /// @param value_count  numbers of each row
  RowSorter(std::size_t value_count, std::size_t memory_bytes);
  ~RowSorter();
  RowSorter(const RowSorter&) = delete;
  RowSorter& operator=(const RowSorter&) = delete;

  /// ResourceExhausted when the temporary file cannot be written, OutOfRange for a row of a stream
  /// that comes after later ones were given.
  absl::Status add(std::int64_t key, std::uint64_t id, std::uint64_t line,
                   std::span<const double> values);
  /// A moment the file lists without anybody.
  absl::Status add_moment(std::int64_t key);
  /// No row may be added after this.
  absl::Status finish();
  /// Instead of `finish`, while nothing was spilled: `next` calls `feed`, which adds rows or
  /// returns false at the end, and holds two keys and some thousand rows.
  void stream(std::function<absl::StatusOr<bool>()> feed);
  /// Whether no key was less than the one before.
  bool keys_rise() const { return keys_rise_; }
  std::size_t key_count() const { return key_set_.size(); }  // before `finish`; distinct

  /// Rows by key, then id, then line; `row.values` holds until the next call. False at the end.
  absl::StatusOr<bool> next(Row& row);

  bool empty() const { return row_count_ == 0; }
  std::uint64_t row_count() const { return row_count_; }
  std::int64_t first_key() const { return first_key_; }
  std::int64_t last_key() const { return last_key_; }
  /// Distinct keys in order, after `finish`. Empty when there were more than four million.
  const std::vector<std::int64_t>& keys() const { return keys_; }
  bool spilled() const { return !runs_.empty(); }

 private:
  struct Run;
  absl::Status push(std::int64_t key, std::uint64_t id, std::uint64_t line,
                    std::span<const double> values);
  void sort_memory();
  absl::Status spill();
  absl::Status refill(Run& run);
  absl::Status refill_stream();
  void sort_keys();
  const std::uint64_t* memory_row(std::size_t index) const;

  std::size_t stride_;          // words of a row: key, id, line, values
  std::size_t rows_in_memory_;  // limit
  std::vector<std::uint64_t> words_;
  std::vector<std::uint32_t> order_;  // empty when words_ is in order
  bool in_order_ = true;
  std::size_t next_memory_ = 0;
  bool keys_rise_ = true;

  std::function<absl::StatusOr<bool>()> feed_;  // of a stream
  bool fed_ = false;                            // to its end
  std::size_t complete_rows_ = 0;               // in memory, of keys that no row may come to
  std::int64_t complete_key_ = 0;
  bool has_complete_ = false;

  int file_ = -1;
  std::uint64_t file_bytes_ = 0;
  std::vector<std::unique_ptr<Run>> runs_;
  std::vector<std::uint32_t> heap_;  // indices of runs_
  std::vector<double> values_;       // of the row given last

  std::uint64_t row_count_ = 0;
  std::int64_t first_key_ = 0, last_key_ = 0;
  std::int64_t recent_key_ = 0;
  std::unordered_set<std::int64_t> key_set_;
  bool too_many_keys_ = false;
  std::vector<std::int64_t> keys_;
};

}  // namespace throng::trajectory::detail
