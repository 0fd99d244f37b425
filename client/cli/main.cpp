// throng: the thin client on the command line. Flags and wiring only.
#include <CLI/CLI.hpp>
#include <cstdlib>
#include <string>
#include <vector>

#include "client/cli/commands.hpp"
#include "client/cli/connection_flags.hpp"
#include "client/cli/interrupt.hpp"
#include "throng/render/color_map.hpp"
#include "throng/trajectory/writer.hpp"

namespace {

using namespace throng::client;

void add_reading(CLI::App& app, throng::trajectory::ReadOptions& read, std::string& unit,
                 std::string& z) {
  app.add_option("--source-fps", read.source_fps, "Frames per second, where the file does not say");
  app.add_option("--source-unit", unit,
                 "Unit of length, where the file does not say: m, cm, mm or a number of metres")
      ->type_name("UNIT");
  app.add_option("--z", z, "What the file's z is: height of the ground, or to be ignored")
      ->check(CLI::IsMember({"ground", "ignore"}))
      ->capture_default_str();
  app.add_option("--format", read.format, "Format, where content does not tell")
      ->check(CLI::IsMember(throng::trajectory::format_names()));
}

void finish_reading(throng::trajectory::ReadOptions& read, const std::string& unit,
                    const std::string& z) {
  if (!unit.empty()) {
    const auto metres = throng::trajectory::parse_unit(unit);
    if (!metres.ok()) throw CLI::ValidationError(std::string(metres.status().message()));
    read.source_unit_m = *metres;
  }
  read.ground_z = z == "ground";
}

/// Options of a view as they are spelled.
struct ViewTexts {
  std::string size = "1280x720", camera = "overview", channel_range;
};

void add_view(CLI::App& app, ViewCommand& view, ViewTexts& texts) {
  app.add_option("--crowd", view.crowd, "Name of the crowd")->required();
  app.add_option("--size", texts.size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  app.add_option("--quality", view.quality, "JPEG quality")
      ->capture_default_str()
      ->check(CLI::Range(1, 100));
  app.add_option("--vertex-budget", view.vertex_budget,
                 "Vertices per frame (0: the server decides)")
      ->capture_default_str();
  app.add_option("--camera", texts.camera, std::string(CameraScript::kSpellings))
      ->capture_default_str()
      ->type_name("CAMERA");
  app.add_option("--channel", view.channel, "Colour agents by this channel");
  app.add_option("--channel-range", texts.channel_range,
                 "Values at the ends of the colour scale (default 0:2)")
      ->type_name("LOW:HIGH");
  app.add_option("--color-map", view.color_map, "Colours of the channel")
      ->capture_default_str()
      ->check(CLI::IsMember(std::vector<std::string>(throng::render::kColorMapNames.begin(),
                                                     throng::render::kColorMapNames.end())));
  app.add_option("--wait", view.wait_s, "Seconds to wait for server and crowd")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86400.0));
}

void add_rate(CLI::App& app, ViewCommand& view) {
  app.add_option("--fps", view.fps, "Frames per second at most")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 1000.0));
}

/// Checks what CLI11 can't; exits with 2 through CLI11's own way of telling.
void finish_view(ViewCommand& view, const ViewTexts& texts) {
  unsigned width = 0, height = 0;
  char rest = 0;
  if (std::sscanf(texts.size.c_str(), "%5ux%5u%c", &width, &height, &rest) != 2) {
    throw CLI::ValidationError("--size", "'" + texts.size + "' is not WIDTHxHEIGHT");
  }
  view.width_px = width;
  view.height_px = height;
  auto camera = CameraScript::parse(texts.camera);
  if (!camera.ok()) throw CLI::ValidationError(std::string(camera.status().message()));
  view.camera = *std::move(camera);
  if (texts.channel_range.empty()) return;
  const auto range = parse_range(texts.channel_range);
  if (!range.ok()) throw CLI::ValidationError(std::string(range.status().message()));
  view.channel_low = range->first;
  view.channel_high = range->second;
}

}  // namespace

int main(int argc, char** argv) {
  Common common;
  PublishCommand publish;
  RecordCommand record;
  SnapshotCommand snapshot;
  ViewCommand watch;
  ConvertCommand convert;
  std::string publish_unit, publish_z = "ignore", info_unit, info_z = "ignore";
  std::string convert_unit, convert_z = "ground", info_file, removed;
  ViewTexts record_text, snapshot_text, watch_text;
  watch_text.size = "320x180";
  throng::trajectory::ReadOptions info_read;
  std::optional<double> watch_seconds;
  bool crowds_json = false, info_json = false, doctor_json = false, remove_json = false;

  CLI::App app{"Publishes crowds to a throng server and shows what it draws.", "throng"};
  app.set_version_flag("--version", THRONG_VERSION);
  app.failure_message([](const CLI::App* from, const CLI::Error& error) {
    return "throng: " + CLI::FailureMessage::simple(from, error);
  });
  app.require_subcommand(1);
  app.fallthrough();
  app.add_flag("--quiet,-q", common.quiet, "No progress");
  add_connection(app, common.connection);
  app.footer(
      "Examples:\n"
      "  throng publish run.sqlite --crowd station --loop\n"
      "  throng record --crowd station -o station.mp4 --seconds 10\n"
      "  throng record --crowd station -o frames/####.jpg --camera \"0,-20,8:0,0,1\" --frames 30\n"
      "  throng snapshot --crowd station -o station.png\n"
      "  throng crowds --json\n"
      "  throng remove station\n"
      "  throng info run.sqlite\n"
      "  throng convert run.sqlite run.csv\n"
      "  throng doctor\n"
      "  throng --quiet --server grpcs://host:7447 --ca-file ca.pem --token-file token crowds\n"
      "Exit codes: 0 done, 1 failure, 2 usage, 3 bad input, 130 and 143 interrupted.");

  CLI::App* publish_app = app.add_subcommand("publish", "Play a trajectory file to a crowd");
  publish_app->footer(
      "Examples:\n"
      "  throng publish run.sqlite --crowd station --loop\n"
      "  throng publish walk.txt --crowd lab --source-fps 16 --source-unit cm --rate 2\n"
      "  throng publish city.csv --crowd city --wait 60 --take-over --seed 7\n"
      "  throng publish postvis.traj --crowd hall --environment hall.scenario\n"
      "  throng publish fcd.xml.gz --crowd town --net town.net.xml.gz\n"
      "  throng publish hills.txt --crowd hills --format archive-text --z ground");
  publish_app->add_option("file", publish.file, "JuPedSim sqlite, archive text, CSV, ...")
      ->required();
  publish_app->add_option("--crowd", publish.crowd, "Name of the crowd")->required();
  publish_app->add_option("--rate", publish.rate, "Times as fast as the file says")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 1000.0));
  publish_app->add_flag("--loop", publish.loop, "Begin again at the end, until interrupted");
  publish_app->add_flag("--take-over", publish.take_over, "End another producer of this crowd");
  publish_app->add_option("--seed", publish.seed,
                          "With an agent's id, decides who it is (default: as recorded, else 0)");
  publish_app
      ->add_option("--environment", publish.environment,
                   "WKT, GeoJSON or Vadere scenario of the site (default: what the file holds)")
      ->check(CLI::ExistingFile);
  publish_app
      ->add_option("--net", publish.net, "SUMO's network (.net.xml, .net.xml.gz): its streets")
      ->check(CLI::ExistingFile);
  publish_app->add_option("--wait", publish.wait_s, "Seconds to wait for the server")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86400.0));
  add_reading(*publish_app, publish.read, publish_unit, publish_z);

  CLI::App* record_app =
      app.add_subcommand("record", "Keep what a viewer sees, as video or pictures");
  add_view(*record_app, record.view, record_text);
  add_rate(*record_app, record.view);
  record_app
      ->add_option("-o,--output", record.output,
                   "out.mp4, frames/####.jpg, frames/####.png or one.jpg")
      ->required();
  record_app->add_option("--seconds", record.seconds, "Length")->check(CLI::PositiveNumber);
  record_app->add_option("--frames", record.frames, "Number of frames")->check(CLI::PositiveNumber);
  record_app->footer(
      "Without --seconds and --frames it ends after the producer has left.\n"
      "Examples:\n"
      "  throng record --crowd station -o station.mp4 --seconds 10 --fps 25\n"
      "  throng record --crowd station -o frames/####.jpg --camera \"0,-20,8:0,0,1\" --frames 30\n"
      "  throng record --crowd station -o speed.mp4 --channel speed --channel-range 0:2 "
      "--color-map plasma\n"
      "  throng record --crowd station -o turn.mp4 --camera orbit --seconds 30\n"
      "  throng record --crowd station -o fine.mp4 --size 1920x1080 --quality 95 "
      "--vertex-budget 5000000 --wait 60\n" +
      std::string(CameraScript::kFileHelp));

  CLI::App* snapshot_app = app.add_subcommand("snapshot", "One picture of a crowd, now or earlier");
  add_view(*snapshot_app, snapshot.view, snapshot_text);
  snapshot_app->add_option("url", common.connection.url, "Where the server is, as --server");
  snapshot_app->get_option("--crowd")->required(false)->description(
      "Name of the crowd (default: the only one)");
  snapshot_app->add_option("-o,--output", snapshot.output, "one.png or one.jpg")->required();
  snapshot_app->add_option("--time", snapshot.time_s, "Scene time in seconds (default: now)")
      ->check(CLI::Range(-1e9, 1e9));
  snapshot_app->footer(
      "Examples:\n"
      "  throng snapshot --crowd station -o station.png --size 1920x1080\n"
      "  throng snapshot host:7447 -o now.png\n"
      "  throng snapshot --crowd station -o then.jpg --time 12.5 --vertex-budget 3000000\n"
      "  throng snapshot --crowd station -o plan.png --camera top\n"
      "  throng snapshot --crowd station -o speed.jpg --channel speed --channel-range 0:2 "
      "--color-map cividis --quality 95 --wait 60");

  CLI::App* watch_app = app.add_subcommand("watch", "One line a second about what a viewer gets");
  add_view(*watch_app, watch, watch_text);
  add_rate(*watch_app, watch);
  watch_app->footer(
      "Examples:\n"
      "  throng watch --crowd station\n"
      "  throng watch --crowd station --size 1280x720 --seconds 10\n"
      "  throng watch --crowd station --camera top --fps 60 --quality 70 --vertex-budget 500000\n"
      "  throng watch --crowd station --channel speed --channel-range 0:2 "
      "--color-map magma --wait 60");
  watch_app->add_option("--seconds", watch_seconds, "Length")->check(CLI::PositiveNumber);

  CLI::App* crowds_app = app.add_subcommand("crowds", "List the crowds of a server");
  crowds_app->footer("Examples:\n  throng crowds\n  throng crowds --json --server host:7447");
  crowds_app->add_flag("--json", crowds_json, "As JSON");

  CLI::App* remove_app =
      app.add_subcommand("remove", "Remove a crowd that no producer feeds, with its history");
  remove_app->footer(
      "What --record keeps of it stays on the server's disk, and can be published again.\n"
      "Examples:\n  throng remove station\n  throng remove station --json --server host:7447");
  remove_app->add_option("crowd", removed, "Name of the crowd")->required();
  remove_app->add_flag("--json", remove_json, "As JSON");

  CLI::App* info_app =
      app.add_subcommand("info", "What a server offers, or what a trajectory file holds");
  info_app->footer(
      "Examples:\n"
      "  throng info\n"
      "  throng info run.sqlite --json\n"
      "  throng info walk.txt --source-fps 16 --source-unit cm\n"
      "  throng info circle.rvo --source-unit 0.2\n"
      "  throng info hills.txt --format archive-text --z ground");
  info_app->add_option("file", info_file, "Trajectory file (none: ask the server)");
  info_app->add_flag("--json", info_json, "As JSON");
  add_reading(*info_app, info_read, info_unit, info_z);

  CLI::App* convert_app =
      app.add_subcommand("convert", "Write a trajectory file in another format");
  convert_app->add_option("input", convert.input, "JuPedSim sqlite, archive text, CSV, ...")
      ->required();
  convert_app
      ->add_option(
          "output", convert.output,
          "run.csv, run.sqlite or run.h5 (JuPedSim), run.txt (archive), run.traj (Vadere), "
          "run.xml (SUMO), run.scb (Menge), run.ndjson (TrajNet++); text may end with .gz")
      ->required();
  convert_app
      ->add_option(
          "--to", convert.format,
          "Format to write, where the name does not tell; .txt is archive text unless this "
          "says obsmat (ETH)")
      ->check(CLI::IsMember(throng::trajectory::write_format_names()));
  convert_app
      ->add_option("--fps", convert.fps, "Rate of the written frames (default: as in the input)")
      ->check(CLI::Range(0.001, 10000.0));
  add_reading(*convert_app, convert.read, convert_unit, convert_z);
  convert_app->footer(
      "What the written format cannot hold is told in one line each, or is an error.\n"
      "Examples:\n"
      "  throng convert fcd.xml.gz walk.csv\n"
      "  throng convert run.sqlite fcd.xml.gz\n"
      "  throng convert run.csv eth.txt --to obsmat\n"
      "  throng convert walk.txt walk.sqlite --source-fps 16 --source-unit cm\n"
      "  throng convert run.sqlite run.dat --to archive-text\n"
      "  throng convert hills.txt hills.csv --format archive-text --z ground --fps 5");

  CLI::App* doctor_app =
      app.add_subcommand("doctor", "What this machine and the server can draw with");
  doctor_app->footer("Examples:\n  throng doctor\n  throng doctor --json --server host:7447");
  doctor_app->add_flag("--json", doctor_json, "As JSON");

  try {
    app.parse(argc, argv);
    if (record_app->parsed()) finish_view(record.view, record_text);
    if (snapshot_app->parsed()) finish_view(snapshot.view, snapshot_text);
    if (watch_app->parsed()) finish_view(watch, watch_text);
    finish_reading(publish.read, publish_unit, publish_z);
    finish_reading(info_read, info_unit, info_z);
    finish_reading(convert.read, convert_unit, convert_z);
  } catch (const CLI::ParseError& error) {
    if (app.get_subcommands().empty() && app.remaining_size() > 0) {
      return app.exit(CLI::ExtrasError("throng", {app.remaining().front()})) == 0 ? kOk : kUsage;
    }
    return app.exit(error) == 0 ? kOk : kUsage;
  }
  catch_interrupts();
  if (publish_app->parsed()) {
    publish.common = common;
    return run_publish(publish);
  }
  if (record_app->parsed()) {
    record.view.common = common;
    return run_record(record);
  }
  if (snapshot_app->parsed()) {
    snapshot.view.common = common;
    return run_snapshot(snapshot);
  }
  if (convert_app->parsed()) {
    convert.common = common;
    return run_convert(convert);
  }
  if (watch_app->parsed()) {
    watch.common = common;
    return run_watch(watch, watch_seconds);
  }
  if (crowds_app->parsed()) return run_crowds(common, crowds_json);
  if (remove_app->parsed()) return run_remove(common, removed, remove_json);
  if (info_app->parsed()) {
    return info_file.empty() ? run_server_info(common, info_json)
                             : run_file_info(info_file, info_read, info_json);
  }
  const bool named = !common.connection.url.empty() || std::getenv("THRONG_URL") != nullptr;
  return run_doctor(common, named, doctor_json);
}
