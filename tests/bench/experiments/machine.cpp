#include "bench/experiments/machine.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/strip.h>
#include <sys/sysinfo.h>
#include <sys/utsname.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <memory>
#include <sstream>
#include <thread>

#include "render/compute/cpu/kernels.hpp"

namespace throng::bench {
namespace {

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) != 0) continue;
    const std::size_t colon = line.find(':');
    return colon == std::string::npos
               ? line
               : std::string(absl::StripAsciiWhitespace(line.substr(colon + 1)));
  }
  return "unknown";
}

/// What a command says on its first line; empty if it can't be run.
std::string first_line_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  char line[256] = "";
  if (pipe == nullptr || std::fgets(line, sizeof(line), pipe.get()) == nullptr) return {};
  return std::string(absl::StripAsciiWhitespace(line));
}

std::string commit_of_source() {
  const std::string git = absl::StrCat("git -C '", THRONG_SOURCE_DIR, "' ");
  const std::string commit = first_line_of(git + "rev-parse --short=12 HEAD 2>/dev/null");
  if (commit.empty()) return "unknown";
  const bool changed = !first_line_of(git + "status --porcelain -uno 2>/dev/null").empty();
  return commit + (changed ? " and changes" : "");
}

const char* instruction_set() {
  switch (render::best_kernel_level()) {
    case render::KernelLevel::kAvx512:
      return "AVX-512";
    case render::KernelLevel::kAvx2:
      return "AVX2";
    case render::KernelLevel::kPlain:
      break;
  }
  return "plain";
}

}  // namespace

Machine Machine::describe() {
  Machine machine;
  machine.processor = processor_name();
  machine.instructions = instruction_set();
  machine.cores = std::max(1U, std::thread::hardware_concurrency());
  struct sysinfo memory {};
  if (sysinfo(&memory) == 0) {
    machine.memory = absl::StrFormat("%.0f GiB", static_cast<double>(memory.totalram) *
                                                     memory.mem_unit / (1024.0 * 1024 * 1024));
  }
  utsname system{};
  if (uname(&system) == 0) machine.system = absl::StrCat(system.sysname, " ", system.release);
  double load[1] = {0};
  if (getloadavg(load, 1) == 1) machine.load = load[0];
  machine.commit = commit_of_source();
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char date[32] = "";
  std::strftime(date, sizeof(date), "%Y-%m-%d", &utc);
  machine.date = date;
  return machine;
}

std::string Machine::line() const {
  return absl::StrFormat("%s, %u cores, %s, %s; commit %s; load %.1f when it started", processor,
                         cores, instructions, memory, commit, load);
}

nlohmann::ordered_json Machine::json() const {
  return {{"processor", processor}, {"cores", cores},   {"instructions", instructions},
          {"memory", memory},       {"system", system}, {"commit", commit},
          {"date", date},           {"load", load}};
}

}  // namespace throng::bench
