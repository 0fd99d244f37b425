#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <functional>
#include <memory>
#include <mutex>

#include "server/web/door.hpp"

namespace throng::server {

/// A connection that the door can end.
class WebConnection {
 public:
  virtual ~WebConnection() = default;
  /// On the door's thread.
  virtual void go_away() = 0;
};

/// Runs things on the door's thread for threads that may outlive the door.
class Mailbox {
 public:
  explicit Mailbox(boost::asio::io_context& context) : context_(&context) {}
  void post(std::function<void()> action) {
    const std::lock_guard lock(mutex_);
    if (context_ != nullptr) boost::asio::post(*context_, std::move(action));
  }
  /// What is posted from now on never runs.
  void close() {
    const std::lock_guard lock(mutex_);
    context_ = nullptr;
  }

 private:
  std::mutex mutex_;
  boost::asio::io_context* context_;
};

/// Takes over a connection that asked for a WebSocket: the talk of web.proto. Lives until the
/// connection ends; `lease` is let go of then.
std::shared_ptr<WebConnection> open_socket(
    boost::beast::tcp_stream stream,
    const boost::beast::http::request<boost::beast::http::string_body>& upgrade,
    const WebOptions& options, Services& services, std::shared_ptr<Mailbox> mailbox,
    std::shared_ptr<void> lease);

}  // namespace throng::server
