#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace throng::render {

/// Encodes rows of 4 bytes a pixel (r g b x) as baseline JPEG, 4:2:0, with libjpeg-turbo.
/// One encoder per thread; it keeps its buffers.
class JpegEncoder {
 public:
  JpegEncoder();
  ~JpegEncoder();
  JpegEncoder(const JpegEncoder&) = delete;
  JpegEncoder& operator=(const JpegEncoder&) = delete;
  /// @param quality  1 to 100. InvalidArgument for a wrong size or quality.
  /// The bytes stay valid until the next call.
  absl::StatusOr<std::span<const std::uint8_t>> encode(std::span<const std::uint8_t> rgbx,
                                                       std::uint32_t width_px,
                                                       std::uint32_t height_px, int quality);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Decodes a JPEG to r g b x rows. InvalidArgument: not a JPEG, or larger than 16384 px a side.
struct DecodedImage {
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<std::uint8_t> rgbx;
};
absl::StatusOr<DecodedImage> decode_jpeg(std::span<const std::uint8_t> jpeg);

/// PNG, 8 bit RGB. Deterministic: the same pixels give the same bytes.
absl::StatusOr<std::vector<std::uint8_t>> encode_png(std::span<const std::uint8_t> rgbx,
                                                     std::uint32_t width_px,
                                                     std::uint32_t height_px);
absl::StatusOr<DecodedImage> decode_png(std::span<const std::uint8_t> png);

/// A channel of an EXR file: one value a pixel [height][width], rows from the top.
struct ExrChannel {
  std::string name;
  std::variant<std::span<const float>, std::span<const std::uint32_t>> values;
};
/// OpenEXR with 32-bit FLOAT and UINT channels, losslessly deflated. Deterministic.
/// @param comment  kept in the file, for who finds it.
/// InvalidArgument for a wrong size; ResourceExhausted; Internal with what OpenEXR said.
absl::StatusOr<std::vector<std::uint8_t>> encode_exr(std::span<const ExrChannel> channels,
                                                     std::uint32_t width_px,
                                                     std::uint32_t height_px,
                                                     const std::string& comment);

/// Makes the folder that `path` lies in, if need be. Unavailable names it.
absl::Status make_folder_of(const std::string& path);

/// Writes `path` atomically: a temporary file beside it, fsync, rename.
absl::Status write_file(const std::string& path, std::span<const std::uint8_t> bytes);

/// H.264 in mp4 (yuv420p, fast start) through libavcodec; MPEG-4 part 2 where no H.264 encoder is.
class VideoWriter {
 public:
  virtual ~VideoWriter() = default;
  /// A frame of the size given at opening, shown from `time_us` on (strictly increasing).
  virtual absl::Status add(std::span<const std::uint8_t> rgbx, std::int64_t time_us) = 0;
  /// Ends the file; without it the file is left unfinished and removed.
  virtual absl::Status finish() = 0;
  virtual std::string codec() const = 0;
};
/// Sizes are rounded down to even. Unavailable: no encoder, or the file can't be written.
absl::StatusOr<std::unique_ptr<VideoWriter>> open_video(const std::string& path,
                                                        std::uint32_t width_px,
                                                        std::uint32_t height_px, double fps);

}  // namespace throng::render
