#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "throng/trajectory/trajectory.hpp"

namespace throng::trajectory::detail {

/// Bytes of a file, unpacked when it is gzip.
class ByteSource {
 public:
  static absl::StatusOr<std::unique_ptr<ByteSource>> open(const std::string& path);
  ~ByteSource();
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  /// Up to `size` bytes; 0 at the end. DataLoss for a damaged or cut gzip stream.
  absl::StatusOr<std::size_t> read(char* to, std::size_t size);
  const std::string& path() const { return path_; }
  /// How much of the file was read, 0 to 1; 0 where its size is not known.
  double share() const;

 private:
  ByteSource(std::string path, void* file) : path_(std::move(path)), file_(file) {}
  std::string path_;
  void* file_;  // gzFile
};

/// Lines of a text file, one at a time, without their ends and without a byte order mark.
class LineSource {
 public:
  static constexpr std::size_t kMaxLineBytes = 1u << 20;

  static absl::StatusOr<std::unique_ptr<LineSource>> open(
      const std::string& path, std::size_t max_line_bytes = kMaxLineBytes);
  /// False at the end. The view holds until the next call.
  absl::StatusOr<bool> next(std::string_view& line);
  /// Number of the line that `next` gave, from 1.
  std::uint64_t number() const { return number_; }
  /// Whether that line had no newline: the last one of a file that may have been cut short.
  bool unterminated() const { return unterminated_; }
  /// Tells ReadOptions::goes_on how far the file was read, every so many lines; Cancelled.
  absl::Status tell(const ReadOptions& options) const;

 private:
  LineSource(std::unique_ptr<ByteSource> bytes, std::size_t max_line_bytes)
      : bytes_(std::move(bytes)), max_line_bytes_(max_line_bytes) {}
  std::unique_ptr<ByteSource> bytes_;
  std::size_t max_line_bytes_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;  // what is unread in buffer_
  std::uint64_t number_ = 0;
  bool at_end_ = false;
  bool unterminated_ = false;
};

}  // namespace throng::trajectory::detail
