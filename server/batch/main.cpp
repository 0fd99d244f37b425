// throng-render: a trajectory and a camera in, numbered pictures or a video out.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <tuple>

#include <absl/strings/str_cat.h>

#include "client/camera/camera_script.hpp"
#include "server/batch/job.hpp"
#include "server/far_options.hpp"
#include "throng/render/gpu.hpp"

namespace {

using throng::server::BatchJob;
using throng::server::BatchOutcome;
using throng::server::ExitCode;

std::atomic<bool> stop_requested = false;
volatile std::sig_atomic_t stop_signal = 0;

extern "C" void on_signal(int signal) {
  // a second one means now: the first waits for the picture, or the file, that is under way
  if (stop_signal != 0) std::_Exit(128 + signal);
  stop_signal = signal;
  stop_requested.store(true);  // lock-free, so allowed here
}

constexpr const char* kOutputs = R"(What is written, by the ending of --output:
  .png .jpg .jpeg    one picture each, sRGB without alpha (--jpeg-quality)
  .mp4 .mkv .mov     one video, H.264 where the system has it, else MPEG-4
  .exr               what --passes depth and id write beside the colours
  -                  PPM pictures, one after the other

)";

constexpr const char* kFooter = R"(Examples:
  throng-render run.sqlite -o out/####.png
  throng-render walk.txt --source-fps 16 --source-unit cm -o walk.mp4 --size 1920x1080
  throng-render run.sqlite -o out/%05d.jpg --frames 1-200x2 --camera path.json
  throng-render run.sqlite -o out/####.png --shard 2/3      (or auto on Slurm and Kubernetes)
  throng-render run.sqlite -o '{camera}.mp4' --camera overview --camera top --camera follow:17
  throng-render --synthetic 30000 --seed 7 -o crowd/####.png --frames 1-25
  throng-render run.sqlite -o '{pass}/####.png' --passes color,depth,id --boxes gt.txt
  throng-render run.csv -o run.mp4 --channel speed --channel-range 0:2 --overlay time,legend --title "Exit B"
  throng-render run.csv -o slow.png --frames 1 --channel speed --color-map plasma --overlay legend
  throng-render run.sqlite -o run.mp4 --fps 30 --cast mine --no-shadows --no-ground --quiet
  throng-render run.sqlite -o out/####.jpg --jpeg-quality 80 --skip-existing --stats stats.jsonl
  throng-render run.sqlite -o site.mp4 --environment site.glb --wall-height 2.5        (or --no-walls)
  throng-render fcd.xml.gz -o town.mp4 --net town.net.xml
  throng-render run.sqlite -o out/####.png --boxes gt.txt --box-extent whole
  throng-render hills.txt -o hills.mp4 --format archive-text --z ground
  throng-render run.sqlite -o paper.png --frames 1 --vertex-budget 5000000 --lod dong2019 --form mesh
  throng-render --synthetic 100000 --synthetic-seconds 4 -o far.mp4 --far density --far-distance 60 --far-points 200000
  throng-render run.sqlite -o run.mp4 --compute cuda --gpu 0 --gpu-memory-mib 8192     (on a GPU)
  throng-render run.sqlite -o run.mp4 --raster visibility --threads 4
  throng-render run.sqlite -o - | ffmpeg -f image2pipe -c:v ppm -framerate 25 -i - walk.webm

Exit codes: 0 all pictures written, 1 internal error, 2 usage, 3 bad input, 4 nothing to render with,
  5 output can't be written, 6 some pictures failed, 130 or 143 stopped by Ctrl-C or SIGTERM.)";

bool parse_pair(const std::string& text, char separator, double& first, double& second) {
  const std::size_t at = text.find(separator);
  if (at == std::string::npos) return false;
  return CLI::detail::lexical_cast(text.substr(0, at), first) &&
         CLI::detail::lexical_cast(text.substr(at + 1), second);
}

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

void show_progress(std::uint32_t done, std::uint32_t total, const std::string& path) {
  static const bool terminal = isatty(STDERR_FILENO) == 1;
  if (path == "-" && !terminal) return;  // the pictures go where the lines would
  if (!terminal) {
    std::printf("frame %u/%u %s\n", done, total, path.c_str());
    std::fflush(stdout);
    return;
  }
  constexpr int kWidth = 40;
  const int filled = static_cast<int>(static_cast<std::uint64_t>(kWidth) * done / total);
  std::fprintf(stderr, "\r[%.*s%*s] %u/%u %s\033[K", filled,
               "########################################", kWidth - filled, "", done, total,
               path.c_str());
  if (done == total) std::fputc('\n', stderr);
}

}  // namespace

int main(int argc, char** argv) {
  throng::render::prepare_gpu();
  CLI::App app{"Turns a trajectory file into pictures of a walking crowd.", "throng-render"};
  app.footer(
      absl::StrCat(kOutputs, throng::client::CameraScript::kFileHelp.data(), "\n\n", kFooter));
  app.failure_message([](const CLI::App* from, const CLI::Error& error) {
    return "throng-render: " + CLI::FailureMessage::simple(from, error);
  });
  app.set_version_flag("--version", "throng-render " THRONG_VERSION);
  BatchJob job;
  std::uint32_t gpu_memory_mib = 0;
  std::string size = "1280x720", unit, z_rule, shard = "1/1", channel_range, lod = "budget",
              form = "mesh", compute = "auto", gpu, raster = "auto", overlay, title,
              passes = "color", box_extent = "visible", color_map = "viridis";
  double source_fps = 0.0;
  app.add_option("trajectory", job.trajectory,
                 "Trajectory file (JuPedSim sqlite, archive text, CSV ...)")
      ->type_name("FILE");
  app.add_option("-o,--output", job.output,
                 "out/####.png, out/%04d.jpg, out/$F4.png; one.png; or one .mp4. {camera} becomes "
                 "the camera's name, {pass} that of the pass; - writes PPM pictures to standard "
                 "output. What each ending holds is told below")
      ->required()
      ->type_name("PATH");
  app.add_option("--cast", job.cast, "Folder of baked characters (default: the built-in cast)")
      ->type_name("DIR");
  app.add_option("--size", size, "Size of the pictures, px")
      ->capture_default_str()
      ->type_name("WxH");
  app.add_option("--fps", job.fps, "Pictures per second of scene time")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 1000.0));
  app.add_option("--frames", job.frames, "Pictures to render, from 1: 5 or 1-100x2,205")
      ->type_name("SPEC");
  app.add_option("--camera", job.cameras,
                 absl::StrCat(throng::client::CameraScript::kSpellings.data(),
                              "; more than once: all of them in one pass"))
      ->capture_default_str()
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false)
      ->type_name("CAMERA");
  app.add_option("--vertex-budget", job.selection.vertex_budget,
                 "Vertices per picture over the crowd, N")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1'000'000'000}));
  app.add_option("--lod", lod, "Rule that deals out the budget")
      ->capture_default_str()
      ->check(CLI::IsMember({"budget", "dong2019"}));
  app.add_option(
         "--form", form,
         "What agents are drawn as: mesh, impostor (a box for each joint), or mixed (each in "
         "the cheapest form that is off by at most half a pixel)")
      ->capture_default_str()
      ->check(CLI::IsMember({"mesh", "impostor", "mixed"}));
  throng::server::add_far_options(app, job.far);
  app.add_option("--shard", shard, "Render part I of N, or auto")
      ->capture_default_str()
      ->type_name("I/N|auto");
  app.add_option("--stats", job.stats, "Write counts and stage times, one JSON line per picture")
      ->type_name("FILE.jsonl");
  app.add_option("--synthetic", job.synthetic_agents,
                 "A walking crowd of this many agents, without a file")
      ->type_name("AGENTS")
      ->check(CLI::Range(1U, 4'000'000U));
  app.add_option("--synthetic-seconds", job.synthetic_seconds, "How long the synthetic crowd walks")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 36000.0));
  app.add_option("--seed", job.seed, "With an agent's id, decides character, colours and size")
      ->capture_default_str();
  app.add_option("--channel", job.channel,
                 "Colour the agents by this column of the file; speed is there always")
      ->type_name("NAME");
  app.add_option("--channel-range", channel_range,
                 "Values at the ends of the colour scale (default 0:1)")
      ->type_name("LOW:HIGH");
  app.add_option("--color-map", color_map, "Colours of the channel")
      ->capture_default_str()
      ->check(CLI::IsMember(std::vector<std::string>(throng::render::kColorMapNames.begin(),
                                                     throng::render::kColorMapNames.end())));
  auto* const environment =
      app.add_option(
             "--environment", job.environment,
             "Site: WKT, GeoJSON, a Vadere scenario or a static glTF (default: what the trajectory "
             "holds)")
          ->type_name("FILE");
  app.add_option("--net", job.net, "SUMO's network (.net.xml, .net.xml.gz): streets on the ground")
      ->type_name("FILE")
      ->excludes(environment);
  app.add_option("--wall-height", job.environment_options.wall_height_m, "Height of walls, m")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 100.0));
  bool no_walls = false;
  app.add_flag("--no-walls", no_walls, "Draw no walls and obstacles");
  app.add_option("--overlay", overlay, "Write into the pictures: time,agents,scale,legend or all")
      ->type_name("ITEMS");
  app.add_option("--passes", passes,
                 "What to write of each picture: color, depth (EXR, Z in metres) and id (EXR, the "
                 "agent of each pixel)")
      ->capture_default_str()
      ->type_name("LIST");
  app.add_option("--boxes", job.boxes,
                 "Write where each agent is in the pictures, as MOTChallenge text")
      ->type_name("FILE.txt");
  app.add_option("--box-extent", box_extent,
                 "visible: around the pixels that show the agent; whole: with what others hide")
      ->capture_default_str()
      ->check(CLI::IsMember({"visible", "whole"}));
  app.add_option("--title", title, "Write this into the pictures")->type_name("TEXT");
  app.add_option("--source-fps", source_fps, "Frame rate of the file, where it does not say")
      ->check(CLI::Range(0.001, 10000.0));
  app.add_option(
         "--source-unit", unit,
         "Unit of length of the file, where it does not say: m, cm, mm or a number of metres")
      ->type_name("UNIT");
  app.add_option("--z", z_rule, "What the file's z is: height of the ground, or to be ignored")
      ->check(CLI::IsMember({"ground", "ignore"}));
  app.add_option("--format", job.read.format,
                 "Format of the file, where it can't be told by content")
      ->check(CLI::IsMember(throng::trajectory::format_names()));
  app.add_option("--jpeg-quality", job.jpeg_quality, "1 to 100")
      ->capture_default_str()
      ->check(CLI::Range(1, 100));
  app.add_option("--compute", compute, "What finds, poses and builds the figures")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}));
  app.add_option("--gpu", gpu, "CUDA device (default: the first)")->type_name("INDEX|UUID");
  app.add_option("--gpu-memory-mib", gpu_memory_mib, "Device memory that may be used, 0: all")
      ->capture_default_str();
  app.add_option("--raster", raster, "Rasterizer")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "gl", "visibility"}));
  app.add_option("--threads", job.pipeline.threads, "Worker threads, 0: one for each core")
      ->capture_default_str()
      ->check(CLI::Range(0U, 1024U));
  app.add_flag("--skip-existing", job.skip_existing, "Leave pictures alone that are there already");
  bool no_shadows = false, no_ground = false;
  app.add_flag("--no-shadows", no_shadows, "Draw no contact shadows");
  app.add_flag("--no-ground", no_ground, "Draw no ground");
  bool quiet = false;
  app.add_flag("-q,--quiet", quiet, "No progress");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    return code == 0 ? 0 : static_cast<int>(ExitCode::kUsage);
  }
  const auto usage = [](const std::string& message) {
    std::fprintf(stderr, "throng-render: %s\n", message.c_str());
    return static_cast<int>(ExitCode::kUsage);
  };

  if (job.trajectory.empty() == (job.synthetic_agents == 0)) {
    return usage("give either a trajectory file or --synthetic AGENTS");
  }
  double width = 0, height = 0;
  const auto fits = [](double side) { return side >= 1 && side <= 16384; };  // false for NaN
  if (!parse_pair(size, 'x', width, height) || !fits(width) || !fits(height)) {
    return usage("--size: '" + size + "' must be WxH with 1 to 16384 px a side");
  }
  job.viewport = {static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)};
  if (!channel_range.empty()) {
    const auto range = throng::client::parse_range(channel_range);
    if (!range.ok()) return usage(std::string(range.status().message()));
    std::tie(job.channel_low, job.channel_high) = *range;
  }
  job.color_map = *throng::render::color_map_of(color_map);
  const auto parsed_overlay = throng::server::parse_overlay(overlay);
  if (!parsed_overlay.ok()) return usage(std::string(parsed_overlay.status().message()));
  job.overlay = *parsed_overlay;
  job.overlay.title = title;
  const auto parsed_passes = throng::server::parse_passes(passes);
  if (!parsed_passes.ok()) return usage(std::string(parsed_passes.status().message()));
  job.passes = *parsed_passes;
  job.box_extent = box_extent == "whole" ? throng::server::BoxExtent::kWhole
                                         : throng::server::BoxExtent::kVisible;
  const auto parsed_shard = throng::server::parse_shard(shard);
  if (!parsed_shard.ok()) return usage(std::string(parsed_shard.status().message()));
  job.shard = *parsed_shard;
  if (source_fps > 0) job.read.source_fps = source_fps;
  if (!unit.empty()) {
    const auto metres = throng::trajectory::parse_unit(unit);
    if (!metres.ok()) return usage(std::string(metres.status().message()));
    job.read.source_unit_m = *metres;
  }
  job.read.ground_z = z_rule == "ground";
  job.selection.rule =
      lod == "dong2019" ? throng::render::LodRule::kDong2019 : throng::render::LodRule::kBudget;
  if (form == "mixed") job.selection.form = throng::render::FormRule::kMixed;
  if (form == "impostor") job.selection.form = throng::render::FormRule::kImpostor;
  job.pipeline.raster = raster == "gl"           ? throng::render::RasterKind::kGl
                        : raster == "visibility" ? throng::render::RasterKind::kVisibility
                                                 : throng::render::RasterKind::kAuto;
  if (gpu_memory_mib > 0) throng::render::limit_gpu_memory(std::uint64_t{gpu_memory_mib} << 20);
  if (!gpu.empty()) {
    if (absl::Status status = throng::render::choose_gpu(gpu); !status.ok()) {
      return usage(absl::StrCat("--gpu: ", status.message()));
    }
  }
  std::string why;
  if (compute == "cuda" || (compute == "auto" && throng::render::best_backend(why) ==
                                                     throng::render::BackendKind::kCuda)) {
    job.pipeline.backend = throng::render::BackendKind::kCuda;
  }
  job.walls = !no_walls;
  job.look.shadows = !no_shadows;
  job.look.ground = !no_ground;
  if (job.cast.empty()) job.cast = default_cast();
  if (job.cast.empty()) {
    return usage(
        "no built-in cast beside the program; bake one with "
        "'throng-bake --builtin -o cast' and give --cast cast");
  }

  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  if (job.output == "-") std::signal(SIGPIPE, SIG_IGN);  // then it is an error as any other
  const BatchOutcome outcome = throng::server::run_batch(
      job, quiet ? throng::server::BatchProgress() : show_progress, stop_requested);
  for (const std::string& note : outcome.notes) {
    std::fprintf(stderr, "throng-render: note: %s\n", note.c_str());
  }
  if (!outcome.error.empty()) std::fprintf(stderr, "throng-render: %s\n", outcome.error.c_str());
  if (!quiet && (outcome.error.empty() || outcome.written + outcome.skipped > 0)) {
    std::fprintf(stderr, "throng-render: %u written, %u there already\n", outcome.written,
                 outcome.skipped);
  }
  if (stop_signal != 0) return 128 + stop_signal;
  return static_cast<int>(outcome.code);
}
