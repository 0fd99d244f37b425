#include <absl/strings/str_format.h>

#include <algorithm>
#include <cstdio>

#include "client/cli/commands.hpp"
#include "client/cli/interrupt.hpp"
#include "client/cli/output.hpp"
#include "throng/trajectory/writer.hpp"

namespace throng::client {

int run_convert(const ConvertCommand& command) {
  const char* const kName = "convert";
  Progress progress(command.common.quiet);
  progress.show(command.input + ": looking through it");
  trajectory::ReadOptions read = command.read;
  read.goes_on = [&](double share) {
    progress.show(
        absl::StrFormat("%s: sorting by time, %.0f %% read", command.input, 100.0 * share));
    return interrupted() == 0;
  };
  const auto summary = trajectory::convert(
      command.input, command.output, read, command.format, command.fps,
      [&](std::uint64_t frames, std::uint64_t all) {
        progress.show(absl::StrFormat("%s: frame %d of %d, %d %%", command.output, frames, all,
                                      100 * frames / std::max(frames, all)));
        return interrupted() == 0;
      });
  progress.end();
  if (interrupted() != 0 && !summary.ok()) return 128 + interrupted();
  if (!summary.ok()) {
    report(kName, summary.status());
    return kBadInput;
  }
  if (!command.common.quiet) {
    for (const std::string& note : summary->info.notes) {
      absl::FPrintF(stderr, "throng convert: note: %s\n", note);
    }
    absl::FPrintF(stderr, "throng convert: %d frames, %.2f s, %d agents\n", summary->frames,
                  summary->duration_s, summary->agents);
  }
  std::printf("%s\n", command.output.c_str());
  return kOk;
}

}  // namespace throng::client
