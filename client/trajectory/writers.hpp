#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "support.hpp"
#include "throng/trajectory/writer.hpp"

/// One function for each format that is written, and what they share; `make_writer` in writer.cpp
/// chooses. All of them get a rate that is valid where the format counts frames.
namespace throng::trajectory::detail {

using WriterOr = absl::StatusOr<std::unique_ptr<Writer>>;

WriterOr write_csv(const std::string& path, const WriteSpec& spec);
WriterOr write_archive_text(const std::string& path, const WriteSpec& spec);
WriterOr write_obsmat(const std::string& path, const WriteSpec& spec);
WriterOr write_jupedsim_sqlite(const std::string& path, const WriteSpec& spec);
WriterOr write_hdf5(const std::string& path, const WriteSpec& spec);
WriterOr write_vadere(const std::string& path, const WriteSpec& spec);
WriterOr write_sumo_fcd(const std::string& path, const WriteSpec& spec);
WriterOr write_menge_scb(const std::string& path, const WriteSpec& spec);
WriterOr write_trajnet(const std::string& path, const WriteSpec& spec);

/// Largest ids: of a double, of the u4 that JuPedSim's HDF5 has, of Vadere's int.
inline constexpr std::uint64_t kLargestExactId = std::uint64_t{1} << 53;
inline constexpr std::uint64_t kLargestHdf5Id = 0xFFFFFFFFu;
inline constexpr std::uint64_t kLargestVadereId = 0x7FFFFFFFu;
/// From here on neighbours in single precision are 0.125 m apart: no walk survives that.
inline constexpr double kMaxScbPositionM = 1048576.0;

/// The shortest digits that read back as the same number.
template <typename Number>
void append(std::string& text, Number value) {
  char digits[40];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

/// Seconds with as many decimals as the microseconds need, at least `decimals`.
void append_seconds(std::string& text, std::int64_t time_us, std::size_t decimals);

inline bool heading_known(const Frame& frame, std::size_t agent) {
  return !frame.heading_rad.empty() && std::isfinite(frame.heading_rad[agent]);
}

absl::Status check_columns(const std::string& path, const WriteSpec& spec, const Frame& frame,
                           const std::vector<std::string>& names);
absl::Status check_ids(const std::string& path, const Frame& frame, std::uint64_t largest);

/// Frame number of a frame whose columns and ids fit a format of plain numbers; an error when its
/// time is near none, or none after `last`.
absl::StatusOr<std::int64_t> numbered_frame(const std::string& path, const WriteSpec& spec,
                                            const Frame& frame,
                                            const std::vector<std::string>& names,
                                            std::int64_t last,
                                            std::uint64_t largest_id = kLargestExactId);

/// "FILE: cannot be written: REASON", ResourceExhausted when the disk is full.
absl::Status cannot_write(const std::string& path, int error);

/// A file under a temporary name until it is closed; gzipped when its name ends with .gz.
class OutputFile {
 public:
  OutputFile() = default;
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  absl::Status open(const std::string& path);
  absl::Status put(const std::string& bytes);
  absl::Status close();

 private:
  std::string path_, temporary_;
  void* file_ = nullptr;  // gzFile
};

template <typename Kind>
WriterOr opened(const std::string& path, const WriteSpec& spec) {
  auto writer = std::make_unique<Kind>();
  if (absl::Status s = writer->open(path, spec); !s.ok()) return s;
  return std::unique_ptr<Writer>(std::move(writer));
}

}  // namespace throng::trajectory::detail
