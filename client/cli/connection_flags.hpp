#pragma once

#include <CLI/CLI.hpp>

#include "throng/client/connection.hpp"

namespace throng::client {

/// Where the server is: the same for every program of a viewer.
inline void add_connection(CLI::App& app, ConnectionOptions& connection) {
  app.add_option("--server", connection.url,
                 "HOST:PORT, grpcs://HOST:PORT for TLS (default: THRONG_URL, else 127.0.0.1:7447)");
  app.add_option("--ca-file", connection.ca_file,
                 "PEM that the server's certificate is checked with (default: THRONG_CA_FILE)");
  app.add_option("--token-file", connection.token_file,
                 "File with the token to show (default: THRONG_TOKEN_FILE)");
}

}  // namespace throng::client
