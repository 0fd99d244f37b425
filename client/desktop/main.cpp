// throng-view: a crowd in a window. Flags and wiring only.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "client/cli/connection_flags.hpp"
#include "client/desktop/view_text.hpp"
#include "client/desktop/window.hpp"

namespace {

enum ExitCode : int { kOk = 0, kFailure = 1, kUsage = 2 };

constexpr const char* kFooter =
    R"(Drag turns, right drag moves, the wheel comes nearer, a click follows a person; ? shows all keys.
Examples:
  throng-view
  throng-view --server host:7447 --crowd station --size 1600x900
  throng-view --crowd station --channel speed --channel-range 0:2 --color-map magma --overlays time,scale
  throng-view --crowd station --camera follow:17
  throng-view --view 'crowd=station&cam=1,2,0,15,-60,30&t=3.2&show=grid,time'
  throng-view --crowd station --screenshot station.png
  throng-view --crowd station --script tour.txt --json --patience 120
  throng-view --server grpcs://host:7447 --ca-file ca.pem --token-file token
  throng-view --crowd station --scale 1.5 --fps 60 --sharpness fine --vertex-budget 2000000
  throng-view --crowd station --pictures shots

A script has lines such as: wait frames>2, click 640 380, drag 100 100 300 120 right, wheel 3 640 380,
key T, press W, release W, size 800 600, state out.jsonl, screenshot out.png.
Exit codes: 0 done, 1 failure, 2 usage.)";

CLI::ValidationError refused(const absl::Status& status) {
  return CLI::ValidationError(std::string(status.message()));
}

int fail(const absl::Status& status) {
  std::fprintf(stderr, "throng-view: %s\n", std::string(status.message()).c_str());
  return absl::IsInvalidArgument(status) ? kUsage : kFailure;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace throng::client;
  WindowSettings settings;
  std::string size = "1280x720", overlays, script, camera = "overview", channel_range,
              color_map = "viridis", view;
  CLI::App app{"Shows a crowd that a throng server draws, in a window.", "throng-view"};
  app.failure_message([](const CLI::App* from, const CLI::Error& error) {
    return "throng-view: " + CLI::FailureMessage::simple(from, error);
  });
  app.footer(kFooter);
  app.set_version_flag("--version", "throng-view " THRONG_VERSION);
  add_connection(app, settings.connection);
  app.add_option("--crowd", settings.viewer.crowd,
                 "Name of the crowd (default: the only one, or the one chosen in the window)");
  app.add_option("--size", size, "WIDTHxHEIGHT of the window, px")->capture_default_str();
  app.add_option("--scale", settings.scale,
                 "Size of text and buttons (default: as the screen's dots per inch ask for)")
      ->check(CLI::Range(0.5, 4.0));
  app.add_option("--camera", camera,
                 absl::StrCat("Where it begins: ", CameraScript::kSpellings.data()))
      ->capture_default_str()
      ->type_name("CAMERA");
  auto* const view_option =
      app.add_option("--view", view,
                     "All of a view as the page's address has it behind #, or that address; the "
                     "state of --json has it as 'view'")
          ->type_name("TEXT");
  app.add_option("--channel", settings.viewer.channel, "Colour agents by this channel");
  app.add_option("--channel-range", channel_range,
                 "Values at the ends of the colour scale (default: those in view)")
      ->type_name("LOW:HIGH");
  auto* const map_option =
      app.add_option("--color-map", color_map, "Colours of the channel")
          ->capture_default_str()
          ->check(CLI::IsMember(std::vector<std::string>(throng::render::kColorMapNames.begin(),
                                                         throng::render::kColorMapNames.end())));
  app.add_option("--overlays", overlays, "Of ids,trails,density,grid,scale,time");
  app.add_option("--fps", settings.viewer.rate_hz, "Frames per second at most")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 1000.0));
  app.add_option("--vertex-budget", settings.viewer.vertex_budget,
                 "Vertices per frame (0: the server decides)")
      ->capture_default_str();
  app.add_option("--sharpness", settings.viewer.sharpness,
                 "Pixels drawn for each of the window's, along a side: half for a slow network, "
                 "fine for less aliasing")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, double>{{"half", 0.5}, {"normal", 1.0}, {"fine", 2.0}}));
  app.add_option("--pictures", settings.pictures, "Folder that P and R save to")
      ->capture_default_str()
      ->type_name("DIR");
  app.add_option("--screenshot", settings.screenshot,
                 "Write the first picture of a hidden window, and end")
      ->type_name("FILE.png");
  app.add_option("--script", script, "Play these events in a hidden window, and end")
      ->type_name("FILE");
  app.add_option("--patience", settings.patience_s, "Seconds a screenshot or script waits at most")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 86400.0));
  app.add_flag("--json", settings.prints_state, "Print what was shown as JSON, at the end");
  try {
    app.parse(argc, argv);
    unsigned width = 0, height = 0;
    char rest = 0;
    if (std::sscanf(size.c_str(), "%5ux%5u%c", &width, &height, &rest) != 2 || width < 64 ||
        height < 64 || width > 8192 || height > 8192) {
      throw CLI::ValidationError("--size",
                                 "'" + size + "' is not WIDTHxHEIGHT with 64 to 8192 px a side");
    }
    settings.width_px = width;
    settings.height_px = height;
    auto parsed_camera = CameraScript::parse(camera);
    if (!parsed_camera.ok()) throw refused(parsed_camera.status());
    settings.viewer.camera = *std::move(parsed_camera);
    if (!channel_range.empty()) {
      const auto range = parse_range(channel_range);
      if (!range.ok()) throw refused(range.status());
      settings.viewer.range = *range;
    }
    settings.viewer.color_map = *throng::render::color_map_of(color_map);
    if (view_option->count() > 0) {
      const auto parsed = parse_view_text(view);
      if (!parsed.ok()) throw refused(parsed.status());
      if (settings.viewer.crowd.empty()) settings.viewer.crowd = parsed->crowd;
      settings.viewer.held = parsed->camera;
      settings.viewer.follow = parsed->follow;
      settings.viewer.time_us = parsed->time_us;
      settings.viewer.speed = parsed->speed;
      if (settings.viewer.channel.empty()) settings.viewer.channel = parsed->channel;
      if (!settings.viewer.range) settings.viewer.range = parsed->range;
      if (map_option->count() == 0) settings.viewer.color_map = parsed->color_map;
      if (overlays.empty()) overlays = absl::StrJoin(parsed->show, ",");
    }
    std::stringstream names(overlays);
    for (std::string name; std::getline(names, name, ',');) {
      const auto* const found = std::find_if(std::begin(kOverlayNames), std::end(kOverlayNames),
                                             [&](const char* one) { return name == one; });
      if (found == std::end(kOverlayNames)) {
        throw CLI::ValidationError("--overlays", "'" + name + "' is not one of ids, trails, " +
                                                     "density, grid, scale, time");
      }
      settings.viewer.overlays.set(static_cast<std::size_t>(found - std::begin(kOverlayNames)));
    }
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kUsage;
  }
  if (!script.empty()) {
    std::ifstream file(script, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    if (!file) return fail(absl::InvalidArgumentError(script + ": can't be read"));
    auto steps = parse_script(text);
    if (!steps.ok()) {
      return fail(
          absl::InvalidArgumentError(script + ": " + std::string(steps.status().message())));
    }
    settings.script = *std::move(steps);
  }
  const absl::Status status = run_window(settings);
  return status.ok() ? kOk : fail(status);
}
