// throng-bake: flags and wiring; the work is in bake/.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "simplify/bake/export_obj.hpp"
#include "simplify/bake/inspect.hpp"
#include "simplify/bake/jobs.hpp"
#include "simplify/builtin/builtin.hpp"
#include "simplify/report/report.hpp"
#include "simplify/report/sheet.hpp"

namespace {

enum ExitCode { kOk = 0, kInternal = 1, kUsage = 2, kBadInput = 3, kUnwritable = 5 };

int exit_code(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return kOk;
    case absl::StatusCode::kInternal:
      return kInternal;
    case absl::StatusCode::kUnavailable:
      return kUnwritable;
    default:
      return kBadInput;
  }
}

int fail(const absl::Status& status) {
  std::fprintf(stderr, "throng-bake: error: %s\n", std::string(status.message()).c_str());
  return exit_code(status);
}

constexpr const char* kFooter = R"(Examples:
  throng-bake --builtin -o cast                     the cast that comes with throng
  throng-bake guest.glb host.glb -o cast            adds two characters to the folder
  throng-bake giant.glb --height 1.75 -o cast       scales to the height of a person
  throng-bake plain.glb --clips moves.glb -o cast   takes clips from another file
  throng-bake a.glb --name guest -o cast --force    under another name, also where nothing changed
  throng-bake big.glb -o cast --texture 1024 --coarsest 60 --jobs 4
  throng-bake big.glb -o cast --criterion peng2011 --poses 12    how collapses are chosen
  throng-bake big.glb -o cast --relief-texel 4      finer impostors; 0: none
  throng-bake big.glb -o cast --relief-uniform 128  as published (Beacco 2010)
  throng-bake inspect cast                          counts, beside table 1 of Dong & Peng 2019
  throng-bake inspect cast/guest.throng --json
  throng-bake report cast -o report                 pictures and figures of every level
  throng-bake sheet cast -o sheet.png               one picture of everybody
  throng-bake export cast/guest.throng --vertices 200 -o lod.obj

Inputs that did not change since they were baked into the folder are left alone.
Exit codes: 0 done, 1 internal error, 2 usage, 3 an input is bad (the others are baked), 5 not writable.)";

/// One line that is written over on a terminal; nothing elsewhere.
class ProgressLine {
 public:
  explicit ProgressLine(const char* what) : what_(what) {}
  void clear() {
    if (is_terminal_ && shown_ >= 0) std::fputs("\r\033[K", stderr);
    shown_ = -1;
  }
  void show(float share) {
    const int percent = static_cast<int>(share * 100.0F);
    if (!is_terminal_ || percent == shown_) return;
    shown_ = percent;
    std::fprintf(stderr, "\r%s %3d %%", what_, percent);
    std::fflush(stderr);
  }

 private:
  const char* what_;
  bool is_terminal_ = ::isatty(STDERR_FILENO) != 0;
  int shown_ = -1;
};

/// What an interrupted bake leaves of a folder that it made: nothing, unless something is in it.
std::string made_folder;

extern "C" void on_interrupt(int signal) {
  ::rmdir(made_folder.c_str());  // may be called here; refuses a folder that holds something
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

int run_bake(throng::simplify::JobOptions& options) {
  if (!std::filesystem::exists(options.folder)) {
    made_folder = options.folder;
    std::signal(SIGINT, on_interrupt);
    std::signal(SIGTERM, on_interrupt);
  }
  ProgressLine progress("baking");
  options.say = [&](const std::string& line) {
    progress.clear();
    std::fprintf(stderr, "%s\n", line.c_str());
  };
  options.on_progress = [&](float share) { progress.show(share); };
  throng::simplify::JobSummary summary;
  const absl::Status status = throng::simplify::run_jobs(options, summary);
  progress.clear();
  if (!status.ok()) return fail(status);
  std::fprintf(stderr, "%d baked, %d unchanged, %d failed; cast in %s\n", summary.baked,
               summary.unchanged, summary.failed, options.folder.c_str());
  if (summary.is_internal) return kInternal;
  if (summary.is_unwritable) return kUnwritable;
  return summary.failed > 0 ? kBadInput : kOk;
}

int run_inspect(const std::vector<std::string>& inputs, bool as_json) {
  int code = kOk;
  std::vector<throng::render::Character> several;
  const auto files = throng::simplify::find_baked(inputs);
  if (!files.ok()) return fail(files.status());
  for (const throng::simplify::BakedFile& file : *files) {
    auto character = throng::render::read_character(file.path);
    if (!character.ok()) {
      code = fail(character.status());
      continue;
    }
    const std::uint64_t bytes = std::filesystem::file_size(file.path);
    if (as_json) {
      std::fputs(throng::simplify::inspect_json(*character, bytes).c_str(), stdout);
    } else if (files->size() == 1) {
      std::fputs(throng::simplify::inspect_text(*character, bytes).c_str(), stdout);
    } else {
      several.push_back(*std::move(character));
    }
  }
  if (!several.empty()) std::fputs(throng::simplify::inspect_table(several).c_str(), stdout);
  return code;
}

int run_report(throng::simplify::ReportOptions& options, bool as_json) {
  ProgressLine progress("measuring");
  options.say = [&](const std::string& line) {
    progress.clear();
    std::fprintf(stderr, "%s\n", line.c_str());
  };
  options.on_progress = [&](float share) { progress.show(share); };
  const auto result = throng::simplify::write_report(options);
  progress.clear();
  if (!result.ok()) return fail(result.status());
  if (as_json) std::fputs(throng::simplify::report_json(*result).c_str(), stdout);
  std::fprintf(stderr, "%zu characters in %.1f s; see %s/index.html\n", result->characters.size(),
               result->seconds, options.folder.c_str());
  return result->errors.empty() ? kOk : kBadInput;
}

int run_export(const std::string& path, std::uint32_t vertices, const std::string& out) {
  const auto character = throng::render::read_character(path);
  if (!character.ok()) return fail(character.status());
  const absl::Status status = throng::simplify::export_obj(*character, vertices, out);
  return status.ok() ? kOk : fail(status);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Bakes animated characters into what throng draws: one mesh with every level of detail,\n"
      "its skeleton, clips and texture.");
  app.footer(kFooter);
  app.failure_message([](const CLI::App* from, const CLI::Error& error) {
    return "throng-bake: " + CLI::FailureMessage::simple(from, error);
  });

  throng::simplify::JobOptions options;
  options.jobs = std::max(1U, std::thread::hardware_concurrency());
  std::string criterion = "throng";
  std::vector<std::string> inputs;
  app.add_option("inputs", inputs, "glTF 2.0 files (.glb, .gltf)");
  app.add_flag("--builtin", options.builtin, "Bake the built-in cast");
  app.add_option("-o,--out", options.folder, "Folder of the cast");
  app.add_option("--name", options.name, "Name of the character, for one input");
  app.add_option("--clips", options.clip_files,
                 "Files whose clips are added, matched by joint name")
      ->take_all()
      ->expected(1)
      ->allow_extra_args(false);
  app.add_option("--height", options.bake.height_m, "Scale to this height, metres")
      ->check(CLI::Range(0.01, 1000.0));
  app.add_option("--criterion", criterion, "What decides on collapses")
      ->check(CLI::IsMember({"throng", "peng2011"}))
      ->capture_default_str();
  app.add_option("--poses", options.bake.max_poses, "Poses that the default criterion looks at")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--coarsest", options.bake.coarsest_count, "Vertices of the coarsest level")
      ->check(CLI::Range(4, 100000))
      ->capture_default_str();
  app.add_option("--texture", options.bake.rebuild.max_texture_px, "Widest texture, pixels")
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  float relief_texel_mm = 1000.0F * options.relief.texel_m;
  app.add_option("--relief-texel", relief_texel_mm,
                 "Texels of the relief impostor, mm (heads half of it); 0 leaves it out")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  app.add_option("--relief-uniform", options.relief.uniform_px,
                 "Every face of the relief impostor has so many texels a side (Beacco 2010: 128)")
      ->check(CLI::Range(4, 1024));
  app.add_option("-j,--jobs", options.jobs, "Characters baked at a time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_flag("--force", options.force, "Bake unchanged inputs, too");

  CLI::App* inspect = app.add_subcommand("inspect", "Tells what is in baked characters");
  inspect->footer(
      "Examples:\n"
      "  throng-bake inspect cast\n"
      "  throng-bake inspect cast/guest.throng --json");
  std::vector<std::string> inspected;
  bool as_json = false;
  inspect->add_option("cast", inspected, "Folder of a cast, or .throng files")->required();
  inspect->add_flag("--json", as_json, "As JSON, one object for each character");

  CLI::App* export_level =
      app.add_subcommand("export", "Writes one level of detail as Wavefront OBJ");
  export_level->footer(
      "Examples:\n"
      "  throng-bake export cast/guest.throng -o guest.obj\n"
      "  throng-bake export cast/guest.throng --vertices 200 -o lod.obj");
  std::string exported, exported_to;
  std::uint32_t vertices = 0;
  export_level->add_option("file", exported, "Baked character (.throng)")->required();
  export_level->add_option("--vertices", vertices, "At most so many vertices (default: all)");
  export_level->add_option("-o,--out", exported_to, "OBJ file to write")->required();

  CLI::App* report =
      app.add_subcommand("report", "Measures every level of baked characters, and shows them");
  report->footer(
      "Examples:\n"
      "  throng-bake report cast -o report\n"
      "  throng-bake report cast -o report --characters guest,host --meshoptimizer "
      ".venv/bin/python\n"
      "  throng-bake report cast -o report --peng2011 teacher --views 8 --poses 8 --json\n"
      "  throng-bake report cast -o report --attribute-weights 0.2 1 --jobs 4");
  throng::simplify::ReportOptions report_options;
  report_options.jobs = std::max(1U, std::thread::hardware_concurrency());
  report_options.python = "python3";
  bool report_json = false;
  std::vector<float> attribute_weights;
  report->add_option("cast", report_options.inputs, "Folder of a cast, or .throng files")
      ->required();
  report->add_option("-o,--out", report_options.folder, "Folder of the report")->required();
  report->add_option("--characters", report_options.characters, "Only these, by name")
      ->delimiter(',')
      ->allow_extra_args(false);
  report->add_option("--views", report_options.measure.views, "Views around each pose")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  report->add_option("--poses", report_options.measure.poses, "Poses of each character")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  report
      ->add_option("--meshoptimizer", report_options.python,
                   "Python that has the package meshoptimizer, for its attribute-aware\n"
                   "simplification; '' leaves it out")
      ->capture_default_str();
  report
      ->add_option("--attribute-weights", attribute_weights,
                   "What normals and texture coordinates weigh there (default 0.2 1)")
      ->expected(2)
      ->check(CLI::Range(0.0, 1000.0));
  report
      ->add_option("--peng2011", report_options.peng2011,
                   "Adds figures 2 and 3 of Peng et al. 2011 with this character of the\n"
                   "built-in cast")
      ->check(CLI::IsMember(throng::builtin::builtin_names()));
  report->add_option("-j,--jobs", report_options.jobs, "Characters measured at a time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  report->add_flag("--json", report_json, "Writes the summary as JSON to standard output, too");

  CLI::App* sheet = app.add_subcommand("sheet", "Draws everybody of a cast on one picture");
  sheet->footer(
      "Examples:\n"
      "  throng-bake sheet cast -o sheet.png\n"
      "  throng-bake sheet cast -o two.png --characters guest,host --figure-px 600");
  throng::simplify::SheetOptions sheet_options;
  sheet->add_option("cast", sheet_options.inputs, "Folder of a cast, or .throng files")->required();
  sheet->add_option("-o,--out", sheet_options.path, "PNG file to write")->required();
  sheet->add_option("--characters", sheet_options.characters, "Only these, by name")
      ->delimiter(',')
      ->allow_extra_args(false);
  sheet->add_option("--figure-px", sheet_options.figure_px, "Height of the tallest figure of a row")
      ->check(CLI::Range(40, 2000))
      ->capture_default_str();

  try {
    app.parse(argc, argv);
    if (app.get_subcommands().empty()) {
      if (!options.builtin && inputs.empty())
        throw CLI::ValidationError("nothing to bake: name files or --builtin");
      if (options.folder.empty()) throw CLI::RequiredError("-o,--out");
    }
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kUsage;
  }
  options.inputs = inputs;
  options.relief.texel_m = 0.001F * relief_texel_mm;
  if (criterion == "peng2011") options.bake.criterion = throng::simplify::Criterion::kPeng2011;

  if (*inspect) return run_inspect(inspected, as_json);
  if (attribute_weights.size() == 2) {
    report_options.measure.attribute_weights.normal = attribute_weights[0];
    report_options.measure.attribute_weights.uv = attribute_weights[1];
  }
  if (*report) return run_report(report_options, report_json);
  if (*sheet) {
    const absl::Status status = throng::simplify::write_sheet(sheet_options);
    return status.ok() ? kOk : fail(status);
  }
  if (*export_level)
    return run_export(exported, vertices == 0 ? 0xFFFFFFFFU : vertices, exported_to);
  return run_bake(options);
}
