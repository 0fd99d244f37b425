#pragma once

#include <absl/status/status.h>

#include <string>

namespace throng::server {

/// How a server is reached and who may.
struct ListenOptions {
  std::string listen = "127.0.0.1:7447";  // HOST:PORT, [IPv6]:PORT; port 0: any free one
  std::string tls_cert_file;              // PEM
  std::string tls_key_file;               // PEM
  std::string token_file;                 // one token a line; empty: no token is asked for
  bool insecure = false;                  // allows a bind to any address without TLS and token
};

/// True for localhost, 127.0.0.0/8 and ::1, which only this machine reaches.
bool is_loopback(const std::string& host);

/// A loopback address is always allowed. Any other one shows the crowd to the network and so wants
/// TLS and a token, or `insecure`: FailedPrecondition names what is missing. InvalidArgument for an
/// address that can't be read and for a TLS certificate without its key.
absl::Status check_bind(const ListenOptions& options);

/// The same for the web door, `address` being HOST:PORT: it speaks plain HTTP, so that any address
/// but loopback wants `insecure`.
absl::Status check_http_bind(const std::string& address, bool insecure);

}  // namespace throng::server
