#include "server/rpc/bind_rules.hpp"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <arpa/inet.h>

#include <cstdint>

namespace throng::server {
namespace {

/// Splits HOST:PORT and [HOST]:PORT.
bool split_address(const std::string& address, std::string& host, std::string& port) {
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  host = address.substr(0, colon);
  port = address.substr(colon + 1);
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
    return true;
  }
  return host.find(':') == std::string::npos;
}

absl::Status read_address(const char* flag, const std::string& address, std::string& host) {
  std::string port;
  std::uint32_t number = 0;
  if (split_address(address, host, port) && absl::SimpleAtoi(port, &number) && number <= 65535) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      flag, ": '", address, "' is not HOST:PORT or [IPv6]:PORT with a port up to 65535"));
}

}  // namespace

bool is_loopback(const std::string& host) {
  if (host == "localhost") return true;
  in_addr v4{};
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  in6_addr v6{};
  if (inet_pton(AF_INET6, host.c_str(), &v6) == 1) return IN6_IS_ADDR_LOOPBACK(&v6) != 0;
  return false;
}

absl::Status check_bind(const ListenOptions& options) {
  std::string host;
  if (absl::Status status = read_address("--listen", options.listen, host); !status.ok()) {
    return status;
  }
  if (options.tls_cert_file.empty() != options.tls_key_file.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key: one was given without the other");
  }
  if (is_loopback(host) || options.insecure) return absl::OkStatus();
  std::string list;
  if (options.tls_cert_file.empty()) absl::StrAppend(&list, " --tls-cert FILE --tls-key FILE");
  if (options.token_file.empty()) absl::StrAppend(&list, " --token-file FILE");
  if (list.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("--listen: ", options.listen, " can be reached from other machines; add", list,
                   ", or --insecure if everybody there may see and feed the crowds"));
}

absl::Status check_http_bind(const std::string& address, bool insecure) {
  std::string host;
  if (absl::Status status = read_address("--http", address, host); !status.ok()) return status;
  if (is_loopback(host) || insecure) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "--http: ", address,
      " can be reached from other machines and is plain HTTP; bind loopback "
      "behind an HTTPS proxy or an ssh tunnel, or add --insecure if everybody there may look"));
}

}  // namespace throng::server
