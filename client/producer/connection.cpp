#include "throng/client/connection.hpp"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/string_view.h>
#include <absl/strings/strip.h>
#include <grpcpp/grpcpp.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <utility>

#include "answers_http.hpp"

namespace throng::client {
namespace {

std::string from_environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

absl::StatusOr<std::string> read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(absl::StrCat("can't read ", path));
  return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

absl::StatusOr<std::string> read_token(const std::string& path) {
  const auto text = read_text(path);
  if (!text.ok()) return text.status();
  absl::string_view rest = *text;
  while (!rest.empty()) {
    const std::size_t end = rest.find('\n');
    const absl::string_view line = absl::StripAsciiWhitespace(rest.substr(0, end));
    if (!line.empty() && line.front() != '#') return std::string(line);
    if (end == absl::string_view::npos) break;
    rest.remove_prefix(end + 1);
  }
  return absl::InvalidArgumentError(absl::StrCat("token file ", path, " has no token"));
}

}  // namespace

std::string default_url() {
  const std::string url = from_environment("THRONG_URL");
  return url.empty() ? "127.0.0.1:7447" : url;
}

absl::StatusOr<std::shared_ptr<const Connection>> Connection::open(ConnectionOptions options) {
  if (options.url.empty()) options.url = default_url();
  if (options.ca_file.empty()) options.ca_file = from_environment("THRONG_CA_FILE");
  if (options.token_file.empty()) options.token_file = from_environment("THRONG_TOKEN_FILE");

  absl::string_view address = options.url;
  bool tls = !options.ca_file.empty();
  if (absl::ConsumePrefix(&address, "grpcs://")) {
    tls = true;
  } else if (absl::ConsumePrefix(&address, "grpc://")) {
    tls = false;
  }
  absl::ConsumeSuffix(&address, "/");
  const std::size_t colon = address.rfind(':');
  if (address.find('/') != absl::string_view::npos || colon == absl::string_view::npos ||
      colon == 0 || colon + 1 == address.size() ||
      address.find_first_not_of("0123456789", colon + 1) != absl::string_view::npos) {
    return absl::InvalidArgumentError(absl::StrCat(
        "server '", options.url, "' is not HOST:PORT, grpc://HOST:PORT or grpcs://HOST:PORT"));
  }

  std::shared_ptr<Connection> connection(new Connection());
  connection->address_ = std::string(address);
  if (!options.token_file.empty()) {
    auto token = read_token(options.token_file);
    if (!token.ok()) return token.status();
    connection->token_ = *std::move(token);
  }
  std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials();
  if (tls) {
    grpc::SslCredentialsOptions ssl;
    if (!options.ca_file.empty()) {
      auto ca = read_text(options.ca_file);
      if (!ca.ok()) return ca.status();
      ssl.pem_root_certs = *std::move(ca);
    }
    credentials = grpc::SslCredentials(ssl);
  }
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(256 << 20);
  // The server's defaults allow this; an idle connection behind a NAT would be forgotten otherwise.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20'000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 200);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 5'000);
  // A connection of its own for each Connection: a stream that is stuck holds up no other.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  connection->channel_ = grpc::CreateCustomChannel(connection->address_, credentials, arguments);
  return std::shared_ptr<const Connection>(std::move(connection));
}

void Connection::prepare(grpc::ClientContext& context) const {
  if (!token_.empty()) context.AddMetadata("authorization", absl::StrCat("Bearer ", token_));
}

absl::Status from_grpc(const grpc::Status& status, const Connection& connection) {
  const auto code = static_cast<absl::StatusCode>(status.error_code());
  const bool is_silent = status.error_code() == grpc::StatusCode::UNAVAILABLE ||
                         status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
  if (is_silent && answers_http(connection.address())) {
    return absl::FailedPreconditionError(absl::StrCat(
        connection.address(), " answers HTTP: that is the address of a page (--http); give the ",
        "server's (--listen, usually 127.0.0.1:7447) with --server or THRONG_URL"));
  }
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    return absl::Status(
        code,
        absl::StrCat("no server answers at ", connection.address(), " (", status.error_message(),
                     "); start one with 'throng-server', or name another with "
                     "--server or THRONG_URL"));
  }
  return absl::Status(code, status.error_message());
}

}  // namespace throng::client
