#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace throng::server {

struct Services;

struct WebOptions {
  std::string http = "127.0.0.1:7480";  // HOST:PORT, [IPv6]:PORT; port 0: any free one
  std::vector<std::string> hosts;       // names a browser may call this server by, beside its own
  std::string web_root;                 // folder of the page; empty: the one compiled in
  bool insecure = false;                // allows an address that other machines reach
  std::size_t max_connections = 256;
  std::size_t max_message_bytes = 64u << 10;
  std::size_t max_messages_per_second = 400;  // of one connection; faster ones are read later
};

/// The door for browsers: the page, /ws, /metrics and /healthz over plain HTTP, on a thread of its
/// own. What it says and shows is what the gRPC services say and show.
class WebDoor {
 public:
  /// InvalidArgument: an address that can't be read. FailedPrecondition: one that other machines
  /// reach without `insecure`. Unavailable: the port is taken.
  /// `services` must outlive the door.
  static absl::StatusOr<std::unique_ptr<WebDoor>> open(WebOptions options, Services& services);
  /// Says goodbye to all connections.
  ~WebDoor();

  int port() const;
  std::string address() const;  // HOST:PORT that was really bound

 private:
  struct State;
  explicit WebDoor(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace throng::server
