#pragma once

#include <absl/status/status.h>

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "throng/render/encode.hpp"
#include "throng/render/frame.hpp"

namespace throng::server {

/// kStream: binary PPM pictures, one after the other, to a file that is open.
enum class OutputKind { kPng, kJpeg, kExr, kVideo, kStream };

/// One picture and where it goes; an empty path: nowhere.
struct FinishedPicture {
  render::Picture picture;
  render::FramePasses passes;
  std::string color_path, depth_path, id_path;
  std::int64_t time_us = 0;
};

/// Encodes and writes pictures beside the render loop, one behind it.
class PictureSink {
 public:
  /// @param video  for kVideo, must outlive the sink.  @param stream_fd  for kStream.
  PictureSink(OutputKind kind, int jpeg_quality, render::VideoWriter* video, int stream_fd);
  ~PictureSink() { drain(); }

  /// Waits until the picture before has been written, then takes this one.
  void add(FinishedPicture finished);

  /// True once a picture could not be written.
  bool failed();

  /// Writes what is left. After it: which files failed, and why.
  const std::vector<std::pair<std::string, absl::Status>>& drain();

 private:
  absl::Status write();
  absl::Status write_color();
  absl::Status write_stream();
  void run();

  OutputKind kind_;
  int jpeg_quality_;
  render::VideoWriter* video_;
  int stream_fd_;
  render::JpegEncoder jpeg_;
  std::mutex mutex_;
  std::condition_variable work_, idle_;
  bool waiting_ = false, ended_ = false;
  FinishedPicture finished_;
  std::vector<std::pair<std::string, absl::Status>> failures_;
  std::thread thread_;
};

}  // namespace throng::server
