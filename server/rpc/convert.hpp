#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/support/status.h>

#include "server/scene/registry.hpp"
#include "server/view/viewer.hpp"

namespace throng::v1 {
class AgentColumns;
class Camera;
class CrowdInfo;
class DensityGrid;
class FrameStats;
class PickAgentResponse;
class Playback;
class StreamViewResponse;
class StartPublishing;
class ViewOptions;
}  // namespace throng::v1

namespace throng::server {

/// The two libraries use the same codes.
grpc::Status to_grpc(const absl::Status& status);

/// InvalidArgument names the field: not finite, beyond 1e9 m, looking nowhere, an angle out of
/// range.
absl::StatusOr<render::Camera> camera_from(const v1::Camera& camera);
void fill_camera(const render::Camera& camera, v1::Camera& message);

/// Puts what `options` carries into `request` and leaves the rest. NotFound: unknown crowd;
/// InvalidArgument: a field out of range (also the first time, when there is no crowd_name).
absl::Status apply_options(const v1::ViewOptions& options, const Registry& registry,
                           Clock::time_point now, ViewRequest& request);

/// All of a frame but its image and what a viewer asked for beside it.
void fill_frame(const OutgoingFrame& outgoing, v1::StreamViewResponse& message);
void fill_playback(const Playhead& playhead, std::int64_t scene_time_us, v1::Playback& message);
void fill_agents(const AgentList& agents, const glm::dvec3& origin_world,
                 v1::AgentColumns& message);
void fill_density(const DensityMap& map, v1::DensityGrid& message);
void fill_agent(const ShownAgent& agent, const AgentsAt& agents, const NamedCrowd& named,
                const render::Crowd& crowd, v1::PickAgentResponse& message);

void fill_stats(const EncodedFrame& frame, v1::FrameStats& message);
void fill_crowd(const CrowdReport& report, v1::CrowdInfo& message);
StartRequest start_request_from(const v1::StartPublishing& start);

}  // namespace throng::server
