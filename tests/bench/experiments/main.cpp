// throng-bench: the published experiments, with our numbers beside theirs. Flags and wiring only.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "bench/experiments/options.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/walkthrough.hpp"

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
  throng-bench raster                                 visibility against OpenGL on llvmpipe

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
  std::string cast, size, raster = "visibility", lod = "dong2019";
  Common common;
  PaperOptions paper;
  RasterOptions raster_pairs;
};

void add_common(CLI::App& command, Flags& flags) {
  command
      .add_option("--cast", flags.cast, "Folder of baked characters (default: the built-in cast)")
      ->type_name("DIR");
  command
      .add_option("--size", flags.size,
                  "Size of the pictures, px (default 1280x720; raster: 1920x1088)")
      ->type_name("WxH");
  command.add_option("--threads", flags.common.threads, "Worker threads, 0: one for each core")
      ->capture_default_str()
      ->check(CLI::Range(0U, 1024U));
  command.add_option("--json", flags.common.json, "Write all numbers and the machine they are of")
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
  paper->add_option("--agents", flags.paper.agents, "Instances in the crowd")
      ->capture_default_str()
      ->check(CLI::Range(1U, 4'000'000U));
  paper->add_option("--budgets", flags.paper.budgets_million, "Vertex budgets N, in millions")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0))
      ->type_name("N,N,...");
  paper->add_option("--frames", flags.paper.frames, "Frames, spread over the walkthrough's 1,000")
      ->capture_default_str()
      ->check(CLI::Range(1U, Walkthrough::kFrames));
  paper->add_option("--raster", flags.raster, "Rasterizer")
      ->capture_default_str()
      ->check(CLI::IsMember({"gl", "visibility"}));
  paper->add_option("--lod", flags.lod, "Rule that deals out the budget")
      ->capture_default_str()
      ->check(CLI::IsMember({"budget", "dong2019"}));
  paper->add_option("--camera", flags.paper.camera_path, "Camera path (default: the bench's own)")
      ->type_name("FILE");

  CLI::App* raster =
      app.add_subcommand("raster", "Visibility rasterizer against gl on identical buffers");
  add_common(*raster, flags);
  raster->add_option("--pairs", flags.raster_pairs.pairs, "Draws by each, in turns")
      ->capture_default_str()
      ->check(CLI::Range(1U, 1000U));
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

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kUsage;
  }
  const auto usage = [](const std::string& message) {
    std::fprintf(stderr, "throng-bench: %s\n", message.c_str());
    return static_cast<int>(kUsage);
  };
  if (flags.size.empty()) flags.size = *raster ? "1920x1088" : "1280x720";
  if (!parse_size(flags.size, flags.common.viewport)) {
    return usage("--size: '" + flags.size + "' must be WxH with 1 to 16384 px a side");
  }
  flags.paper.raster =
      flags.raster == "gl" ? render::RasterKind::kGl : render::RasterKind::kVisibility;
  flags.paper.lod = flags.lod == "budget" ? render::LodRule::kBudget : render::LodRule::kDong2019;
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
  const absl::Status status =
      *raster ? run_raster(flags.common, flags.raster_pairs) : run_paper(flags.common, flags.paper);
  if (stop_signal != 0) return 128 + stop_signal;
  return status.ok() ? kOk : fail(status);
}

}  // namespace
}  // namespace throng::bench

int main(int argc, char** argv) { return throng::bench::run(argc, argv); }
