#include "server/rpc/server.hpp"

#include <absl/strings/str_cat.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/security/server_credentials.h>

#include <fstream>
#include <iterator>
#include <mutex>
#include <random>
#include <utility>

#include "server/rpc/convert.hpp"
#include "server/rpc/services.hpp"
#include "throng/v1/crowd.grpc.pb.h"
#include "throng/v1/server.grpc.pb.h"

namespace throng::server {
namespace {

class CrowdService final : public v1::CrowdService::CallbackService {
 public:
  explicit CrowdService(Services& services) : services_(services) {}

  grpc::ServerUnaryReactor* ListCrowds(grpc::CallbackServerContext* context,
                                       const v1::ListCrowdsRequest*,
                                       v1::ListCrowdsResponse* response) override {
    absl::Status status = services_.authorize(*context);
    if (status.ok()) {
      for (const CrowdReport& report : services_.registry->list()) {
        fill_crowd(report, *response->add_crowds());
      }
    }
    return finished(context, status);
  }

  grpc::ServerUnaryReactor* GetCrowd(grpc::CallbackServerContext* context,
                                     const v1::GetCrowdRequest* request,
                                     v1::GetCrowdResponse* response) override {
    absl::Status status = services_.authorize(*context);
    if (status.ok()) {
      const auto crowd = services_.registry->find(request->crowd_name());
      status = crowd.status();
      if (crowd.ok()) fill_crowd((*crowd)->report(), *response->mutable_crowd());
    }
    return finished(context, status);
  }

  grpc::ServerUnaryReactor* DeleteCrowd(grpc::CallbackServerContext* context,
                                        const v1::DeleteCrowdRequest* request,
                                        v1::DeleteCrowdResponse*) override {
    absl::Status status = services_.authorize(*context);
    if (status.ok()) {
      status = services_.registry->remove(request->crowd_name());
      services_.loop->wake();
    }
    return finished(context, status);
  }

 private:
  static grpc::ServerUnaryReactor* finished(grpc::CallbackServerContext* context,
                                            const absl::Status& status) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(to_grpc(status));
    return reactor;
  }

  Services& services_;
};

std::shared_ptr<const v1::GetServerInfoResponse> make_server_info(const Services& services,
                                                                  const render::Cast& cast,
                                                                  const std::string& version) {
  auto info = std::make_shared<v1::GetServerInfoResponse>();
  info->set_version(version);
  info->set_server_run_id(services.server_run_id);
  info->set_compute_backend(services.loop->compute_name());
  info->set_rasterizer(services.loop->raster_name());
  const Limits& from = services.registry->limits();
  v1::Limits& limits = *info->mutable_limits();
  limits.set_max_message_bytes(from.max_message_bytes);
  limits.set_max_crowds(from.max_crowds);
  limits.set_max_viewers(from.max_viewers);
  limits.set_max_agents_per_crowd(from.max_agents_per_crowd);
  limits.set_max_channels(from.max_channels);
  limits.set_max_history_bytes_per_crowd(from.max_history_bytes_per_crowd);
  limits.set_max_width_px(from.max_width_px);
  limits.set_max_height_px(from.max_height_px);
  limits.set_max_frames_in_flight(from.max_frames_in_flight);
  limits.set_max_vertex_budget(from.max_vertex_budget);
  limits.set_max_rate_hz(from.max_rate_hz);
  limits.set_max_environment_bytes(from.max_environment_bytes);
  limits.set_max_pending_pictures(from.max_pending_pictures);
  for (const render::CastMember& member : cast.members) {
    v1::CharacterInfo& character = *info->add_cast();
    character.set_name(member.character.name);
    character.set_vertices(member.character.vertex_count());
    character.set_triangles(member.character.triangle_count());
    character.set_joints(member.character.joint_count());
    for (const render::Clip& clip : member.character.clips) character.add_clips(clip.name);
  }
  return info;
}

class ServerService final : public v1::ServerService::CallbackService {
 public:
  explicit ServerService(Services& services) : services_(services) {}

  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* context,
                                          const v1::GetServerInfoRequest*,
                                          v1::GetServerInfoResponse* response) override {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    const absl::Status status = services_.authorize(*context);
    if (status.ok()) fill_server_info(services_, *response);
    reactor->Finish(to_grpc(status));
    return reactor;
  }

 private:
  Services& services_;
};

std::string random_run_id() {
  std::random_device device;
  const std::uint64_t bits = (std::uint64_t{device()} << 32) | device();
  return absl::StrCat(absl::Hex(bits, absl::kZeroPad16));
}

absl::StatusOr<std::string> read_text(const char* flag, const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(absl::StrCat(flag, ": can't read ", path));
  return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> make_credentials(
    const ListenOptions& options) {
  if (options.tls_cert_file.empty()) return grpc::InsecureServerCredentials();
  const auto cert = read_text("--tls-cert", options.tls_cert_file);
  if (!cert.ok()) return cert.status();
  const auto key = read_text("--tls-key", options.tls_key_file);
  if (!key.ok()) return key.status();
  grpc::SslServerCredentialsOptions tls;
  tls.pem_key_cert_pairs.push_back({*key, *cert});
  return grpc::SslServerCredentials(tls);
}

}  // namespace

void fill_server_info(const Services& services, v1::GetServerInfoResponse& response) {
  response = *services.info;
  response.set_uptime_s(std::chrono::duration<double>(Clock::now() - services.began).count());
}

struct Server::State {
  ServerOptions options;
  // In the order of making: what is below uses what is above and is destroyed before it.
  std::unique_ptr<Registry> registry;
  std::unique_ptr<RenderLoop> loop;
  std::unique_ptr<Worker> worker;
  Services services;
  std::vector<std::unique_ptr<grpc::Service>> handlers;
  std::unique_ptr<grpc::Server> server;
  int port = 0;
  bool drained = false;
};

Server::Server(std::unique_ptr<State> state) : state_(std::move(state)) {}

absl::StatusOr<std::unique_ptr<Server>> Server::start(ServerOptions options,
                                                      std::shared_ptr<const render::Cast> cast,
                                                      MakeRenderer make_renderer) {
  if (absl::Status status = check_bind(options.listen); !status.ok()) return status;
  absl::StatusOr<TokenGate> gate = TokenGate::read(options.listen.token_file);
  if (!gate.ok()) return gate.status();
  const auto credentials = make_credentials(options.listen);
  if (!credentials.ok()) return credentials.status();

  auto state = std::make_unique<State>();
  state->options = options;
  state->registry = std::make_unique<Registry>(cast, options.limits, options.playout, options.now,
                                               options.record);
  if (options.resume) state->registry->resume();
  RenderLoopOptions loop_options;
  loop_options.default_vertex_budget = options.default_vertex_budget;
  loop_options.target_ms = options.target_ms;
  loop_options.controller = options.controller;
  loop_options.form = options.form;
  loop_options.far = options.far;
  loop_options.max_pending_pictures = options.limits.max_pending_pictures;
  loop_options.now = options.now;
  auto loop = RenderLoop::start(std::move(make_renderer), std::move(loop_options));
  if (!loop.ok()) return loop.status();
  state->loop = *std::move(loop);
  state->worker = std::make_unique<Worker>(options.ingest_threads);

  Services& services = state->services;
  services.registry = state->registry.get();
  services.loop = state->loop.get();
  services.worker = state->worker.get();
  services.gate = std::make_shared<const TokenGate>(*std::move(gate));
  services.server_run_id = random_run_id();
  services.now = options.now;
  services.info = make_server_info(services, *cast, options.version);
  state->handlers.push_back(make_ingest_service(services));
  state->handlers.push_back(make_view_service(services));
  state->handlers.push_back(std::make_unique<CrowdService>(services));
  state->handlers.push_back(std::make_unique<ServerService>(services));

  static std::once_flag once;
  std::call_once(once, [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
  grpc::ServerBuilder builder;
  builder.AddListeningPort(options.listen.listen, *credentials, &state->port);
  for (const auto& handler : state->handlers) builder.RegisterService(handler.get());
  builder.SetMaxReceiveMessageSize(static_cast<int>(options.limits.max_message_bytes));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS,
                             static_cast<int>(options.keepalive_time.count()));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                             static_cast<int>(options.keepalive_timeout.count()));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                             static_cast<int>(options.min_ping_interval.count()));
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 256);
  // Two servers on one port would share its connections without a word.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  // Only reflection uses the synchronous interface.
  builder.SetSyncServerOption(grpc::ServerBuilder::NUM_CQS, 1);
  builder.SetSyncServerOption(grpc::ServerBuilder::MIN_POLLERS, 1);
  builder.SetSyncServerOption(grpc::ServerBuilder::MAX_POLLERS, 2);
  if (services.gate->asks()) {
    std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> makers;
    makers.push_back(make_token_interceptors(services.gate));
    builder.experimental().SetInterceptorCreators(std::move(makers));
  }
  state->server = builder.BuildAndStart();
  if (state->server == nullptr || state->port == 0) {
    const bool tls = !options.listen.tls_cert_file.empty();
    return absl::UnavailableError(absl::StrCat(
        "--listen: can't bind ", options.listen.listen, "; is another server there?",
        tls ? absl::StrCat(" Or ", options.listen.tls_cert_file, " and ",
                           options.listen.tls_key_file, " are not a PEM certificate and its key.")
            : std::string()));
  }
  return std::unique_ptr<Server>(new Server(std::move(state)));
}

Server::~Server() { drain(); }

int Server::port() const { return state_->port; }

std::string Server::address() const {
  const std::string& listen = state_->options.listen.listen;
  return absl::StrCat(listen.substr(0, listen.rfind(':')), ":", state_->port);
}

Registry& Server::registry() { return *state_->registry; }

RenderLoop& Server::loop() { return *state_->loop; }

Services& Server::services() { return state_->services; }

void Server::drain() {
  if (state_->drained) return;
  state_->drained = true;
  if (grpc::HealthCheckServiceInterface* health = state_->server->GetHealthCheckService()) {
    health->SetServingStatus(false);
  }
  state_->services.streams.drain();
  state_->server->Shutdown(std::chrono::system_clock::now() + state_->options.drain_time);
  state_->server->Wait();
}

}  // namespace throng::server
