#include "server/web/socket.hpp"

#include <absl/strings/str_cat.h>
#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/websocket.hpp>
#include <cstring>
#include <deque>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "server/rpc/convert.hpp"
#include "server/rpc/services.hpp"
#include "server/rpc/view_session.hpp"
#include "throng/v1/web.pb.h"

namespace throng::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using beast::error_code;

constexpr std::size_t kMostReplies = 16;   // that wait; no more is read until some are written
constexpr std::chrono::seconds kIdle{20};  // a ping after half of it

std::string to_json(const google::protobuf::Message& message) {
  std::string json;
  // Only fails for an Any of unknown type.
  (void)google::protobuf::util::MessageToJsonString(message, &json);
  return json;
}

/// One browser. All of it runs on the door's thread but `poke`.
class Socket final : public WebConnection, public std::enable_shared_from_this<Socket> {
 public:
  Socket(beast::tcp_stream stream, const WebOptions& options, Services& services,
         std::shared_ptr<Mailbox> mailbox, std::shared_ptr<void> lease)
      : stream_(std::move(stream)),
        pace_(stream_.get_executor()),
        options_(options),
        services_(services),
        mailbox_(std::move(mailbox)),
        lease_(std::move(lease)),
        connection_(++services.connections),
        authorized_(!services.gate->asks()) {}

  ~Socket() override { spdlog::debug("connection={} event=socket_closed", connection_); }

  void accept(const beast::http::request<beast::http::string_body>& upgrade) {
    websocket::stream_base::timeout timeout;
    timeout.handshake_timeout = std::chrono::seconds(10);
    timeout.idle_timeout = kIdle;
    timeout.keep_alive_pings = true;
    stream_.set_option(timeout);
    stream_.read_message_max(options_.max_message_bytes);
    stream_.auto_fragment(false);
    beast::get_lowest_layer(stream_).expires_never();
    stream_.async_accept(upgrade, [self = shared_from_this()](error_code error) {
      if (error) return self->end(error);
      spdlog::debug("connection={} event=socket_opened", self->connection_);
      self->open_ = true;
      self->read();
    });
  }

  void go_away() override { close(websocket::close_code::going_away, "the server is stopping"); }

 private:
  void read() {
    if (reading_ || !open_ || closing_ || replies_.size() >= kMostReplies) return;
    // Who floods is slowed down and harms nobody else.
    const Clock::time_point now = Clock::now();
    if (now - second_began_ >= std::chrono::seconds(1)) {
      second_began_ = now;
      messages_ = 0;
    }
    reading_ = true;
    if (++messages_ > options_.max_messages_per_second) {
      pace_.expires_at(second_began_ + std::chrono::seconds(1));
      pace_.async_wait([self = shared_from_this()](error_code) {
        self->reading_ = false;
        self->read();
      });
      return;
    }
    stream_.async_read(inbox_, [self = shared_from_this()](error_code error, std::size_t) {
      self->reading_ = false;
      if (error) return self->end(error);
      self->on_message();
      self->inbox_.consume(self->inbox_.size());
      self->pump();
      self->read();
    });
  }

  void on_message() {
    v1::WebRequest request;
    if (!stream_.got_text()) {
      return refuse(0, absl::InvalidArgumentError("message: it is binary, must be text (JSON)"));
    }
    const std::string_view text(static_cast<const char*>(inbox_.data().data()), inbox_.size());
    const auto parsed = google::protobuf::util::JsonStringToMessage(
        google::protobuf::StringPiece(text.data(), text.size()), &request);
    if (!parsed.ok()) {
      const std::string why(parsed.message().data(),
                            std::min<std::size_t>(parsed.message().size(), 300));
      return refuse(0,
                    absl::InvalidArgumentError(absl::StrCat("message: not a WebRequest: ", why)));
    }
    if (!authorized_) {
      const std::string authorization = absl::StrCat("Bearer ", request.token());
      const std::string_view shown(authorization);
      if (absl::Status status = services_.gate->check(request.token().empty() ? nullptr : &shown);
          !status.ok()) {
        refuse(request.id(), status);
        ends_after_replies_ = true;
        return;
      }
      authorized_ = true;
    }
    if (absl::Status status = answer(request); !status.ok()) refuse(request.id(), status);
  }

  absl::Status answer(const v1::WebRequest& request) {
    v1::WebResponse response;
    response.set_id(request.id());
    switch (request.request_case()) {
      case v1::WebRequest::kView:
        // An acknowledgement that crossed the end of its view.
        if (view_ == nullptr && !request.view().has_options() &&
            request.view().acked_frame_index() != 0) {
          return absl::OkStatus();
        }
        if (view_ == nullptr) open_view();
        return view_->handle(request.view());
      case v1::WebRequest::kListCrowds:
        for (const CrowdReport& report : services_.registry->list()) {
          fill_crowd(report, *response.mutable_list_crowds()->add_crowds());
        }
        response.mutable_list_crowds();
        break;
      case v1::WebRequest::kGetServerInfo:
        fill_server_info(services_, *response.mutable_get_server_info());
        break;
      case v1::WebRequest::kPickAgent: {
        absl::Status status =
            pick_agent(services_, request.pick_agent(), *response.mutable_pick_agent());
        if (!status.ok()) return status;
        break;
      }
      case v1::WebRequest::kEndView:
        ++view_number_;
        view_.reset();
        return absl::OkStatus();
      case v1::WebRequest::REQUEST_NOT_SET:
        if (!request.token().empty()) return absl::OkStatus();
        return absl::InvalidArgumentError("request: the message has none");
    }
    replies_.push_back(to_json(response));
    return absl::OkStatus();
  }

  void refuse(std::uint32_t id, const absl::Status& status) {
    spdlog::debug("connection={} event=request_refused status=\"{}\"", connection_,
                  status.ToString());
    v1::WebResponse response;
    response.set_id(id);
    response.mutable_error()->set_code(absl::StatusCodeToString(status.code()));
    response.mutable_error()->set_message(std::string(status.message()));
    replies_.push_back(to_json(response));
  }

  void open_view() {
    std::weak_ptr<Socket> weak = weak_from_this();
    // Called from the loop's threads, at times after this connection or its door has ended.
    const auto on_thread = [weak, mailbox = mailbox_](auto action) {
      mailbox->post([weak, action = std::move(action)] {
        if (const auto self = weak.lock()) action(*self);
      });
    };
    const std::uint64_t number = ++view_number_;
    view_ = std::make_unique<ViewSession>(
        services_, connection_, [on_thread] { on_thread([](Socket& self) { self.pump(); }); },
        [on_thread, number](absl::Status status) {
          on_thread([status = std::move(status), number](Socket& self) {
            if (self.view_number_ != number || self.view_ == nullptr) return;
            self.view_.reset();  // another crowd can be asked for
            self.refuse(0, status);
            self.pump();
          });
        });
  }

  /// Writes what is next: answers first, then the newest frame.
  void pump() {
    if (writing_ || closing_ || !open_) return;
    if (!replies_.empty()) {
      outbox_ = std::move(replies_.front());
      replies_.pop_front();
      stream_.text(true);
      return write(asio::buffer(outbox_));
    }
    if (ends_after_replies_) return close(websocket::close_code::policy_error, "no good token");
    if (view_ == nullptr) return;
    std::optional<OutgoingFrame> outgoing = view_->take();
    if (!outgoing.has_value()) return;

    v1::WebResponse response;
    v1::StreamViewResponse& frame = *response.mutable_frame();
    view_->describe(*outgoing, frame);
    // Nothing moved: the browser has this picture.
    const bool same = outgoing->frame == shown_;
    frame.set_same_image(same);
    shown_ = std::move(outgoing->frame);
    const std::string header = to_json(response);
    const auto size = static_cast<std::uint32_t>(header.size());
    outbox_.clear();
    for (int byte = 0; byte < 4; ++byte) outbox_.push_back(static_cast<char>(size >> (8 * byte)));
    outbox_ += header;
    stream_.binary(true);
    const asio::const_buffer image = same ? asio::const_buffer() : asio::buffer(shown_->image);
    write(std::array<asio::const_buffer, 2>{asio::buffer(outbox_), image});
  }

  template <typename Buffers>
  void write(const Buffers& buffers) {
    writing_ = true;
    stream_.async_write(buffers, [self = shared_from_this()](error_code error, std::size_t) {
      self->writing_ = false;
      if (error) return self->end(error);
      self->pump();
      self->read();
    });
  }

  void close(websocket::close_code code, const char* why) {
    if (closing_) return;
    closing_ = true;
    if (view_ != nullptr) view_->close();
    if (!open_) {
      beast::get_lowest_layer(stream_).close();
      return;
    }
    stream_.async_close(websocket::close_reason(code, why),
                        [self = shared_from_this()](error_code) {});
  }

  void end(error_code error) {
    if (open_ && error != websocket::error::closed) {
      spdlog::debug("connection={} event=socket_broke error=\"{}\"", connection_, error.message());
    }
    open_ = false;
    closing_ = true;
    pace_.cancel();
    view_.reset();
  }

  websocket::stream<beast::tcp_stream> stream_;
  asio::steady_timer pace_;
  const WebOptions& options_;
  Services& services_;
  const std::shared_ptr<Mailbox> mailbox_;
  const std::shared_ptr<void> lease_;
  const std::uint64_t connection_;
  bool authorized_;
  bool open_ = false;
  bool closing_ = false;
  bool ends_after_replies_ = false;
  bool reading_ = false;
  bool writing_ = false;
  beast::flat_buffer inbox_;
  std::string outbox_;
  std::deque<std::string> replies_;
  std::shared_ptr<const EncodedFrame> shown_;  // what was sent last
  std::unique_ptr<ViewSession> view_;
  std::uint64_t view_number_ = 0;
  Clock::time_point second_began_{};
  std::size_t messages_ = 0;  // in this second
};

}  // namespace

std::shared_ptr<WebConnection> open_socket(
    beast::tcp_stream stream, const beast::http::request<beast::http::string_body>& upgrade,
    const WebOptions& options, Services& services, std::shared_ptr<Mailbox> mailbox,
    std::shared_ptr<void> lease) {
  auto socket = std::make_shared<Socket>(std::move(stream), options, services, std::move(mailbox),
                                         std::move(lease));
  socket->accept(upgrade);
  return socket;
}

}  // namespace throng::server
