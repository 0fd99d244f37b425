#include "server/web/door.hpp"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "server/rpc/bind_rules.hpp"
#include "server/rpc/services.hpp"
#include "server/web/metrics.hpp"
#include "server/web/page.hpp"
#include "server/web/socket.hpp"
#include "server/web/web_rules.hpp"

namespace throng::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using beast::error_code;

constexpr std::chrono::seconds kRequestTime{30};  // to send one, to take its answer, to stay idle
constexpr std::uint32_t kLargestHeader = 16u << 10;
constexpr std::uint64_t kLargestBody = 4u << 10;  // nothing takes one

/// What all connections of a door share.
struct Shared {
  WebOptions options;
  WebRules rules;
  Services* services = nullptr;
  std::shared_ptr<Mailbox> mailbox;
  // Of the door's thread:
  std::vector<std::weak_ptr<WebConnection>> connections;
  std::size_t open = 0;
  std::unique_ptr<asio::steady_timer> farewell;  // set when the door closes
};

http::response<http::string_body> make_response(const http::request<http::string_body>& request,
                                                http::status status, std::string_view type,
                                                std::string body) {
  http::response<http::string_body> response{status, request.version()};
  response.set(http::field::content_type, beast::string_view(type.data(), type.size()));
  response.set(http::field::cache_control, "no-cache");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  // The page needs nothing from elsewhere; pictures and recordings are blobs of its own. A notebook
  // on the viewer's own machine may show it (throng.show).
  response.set("Content-Security-Policy",
               "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
               "img-src 'self' blob: data:; media-src blob:; base-uri 'none'; form-action 'none'; "
               "frame-ancestors 'self' http://127.0.0.1:* http://localhost:* "
               "https://127.0.0.1:* https://localhost:*");
  response.keep_alive(request.keep_alive());
  response.body() = std::move(body);
  response.prepare_payload();
  if (request.method() == http::verb::head) response.body().clear();
  return response;
}

http::response<http::string_body> make_answer(Shared& shared,
                                              const http::request<http::string_body>& request) {
  constexpr std::string_view kText = "text/plain; charset=utf-8";
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    auto response = make_response(request, http::status::method_not_allowed, kText,
                                  "only GET and HEAD are answered here\n");
    response.set(http::field::allow, "GET, HEAD");
    return response;
  }
  const std::string_view target(request.target().data(), request.target().size());
  const std::string_view path = target.substr(0, target.find('?'));
  if (path == "/healthz") return make_response(request, http::status::ok, kText, "ok\n");
  if (path == "/metrics") {
    const beast::string_view value = request[http::field::authorization];
    const std::string_view authorization(value.data(), value.size());
    const absl::Status status =
        shared.services->gate->check(value.empty() ? nullptr : &authorization);
    if (!status.ok()) {
      auto response = make_response(request, http::status::unauthorized, kText,
                                    absl::StrCat(status.message(), "\n"));
      response.set(http::field::www_authenticate, "Bearer");
      return response;
    }
    return make_response(request, http::status::ok, "text/plain; version=0.0.4; charset=utf-8",
                         metrics_text(*shared.services, shared.open));
  }
  if (path == "/ws") {
    auto response = make_response(request, http::status::upgrade_required, kText,
                                  "this is for a WebSocket; the page is at /\n");
    response.set(http::field::upgrade, "websocket");
    return response;
  }
  const std::optional<std::string> name = asset_name(target);
  if (name.has_value()) {
    auto file = read_page(shared.options.web_root, *name);
    if (file.ok()) {
      return make_response(request, http::status::ok, content_type(*name), *std::move(file));
    }
  }
  return make_response(request, http::status::not_found, kText,
                       "there is nothing here; the page is at /\n");
}

/// One connection until it ends or becomes a WebSocket.
class HttpConnection final : public WebConnection,
                             public std::enable_shared_from_this<HttpConnection> {
 public:
  HttpConnection(tcp::socket socket, std::shared_ptr<Shared> shared, std::shared_ptr<void> lease)
      : stream_(std::move(socket)), shared_(std::move(shared)), lease_(std::move(lease)) {}

  void read() {
    parser_.emplace();
    parser_->header_limit(kLargestHeader);
    parser_->body_limit(kLargestBody);
    stream_.expires_after(kRequestTime);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](error_code error, std::size_t) {
                       if (error) return self->on_bad_read(error);
                       self->on_request();
                     });
  }

  void go_away() override { stream_.close(); }

 private:
  void on_bad_read(error_code error) {
    const bool too_long = error == http::error::header_limit || error == http::error::body_limit;
    if (!too_long &&
        error.category() != http::make_error_code(http::error::bad_line_ending).category()) {
      return;  // gone, or too slow
    }
    if (error == http::error::end_of_stream || error == http::error::partial_message) return;
    http::request<http::string_body> nothing;
    nothing.version(11);
    nothing.keep_alive(false);
    respond(make_response(nothing,
                          too_long ? http::status::payload_too_large : http::status::bad_request,
                          "text/plain; charset=utf-8", "not a request that is answered here\n"));
  }

  void on_request() {
    const http::request<http::string_body> request = parser_->release();
    const auto field = [&](http::field name) {
      const beast::string_view value = request[name];
      return std::string_view(value.data(), value.size());
    };
    const absl::Status status =
        shared_->rules.check(field(http::field::host), field(http::field::origin));
    if (!status.ok()) {
      spdlog::warn("event=web_refused reason=\"{}\"", std::string(status.message()));
      return respond(make_response(request, http::status::forbidden, "text/plain; charset=utf-8",
                                   absl::StrCat(status.message(), "\n")));
    }
    const std::string_view target(request.target().data(), request.target().size());
    if (boost::beast::websocket::is_upgrade(request) &&
        target.substr(0, target.find('?')) == "/ws") {
      shared_->connections.push_back(open_socket(std::move(stream_), request, shared_->options,
                                                 *shared_->services, shared_->mailbox,
                                                 std::move(lease_)));
      return;
    }
    respond(make_answer(*shared_, request));
  }

  void respond(http::response<http::string_body> response) {
    response_ = std::move(response);
    stream_.expires_after(kRequestTime);
    http::async_write(stream_, response_,
                      [self = shared_from_this()](error_code error, std::size_t) {
                        if (error) return;
                        if (self->response_.need_eof()) {
                          self->stream_.socket().shutdown(tcp::socket::shutdown_send, error);
                          return;
                        }
                        self->read();
                      });
  }

  beast::tcp_stream stream_;
  const std::shared_ptr<Shared> shared_;
  std::shared_ptr<void> lease_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  http::response<http::string_body> response_;
};

}  // namespace

struct WebDoor::State {
  explicit State(WebOptions options) : shared(std::make_shared<Shared>()) {
    shared->options = std::move(options);
  }

  void accept() {
    acceptor.async_accept([this](error_code error, tcp::socket socket) {
      if (!acceptor.is_open()) return;
      if (error) {
        // Out of descriptors, mostly: trying again at once would spin.
        spdlog::warn("event=web_accept_failed error=\"{}\"", error.message());
        retry.expires_after(std::chrono::milliseconds(100));
        retry.async_wait([this](error_code waited) {
          if (!waited) accept();
        });
        return;
      }
      if (shared->open < shared->options.max_connections) {
        socket.set_option(tcp::no_delay(true), error);
        ++shared->open;
        std::shared_ptr<void> lease(nullptr, [shared = shared](void*) {
          if (--shared->open == 0 && shared->farewell != nullptr) shared->farewell->cancel();
        });
        auto connection =
            std::make_shared<HttpConnection>(std::move(socket), shared, std::move(lease));
        std::erase_if(shared->connections, [](const auto& weak) { return weak.expired(); });
        shared->connections.push_back(connection);
        connection->read();
      } else {
        spdlog::warn("event=web_refused reason=\"{} connections, which is the limit\"",
                     shared->open);
      }
      accept();
    });
  }

  asio::io_context context{1};
  tcp::acceptor acceptor{context};
  asio::steady_timer retry{context};
  std::shared_ptr<Shared> shared;
  std::string host;
  int port = 0;
  std::thread thread;
};

WebDoor::WebDoor(std::unique_ptr<State> state) : state_(std::move(state)) {}

absl::StatusOr<std::unique_ptr<WebDoor>> WebDoor::open(WebOptions options, Services& services) {
  if (absl::Status status = check_http_bind(options.http, options.insecure); !status.ok()) {
    return status;
  }
  auto state = std::make_unique<State>(std::move(options));
  Shared& shared = *state->shared;
  const std::string& http = shared.options.http;
  const std::size_t colon = http.rfind(':');
  state->host = http.substr(0, colon);
  shared.services = &services;
  shared.mailbox = std::make_shared<Mailbox>(state->context);
  shared.rules.bound_host = host_name(http);
  for (const std::string& host : shared.options.hosts) {
    shared.rules.hosts.push_back(host_name(host));
  }

  const auto cant = [&](const char* what, const error_code& error) {
    return absl::UnavailableError(
        absl::StrCat("--http: can't ", what, " ", http, ": ", error.message()));
  };
  error_code error;
  tcp::resolver resolver(state->context);
  const auto found =
      resolver.resolve(shared.rules.bound_host, http.substr(colon + 1),
                       tcp::resolver::passive | tcp::resolver::numeric_service, error);
  if (error || found.empty()) return cant("find", error);
  const tcp::endpoint endpoint = found.begin()->endpoint();
  state->acceptor.open(endpoint.protocol(), error);
  if (error) return cant("open", error);
  state->acceptor.set_option(asio::socket_base::reuse_address(true), error);
  state->acceptor.bind(endpoint, error);
  if (error) return cant("bind", error);
  state->acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) return cant("listen on", error);
  state->port = state->acceptor.local_endpoint(error).port();
  state->accept();
  State* raw = state.get();
  state->thread = std::thread([raw] { raw->context.run(); });
  return std::unique_ptr<WebDoor>(new WebDoor(std::move(state)));
}

WebDoor::~WebDoor() {
  State& state = *state_;
  asio::post(state.context, [&state] {
    error_code error;
    state.acceptor.close(error);
    state.retry.cancel();
    Shared& shared = *state.shared;
    if (shared.open > 0) {
      // Who does not answer the goodbye is cut.
      shared.farewell =
          std::make_unique<asio::steady_timer>(state.context, std::chrono::seconds(1));
      shared.farewell->async_wait([&state](error_code waited) {
        if (!waited) state.context.stop();
      });
    }
    for (const auto& weak : shared.connections) {
      if (const auto connection = weak.lock()) connection->go_away();
    }
  });
  state.thread.join();
  state.shared->mailbox->close();
}

int WebDoor::port() const { return state_->port; }

std::string WebDoor::address() const { return absl::StrCat(state_->host, ":", state_->port); }

}  // namespace throng::server
