#include "client/view/view_stream.hpp"

#include <grpcpp/grpcpp.h>

#include "throng/v1/view.grpc.pb.h"

namespace throng::client {

struct ViewStream::State {
  std::shared_ptr<const Connection> connection;
  std::unique_ptr<v1::ViewService::Stub> stub;
  grpc::ClientContext context;
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamViewRequest, v1::StreamViewResponse>> stream;
  bool is_finished = false;
};

ViewStream::ViewStream(std::shared_ptr<const Connection> connection, const v1::ViewOptions& options,
                       std::optional<std::chrono::system_clock::time_point> deadline)
    : state_(std::make_unique<State>()) {
  state_->connection = std::move(connection);
  state_->stub = v1::ViewService::NewStub(state_->connection->channel());
  state_->connection->prepare(state_->context);
  if (deadline.has_value()) state_->context.set_deadline(*deadline);
  state_->stream = state_->stub->StreamView(&state_->context);
  v1::StreamViewRequest request;
  *request.mutable_options() = options;
  send(request);  // should it fail, so will the first read
}

ViewStream::~ViewStream() {
  if (state_->is_finished) return;
  cancel();
  finish().IgnoreError();
}

bool ViewStream::read(v1::StreamViewResponse& frame) { return state_->stream->Read(&frame); }

bool ViewStream::send(const v1::StreamViewRequest& request) {
  return state_->stream->Write(request);
}

void ViewStream::cancel() { state_->context.TryCancel(); }

absl::Status ViewStream::finish() {
  // A write that failed says nothing; the status does, after what is left to read.
  v1::StreamViewResponse frame;
  while (state_->stream->Read(&frame)) {
  }
  state_->is_finished = true;
  return from_grpc(state_->stream->Finish(), *state_->connection);
}

}  // namespace throng::client
