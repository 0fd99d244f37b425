#pragma once

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/rpc/server.hpp"
#include "server/view/painter.hpp"
#include "throng/v1/crowd.grpc.pb.h"
#include "throng/v1/ingest.grpc.pb.h"
#include "throng/v1/server.grpc.pb.h"
#include "throng/v1/view.grpc.pb.h"

namespace throng::test {

/// Generous: it only bounds how long a broken build hangs.
constexpr std::chrono::seconds kDeadline{300};

/// A slow machine may need a second attempt to connect.
inline void prepare(grpc::ClientContext& context) {
  context.set_wait_for_ready(true);
  context.set_deadline(std::chrono::system_clock::now() + kDeadline);
}

template <typename T>
std::string bytes_of(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

/// A server in this process on a free port, with a painter instead of GL.
class TestServer {
 public:
  explicit TestServer(server::ServerOptions options = {}) {
    options.listen.listen = "127.0.0.1:0";
    if (options.drain_time == server::ServerOptions().drain_time) {
      options.drain_time = std::chrono::milliseconds(500);
    }
    auto started = server::Server::start(std::move(options), nobody_cast(), painter(log));
    EXPECT_TRUE(started.ok()) << started.status();
    if (started.ok()) server = *std::move(started);
  }

  std::string address() const { return server->address(); }

  /// A connection of its own.
  std::shared_ptr<grpc::Channel> channel() const {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel(address(), grpc::InsecureChannelCredentials(), arguments);
  }

  v1::CrowdInfo crowd(const std::string& name) const {
    grpc::ClientContext context;
    prepare(context);
    v1::GetCrowdRequest request;
    request.set_crowd_name(name);
    v1::GetCrowdResponse response;
    const grpc::Status status =
        v1::CrowdService::NewStub(channel())->GetCrowd(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.crowd();
  }

  std::shared_ptr<PainterLog> log = std::make_shared<PainterLog>();
  std::unique_ptr<server::Server> server;
};

/// One publishing stream, spoken by hand.
class Publishing {
 public:
  using Request = v1::PublishAgentsRequest;
  using Response = v1::PublishAgentsResponse;

  explicit Publishing(const std::shared_ptr<grpc::Channel>& channel)
      : stub_(v1::IngestService::NewStub(channel)) {
    prepare(context_);
    stream_ = stub_->PublishAgents(&context_);
  }
  ~Publishing() {
    if (!finished_) {
      context_.TryCancel();
      stream_->Finish();
    }
  }

  bool send(const Request& request) { return stream_->Write(request); }
  std::optional<Response> read() {
    Response response;
    if (!stream_->Read(&response)) return std::nullopt;
    return response;
  }
  /// The outcome of the next frame's acknowledgement; other acknowledgements are passed over.
  v1::FrameAck::Outcome outcome() {
    while (const auto response = read()) {
      if (response->has_frame()) return response->frame().outcome();
    }
    return v1::FrameAck::OUTCOME_UNSPECIFIED;
  }
  /// Reads to the end.
  grpc::Status finish() {
    stream_->WritesDone();
    return end();
  }
  /// As `finish`, for a stream that the server ends.
  grpc::Status end() {
    while (read()) {
    }
    finished_ = true;
    return stream_->Finish();
  }

  bool start(const std::string& crowd, const std::string& run = "run", bool take_over = false) {
    Request request;
    request.mutable_start()->set_crowd_name(crowd);
    request.mutable_start()->set_run_id(run);
    request.mutable_start()->set_take_over(take_over);
    return send(request);
  }
  bool membership(std::uint64_t epoch, const std::vector<std::uint64_t>& ids) {
    Request request;
    request.mutable_membership()->set_epoch(epoch);
    request.mutable_membership()->set_ids(bytes_of(ids));
    return send(request);
  }
  /// Rows [first, first + count) of a frame at `frame` tenths of a second.
  bool chunk(std::uint64_t frame, std::uint64_t epoch, std::uint32_t first, std::uint32_t count) {
    Request request;
    v1::AgentChunk& chunk = *request.mutable_chunk();
    chunk.set_frame_index(frame);
    chunk.set_scene_time_us(static_cast<std::int64_t>(frame) * 100'000);
    chunk.set_epoch(epoch);
    chunk.set_first_agent(first);
    chunk.set_positions(bytes_of(std::vector<float>(std::size_t{3} * count)));
    return send(request);
  }

 private:
  std::unique_ptr<v1::IngestService::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<Request, Response>> stream_;
  bool finished_ = false;
};

/// One view stream, spoken by hand.
class Viewing {
 public:
  explicit Viewing(const std::shared_ptr<grpc::Channel>& channel)
      : stub_(v1::ViewService::NewStub(channel)) {
    prepare(context_);
    stream_ = stub_->StreamView(&context_);
  }
  ~Viewing() {
    if (!finished_) {
      context_.TryCancel();
      stream_->Finish();
    }
  }

  /// A view of 32 x 16 pixels whose camera stands at x = `red`, which is how red the picture is.
  static v1::ViewOptions options(const std::string& crowd, double red) {
    v1::ViewOptions options;
    options.set_crowd_name(crowd);
    options.set_width_px(32);
    options.set_height_px(16);
    options.set_max_rate_hz(60.0);
    v1::Vec3& eye = *options.mutable_camera()->mutable_eye();
    eye.set_x(red);
    eye.set_y(50.0);
    eye.set_z(50.0);
    return options;
  }

  bool send(const v1::ViewOptions& options) {
    v1::StreamViewRequest request;
    *request.mutable_options() = options;
    return stream_->Write(request);
  }
  bool ack(std::uint64_t frame_index) {
    v1::StreamViewRequest request;
    request.set_acked_frame_index(frame_index);
    return stream_->Write(request);
  }
  std::optional<v1::StreamViewResponse> read() {
    v1::StreamViewResponse response;
    if (!stream_->Read(&response)) return std::nullopt;
    return response;
  }
  /// Reads and acknowledges.
  std::optional<v1::StreamViewResponse> next() {
    auto response = read();
    if (response) ack(response->frame_index());
    return response;
  }
  grpc::Status finish() {
    stream_->WritesDone();
    return end();
  }
  grpc::Status end() {
    while (read()) {
    }
    finished_ = true;
    return stream_->Finish();
  }

 private:
  std::unique_ptr<v1::ViewService::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamViewRequest, v1::StreamViewResponse>> stream_;
  bool finished_ = false;
};

/// A call of a service whose messages this test has no code for (health, reflection): the bytes of
/// the request go out, those of the responses come in.
class RawCall {
 public:
  RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
          const std::string& request, const std::string& authorization = {})
      : stub_(channel) {
    prepare(context_);
    if (!authorization.empty()) context_.AddMetadata("authorization", authorization);
    call_ = stub_.PrepareCall(&context_, method, &queue_);
    call_->StartCall(tag());
    wait();
    const grpc::Slice slice(request);
    call_->Write(grpc::ByteBuffer(&slice, 1), tag());
    wait();
    call_->WritesDone(tag());
    wait();
  }
  std::optional<std::string> read() {
    grpc::ByteBuffer buffer;
    call_->Read(&buffer, tag());
    if (!wait()) return std::nullopt;
    std::vector<grpc::Slice> slices;
    EXPECT_TRUE(buffer.Dump(&slices).ok());
    std::string bytes;
    for (const grpc::Slice& slice : slices) {
      bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
    }
    return bytes;
  }
  grpc::Status finish() {
    grpc::Status status;
    call_->Finish(&status, tag());
    wait();
    return status;
  }

 private:
  static void* tag() { return reinterpret_cast<void*>(1); }
  bool wait() {
    void* got = nullptr;
    bool ok = false;
    return queue_.Next(&got, &ok) && ok;
  }

  grpc::GenericStub stub_;
  grpc::ClientContext context_;
  grpc::CompletionQueue queue_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
};

}  // namespace throng::test
