extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/error.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <mutex>

#include "render/encode/image_size.hpp"
#include "throng/render/encode.hpp"

namespace throng::render {
namespace {

std::string error_text(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = "";
  av_strerror(code, text, sizeof(text));
  return text;
}

struct EncoderChoice {
  const char* name;
  int time_base_den;  // ticks a second; MPEG-4 part 2 has 16 bits for it
};

// Best first. A hardware encoder is found by name on any machine and only opens where the hardware
// is, so each is tried until one opens.
constexpr EncoderChoice kEncoders[] = {
    {"libx264", 1'000'000},
    {"libopenh264", 1'000'000},
    {"h264_nvenc", 1'000'000},
    {"mpeg4", 60'000},
};

class LibavVideoWriter final : public VideoWriter {
 public:
  LibavVideoWriter(std::string path, std::uint32_t width_px, std::uint32_t height_px, double fps)
      : path_(std::move(path)),
        source_width_px_(width_px),
        source_height_px_(height_px),
        fps_(fps) {}

  ~LibavVideoWriter() override {
    avcodec_free_context(&codec_);
    if (format_ != nullptr && format_->pb != nullptr) avio_closep(&format_->pb);
    avformat_free_context(format_);
    sws_freeContext(scale_);
    av_frame_free(&frame_);
    av_packet_free(&packet_);
    if (!temporary_.empty() && !finished_) ::unlink(temporary_.c_str());
  }

  absl::Status open() {
    // The library's own lines on stderr repeat what the status says.
    static std::once_flag quiet;
    std::call_once(quiet, [] { av_log_set_level(AV_LOG_FATAL); });

    width_px_ = static_cast<int>(source_width_px_ & ~1u);
    height_px_ = static_cast<int>(source_height_px_ & ~1u);
    if (auto status = open_encoder(); !status.ok()) return status;

    // The container is chosen by the real name; the bytes go to a temporary file until `finish`.
    static std::atomic<unsigned> counter{0};
    const AVOutputFormat* container = av_guess_format(nullptr, path_.c_str(), nullptr);
    if (container == nullptr) container = av_guess_format("mp4", nullptr, nullptr);
    std::string temporary =
        absl::StrCat(path_, ".", ::getpid(), ".", counter.fetch_add(1), ".part");
    // Fast start opens the file again by the context's name, so that is the temporary one.
    int code = avformat_alloc_output_context2(&format_, container, nullptr, temporary.c_str());
    if (code < 0) return failed("avformat_alloc_output_context2", code);
    AVStream* stream = avformat_new_stream(format_, nullptr);
    if (stream == nullptr) return failed("avformat_new_stream", AVERROR(ENOMEM));
    stream->time_base = codec_->time_base;
    stream->avg_frame_rate = codec_->framerate;
    code = avcodec_parameters_from_context(stream->codecpar, codec_);
    if (code < 0) return failed("avcodec_parameters_from_context", code);

    code = avio_open(&format_->pb, temporary.c_str(), AVIO_FLAG_WRITE);
    if (code < 0) {
      return absl::UnavailableError(
          absl::StrCat("open_video: ", temporary, ": ", error_text(code)));
    }
    temporary_ = std::move(temporary);
    // Fast start: the index is moved to the front, so that a browser plays before it has all.
    AVDictionary* options = nullptr;
    av_dict_set(&options, "movflags", "+faststart", 0);
    code = avformat_write_header(format_, &options);
    av_dict_free(&options);
    if (code < 0) return failed("avformat_write_header", code);

    frame_ = av_frame_alloc();
    packet_ = av_packet_alloc();
    if (frame_ == nullptr || packet_ == nullptr) return failed("av_frame_alloc", AVERROR(ENOMEM));
    frame_->format = codec_->pix_fmt;
    frame_->width = width_px_;
    frame_->height = height_px_;
    frame_->color_range = codec_->color_range;
    frame_->colorspace = codec_->colorspace;
    code = av_frame_get_buffer(frame_, 0);
    if (code < 0) return failed("av_frame_get_buffer", code);
    scale_ =
        sws_getContext(width_px_, height_px_, AV_PIX_FMT_RGB0, width_px_, height_px_,
                       codec_->pix_fmt, SWS_BILINEAR | SWS_ACCURATE_RND, nullptr, nullptr, nullptr);
    if (scale_ == nullptr) return failed("sws_getContext", AVERROR(EINVAL));
    const int* bt709 = sws_getCoefficients(SWS_CS_ITU709);
    sws_setColorspaceDetails(scale_, bt709, 1, bt709, 0, 0, 1 << 16, 1 << 16);
    return absl::OkStatus();
  }

  absl::Status add(std::span<const std::uint8_t> rgbx, std::int64_t time_us) override {
    if (ended_) return absl::FailedPreconditionError("VideoWriter::add: the video has ended");
    if (auto status =
            check_image("VideoWriter::add", rgbx.size(), source_width_px_, source_height_px_);
        !status.ok()) {
      return status;
    }
    if (frames_ == 0) first_time_us_ = time_us;
    if (frames_ > 0 && time_us <= last_time_us_) {
      return absl::InvalidArgumentError(absl::StrCat("VideoWriter::add: time is ", time_us,
                                                     " us, must be after ", last_time_us_, " us"));
    }
    const std::int64_t pts = av_rescale(time_us - first_time_us_, codec_->time_base.den, 1'000'000);
    if (frames_ > 0 && pts <= last_pts_) {
      return absl::InvalidArgumentError(
          absl::StrCat("VideoWriter::add: frames ", time_us - last_time_us_, " us apart, ",
                       codec_->codec->name, " needs ", 1'000'000 / codec_->time_base.den + 1));
    }
    int code = av_frame_make_writable(frame_);
    if (code < 0) return failed("av_frame_make_writable", code);
    const std::uint8_t* planes[] = {rgbx.data()};
    const int strides[] = {static_cast<int>(4 * source_width_px_)};
    sws_scale(scale_, planes, strides, 0, height_px_, frame_->data, frame_->linesize);
    frame_->pts = pts;
    code = avcodec_send_frame(codec_, frame_);
    if (code < 0) return failed("avcodec_send_frame", code);
    last_time_us_ = time_us;
    last_pts_ = pts;
    ++frames_;
    return write_packets();
  }

  absl::Status finish() override {
    if (ended_) return absl::FailedPreconditionError("VideoWriter::finish: the video has ended");
    ended_ = true;
    int code = avcodec_send_frame(codec_, nullptr);
    if (code < 0) return failed("avcodec_send_frame", code);
    if (auto status = write_packets(); !status.ok()) return status;
    code = av_write_trailer(format_);
    if (code < 0) return failed("av_write_trailer", code);
    code = avio_closep(&format_->pb);
    if (code < 0) return failed("avio_close", code);
    if (std::rename(temporary_.c_str(), path_.c_str()) != 0) {
      return failed("rename", AVERROR(errno));
    }
    finished_ = true;
    return absl::OkStatus();
  }

  std::string codec() const override { return codec_->codec->name; }

 private:
  absl::Status failed(const char* call, int code) const {
    const std::string message = absl::StrCat("video ", path_, ": ", call, ": ", error_text(code));
    if (code == AVERROR(ENOMEM)) return absl::ResourceExhaustedError(message);
    if (code == AVERROR(ENOSPC) || code == AVERROR(EIO) || code == AVERROR(EACCES) ||
        code == AVERROR(ENOENT)) {
      return absl::UnavailableError(message);
    }
    return absl::InternalError(message);
  }

  absl::Status open_encoder() {
    std::string tried;
    for (const EncoderChoice& choice : kEncoders) {
      const AVCodec* encoder = avcodec_find_encoder_by_name(choice.name);
      if (encoder == nullptr) {
        absl::StrAppend(&tried, " ", choice.name, " (not in libavcodec)");
        continue;
      }
      codec_ = avcodec_alloc_context3(encoder);
      if (codec_ == nullptr) return failed("avcodec_alloc_context3", AVERROR(ENOMEM));
      codec_->width = width_px_;
      codec_->height = height_px_;
      codec_->pix_fmt = AV_PIX_FMT_YUV420P;
      codec_->time_base = AVRational{1, choice.time_base_den};
      codec_->framerate = av_d2q(fps_, 60'000);
      codec_->sample_aspect_ratio = AVRational{1, 1};
      codec_->color_range = AVCOL_RANGE_MPEG;
      codec_->colorspace = AVCOL_SPC_BT709;
      codec_->color_primaries = AVCOL_PRI_BT709;
      codec_->color_trc = AVCOL_TRC_IEC61966_2_1;
      codec_->gop_size = std::max(1, static_cast<int>(std::lround(2.0 * std::min(fps_, 1000.0))));
      codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
      // 0.15 bits a pixel for those without a constant-quality mode.
      codec_->bit_rate =
          static_cast<std::int64_t>(std::min(0.15 * width_px_ * height_px_ * fps_, 400e6));
      AVDictionary* options = nullptr;
      if (std::string_view(choice.name) == "libx264") {
        codec_->bit_rate = 0;
        av_dict_set(&options, "preset", "veryfast", 0);
        av_dict_set(&options, "crf", "19", 0);
      } else if (std::string_view(choice.name) == "mpeg4") {
        codec_->flags |= AV_CODEC_FLAG_QSCALE;
        codec_->global_quality = 3 * FF_QP2LAMBDA;
      }
      const int code = avcodec_open2(codec_, encoder, &options);
      av_dict_free(&options);
      if (code == 0) return absl::OkStatus();
      avcodec_free_context(&codec_);
      absl::StrAppend(&tried, " ", choice.name, " (", error_text(code), ")");
    }
    return absl::UnavailableError(absl::StrCat("open_video: ", path_, ": no encoder opens ",
                                               width_px_, "x", height_px_, " px at ", fps_,
                                               " frames a second; tried", tried));
  }

  absl::Status write_packets() {
    while (true) {
      int code = avcodec_receive_packet(codec_, packet_);
      if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return absl::OkStatus();
      if (code < 0) return failed("avcodec_receive_packet", code);
      // Without a duration the last frame would be shown for no time at all.
      packet_->duration = std::max<std::int64_t>(1, std::llround(codec_->time_base.den / fps_));
      av_packet_rescale_ts(packet_, codec_->time_base, format_->streams[0]->time_base);
      packet_->stream_index = 0;
      code = av_interleaved_write_frame(format_, packet_);
      if (code < 0) return failed("av_interleaved_write_frame", code);
    }
  }

  const std::string path_;
  const std::uint32_t source_width_px_, source_height_px_;
  const double fps_;
  int width_px_ = 0, height_px_ = 0;
  std::string temporary_;
  AVFormatContext* format_ = nullptr;
  AVCodecContext* codec_ = nullptr;
  SwsContext* scale_ = nullptr;
  AVFrame* frame_ = nullptr;
  AVPacket* packet_ = nullptr;
  std::uint64_t frames_ = 0;
  std::int64_t first_time_us_ = 0, last_time_us_ = 0, last_pts_ = 0;
  bool ended_ = false, finished_ = false;
};

}  // namespace

absl::StatusOr<std::unique_ptr<VideoWriter>> open_video(const std::string& path,
                                                        std::uint32_t width_px,
                                                        std::uint32_t height_px, double fps) {
  // Two pixels are the least that chroma at half resolution leaves.
  if (width_px < 2 || width_px > kMaxSidePx || height_px < 2 || height_px > kMaxSidePx) {
    return absl::InvalidArgumentError(absl::StrCat("open_video: size is ", width_px, "x", height_px,
                                                   " px, each side must be 2 to ", kMaxSidePx));
  }
  if (!(fps > 0.0) || fps > 1000.0) {
    return absl::InvalidArgumentError(
        absl::StrCat("open_video: ", fps, " frames a second, must be above 0 and at most 1000"));
  }
  auto writer = std::make_unique<LibavVideoWriter>(path, width_px, height_px, fps);
  if (auto status = writer->open(); !status.ok()) return status;
  return writer;
}

}  // namespace throng::render
