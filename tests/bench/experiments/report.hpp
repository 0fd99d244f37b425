#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <nlohmann/json.hpp>
#include <string>

#include "throng/render/picture.hpp"

namespace throng::bench {

/// Set by Ctrl-C: experiments end after the frame that is under way and report what they have.
extern std::atomic<bool> stop_requested;

/// One line on stderr that tells how far an experiment is; only now and then where stderr is no
/// terminal.
class Progress {
 public:
  Progress(std::string what, std::size_t total);
  ~Progress();
  void step(const std::string& detail);

 private:
  std::string what_;
  std::size_t total_, done_ = 0;
  bool terminal_;
};

/// Writes an experiment's numbers, indented. PermissionDenied when the file can't be written.
absl::Status write_json(const std::string& file, const nlohmann::ordered_json& json);

absl::Status write_png(const std::string& file, const render::Picture& picture);

}  // namespace throng::bench
