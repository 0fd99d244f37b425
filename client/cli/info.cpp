#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <google/protobuf/util/json_util.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/cli/commands.hpp"
#include "client/cli/interrupt.hpp"
#include "client/cli/output.hpp"
#include "throng/v1/crowd.grpc.pb.h"
#include "throng/v1/server.grpc.pb.h"

namespace throng::client {
namespace {

constexpr std::chrono::seconds kDeadline{5};

void print_json(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string text;
  const auto status = google::protobuf::util::MessageToJsonString(message, &text, options);
  if (!status.ok()) text = "{}\n";  // our own messages always can be printed
  std::fputs(text.c_str(), stdout);
}

/// One call with a deadline. `call` gets the context and the channel and returns the status.
template <typename Call>
absl::Status ask(const Common& common, Call call) {
  const auto connection = Connection::open(common.connection);
  if (!connection.ok()) return connection.status();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kDeadline);
  (*connection)->prepare(context);
  return from_grpc(call(context, (*connection)->channel()), **connection);
}

}  // namespace

int run_crowds(const Common& common, bool json) {
  v1::ListCrowdsResponse crowds;
  const absl::Status status = ask(common, [&](grpc::ClientContext& context, const auto& channel) {
    return v1::CrowdService::NewStub(channel)->ListCrowds(&context, {}, &crowds);
  });
  if (!status.ok()) return report("crowds", status);
  if (json) {
    print_json(crowds);
    return kOk;
  }
  if (crowds.crowds_size() == 0) {
    std::fprintf(stderr, "no crowds; publish one with 'throng publish FILE --crowd NAME'\n");
    return kOk;
  }
  absl::PrintF("%-20s %8s %-5s %7s %10s %8s %s\n", "CROWD", "AGENTS", "LIVE", "VIEWERS", "TIME s",
               "FRAMES", "PRODUCER");
  for (const v1::CrowdInfo& crowd : crowds.crowds()) {
    absl::PrintF("%-20s %8d %-5s %7d %10.1f %8d %s\n", crowd.name(), crowd.agents(),
                 crowd.live() ? "yes" : "no", crowd.viewers(),
                 static_cast<double>(crowd.newest_time_us()) * 1e-6, crowd.frames(),
                 crowd.producer());
    if (crowd.unrecorded_frames() > 0) {
      absl::FPrintF(stderr, "throng: the recording of '%s' lost %d frames\n", crowd.name(),
                    crowd.unrecorded_frames());
    }
  }
  return kOk;
}

int run_remove(const Common& common, const std::string& crowd, bool json) {
  absl::Status status = ask(common, [&](grpc::ClientContext& context, const auto& channel) {
    v1::DeleteCrowdRequest request;
    request.set_crowd_name(crowd);
    v1::DeleteCrowdResponse response;
    return v1::CrowdService::NewStub(channel)->DeleteCrowd(&context, request, &response);
  });
  if (absl::IsNotFound(status)) {
    v1::ListCrowdsResponse there;
    const absl::Status listed = ask(common, [&](grpc::ClientContext& context, const auto& channel) {
      return v1::CrowdService::NewStub(channel)->ListCrowds(&context, {}, &there);
    });
    std::vector<std::string> names;
    for (const v1::CrowdInfo& one : there.crowds()) names.push_back(one.name());
    if (listed.ok()) {
      status = absl::NotFoundError(
          absl::StrCat(status.message(), "; there ", names.size() == 1 ? "is " : "are ",
                       names.empty() ? std::string("none") : absl::StrJoin(names, ", ")));
    }
  }
  if (!status.ok()) return report("remove", status);
  if (json) {
    std::printf("%s\n", nlohmann::ordered_json{{"removed", crowd}}.dump().c_str());
  } else if (!common.quiet) {
    absl::FPrintF(stderr, "throng remove: '%s' is gone\n", crowd);
  }
  return kOk;
}

int run_server_info(const Common& common, bool json) {
  v1::GetServerInfoResponse info;
  const absl::Status status = ask(common, [&](grpc::ClientContext& context, const auto& channel) {
    return v1::ServerService::NewStub(channel)->GetServerInfo(&context, {}, &info);
  });
  if (!status.ok()) return report("info", status);
  if (json) {
    print_json(info);
    return kOk;
  }
  const v1::Limits& limits = info.limits();
  absl::PrintF("version     %s, up %.0f s\n", info.version(), info.uptime_s());
  absl::PrintF("compute     %s\n", info.compute_backend());
  absl::PrintF("rasterizer  %s\n", info.rasterizer());
  absl::PrintF("limits      %d crowds, %d viewers, %d agents and %d channels a crowd,\n",
               limits.max_crowds(), limits.max_viewers(), limits.max_agents_per_crowd(),
               limits.max_channels());
  absl::PrintF(
      "            %d MiB a message, %d MiB of history a crowd, %dx%d px, %d frames in flight\n",
      limits.max_message_bytes() >> 20, limits.max_history_bytes_per_crowd() >> 20,
      limits.max_width_px(), limits.max_height_px(), limits.max_frames_in_flight());
  absl::PrintF("%-18s %8s %9s %6s %s\n", "CHARACTER", "VERTICES", "TRIANGLES", "JOINTS", "CLIPS");
  for (const v1::CharacterInfo& character : info.cast()) {
    std::string clips;
    for (const std::string& clip : character.clips())
      absl::StrAppend(&clips, clips.empty() ? "" : " ", clip);
    absl::PrintF("%-18s %8d %9d %6d %s\n", character.name(), character.vertices(),
                 character.triangles(), character.joints(), clips);
  }
  return kOk;
}

int run_file_info(const std::string& file, const trajectory::ReadOptions& read, bool json) {
  Progress progress(json);
  trajectory::ReadOptions telling = read;
  telling.goes_on = [&](double share) {
    progress.show(absl::StrFormat("%s: %.0f %% read", file, 100.0 * share));
    return interrupted() == 0;
  };
  const auto summary = trajectory::summarize(file, telling);
  progress.end();
  if (interrupted() != 0) return 128 + interrupted();
  if (!summary.ok()) {
    report("info", summary.status());
    return kBadInput;
  }
  const trajectory::Info& info = summary->info;
  if (json) {
    nlohmann::ordered_json report;
    report["file"] = file;
    report["format"] = info.format;
    report["fps"] = info.fps;
    report["frames"] = summary->frames;
    report["frames_inserted"] = summary->frames_inserted;
    report["duration_s"] = summary->duration_s;
    report["agents"] = summary->agents;
    report["most_at_once"] = summary->most_at_once;
    if (summary->has_positions) {
      report["extent_m"] = {{"low", {summary->min_x_m, summary->min_y_m, summary->min_z_m}},
                            {"high", {summary->max_x_m, summary->max_y_m, summary->max_z_m}}};
    }
    report["has_z"] = summary->has_z;
    report["has_heading"] = summary->has_heading;
    report["channels"] = info.channel_names;
    report["motions"] = info.motion_names;
    report["walkable_area"] = !info.walkable_area_wkt.empty();
    report["notes"] = info.notes;
    std::printf("%s\n",
                report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    return kOk;
  }
  absl::PrintF("format    %s\n", info.format);
  if (info.fps > 0) {
    absl::PrintF("rate      %g frames per second\n", info.fps);
  } else {
    absl::PrintF("rate      irregular\n");
  }
  absl::PrintF("frames    %d, %.2f s\n", summary->frames, summary->duration_s);
  absl::PrintF("agents    %d, at most %d at once\n", summary->agents, summary->most_at_once);
  if (summary->has_positions) {
    absl::PrintF("extent    x %.2f to %.2f m, y %.2f to %.2f m", summary->min_x_m, summary->max_x_m,
                 summary->min_y_m, summary->max_y_m);
    if (summary->has_z) absl::PrintF(", z %.2f to %.2f m", summary->min_z_m, summary->max_z_m);
    absl::PrintF("\n");
  }
  absl::PrintF("heading   %s\n", summary->has_heading ? "yes" : "no, derived from motion");
  const auto listed = [](const std::vector<std::string>& names) {
    return names.empty() ? "none" : absl::StrJoin(names, ", ");
  };
  absl::PrintF("channels  %s\n", listed(info.channel_names));
  absl::PrintF("motions   %s\n", listed(info.motion_names));
  absl::PrintF("area      %s\n", info.walkable_area_wkt.empty() ? "none" : "walkable area given");
  for (const std::string& note : info.notes) absl::PrintF("note      %s\n", note);
  return kOk;
}

}  // namespace throng::client
