#include "text_source.hpp"

#include <absl/strings/str_cat.h>
#include <zlib.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "support.hpp"

namespace throng::trajectory::detail {

absl::StatusOr<std::unique_ptr<ByteSource>> ByteSource::open(const std::string& path) {
  errno = 0;
  gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) {
    const int error = errno;
    const std::string message = absl::StrCat(
        path, ": ", error != 0 ? std::strerror(error) : "not enough memory to open it");
    if (error == ENOENT) return absl::NotFoundError(message);
    if (error == EACCES) return absl::PermissionDeniedError(message);
    return absl::UnavailableError(message);
  }
  gzbuffer(file, 1u << 17);
  return std::unique_ptr<ByteSource>(new ByteSource(path, file));
}

ByteSource::~ByteSource() { gzclose(static_cast<gzFile>(file_)); }

double ByteSource::share() const {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path_, error);
  const auto at = gzoffset(static_cast<gzFile>(file_));
  return error || size == 0 || at < 0 ? 0.0 : static_cast<double>(at) / static_cast<double>(size);
}

absl::StatusOr<std::size_t> ByteSource::read(char* to, std::size_t size) {
  gzFile file = static_cast<gzFile>(file_);
  const int got = gzread(file, to, static_cast<unsigned>(size));
  if (got > 0) return static_cast<std::size_t>(got);
  int error = Z_OK;
  const char* text = gzerror(file, &error);
  if (error == Z_OK || error == Z_STREAM_END) return std::size_t{0};
  if (error == Z_ERRNO) {
    return absl::UnavailableError(absl::StrCat(path_, ": ", std::strerror(errno)));
  }
  return absl::InvalidArgumentError(absl::StrCat(
      path_, ": ",
      error == Z_BUF_ERROR ? "the gzip stream is cut short" : "the gzip stream is damaged", " (",
      text, "); copy or write the file again"));
}

absl::StatusOr<std::unique_ptr<LineSource>> LineSource::open(const std::string& path,
                                                             std::size_t max_line_bytes) {
  absl::StatusOr<std::unique_ptr<ByteSource>> bytes = ByteSource::open(path);
  if (!bytes.ok()) return bytes.status();
  return std::unique_ptr<LineSource>(new LineSource(*std::move(bytes), max_line_bytes));
}

absl::Status LineSource::tell(const ReadOptions& options) const {
  if (options.goes_on == nullptr || number_ % 65'536 != 0) return absl::OkStatus();
  return options.goes_on(bytes_->share())
             ? absl::OkStatus()
             : absl::CancelledError(absl::StrCat(bytes_->path(), ": reading was stopped"));
}

absl::StatusOr<bool> LineSource::next(std::string_view& line) {
  std::size_t searched = 0;
  while (true) {
    const char* start = buffer_.data() + begin_;
    const std::size_t size = end_ - begin_;
    const void* newline =
        size > searched ? std::memchr(start + searched, '\n', size - searched) : nullptr;
    if (newline != nullptr || (at_end_ && size > 0)) {
      const std::size_t length =
          newline != nullptr ? static_cast<std::size_t>(static_cast<const char*>(newline) - start)
                             : size;
      unterminated_ = newline == nullptr;
      line = std::string_view(start, length);
      begin_ += length + (newline != nullptr ? 1 : 0);
      ++number_;
      if (number_ == 1 && line.substr(0, 3) == "\xEF\xBB\xBF") line.remove_prefix(3);
      if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
      if (line.size() > max_line_bytes_) break;
      return true;
    }
    if (at_end_) return false;
    if (size > max_line_bytes_) break;
    // Move the begun line to the front and fill up behind it.
    searched = size;
    if (begin_ > 0 && size > 0) std::memmove(buffer_.data(), start, size);
    begin_ = 0;
    end_ = size;
    if (buffer_.size() - end_ < (1u << 16))
      buffer_.resize(std::max<std::size_t>(2 * end_, 1u << 17));
    absl::StatusOr<std::size_t> got = bytes_->read(buffer_.data() + end_, buffer_.size() - end_);
    if (!got.ok()) return got.status();
    if (*got == 0) at_end_ = true;
    end_ += *got;
  }
  return fault(bytes_->path(), number_ + (unterminated_ ? 0 : 1),
               absl::StrCat("the line is longer than ", max_line_bytes_,
                            " bytes; this is not a trajectory in text"));
}

}  // namespace throng::trajectory::detail
