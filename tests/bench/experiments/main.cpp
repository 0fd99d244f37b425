// throng-bench: the published experiments, with our numbers beside theirs. Flags and wiring only.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>

#include "bench/experiments/options.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/walkthrough.hpp"
#include "throng/render/gpu.hpp"

namespace throng::bench {
namespace {

volatile std::sig_atomic_t stop_signal = 0;

extern "C" void on_signal(int signal) {
  // a second one means now: the first waits for the frame that is under way
  if (stop_signal != 0) std::_Exit(128 + signal);
  stop_signal = signal;
  stop_requested.store(true);  // lock-free, so allowed here
}

enum ExitCode {
  kOk = 0,
  kInternal = 1,
  kUsage = 2,
  kBadInput = 3,
  kNoRenderer = 4,
  kOutput = 5,
  kLimits = 6
};

constexpr const char* kFooter = R"(Examples:
  throng-bench paper                                  table 2 of Dong & Peng 2019, all budgets
  throng-bench paper --frames 20 --budgets 1,5 --raster gl
  throng-bench paper --size 1920x1080 --json paper.json
  throng-bench paper --selection-camera main.json --reference-camera far.json -o figure5.png
  throng-bench paper --figure 7 --counts 1000,5000,20000
  throng-bench peng2011 --most 8192
  throng-bench beacco2010 --counts 100,1000 --pictures out
  throng-bench quality --agents 1000 --budgets 0.25,1 --pictures out
  throng-bench larkin --json larkin.json              and larkin.png, the plot
  throng-bench sfsm --json sfsm.json
  throng-bench raster                                 visibility against OpenGL on llvmpipe
  throng-bench gpu --json gpu.json                    visibility on a CUDA device
  throng-bench all --json-dir tests/bench/results     those of meshes, in short

Times are wall and, beside them, of all threads on the processor (CPU): on a machine that others use
too, only the second holds. Exit codes: 0 done, 1 internal error, 2 usage, 3 bad input, 4 nothing to
render with, 5 output can't be written, 6 a stated limit is not kept, 130 or 143 stopped by Ctrl-C or SIGTERM.)";

int exit_code(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return kOk;
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kFailedPrecondition:
      return kNoRenderer;
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kInvalidArgument:
      return kBadInput;
    case absl::StatusCode::kPermissionDenied:
      return kOutput;
    case absl::StatusCode::kDataLoss:
      return kLimits;
    default:
      return kInternal;
  }
}

/// The cast that the build put beside the program.
std::string default_cast() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path cast = program.parent_path().parent_path() / "cast";
  return std::filesystem::exists(cast / "cast.json", error) ? cast.string() : std::string();
}

bool parse_size(const std::string& text, render::Viewport& viewport) {
  const std::size_t at = text.find('x');
  unsigned width = 0, height = 0;
  if (at == std::string::npos || !CLI::detail::lexical_cast(text.substr(0, at), width) ||
      !CLI::detail::lexical_cast(text.substr(at + 1), height) || width < 1 || width > 16384 ||
      height < 1 || height > 16384) {
    return false;
  }
  viewport = {width, height};
  return true;
}

struct Flags {
  std::string cast, size, raster = "visibility", lod, geometry, pose;
  bool no_shadows = false;
  Common common;
  PaperOptions paper;
  PengOptions peng;
  BeaccoOptions beacco;
  MixedOptions mixed;
  QualityOptions quality;
  LarkinOptions larkin;
  SfsmOptions sfsm;
  RasterOptions raster_pairs;
  GpuOptions gpu;
};

/// How many of something, from 1.
void add_count(CLI::App& command, const char* name, std::uint32_t& count, std::uint32_t most,
               const char* about) {
  command.add_option(name, count, about)->capture_default_str()->check(CLI::Range(1U, most));
}

void add_common(CLI::App& command, Flags& flags) {
  command
      .add_option("--cast", flags.cast, "Folder of baked characters (default: the built-in cast)")
      ->type_name("DIR");
  command
      .add_option(
          "--size", flags.size,
          "Size of the pictures, px (default 1280x720; figure 5: 640x360 each, raster: 1920x1088)")
      ->type_name("WxH");
  command.add_option("--threads", flags.common.threads, "Worker threads, 0: one for each core")
      ->capture_default_str()
      ->check(CLI::Range(0U, 1024U));
  command.add_option("--json", flags.common.json, "Write all numbers and the machine they are of")
      ->type_name("FILE");
}

/// The crowd, what draws it, and how the budget is dealt out.
void add_crowd(CLI::App& command, Flags& flags, std::uint32_t& agents,
               std::vector<double>& budgets_million, std::string& camera_path) {
  add_count(command, "--agents", agents, 4'000'000, "Instances in the crowd");
  command.add_option("--budgets", budgets_million, "Vertex budgets N, in millions")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0))
      ->type_name("N,N,...");
  command.add_option("--raster", flags.raster, "Rasterizer")
      ->capture_default_str()
      ->check(CLI::IsMember({"gl", "visibility"}));
  command
      .add_option("--lod", flags.lod,
                  "Rule that deals out the budget (default: paper dong2019, quality budget)")
      ->check(CLI::IsMember({"budget", "dong2019"}));
  command
      .add_option("--geometry", flags.geometry,
                  "batched (the published method), fused, or both in turns (default: both, gl "
                  "batched)")
      ->check(CLI::IsMember({"batched", "fused", "both"}));
  command
      .add_option("--pose", flags.pose,
                  "exact: each agent its own; shared: far ones alike (default: batched exact, "
                  "fused shared)")
      ->check(CLI::IsMember({"exact", "shared"}));
  command.add_option("--camera", camera_path, "Camera path (default: the bench's own)")
      ->type_name("FILE");
}

int run(int argc, char** argv) {
  CLI::App app("throng-bench: published crowd rendering experiments, ours beside theirs.");
  app.footer(kFooter);
  app.set_version_flag("--version", "throng-bench " THRONG_VERSION);
  app.require_subcommand(1);
  Flags flags;

  CLI::App* paper =
      app.add_subcommand("paper", "Dong & Peng 2019, table 2: a walkthrough of 30,000");
  add_common(*paper, flags);
  add_crowd(*paper, flags, flags.paper.agents, flags.paper.budgets_million,
            flags.paper.camera_path);
  add_count(*paper, "--frames", flags.paper.frames, Walkthrough::kFrames,
            "Frames, spread over the walkthrough's 1,000");

  std::string compute = "cpu";
  paper->add_option("--compute", compute, "What the stages before the rasterizer run on")
      ->capture_default_str()
      ->check(CLI::IsMember({"cpu", "cuda"}));

  int figure = 0;
  paper->add_option("--figure", figure, "Draw this figure instead of the table")
      ->check(CLI::IsMember({5, 7}));
  paper
      ->add_option("--selection-camera", flags.paper.selection_camera,
                   "Figure 5 with the levels that this camera chooses")
      ->type_name("FILE");
  paper
      ->add_option("--reference-camera", flags.paper.reference_camera,
                   "Figure 5: from where they are looked at")
      ->type_name("FILE");
  paper->add_option("-o,--output", flags.paper.output, "Figure 5: the picture")
      ->capture_default_str()
      ->type_name("FILE.png");

  paper
      ->add_option("--pictures", flags.paper.pictures, "Figure 7: write what each way draws as PNG")
      ->type_name("DIR");
  paper->add_option("--counts", flags.paper.counts, "Figure 7: numbers of instances")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1U, 1'000'000U))
      ->type_name("I,I,...");

  paper
      ->add_option("--quality", flags.paper.quality_places,
                   "Judge quality too, at this many places (needs up to 8 GiB with 30,000)")
      ->check(CLI::Range(0U, 100U))
      ->type_name("PLACES");

  CLI::App* peng = app.add_subcommand(
      "peng2011", "Peng et al. 2011, tables 1 and 2: one character, 32 to 32,768");
  add_common(*peng, flags);
  add_count(*peng, "--frames", flags.peng.frames, 1000, "Frames of each row");
  peng->add_option("--most", flags.peng.most, "Leave out rows with more instances")
      ->capture_default_str()
      ->check(CLI::Range(32U, 32768U));
  peng->add_option("--pictures", flags.peng.pictures, "Write a picture of each row as PNG")
      ->type_name("DIR");

  CLI::App* beacco = app.add_subcommand(
      "beacco2010", "Beacco 2010, figures 4.1, 4.2 and 4.7 to 4.9: relief impostors");
  add_common(*beacco, flags);
  beacco->add_option("--frames", flags.beacco.frames, "Frames of each row")
      ->capture_default_str()
      ->check(CLI::Range(1U, 1000U));
  beacco->add_option("--counts", flags.beacco.counts, "Numbers of agents")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1U, 100'000U))
      ->type_name("I,I,...");
  beacco->add_option("--pictures", flags.beacco.pictures, "Write the figures' pictures as PNG")
      ->type_name("DIR");

  CLI::App* mixed =
      app.add_subcommand("mixed", "The mixed frame against every single form, by quality and time");
  add_common(*mixed, flags);
  mixed->add_option("--agents", flags.mixed.counts, "Numbers of agents")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1U, 4'000'000U))
      ->type_name("I,I,...");
  mixed->add_option("--points", flags.mixed.points_px, "Sizes of points, px")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(0.1, 100.0))
      ->type_name("S,S,...");
  mixed->add_option("--places", flags.mixed.places, "From where: walkthrough, street, above")
      ->delimiter(',')
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, Place>{{"walkthrough", Place::kWalkthrough},
                                                               {"street", Place::kStreet},
                                                               {"above", Place::kAbove}}))
      ->type_name("PLACE,...");
  mixed->add_option("--repeats", flags.mixed.repeats, "Times that each frame is drawn")
      ->capture_default_str()
      ->check(CLI::Range(1U, 100U));
  mixed->add_option("--budgets", flags.mixed.budgets_million, "Vertex budgets of meshes, millions")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0))
      ->type_name("N,N,...");
  mixed->add_option("--errors", flags.mixed.errors_px, "What the mixed frame may be off by, px")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(0.001, 100.0))
      ->type_name("E,E,...");
  mixed
      ->add_option("--oversampling", flags.mixed.oversampling,
                   "Pixels drawn for each of the picture's, along a side: 1, 2 or both")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1U, 2U))
      ->type_name("K,K");
  mixed->add_option("--frames", flags.mixed.frames, "Places of the walkthrough, 2 frames each")
      ->capture_default_str()
      ->check(CLI::Range(1U, 500U));
  mixed->add_option("--pictures", flags.mixed.pictures, "Write what is compared as PNG")
      ->type_name("DIR");

  CLI::App* quality =
      app.add_subcommand("quality", "PSNR, SSIM and flicker of budgets against full detail");
  add_common(*quality, flags);
  add_crowd(*quality, flags, flags.quality.agents, flags.quality.budgets_million,
            flags.quality.camera_path);
  add_count(*quality, "--places", flags.quality.places, 500,
            "Places of the walkthrough, 2 frames each");
  quality->add_flag("--no-shadows", flags.no_shadows, "Draw no contact shadows");
  quality->add_option("--pictures", flags.quality.pictures, "Write what is compared as PNG")
      ->type_name("DIR");

  CLI::App* raster =
      app.add_subcommand("raster", "Visibility rasterizer against gl on identical buffers");
  add_common(*raster, flags);
  add_count(*raster, "--pairs", flags.raster_pairs.pairs, 1000, "Draws by each, in turns");
  raster
      ->add_option("--gl-samples", flags.raster_pairs.gl_samples,
                   "Samples a pixel that gl takes where it is timed")
      ->capture_default_str()
      ->check(CLI::IsMember({1, 4}));
  raster->add_option("--scale", flags.raster_pairs.scale, "Share of the instances that is drawn")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  raster->add_option("--pictures", flags.raster_pairs.pictures, "Write what is compared as PNG")
      ->type_name("DIR");

  CLI::App* gpu =
      app.add_subcommand("gpu", "Visibility on a CUDA device: triangles a second, atomics, memory");
  add_common(*gpu, flags);
  gpu->add_option("--draws", flags.gpu.draws, "Draws of each case")
      ->capture_default_str()
      ->check(CLI::Range(1U, 10'000U));
  gpu->add_option("--camera", flags.gpu.camera_path, "Camera path instead of the walkthrough's")
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
  gpu->add_option("--trajectory", flags.gpu.trajectories, "Draw the crowds of these files instead")
      ->type_name("FILE")
      ->check(CLI::ExistingFile);
  gpu->add_option("--most-agents", flags.gpu.most_agents, "Leave larger crowds out")
      ->capture_default_str();

  CLI::App* larkin =
      app.add_subcommand("larkin", "Larkin et al.: a far crowd under a fixed budget of points");
  add_common(*larkin, flags);
  larkin->add_option("--counts", flags.larkin.counts, "Numbers of agents")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(1U, 4'000'000U))
      ->type_name("I,I,...");
  larkin->add_option("--points", flags.larkin.points, "Budget of points")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{100'000'000}));
  larkin->add_option("--frames", flags.larkin.frames, "Frames of each row")
      ->capture_default_str()
      ->check(CLI::Range(1U, 1000U));
  larkin
      ->add_option("--quality-agents", flags.larkin.quality_agents,
                   "Agents of the crowd whose picture is judged, 0: none")
      ->capture_default_str()
      ->check(CLI::Range(0U, 30'000U));
  larkin->add_option("--pictures", flags.larkin.pictures, "Write what is drawn as PNG")
      ->type_name("DIR");

  CLI::App* sfsm =
      app.add_subcommand("sfsm", "Lyu et al.: frame times under control, targets and views change");
  add_common(*sfsm, flags);
  sfsm->add_option("--agents", flags.sfsm.agents, "Instances in the crowd")
      ->capture_default_str()
      ->check(CLI::Range(1U, 1'000'000U));
  sfsm->add_option("--frames", flags.sfsm.frames, "Frames of each of the two experiments")
      ->capture_default_str()
      ->check(CLI::Range(6U, 100'000U));
  sfsm->add_option("--view-share", flags.sfsm.view_share,
                   "Target of the changing views, a share of the State-0 time")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  sfsm->add_option("--pictures", flags.sfsm.pictures, "Write the last frame of each part as PNG")
      ->type_name("DIR");

  CLI::App* all = app.add_subcommand(
      "all", "paper, figure 7, peng2011, quality and raster, in short, in about ten minutes");
  std::string json_dir;
  all->add_option("--json-dir", json_dir, "Folder of the JSON files")->required()->type_name("DIR");
  all->add_option("--cast", flags.cast, "Folder of baked characters (default: the built-in cast)")
      ->type_name("DIR");
  all->add_option("--threads", flags.common.threads, "Worker threads, 0: one for each core")
      ->check(CLI::Range(0U, 1024U));

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kUsage;
  }
  const auto usage = [](const std::string& message) {
    std::fprintf(stderr, "throng-bench: %s\n", message.c_str());
    return static_cast<int>(kUsage);
  };
  if (!flags.paper.selection_camera.empty() || !flags.paper.reference_camera.empty()) figure = 5;
  if (figure == 7) {
    if (paper->count("--budgets") == 0) flags.paper.budgets_million = {5, 10};
    if (paper->count("--frames") == 0) flags.paper.frames = 5;
  }
  if (figure == 5) {
    if (flags.size.empty()) flags.size = "640x360";
    if (paper->count("--budgets") == 0) flags.paper.budgets_million = {1, 6, 10};
  }
  if (flags.size.empty()) {
    flags.size = *raster || *gpu ? "1920x1088" : *beacco ? "1280x1024" : "1280x720";
  }
  if (!parse_size(flags.size, flags.common.viewport)) {
    return usage("--size: '" + flags.size + "' must be WxH with 1 to 16384 px a side");
  }
  flags.paper.compute = compute == "cuda" ? render::BackendKind::kCuda : render::BackendKind::kCpu;
  const bool only_batched = flags.raster == "gl";
  if (flags.geometry.empty()) flags.geometry = only_batched ? "batched" : "both";
  if (flags.geometry != "batched" && flags.raster == "gl") {
    return usage("--geometry: '" + flags.geometry + "' must be batched with --raster gl");
  }
  std::vector<Form> forms;
  if (flags.geometry != "batched") forms.push_back(kFused);
  if (flags.geometry != "fused") forms.push_back(kBatched);
  for (Form& form : forms) {
    const bool fused = form.geometry == render::GeometryKind::kFused;
    if (flags.pose == "exact") {
      form.pose = render::PoseMode::kExact;
      form.name = fused ? "fused, exact" : "batched, exact";
    } else if (flags.pose == "shared") {
      form.pose = render::PoseMode::kShared;
      form.name = fused ? "fused, shared" : "batched, shared";
    }
  }
  flags.paper.forms = flags.quality.forms = forms;
  flags.paper.raster = flags.quality.raster =
      flags.raster == "gl" ? render::RasterKind::kGl : render::RasterKind::kVisibility;
  if (!flags.lod.empty()) {
    flags.paper.lod = flags.quality.lod =
        flags.lod == "budget" ? render::LodRule::kBudget : render::LodRule::kDong2019;
  }
  flags.quality.shadows = !flags.no_shadows;
  if (flags.cast.empty()) flags.cast = default_cast();
  if (flags.cast.empty()) {
    return usage(
        "no built-in cast beside the program; bake one with "
        "'throng-bake --builtin -o cast' and give --cast cast");
  }
  const auto fail = [](const absl::Status& status) {
    std::fprintf(stderr, "throng-bench: %s\n", std::string(status.message()).c_str());
    return exit_code(status);
  };
  auto cast = render::read_cast(flags.cast);
  if (!cast.ok()) return fail(cast.status());
  flags.common.cast = std::make_shared<const render::Cast>(*std::move(cast));
  flags.common.machine = Machine::describe();

  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  absl::Status status;
  if (*paper) {
    status = figure == 5   ? run_figure5(flags.common, flags.paper)
             : figure == 7 ? run_figure7(flags.common, flags.paper)
                           : run_paper(flags.common, flags.paper);
  }
  if (*gpu) status = run_gpu(flags.common, flags.gpu);
  if (*all) status = run_all(flags.common, json_dir);
  if (*mixed) status = run_mixed(flags.common, flags.mixed);
  if (*beacco) status = run_beacco2010(flags.common, flags.beacco);
  if (*larkin) status = run_larkin(flags.common, flags.larkin);
  if (*sfsm) status = run_sfsm(flags.common, flags.sfsm);
  if (*peng) status = run_peng2011(flags.common, flags.peng);
  if (*quality) status = run_quality(flags.common, flags.quality);
  if (*raster) status = run_raster(flags.common, flags.raster_pairs);
  if (stop_signal != 0) return 128 + stop_signal;
  return status.ok() ? kOk : fail(status);
}

}  // namespace
}  // namespace throng::bench

int main(int argc, char** argv) {
  throng::render::prepare_gpu();
  return throng::bench::run(argc, argv);
}
