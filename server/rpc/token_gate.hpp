#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/support/server_interceptor.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace throng::server {

/// True if both have the same bytes. Takes the same time whatever and wherever they differ in, so
/// that a token can't be guessed a byte at a time; only its length shows.
bool equal_in_constant_time(std::string_view a, std::string_view b);

/// Who may call: whoever sends `authorization: Bearer TOKEN` with one of the tokens. Without
/// tokens, everybody.
class TokenGate {
 public:
  /// One token a line; blank lines and those that begin with # do not count. NotFound and
  /// InvalidArgument (no token, or one shorter than 16 characters) name the file. An empty path: no
  /// tokens.
  static absl::StatusOr<TokenGate> read(const std::string& token_file);

  TokenGate() = default;
  explicit TokenGate(std::vector<std::string> tokens) : tokens_(std::move(tokens)) {}

  bool asks() const { return !tokens_.empty(); }
  /// Unauthenticated. `authorization`: the header's value, null when it was not sent.
  absl::Status check(const std::string_view* authorization) const;

 private:
  std::vector<std::string> tokens_;
};

/// Makes the interceptors that keep a call without a good token from everything but health: its
/// status becomes UNAUTHENTICATED whatever the handler says, and a call to a built-in service,
/// whose handlers do not ask the gate, is cancelled.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> make_token_interceptors(
    std::shared_ptr<const TokenGate> gate);

}  // namespace throng::server
