// throng-server: flags and wiring only.
#include <grpc/support/log.h>
#include <pthread.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>
#include <csignal>

#include <absl/strings/str_cat.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "server/doctor.hpp"
#include "server/far_options.hpp"
#include "server/rpc/server.hpp"
#include "server/web/door.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/gpu.hpp"
#include "throng/render/raster.hpp"

namespace {

using throng::server::ServerOptions;

enum ExitCode { kOk = 0, kFailure = 1, kUsage = 2, kBadInput = 3, kNoDevice = 4 };

/// The cast that the build or the installation put beside the program.
std::string default_cast() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path root = program.parent_path().parent_path();
  for (const char* place : {"cast", "share/throng/cast"}) {
    if (std::filesystem::exists(root / place / "cast.json", error)) return (root / place).string();
  }
  return {};
}

int fail(ExitCode code, const std::string& message) {
  std::fprintf(stderr, "throng-server: %s\n", message.c_str());
  return code;
}

ExitCode exit_code(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kFailedPrecondition:
      return kUsage;
    case absl::StatusCode::kNotFound:
      return kBadInput;
    default:
      return kFailure;
  }
}

throng::render::RasterKind raster_kind(const std::string& name) {
  using throng::render::RasterKind;
  return name == "gl" ? RasterKind::kGl
                      : (name == "visibility" ? RasterKind::kVisibility : RasterKind::kAuto);
}

void add_limits(CLI::App& app, ServerOptions& options) {
  throng::server::Limits& limits = options.limits;
  const char* const kGroup = "Limits";
  const auto add = [&](const char* flag, auto& value, const char* text, double least = 1,
                       double most = 4e9) {
    app.add_option(flag, value, text)
        ->capture_default_str()
        ->check(CLI::Range(least, most))
        ->group(kGroup);
  };
  add("--max-message-bytes", limits.max_message_bytes, "Largest message taken", 65'536,
      2'147'483'647);
  add("--max-crowds", limits.max_crowds, "Named crowds");
  add("--max-viewers", limits.max_viewers, "View streams");
  add("--max-agents", limits.max_agents_per_crowd, "Agents of a crowd", 1, 16'777'216);
  add("--max-channels", limits.max_channels, "Channels of a crowd", 0);
  add("--max-history-bytes", limits.max_history_bytes_per_crowd, "History of a crowd", 1, 1e15);
  app.add_option_function<std::uint64_t>(
         "--history-mib",
         [&limits](std::uint64_t mib) { limits.max_history_bytes_per_crowd = mib << 20; },
         "The same in MiB: how far back viewers can go")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 30))
      ->group(kGroup);
  add("--max-width", limits.max_width_px, "Width of a view, pixels", 16, 16'384);
  add("--max-height", limits.max_height_px, "Height of a view, pixels", 16, 16'384);
  add("--max-frames-in-flight", limits.max_frames_in_flight,
      "Frames sent beyond the last acknowledged");
  add("--max-vertex-budget", limits.max_vertex_budget, "Largest vertex budget a view may ask for",
      1, 1e9);
  add("--max-rate", limits.max_rate_hz, "Frames per second of a view", 0.01, 1000);
  add("--max-environment-bytes", limits.max_environment_bytes, "Text of a walkable area", 0);
  add("--max-pending-pictures", limits.max_pending_pictures, "Still pictures that may wait");
}

void add_network(CLI::App& app, ServerOptions& options) {
  const char* const kGroup = "Network";
  throng::server::ListenOptions& listen = options.listen;
  app.add_option("--listen", listen.listen, "HOST:PORT; port 0 takes any free one")
      ->capture_default_str()
      ->group(kGroup);
  app.add_option("--tls-cert", listen.tls_cert_file, "Certificate chain, PEM")->group(kGroup);
  app.add_option("--tls-key", listen.tls_key_file, "Its private key, PEM")->group(kGroup);
  app.add_option("--token-file", listen.token_file, "Tokens that clients must show, one a line")
      ->group(kGroup);
  app.add_flag("--insecure", listen.insecure,
               "Allow an address that other machines reach without TLS and token")
      ->group(kGroup);
  const auto add_ms = [&](const char* flag, std::chrono::milliseconds& value, const char* text) {
    app.add_option_function<std::int64_t>(
           flag, [&value](std::int64_t ms) { value = std::chrono::milliseconds(ms); }, text)
        ->default_str(std::to_string(value.count()))
        ->check(CLI::Range(std::int64_t{1}, std::int64_t{86'400'000}))
        ->group(kGroup);
  };
  add_ms("--keepalive-ms", options.keepalive_time, "A ping after this long without traffic");
  add_ms("--keepalive-timeout-ms", options.keepalive_timeout,
         "A client that is silent so long is gone");
  add_ms("--min-ping-interval-ms", options.min_ping_interval,
         "Clients that ping faster are sent away");
  add_ms("--drain-ms", options.drain_time, "Time that calls have to end when the server stops");
}

void add_record(CLI::App& app, throng::server::RecordSettings& record, bool& fresh) {
  const char* const kGroup = "Recording";
  app.add_option("--record", record.folder,
                 "Folder that keeps what producers send, CROWD.STAMP.PART.trec, to be played again "
                 "by 'throng publish'; the crowds that it holds are there again after a restart")
      ->group(kGroup);
  app.add_flag("--fresh", fresh, "Begin without the crowds that the folder of --record holds")
      ->group(kGroup);
  app.add_option_function<std::uint64_t>(
         "--record-mib", [&record](std::uint64_t mib) { record.limit_bytes = mib << 20; },
         "Of a crowd, all its runs together; the oldest parts are removed beyond it")
      ->default_str(std::to_string(record.limit_bytes >> 20))
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 30))
      ->group(kGroup);
  app.add_option_function<std::uint64_t>(
         "--record-queue-mib", [&record](std::uint64_t mib) { record.queue_bytes = mib << 20; },
         "Of a crowd, what may wait for a slow disk; frames beyond it are not recorded, but "
         "counted")
      ->default_str(std::to_string(record.queue_bytes >> 20))
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 20))
      ->group(kGroup);
  app.add_option_function<std::int64_t>(
         "--record-sync-ms",
         [&record](std::int64_t ms) { record.sync_every = std::chrono::milliseconds(ms); },
         "Recordings are synced to the disk this often while they grow; 0: left to the system")
      ->default_str(std::to_string(record.sync_every.count()))
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{86'400'000}))
      ->group(kGroup);
}

void add_web(CLI::App& app, throng::server::WebOptions& web) {
  const char* const kGroup = "Browsers";
  web.http.clear();
  app.add_option("--http", web.http, "HOST:PORT of the page for browsers, /metrics and /healthz")
      ->group(kGroup);
  app.add_option("--http-host", web.hosts, "Name that browsers may call this server by, repeatable")
      ->allow_extra_args(false)
      ->group(kGroup);
  app.add_option("--web-root", web.web_root, "Folder of the page, instead of the one compiled in")
      ->check(CLI::ExistingDirectory)
      ->group(kGroup);
}

}  // namespace

int main(int argc, char** argv) {
  throng::render::prepare_gpu();
  ServerOptions options;
  options.version = THRONG_VERSION;
  throng::server::WebOptions web;
  throng::render::FramePipelineOptions pipeline;
  std::uint32_t gpu_memory_mib = 0;
  std::string cast_folder, compute = "auto", gpu, raster = "auto", log_level = "info";
  bool doctor = false, json = false, fresh = false;

  CLI::App app{"Shows crowds: takes agents from simulators and sends pictures to viewers.",
               "throng-server"};
  app.failure_message([](const CLI::App* from, const CLI::Error& error) {
    return "throng-server: " + CLI::FailureMessage::simple(from, error);
  });
  app.set_version_flag("--version", THRONG_VERSION);
  app.add_option("--cast", cast_folder, "Folder of baked characters (default: the built-in cast)");
  auto* vertex_budget =
      app.add_option("--vertex-budget", options.default_vertex_budget,
                     "Vertices per frame of a view that does not say (default: as "
                     "many as --target-ms allows)")
          ->check(CLI::PositiveNumber);
  options.target_ms = 33.0;  // leaves the encoder its share of 40 ms
  app.add_option("--target-ms", options.target_ms,
                 "Render time of a frame that views without a budget are kept to, by their detail")
      ->capture_default_str()
      ->excludes(vertex_budget)
      ->check(CLI::Range(1.0, 10'000.0));
  std::string controller = "predictive";
  app.add_option("--controller", controller,
                 "What keeps views without a budget to --target-ms: a cost model that sets their "
                 "detail (and draws 16 samples a pixel while that leaves time), the state machine "
                 "of Lyu et al. (fewer poses, then points), or nothing")
      ->capture_default_str()
      ->check(CLI::IsMember({"fixed", "predictive", "sfsm"}));
  std::string form = "auto";
  app.add_option("--form", form,
                 "What agents are drawn as: what the controller takes, levels of meshes, relief "
                 "impostors, points, or each as what is cheapest and looks right")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "mesh", "impostor", "points", "mixed"}));
  throng::server::add_far_options(app, options.far);
  app.add_option("--threads", pipeline.threads, "Render threads (0: one for each core)")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024));
  app.add_option("--compute", compute, "What finds, poses and builds the figures")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}));
  app.add_option("--gpu", gpu, "CUDA device (default: the first)")->type_name("INDEX|UUID");
  app.add_option("--gpu-memory-mib", gpu_memory_mib, "Device memory that may be used, 0: all")
      ->capture_default_str();
  app.add_option("--raster", raster, "Rasterizer")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "gl", "visibility"}));
  app.add_option("--log-level", log_level, "What is logged")
      ->capture_default_str()
      ->check(CLI::IsMember({"trace", "debug", "info", "warning", "error", "critical", "off"}));
  app.add_flag("--doctor", doctor, "Print what this machine can draw with, and why not; then exit");
  app.add_flag("--json", json, "With --doctor: as JSON");
  add_network(app, options);
  add_web(app, web);
  add_limits(app, options);
  add_record(app, options.record, fresh);
  app.footer(
      "Examples:\n"
      "  throng-server                                   this machine only, port 7447\n"
      "  throng-server --listen 127.0.0.1:0              any free port; it is printed\n"
      "  throng-server --listen 0.0.0.0:7447 --tls-cert cert.pem --tls-key key.pem \\\n"
      "                --token-file tokens               for other machines\n"
      "  throng-server --http 127.0.0.1:7480             with a page for browsers\n"
      "  throng-server --record runs --record-mib 2048   keep what comes, also for the next start\n"
      "  throng-server --record runs --fresh --record-sync-ms 200 --record-queue-mib 256\n"
      "                                                  an empty server, synced five times a "
      "second\n"
      "  throng-server --cast mine --vertex-budget 2000000 --threads 4 --log-level warning\n"
      "  throng-server --target-ms 20 --controller sfsm  frames of 20 ms\n"
      "  throng-server --form mixed --far density --far-distance 80 --far-points 200000\n"
      "  throng-server --compute cuda --raster visibility --gpu 0 --gpu-memory-mib 8192\n"
      "  throng-server --http 0.0.0.0:7480 --http-host crowds.example.org --insecure\n"
      "                                                  behind a proxy with HTTPS and passwords\n"
      "  throng-server --http 127.0.0.1:7480 --web-root client/browser    a page that is worked "
      "on\n"
      "  throng-server --history-mib 2048                viewers can go back further; in bytes:\n"
      "  throng-server --max-history-bytes 1000000000 --max-environment-bytes 4000000\n"
      "  throng-server --max-crowds 4 --max-viewers 8 --max-agents 200000 --max-channels 4 \\\n"
      "                --max-message-bytes 8000000       limits of a small machine\n"
      "  throng-server --max-width 1920 --max-height 1080 --max-rate 30 \\\n"
      "                --max-vertex-budget 5000000 --max-frames-in-flight 2 \\\n"
      "                --max-pending-pictures 4          of what a view may ask for\n"
      "  throng-server --keepalive-ms 60000 --keepalive-timeout-ms 20000 \\\n"
      "                --min-ping-interval-ms 30000 --drain-ms 1000\n"
      "  throng-server --doctor --json                   what EGL, CUDA and rasterizers can do "
      "here\n"
      "Exit codes: 0 stopped in order, 1 failure, 2 usage, 3 bad input, 4 nothing to draw with.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kUsage;
  }
  options.controller = throng::render::controller_named(controller).value();
  using throng::render::FormRule;
  constexpr std::pair<std::string_view, FormRule> kForms[] = {{"mesh", FormRule::kMesh},
                                                              {"impostor", FormRule::kImpostor},
                                                              {"points", FormRule::kPoints},
                                                              {"mixed", FormRule::kMixed}};
  for (const auto& [name, rule] : kForms) {
    if (form == name) options.form = rule;
  }
  const bool is_fixed = options.controller == throng::render::ControllerKind::kFixed;
  if (vertex_budget->count() > 0 || is_fixed) options.target_ms = 0.0;
  options.far.wait = false;

  spdlog::set_default_logger(spdlog::stderr_color_mt("throng"));
  spdlog::set_level(spdlog::level::from_str(log_level));
  // A call's status says what went wrong; gRPC's own words are for those who look into gRPC.
  gpr_set_log_function([](gpr_log_func_args* args) { spdlog::debug("grpc: {}", args->message); });
  if (cast_folder.empty()) cast_folder = default_cast();
  if (gpu_memory_mib > 0) throng::render::limit_gpu_memory(std::uint64_t{gpu_memory_mib} << 20);
  if (!gpu.empty()) {
    if (absl::Status status = throng::render::choose_gpu(gpu); !status.ok()) {
      return fail(kNoDevice, absl::StrCat("--gpu: ", status.message()));
    }
  }
  if (doctor) {
    std::fputs(throng::server::doctor_report(cast_folder, json).c_str(), stdout);
    return kOk;
  }
  if (cast_folder.empty()) {
    return fail(
        kBadInput,
        "no built-in cast beside the program; bake one with 'throng-bake --builtin -o cast' "
        "and give --cast cast");
  }
  if (absl::Status status = throng::server::check_bind(options.listen); !status.ok()) {
    return fail(kUsage, std::string(status.message()));
  }
  if (!options.record.folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.record.folder, error);
    if (error || access(options.record.folder.c_str(), W_OK | X_OK) != 0) {
      return fail(kBadInput, "--record " + options.record.folder + ": " +
                                 (error ? error.message() : "it cannot be written"));
    }
    options.resume = !fresh;
  }
  auto cast = throng::render::read_cast(cast_folder);
  if (!cast.ok()) return fail(kBadInput, std::string(cast.status().message()));
  const auto shared_cast = std::make_shared<const throng::render::Cast>(*std::move(cast));
  pipeline.raster = raster_kind(raster);
  pipeline.backend =
      compute == "cuda" ? throng::render::BackendKind::kCuda : throng::render::BackendKind::kCpu;
  if (compute == "auto") {
    std::string why;
    pipeline.backend = throng::render::best_backend(why);
    if (pipeline.backend == throng::render::BackendKind::kCuda) {
      spdlog::info("event=compute chosen=cuda why=\"{}\"", why);
    } else {
      spdlog::info("event=compute chosen=cpu detail=\"drawing on the processor\" no_cuda=\"{}\"",
                   why);
    }
  }

  // Before any thread is made, so that all of them inherit it and only the wait below sees signals.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);

  auto server = throng::server::Server::start(
      options, shared_cast, throng::server::pipeline_renderer(shared_cast, pipeline));
  if (!server.ok()) {
    const bool device = server.status().code() == absl::StatusCode::kUnavailable &&
                        server.status().message().substr(0, 8) != "--listen";
    return fail(device ? kNoDevice : exit_code(server.status()),
                std::string(server.status().message()));
  }
  std::unique_ptr<throng::server::WebDoor> door;
  if (!web.http.empty()) {
    web.insecure = options.listen.insecure;
    auto opened = throng::server::WebDoor::open(web, (*server)->services());
    if (!opened.ok())
      return fail(exit_code(opened.status()), std::string(opened.status().message()));
    door = *std::move(opened);
    std::printf("throng-server page at http://%s/\n", door->address().c_str());
  }
  spdlog::info("event=ready compute={} rasterizer={} detail=\"{}\"",
               (*server)->loop().compute_name(), (*server)->loop().raster_name(),
               (*server)->loop().raster_detail());
  // The one line that scripts wait for.
  std::printf("throng-server ready on %s, cast of %zu, compute %s, raster %s\n",
              (*server)->address().c_str(), shared_cast->members.size(),
              (*server)->loop().compute_name().c_str(), (*server)->loop().raster_name().c_str());
  std::fflush(stdout);

  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("event=draining signal={}", signal);
  // A second signal means now.
  std::thread([signals] {
    int again = 0;
    sigwait(&signals, &again);
    std::_Exit(128 + again);
  }).detach();
  door.reset();
  (*server)->drain();
  spdlog::info("event=stopped");
  return kOk;
}
