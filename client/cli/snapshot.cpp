#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "client/cli/commands.hpp"
#include "client/cli/interrupt.hpp"
#include "client/cli/output.hpp"
#include "client/cli/view_stream.hpp"
#include "throng/render/encode.hpp"
#include "throng/v1/crowd.grpc.pb.h"
#include "throng/v1/view.grpc.pb.h"

namespace throng::client {

namespace {

/// A deadline that passed says nothing by itself.
int give_up(const ViewCommand& view, const std::string& crowd, const Connection& connection,
            const absl::Status& status) {
  if (!absl::IsDeadlineExceeded(status)) return report("snapshot", status);
  return report("snapshot",
                absl::DeadlineExceededError(absl::StrCat(
                    "no picture of ", crowd.empty() ? "a crowd" : absl::StrCat("'", crowd, "'"),
                    " from ", connection.address(), " within ", view.wait_s,
                    " s (--wait); is a throng-server there, and the crowd published?")));
}

/// The only crowd there is. NotFound: none yet.
absl::StatusOr<std::string> only_crowd(const Connection& connection,
                                       std::chrono::system_clock::time_point deadline) {
  v1::ListCrowdsResponse there;
  grpc::ClientContext context;
  context.set_deadline(deadline);
  connection.prepare(context);
  const OnInterrupt cancel([&context] { context.TryCancel(); });
  const absl::Status status =
      from_grpc(v1::CrowdService::NewStub(connection.channel())->ListCrowds(&context, {}, &there),
                connection);
  if (!status.ok()) return status;
  std::vector<std::string> names;
  for (const v1::CrowdInfo& one : there.crowds()) names.push_back(one.name());
  if (names.empty()) return absl::NotFoundError("the server has no crowd");
  if (names.size() == 1) return names.front();
  return absl::InvalidArgumentError(
      absl::StrCat("--crowd: which one? There are ", absl::StrJoin(names, ", ")));
}

absl::Status take(const SnapshotCommand& command,
                  const std::shared_ptr<const Connection>& connection,
                  std::chrono::system_clock::time_point deadline, v1::GetPictureRequest& request,
                  v1::GetPictureResponse& response) {
  if (request.options().crowd_name().empty()) {
    auto crowd = only_crowd(*connection, deadline);
    if (!crowd.ok()) return crowd.status();
    request.mutable_options()->set_crowd_name(*std::move(crowd));
  }
  const std::optional<CameraScript>& camera = command.view.camera;
  if (camera.has_value() && (camera->needs_site() || camera->moves())) {
    std::optional<std::int64_t> time_us;
    if (command.time_s.has_value()) time_us = request.scene_time_us();
    const auto sight = sight_of(connection, request.options(), time_us, deadline);
    if (!sight.ok()) return sight.status();
    aim(*camera, sight->time_us, sight->site, *request.mutable_options());
  }
  grpc::ClientContext context;
  context.set_deadline(deadline);
  connection->prepare(context);
  const OnInterrupt cancel([&context] { context.TryCancel(); });
  return from_grpc(
      v1::ViewService::NewStub(connection->channel())->GetPicture(&context, request, &response),
      *connection);
}

}  // namespace

int run_snapshot(const SnapshotCommand& command) {
  const char* const kName = "snapshot";
  v1::GetPictureRequest request;
  *request.mutable_options() = options_of(command.view);
  if (absl::EndsWithIgnoreCase(command.output, ".png")) {
    request.set_format(v1::GetPictureRequest::FORMAT_PNG);
  } else if (absl::EndsWithIgnoreCase(command.output, ".jpg") ||
             absl::EndsWithIgnoreCase(command.output, ".jpeg")) {
    request.set_format(v1::GetPictureRequest::FORMAT_JPEG);
  } else {
    report(kName, absl::InvalidArgumentError(
                      absl::StrCat("-o: '", command.output, "' must end in .png, .jpg or .jpeg")));
    return kUsage;
  }
  if (command.time_s.has_value()) request.set_scene_time_us(std::llround(*command.time_s * 1e6));

  const auto connection = Connection::open(command.view.common.connection);
  if (!connection.ok()) return report(kName, connection.status());
  const auto deadline =
      std::chrono::system_clock::now() +
      std::chrono::milliseconds(static_cast<std::int64_t>(1000 * command.view.wait_s));
  v1::GetPictureResponse response;
  absl::Status status, missed;
  do {
    status = take(command, *connection, deadline, request, response);
    if (interrupted() != 0) return 128 + interrupted();
    if (absl::IsNotFound(status)) missed = status;  // says more than that time is up
  } while (!status.ok() && may_come(status, deadline));
  if (!status.ok())
    return give_up(command.view, request.options().crowd_name(), **connection,
                   missed.ok() ? status : missed);

  const std::string& image = response.image();
  const absl::Status written = render::write_file(
      command.output, {reinterpret_cast<const std::uint8_t*>(image.data()), image.size()});
  if (!written.ok()) return report(kName, written);
  if (!command.view.common.quiet) {
    absl::FPrintF(stderr, "throng snapshot: %s at %.2f s, %d agents, %d in view\n",
                  request.options().crowd_name(),
                  static_cast<double>(response.scene_time_us()) * 1e-6, response.stats().agents(),
                  response.stats().visible());
  }
  std::printf("%s\n", command.output.c_str());
  return kOk;
}

}  // namespace throng::client
