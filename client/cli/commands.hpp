#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "client/camera/camera_script.hpp"
#include "throng/client/connection.hpp"
#include "throng/trajectory/trajectory.hpp"

namespace throng::client {

/// What the program ends with. 130 and 143: interrupted before the end, by SIGINT and SIGTERM.
enum ExitCode : int { kOk = 0, kFailure = 1, kUsage = 2, kBadInput = 3 };

struct Common {
  ConnectionOptions connection;
  bool quiet = false;  // no progress
};

struct PublishCommand {
  Common common;
  std::string file;
  std::string crowd;
  trajectory::ReadOptions read;
  std::string environment;  // file of WKT, GeoJSON or a Vadere scenario; empty: what `file` holds
  std::string net;          // SUMO's network: streets of the site; empty: as `environment` has them
  double rate = 1.0;        // scene seconds for each second
  bool loop = false;
  bool take_over = false;
  std::optional<std::uint64_t> seed;  // none: that of a recording, else 0
  double wait_s = 10.0;               // for the server
};
int run_publish(const PublishCommand& command);

struct ViewCommand {
  Common common;
  std::string crowd;
  std::uint32_t width_px = 1280;
  std::uint32_t height_px = 720;
  double fps = 30.0;
  std::uint32_t quality = 85;
  std::uint64_t vertex_budget = 0;
  std::optional<CameraScript> camera;  // none: an overview
  std::string channel;                 // colours the agents
  std::optional<double> channel_low, channel_high;
  std::string color_map = "viridis";
  double wait_s = 10.0;  // for the server and for the crowd
};

struct RecordCommand {
  ViewCommand view;
  std::string output;
  std::optional<double> seconds;
  std::optional<std::uint64_t> frames;
};
int run_record(const RecordCommand& command);

/// One line of text a second about what a viewer of the crowd gets.
int run_watch(const ViewCommand& command, std::optional<double> seconds);

struct SnapshotCommand {
  ViewCommand view;
  std::string output;            // .jpg or .png
  std::optional<double> time_s;  // scene time; none: now
};
/// One picture, also of a moment that has passed.
int run_snapshot(const SnapshotCommand& command);

struct ConvertCommand {
  Common common;
  std::string input, output;
  trajectory::ReadOptions read;
  std::string format;  // empty: by the ending of `output`
  double fps = 0.0;    // 0: that of the input
};
int run_convert(const ConvertCommand& command);

/// Removes a crowd that no producer feeds from the server.
int run_remove(const Common& common, const std::string& crowd, bool json);

int run_crowds(const Common& common, bool json);
int run_server_info(const Common& common, bool json);
int run_file_info(const std::string& file, const trajectory::ReadOptions& read, bool json);

/// What this machine can draw with, and whether a server answers (a failure if one was named).
int run_doctor(const Common& common, bool named, bool json);

}  // namespace throng::client
