#pragma once

#include <absl/status/status.h>

#include <functional>
#include <string>
#include <vector>

#include "simplify/bake/bake.hpp"
#include "simplify/impostor/relief.hpp"

namespace throng::simplify {

struct JobOptions {
  std::vector<std::string> inputs;  // glTF files
  std::vector<std::string> clip_files;
  bool builtin = false;
  std::string folder;
  std::string name;  // of the character, for a single input; else the file's
  unsigned jobs = 1;
  bool force = false;  // bake what is unchanged, too
  BakeOptions bake;
  ReliefOptions relief;  // texels of 0 m and none uniform: no impostor
  /// A line for the user. Called from several threads, one at a time.
  std::function<void(const std::string&)> say;
  /// Progress of all inputs, 0 to 1; as `say`.
  std::function<void(float)> on_progress;
};

struct JobSummary {
  int baked = 0;
  int unchanged = 0;
  int failed = 0;  // bad input; the others were still baked
  bool is_unwritable = false;
  bool is_internal = false;  // an error in this program
};

/// Bakes all inputs into the folder and writes its cast.json. An input whose content and settings
/// are those of the last time is left alone.
/// Errors only for what stops everything: a folder or cast.json that can't be used.
absl::Status run_jobs(const JobOptions& options, JobSummary& summary);

}  // namespace throng::simplify
