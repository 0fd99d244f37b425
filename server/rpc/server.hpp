#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "server/rpc/bind_rules.hpp"
#include "server/scene/limits.hpp"
#include "server/scene/playout_clock.hpp"
#include "server/scene/recording.hpp"
#include "server/view/render_loop.hpp"

namespace throng::server {

struct Services;

struct ServerOptions {
  ListenOptions listen;
  Limits limits;
  PlayoutSettings playout;
  RecordSettings record;
  bool resume = false;  // begin with the crowds that were recorded
  std::uint64_t default_vertex_budget = 1'000'000;
  double target_ms = 0.0;  // over 0: views that ask for no budget get what a frame this long allows
  render::ControllerKind controller = render::ControllerKind::kPredictive;
  std::optional<render::FormRule> form;  // none: as the controller wants
  render::FarSettings far;               // of all views: who is far away is drawn as one crowd
  std::string version = "0";
  unsigned ingest_threads = 2;
  std::chrono::milliseconds keepalive_time{20'000};     // a ping after this long without traffic
  std::chrono::milliseconds keepalive_timeout{10'000};  // no answer for this long: gone
  std::chrono::milliseconds min_ping_interval{10'000};  // clients that ping faster are sent away
  std::chrono::milliseconds drain_time{5'000};          // calls that last longer are cut
  Now now = [] { return Clock::now(); };
};

/// The services of throng.v1 with health and reflection, on one port.
class Server {
 public:
  /// Checks the bind rules, makes the renderer, opens the port. Errors as check_bind,
  /// TokenGate::read and `make_renderer`; NotFound names a TLS file; Unavailable: the port is
  /// taken.
  static absl::StatusOr<std::unique_ptr<Server>> start(ServerOptions options,
                                                       std::shared_ptr<const render::Cast> cast,
                                                       MakeRenderer make_renderer);
  /// Drains, if that was not done.
  ~Server();

  int port() const;
  std::string address() const;  // HOST:PORT that was really bound
  Registry& registry();
  RenderLoop& loop();
  /// What other doors to the same crowds share with the handlers.
  Services& services();

  /// Health says NOT_SERVING, streams end with UNAVAILABLE, what is in flight has `drain_time`.
  /// Returns when no call is left.
  void drain();

 private:
  struct State;
  explicit Server(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace throng::server
