#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <zlib.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "writers.hpp"

namespace throng::trajectory::detail {

void append_seconds(std::string& text, std::int64_t time_us, std::size_t decimals) {
  char digits[48];
  std::snprintf(digits, sizeof digits, "%s%lld.%06lld", time_us < 0 ? "-" : "",
                static_cast<long long>(std::abs(time_us / 1000000)),
                static_cast<long long>(std::abs(time_us % 1000000)));
  std::size_t size = std::strlen(digits);
  for (std::size_t more = 6; more > decimals && digits[size - 1] == '0'; --more) --size;
  text.append(digits, size);
}

absl::Status check_columns(const std::string& path, const WriteSpec& spec, const Frame& frame,
                           const std::vector<std::string>& names) {
  const std::size_t agents = frame.ids.size();
  const auto fits = [&](std::size_t size, bool may_be_empty) {
    return size == agents || (may_be_empty && size == 0);
  };
  bool good = fits(frame.x_m.size(), false) && fits(frame.y_m.size(), false) &&
              fits(frame.z_m.size(), true) && fits(frame.heading_rad.size(), true) &&
              fits(names.size(), true) && frame.channels.size() == spec.channel_names.size();
  for (const auto& channel : frame.channels) good = good && fits(channel.size(), false);
  if (good) return absl::OkStatus();
  return fault(path, absl::StrCat("write: a column of the frame at ", frame.time_us,
                                  " us has not one entry for each of its ", agents, " agents"));
}

absl::Status check_ids(const std::string& path, const Frame& frame, std::uint64_t largest) {
  for (const std::uint64_t id : frame.ids) {
    if (id > largest) {
      return fault(path,
                   absl::StrCat("write: id is ", id, ", at most ", largest, " fits this format"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::int64_t> numbered_frame(const std::string& path, const WriteSpec& spec,
                                            const Frame& frame,
                                            const std::vector<std::string>& names,
                                            std::int64_t last, std::uint64_t largest_id) {
  if (absl::Status s = check_columns(path, spec, frame, names); !s.ok()) return s;
  if (absl::Status s = check_ids(path, frame, largest_id); !s.ok()) return s;
  const double exact = static_cast<double>(frame.time_us) * 1e-6 * spec.fps;
  const double nearest = std::round(exact);
  if (std::abs(exact - nearest) > 0.1 || !(std::abs(nearest) < kMaxInteger) ||
      static_cast<std::int64_t>(nearest) <= last) {
    return fault(
        path, absl::StrCat("write: time ", number_text(1e-6 * static_cast<double>(frame.time_us)),
                           " s is no frame at ", number_text(spec.fps),
                           " frames per second; write CSV, or give a rate that fits"));
  }
  return static_cast<std::int64_t>(nearest);
}

absl::Status cannot_write(const std::string& path, int error) {
  const std::string message = absl::StrCat(path, ": cannot be written: ", std::strerror(error));
  return error == ENOSPC ? absl::ResourceExhaustedError(message) : absl::UnavailableError(message);
}

OutputFile::~OutputFile() {
  if (file_ == nullptr) return;
  gzclose(static_cast<gzFile>(file_));
  std::remove(temporary_.c_str());
}

absl::Status OutputFile::open(const std::string& path) {
  path_ = path;
  temporary_ = path + ".tmp";
  errno = 0;
  // "T": as it is, without gzip around it
  gzFile file = gzopen(temporary_.c_str(), absl::EndsWithIgnoreCase(path, ".gz") ? "wb6" : "wbT");
  file_ = file;
  if (file == nullptr) return cannot_write(path_, errno != 0 ? errno : ENOMEM);
  gzbuffer(file, 1u << 17);
  return absl::OkStatus();
}

absl::Status OutputFile::put(const std::string& bytes) {
  errno = 0;
  const bool written =
      bytes.empty() || gzfwrite(bytes.data(), bytes.size(), 1, static_cast<gzFile>(file_)) == 1;
  return written ? absl::OkStatus() : cannot_write(path_, errno);
}

absl::Status OutputFile::close() {
  errno = 0;
  const bool closed = gzclose(static_cast<gzFile>(file_)) == Z_OK;
  file_ = nullptr;
  if (closed && std::rename(temporary_.c_str(), path_.c_str()) == 0) return absl::OkStatus();
  const absl::Status status = cannot_write(path_, errno);
  std::remove(temporary_.c_str());
  return status;
}

}  // namespace throng::trajectory::detail
