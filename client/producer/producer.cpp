#include "throng/client/producer.hpp"

#include <absl/strings/str_cat.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <mutex>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "throng/v1/ingest.grpc.pb.h"

namespace throng::client {
namespace {

static_assert(std::endian::native == std::endian::little);

using SteadyClock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kFirstBackoff{100};
constexpr std::chrono::milliseconds kLongestBackoff{5'000};
constexpr std::chrono::seconds kStartTimeout{10};
// Small enough to overlap sending with parsing, large enough that a message's own cost is lost.
constexpr std::uint64_t kChunkBytes = 1u << 20;
constexpr std::uint64_t kMessageOverhead = 1024;
constexpr double kFarthestM = 1e7;  // from the origin; a float32 is good for metres there, no more

struct Members {
  std::uint64_t epoch = 0;
  std::vector<std::uint64_t> ids;
  std::vector<std::string> names;
  std::vector<std::int32_t> characters;  // empty, or [A]
};

struct Frame {
  std::int64_t time_us = 0;
  std::shared_ptr<const Members> members;
  std::vector<float> positions;  // [A][3]
  std::vector<float> headings;   // [A] or empty
  std::vector<std::vector<float>> channels;
  std::vector<std::uint8_t> motion;  // [A] or empty
  std::vector<std::string> motion_names;
};

std::string random_id() {
  std::random_device device;
  const std::uint64_t bits = (std::uint64_t{device()} << 32) | device();
  return absl::StrCat("run-", absl::Hex(bits, absl::kZeroPad16));
}

template <typename T>
std::string bytes_of(const T* data, std::size_t count) {
  return std::string(reinterpret_cast<const char*>(data), count * sizeof(T));
}

}  // namespace

struct Producer::State {
  using Stream = grpc::ClientReaderWriter<v1::PublishAgentsRequest, v1::PublishAgentsResponse>;

  std::string crowd;
  ProducerOptions options;
  std::shared_ptr<const Connection> connection;

  // Only the publishing thread.
  std::shared_ptr<const Members> members;

  mutable std::mutex mutex;
  std::condition_variable changed;
  // All below are guarded by mutex.
  std::deque<Frame> queue;
  ProducerStats stats;
  bool closing = false;
  SteadyClock::time_point close_deadline;
  grpc::ClientContext* context = nullptr;  // of the stream that is open
  // State of the stream that is open.
  bool reader_ended = false;
  std::uint64_t max_chunk_bytes = 0;
  std::uint64_t sent_epoch = 0;
  std::uint64_t sent_index = 0;
  std::uint64_t acked_index = 0;
  bool sending = false;

  std::thread thread;

  void run();
  bool run_stream();
  void read_acks(Stream& stream);
  bool send(Stream& stream, const Frame& frame, std::uint64_t frame_index,
            v1::PublishAgentsRequest& message);
  v1::PublishAgentsRequest start_message() const;
  bool idle() const { return queue.empty() && !sending && acked_index >= sent_index; }
};

v1::PublishAgentsRequest Producer::State::start_message() const {
  v1::PublishAgentsRequest message;
  v1::StartPublishing& start = *message.mutable_start();
  start.set_crowd_name(crowd);
  start.set_run_id(options.run_id);
  start.mutable_origin()->set_x(options.origin_m[0]);
  start.mutable_origin()->set_y(options.origin_m[1]);
  start.mutable_origin()->set_z(options.origin_m[2]);
  for (std::size_t i = 0; i < options.channels.size(); ++i) {
    v1::Channel& channel = *start.add_channels();
    channel.set_name(options.channels[i]);
    if (i < options.units.size()) channel.set_unit(options.units[i]);
  }
  start.set_seed(options.seed);
  start.set_take_over(options.take_over);
  start.set_producer(options.producer);
  start.set_expected_rate_hz(options.expected_rate_hz);
  return message;
}

void Producer::State::run() {
  std::chrono::milliseconds backoff = kFirstBackoff;
  for (;;) {
    const bool started = run_stream();
    if (started) backoff = kFirstBackoff;
    std::unique_lock lock(mutex);
    if (closing || stats.ended) break;
    const auto until = SteadyClock::now() + backoff;
    changed.wait_until(lock, until, [this] { return closing; });
    backoff = std::min(2 * backoff, kLongestBackoff);
    if (closing && (queue.empty() || SteadyClock::now() >= close_deadline)) break;
  }
  const std::lock_guard lock(mutex);
  stats.connected = false;
  stats.dropped += queue.size();
  queue.clear();
  changed.notify_all();
}

/// One connection from start to end; true if the server took the crowd.
bool Producer::State::run_stream() {
  grpc::ClientContext stream_context;
  connection->prepare(stream_context);
  {
    const std::lock_guard lock(mutex);
    context = &stream_context;
    reader_ended = false;
    max_chunk_bytes = 0;
    sent_epoch = sent_index = acked_index = 0;
  }
  const auto stub = v1::IngestService::NewStub(connection->channel());
  const std::unique_ptr<Stream> stream = stub->PublishAgents(&stream_context);
  bool writable = stream->Write(start_message());
  std::thread reader([this, &stream] { read_acks(*stream); });

  bool started = false;
  {
    std::unique_lock lock(mutex);
    auto until = SteadyClock::now() + kStartTimeout;
    if (closing) until = std::min(until, close_deadline);
    changed.wait_until(lock, until, [this] { return max_chunk_bytes != 0 || reader_ended; });
    started = max_chunk_bytes != 0;
    if (started) {
      ++stats.connects;
      stats.connected = true;
      stats.last_error = absl::OkStatus();
      changed.notify_all();
    } else {
      // A call that the server has ended keeps its status only if it is not cancelled now.
      if (!reader_ended) stream_context.TryCancel();
      writable = false;
    }
  }
  v1::PublishAgentsRequest message;
  if (writable && !options.walkable_area_wkt.empty()) {
    message.mutable_environment()->set_walkable_area_wkt(options.walkable_area_wkt);
    writable = stream->Write(message);
  }

  // Send until something ends: the producer, the server or the connection.
  std::optional<Frame> newest;
  while (writable) {
    std::uint64_t index = 0;
    {
      std::unique_lock lock(mutex);
      changed.wait(lock, [this] { return !queue.empty() || closing || reader_ended; });
      if (reader_ended || queue.empty()) break;
      newest = std::move(queue.front());
      queue.pop_front();
      sending = true;
      index = ++sent_index;
    }
    writable = send(*stream, *newest, index, message);
    const std::lock_guard lock(mutex);
    sending = false;
    if (writable) ++stats.sent;
    changed.notify_all();
  }
  stream->WritesDone();
  {
    std::unique_lock lock(mutex);
    const auto until =
        closing ? close_deadline : SteadyClock::now() + std::chrono::milliseconds(500);
    if (!changed.wait_until(lock, until, [this] { return reader_ended; })) {
      stream_context.TryCancel();
    }
  }
  reader.join();
  const grpc::Status status = stream->Finish();
  const absl::Status error = from_grpc(status, *connection);

  const std::lock_guard lock(mutex);
  context = nullptr;
  stats.connected = false;
  if (!error.ok()) stats.last_error = error;
  if (acked_index < sent_index) {
    stats.dropped += sent_index - acked_index;
    // The last frame of a simulation that has ended would otherwise never be seen.
    if (newest.has_value() && queue.empty() && !status.ok() &&
        status.error_code() == grpc::StatusCode::UNAVAILABLE) {
      queue.push_front(*std::move(newest));
      --stats.dropped;
    }
  }
  sent_index = acked_index = 0;
  // Taking the crowd back would end the other producer's stream, which would take it back.
  if (status.error_code() == grpc::StatusCode::ABORTED) stats.ended = true;
  changed.notify_all();
  return started;
}

void Producer::State::read_acks(Stream& stream) {
  v1::PublishAgentsResponse response;
  while (stream.Read(&response)) {
    const std::lock_guard lock(mutex);
    if (response.has_start()) {
      max_chunk_bytes =
          std::max<std::uint64_t>(2 * kMessageOverhead, response.start().max_chunk_bytes());
    } else if (response.has_frame()) {
      const v1::FrameAck& ack = response.frame();
      acked_index = std::max(acked_index, ack.frame_index());
      stats.viewers = ack.viewers();
      switch (ack.outcome()) {
        case v1::FrameAck::OUTCOME_APPLIED:
          ++stats.applied;
          break;
        case v1::FrameAck::OUTCOME_LATE:
          ++stats.late;
          break;
        case v1::FrameAck::OUTCOME_INCOMPLETE:
          ++stats.incomplete;
          break;
        case v1::FrameAck::OUTCOME_UNKNOWN_EPOCH:
          ++stats.unknown_epoch;
          sent_epoch = 0;  // the next frame brings its membership again
          break;
        default:
          break;
      }
    }
    changed.notify_all();
  }
  const std::lock_guard lock(mutex);
  reader_ended = true;
  changed.notify_all();
}

bool Producer::State::send(Stream& stream, const Frame& frame, std::uint64_t frame_index,
                           v1::PublishAgentsRequest& message) {
  const Members& members = *frame.members;
  std::uint64_t chunk_limit = 0;
  bool with_membership = false;
  {
    const std::lock_guard lock(mutex);
    chunk_limit = std::min(kChunkBytes, max_chunk_bytes) - kMessageOverhead;
    with_membership = sent_epoch != members.epoch;
    sent_epoch = members.epoch;
  }
  if (with_membership) {
    v1::Membership& membership = *message.mutable_membership();
    membership.set_epoch(members.epoch);
    membership.set_ids(bytes_of(members.ids.data(), members.ids.size()));
    membership.clear_names();
    for (const std::string& name : members.names) membership.add_names(name);
    membership.set_characters(bytes_of(members.characters.data(), members.characters.size()));
    if (!stream.Write(message)) return false;
  }

  const std::uint64_t agents = members.ids.size();
  const std::uint64_t row_bytes = 12 + (frame.headings.empty() ? 0 : 4) +
                                  4 * frame.channels.size() + (frame.motion.empty() ? 0 : 1);
  for (const std::string& name : frame.motion_names) {
    chunk_limit -= std::min<std::uint64_t>(chunk_limit, name.size() + 4);
  }
  const std::uint64_t rows_at_most = std::max<std::uint64_t>(1, chunk_limit / row_bytes);
  std::uint64_t first = 0;
  do {
    const std::uint64_t rows = std::min(rows_at_most, agents - first);
    v1::AgentChunk& chunk = *message.mutable_chunk();
    chunk.set_frame_index(frame_index);
    chunk.set_scene_time_us(frame.time_us);
    chunk.set_epoch(members.epoch);
    chunk.set_first_agent(static_cast<std::uint32_t>(first));
    chunk.set_positions(frame.positions.data() + 3 * first, rows * 3 * sizeof(float));
    // The message is used again and again: a column of an earlier frame must not stay in it.
    if (frame.headings.empty()) {
      chunk.clear_orientation();
    } else {
      chunk.set_headings(frame.headings.data() + first, rows * sizeof(float));
    }
    if (frame.channels.empty()) chunk.clear_channels();
    while (chunk.channels_size() < static_cast<int>(frame.channels.size())) chunk.add_channels();
    for (std::size_t i = 0; i < frame.channels.size(); ++i) {
      chunk.set_channels(static_cast<int>(i), frame.channels[i].data() + first,
                         rows * sizeof(float));
    }
    chunk.clear_motion_names();
    if (frame.motion.empty()) {
      chunk.clear_motions();
    } else {
      chunk.set_motions(frame.motion.data() + first, rows);
      for (const std::string& name : frame.motion_names) chunk.add_motion_names(name);
    }
    if (!stream.Write(message)) return false;
    first += rows;
  } while (first < agents);
  return true;
}

Producer::Producer(std::shared_ptr<State> state) : state_(std::move(state)) {}

std::unique_ptr<Producer> Producer::connect(std::string url, std::string crowd,
                                            ProducerOptions options) {
  auto state = std::make_shared<State>();
  state->crowd = std::move(crowd);
  options.connection.url = std::move(url);
  options.queue_frames = std::max<std::size_t>(1, options.queue_frames);
  if (options.run_id.empty()) options.run_id = random_id();
  state->options = std::move(options);
  auto connection = Connection::open(state->options.connection);
  if (connection.ok()) {
    state->connection = *std::move(connection);
    state->thread = std::thread([raw = state.get()] { raw->run(); });
  } else {
    state->stats.ended = true;
    state->stats.last_error = connection.status();
  }
  return std::unique_ptr<Producer>(new Producer(std::move(state)));
}

Producer::~Producer() { close(std::chrono::seconds(1)); }

bool Producer::publish(std::int64_t time_us, std::span<const std::uint64_t> ids,
                       std::span<const double> positions, std::span<const float> headings,
                       std::span<const std::span<const float>> channels,
                       const MotionColumn& motions) noexcept {
  State& state = *state_;
  absl::Status error;
  try {
    const std::size_t agents = ids.size();
    const std::size_t axes = agents == 0 ? 3 : positions.size() / agents;
    bool fits = positions.size() == agents * axes && (axes == 2 || axes == 3) &&
                (headings.empty() || headings.size() == agents) &&
                (channels.empty() || channels.size() == state.options.channels.size()) &&
                (motions.motion.empty() || motions.motion.size() == agents);
    for (const std::span<const float>& channel : channels) fits = fits && channel.size() == agents;
    if (!fits) {
      error = absl::InvalidArgumentError(
          absl::StrCat("publish: ", agents, " ids, ", positions.size(), " coordinates, ",
                       headings.size(), " headings, ", channels.size(), " channels and ",
                       motions.motion.size(), " motions do not fit each other"));
    } else if (const auto wrong =
                   std::find_if(motions.motion.begin(), motions.motion.end(),
                                [&](std::uint8_t code) { return code > motions.names.size(); });
               wrong != motions.motion.end()) {
      error = absl::InvalidArgumentError(absl::StrCat("publish: a motion is ", int{*wrong}, ", ",
                                                      motions.names.size(), " names are there"));
    } else if (motions.names.size() > 64) {
      error = absl::InvalidArgumentError(
          absl::StrCat("publish: ", motions.names.size(), " names of motions, at most 64"));
    }

    Frame frame;
    frame.time_us = time_us;
    if (error.ok()) {
      frame.positions.resize(3 * agents);
      for (std::size_t i = 0; i < agents; ++i) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double value = axis < axes ? positions[i * axes + axis] : 0.0;
          const double offset = value - state.options.origin_m[axis];
          if (!(std::abs(offset) <= kFarthestM)) {
            error = absl::InvalidArgumentError(
                absl::StrCat("publish: agent ", ids[i], " stands at ", value, " m, must be within ",
                             kFarthestM, " m of the origin, ", state.options.origin_m[axis]));
          }
          frame.positions[3 * i + axis] = static_cast<float>(offset);
        }
      }
      frame.headings.assign(headings.begin(), headings.end());
      for (const std::span<const float>& channel : channels) {
        frame.channels.emplace_back(channel.begin(), channel.end());
      }
      frame.motion.assign(motions.motion.begin(), motions.motion.end());
      frame.motion_names.assign(motions.names.begin(), motions.names.end());
    }

    // A new membership only where the ids, or their order, are not those of the frame before.
    if (error.ok() &&
        (state.members == nullptr || !std::equal(ids.begin(), ids.end(), state.members->ids.begin(),
                                                 state.members->ids.end()))) {
      auto members = std::make_shared<Members>();
      members->epoch = state.members != nullptr ? state.members->epoch + 1 : 1;
      members->ids.assign(ids.begin(), ids.end());
      std::vector<std::uint64_t> sorted = members->ids;
      std::sort(sorted.begin(), sorted.end());
      const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
      if (twice != sorted.end()) {
        error = absl::InvalidArgumentError(absl::StrCat("publish: id ", *twice, " is there twice"));
      } else {
        if (state.options.agent_name) {
          bool any = false;
          for (const std::uint64_t id : ids) {
            members->names.push_back(state.options.agent_name(id));
            any = any || !members->names.back().empty();
          }
          if (!any) members->names.clear();
        }
        if (state.options.agent_character) {
          for (const std::uint64_t id : ids) {
            members->characters.push_back(state.options.agent_character(id));
          }
          const auto is_chosen = [](std::int32_t character) { return character >= 0; };
          if (std::ranges::none_of(members->characters, is_chosen)) members->characters.clear();
        }
        state.members = std::move(members);
      }
    }
    frame.members = state.members;

    const std::lock_guard lock(state.mutex);
    ++state.stats.published;
    if (!error.ok()) {
      ++state.stats.rejected;
      state.stats.last_error = std::move(error);
      return false;
    }
    if (state.stats.ended || state.closing) {
      ++state.stats.dropped;
      return true;
    }
    if (state.queue.size() >= state.options.queue_frames) {
      state.queue.pop_front();
      ++state.stats.dropped;
    }
    state.queue.push_back(std::move(frame));
    state.changed.notify_all();
    return true;
  } catch (...) {
    // Out of memory: the simulation is worth more than this frame.
    const std::lock_guard lock(state.mutex);
    ++state.stats.published;
    ++state.stats.rejected;
    return false;
  }
}

absl::Status Producer::flush(std::chrono::milliseconds timeout) {
  State& state = *state_;
  std::unique_lock lock(state.mutex);
  state.changed.wait_for(lock, timeout, [&state] { return state.idle() || state.stats.ended; });
  if (state.idle() && !state.stats.ended) return absl::OkStatus();
  if (!state.stats.last_error.ok()) return state.stats.last_error;
  return absl::DeadlineExceededError(
      absl::StrCat("flush: ", state.queue.size(), " frames wait after ", timeout.count(), " ms"));
}

absl::Status Producer::wait_connected(std::chrono::milliseconds timeout) {
  State& state = *state_;
  std::unique_lock lock(state.mutex);
  // Unavailable may pass (a server that starts); any other refusal is final for the caller.
  const auto refused = [&state] {
    const absl::Status& error = state.stats.last_error;
    return state.stats.ended || (!error.ok() && !absl::IsUnavailable(error));
  };
  state.changed.wait_for(lock, timeout, [&] { return state.stats.connected || refused(); });
  if (state.stats.connected) return absl::OkStatus();
  if (!state.stats.last_error.ok()) return state.stats.last_error;
  return absl::DeadlineExceededError(absl::StrCat(
      "connect: no answer from ", state.connection->address(), " in ", timeout.count(), " ms"));
}

void Producer::close(std::chrono::milliseconds timeout) {
  State& state = *state_;
  if (!state.thread.joinable()) return;
  {
    std::unique_lock lock(state.mutex);
    state.closing = true;
    state.close_deadline = SteadyClock::now() + timeout;
    state.changed.notify_all();
    // What is still there at the deadline is given up, whatever it waits for.
    const bool done = state.changed.wait_until(lock, state.close_deadline, [&state] {
      return state.context == nullptr && state.queue.empty();
    });
    if (!done && state.context != nullptr) state.context->TryCancel();
    state.changed.notify_all();
  }
  state.thread.join();
}

ProducerStats Producer::stats() const {
  const std::lock_guard lock(state_->mutex);
  return state_->stats;
}

}  // namespace throng::client
