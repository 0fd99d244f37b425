#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

namespace grpc {
class Channel;
class ClientContext;
class Status;
}  // namespace grpc

namespace throng::client {

/// Where a server is and how to speak to it.
struct ConnectionOptions {
  std::string url;  // HOST:PORT, grpc://HOST:PORT, grpcs://HOST:PORT (TLS); empty: default_url()
  std::string
      ca_file;  // PEM of who signed the server's certificate; empty: the system's; wants TLS
  std::string token_file;  // its first line that is not blank or a # comment is shown to the server
};

/// THRONG_URL if it is set, else 127.0.0.1:7447.
std::string default_url();

/// A channel and the token that goes with each call. Making one does not connect yet.
class Connection {
 public:
  /// InvalidArgument for a URL of another form, NotFound for a file that can't be read.
  /// Unset file names are taken from THRONG_CA_FILE and THRONG_TOKEN_FILE.
  static absl::StatusOr<std::shared_ptr<const Connection>> open(ConnectionOptions options = {});

  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  /// HOST:PORT, for messages.
  const std::string& address() const { return address_; }
  /// Adds the token to a call.
  void prepare(grpc::ClientContext& context) const;

 private:
  Connection() = default;
  std::string address_;
  std::string token_;
  std::shared_ptr<grpc::Channel> channel_;
};

/// The same code and message; a server that can't be reached is named with what to do about it.
/// FailedPrecondition where the address is a page's. May take two seconds after such a failure.
absl::Status from_grpc(const grpc::Status& status, const Connection& connection);

}  // namespace throng::client
