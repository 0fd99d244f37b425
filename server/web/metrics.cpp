#include "server/web/metrics.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <vector>

#include "server/rpc/services.hpp"
#include "throng/v1/server.pb.h"

namespace throng::server {
namespace {

std::string quoted(const std::string& value) {
  return absl::StrCat(
      "\"", absl::StrReplaceAll(value, {{"\\", "\\\\"}, {"\"", "\\\""}, {"\n", "\\n"}}), "\"");
}

class Writer {
 public:
  void family(const char* name, const char* type, const char* help) {
    name_ = name;
    absl::StrAppend(&text_, "# HELP ", name, " ", help, "\n# TYPE ", name, " ", type, "\n");
  }
  template <typename Value>
  void sample(const std::string& labels, Value value) {
    absl::StrAppend(&text_, name_, labels.empty() ? "" : "{", labels, labels.empty() ? " " : "} ",
                    value, "\n");
  }
  template <typename Value>
  void single(const char* name, const char* type, const char* help, Value value) {
    family(name, type, help);
    sample({}, value);
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
  const char* name_ = "";
};

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

std::uint64_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t total = 0, resident = 0;
  file >> total >> resident;
  return resident * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace

std::string metrics_text(Services& services, std::size_t web_connections) {
  Writer out;
  const v1::GetServerInfoResponse& info = *services.info;
  out.family("throng_build_info", "gauge", "Version and devices; always 1.");
  out.sample(absl::StrCat("version=", quoted(info.version()), ",compute=",
                          quoted(info.compute_backend()), ",raster=", quoted(info.rasterizer())),
             1);
  out.single("throng_uptime_seconds", "gauge", "Since the server began.",
             std::chrono::duration<double>(Clock::now() - services.began).count());
  out.single("throng_viewers", "gauge", "Views that are open.", services.viewers.load());
  out.single("throng_web_connections", "gauge", "Connections at the web door.", web_connections);
  const RenderLoopCounters loop = services.loop->counters();
  out.single("throng_rendered_frames_total", "counter", "Frames drawn.", loop.rendered_frames);
  out.single("throng_oversampled_frames_total", "counter",
             "Rendered frames that had time for 16 samples a pixel.", loop.oversampled_frames);
  out.single("throng_shared_frames_total", "counter", "Frames sent that cost no drawing.",
             loop.shared_frames);
  out.single("throng_failed_frames_total", "counter", "Frames that could not be drawn or encoded.",
             loop.failed_frames);
  out.single("throng_encoded_bytes_total", "counter", "Bytes of encoded pictures.",
             loop.encoded_bytes);

  const std::vector<CrowdReport> crowds = services.registry->list();
  const auto each = [&](const char* name, const char* type, const char* help, auto value) {
    out.family(name, type, help);
    for (const CrowdReport& crowd : crowds) {
      out.sample(absl::StrCat("crowd=", quoted(crowd.name)), value(crowd));
    }
  };
  each("throng_crowd_agents", "gauge", "Agents in the newest frame.",
       [](const CrowdReport& crowd) { return crowd.agents; });
  each("throng_crowd_live", "gauge", "1 while a producer is connected.",
       [](const CrowdReport& crowd) { return crowd.live ? 1 : 0; });
  each("throng_crowd_viewers", "gauge", "Views of the crowd.",
       [](const CrowdReport& crowd) { return crowd.viewers; });
  each("throng_crowd_history_bytes", "gauge", "Memory that the history takes.",
       [](const CrowdReport& crowd) { return crowd.history_bytes; });
  each("throng_crowd_history_seconds", "gauge", "Scene time that the history spans.",
       [](const CrowdReport& crowd) {
         return 1e-6 * static_cast<double>(crowd.newest_time_us - crowd.oldest_time_us);
       });
  each("throng_ingest_frames_total", "counter", "Agent frames applied in the current run.",
       [](const CrowdReport& crowd) { return crowd.frames; });
  each("throng_ingest_late_frames_total", "counter", "Agent frames that came late or twice.",
       [](const CrowdReport& crowd) { return crowd.late_frames; });
  each("throng_ingest_incomplete_frames_total", "counter", "Agent frames that missed chunks.",
       [](const CrowdReport& crowd) { return crowd.incomplete_frames; });
  each("throng_recorded_frames_total", "counter", "Agent frames written to the recording.",
       [](const CrowdReport& crowd) { return crowd.recorded.written_frames; });
  each("throng_unrecorded_frames_total", "counter", "Agent frames that the recording lost.",
       [](const CrowdReport& crowd) { return crowd.recorded.lost_frames; });

  out.single("process_cpu_seconds_total", "counter", "User and system time.", cpu_seconds());
  out.single("process_resident_memory_bytes", "gauge", "Resident memory.", resident_bytes());
  return out.take();
}

}  // namespace throng::server
