#include "server/view/render_loop.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

#include "throng/render/control.hpp"
#include "throng/render/device_picture.hpp"
#include "throng/render/encode.hpp"

namespace throng::server {
namespace {

double milliseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

/// Who gets a frame: viewers with the index it has for them, or one caller of `picture`.
struct Recipients {
  std::vector<std::pair<std::shared_ptr<Viewer>, std::uint64_t>> viewers;
  HistoryNow history;
  PictureDone done;
};

void deliver(Recipients& to, const std::shared_ptr<const EncodedFrame>& frame) {
  for (auto& [viewer, index] : to.viewers) viewer->deliver(index, frame, to.history);
  if (to.done) to.done(frame);
}

void fail(Recipients& to, const absl::Status& status) {
  for (auto& [viewer, index] : to.viewers) viewer->end(status);
  if (to.done) to.done(status);
}

/// What decides every pixel of a frame.
struct FrameKey {
  std::weak_ptr<const render::Crowd> crowd;  // weak: a cache must not keep a history alive
  std::weak_ptr<const render::Environment> environment;
  std::int64_t scene_time_us = 0;
  std::int64_t older_time_us = 0, newer_time_us = 0;  // of the snapshots it lies between
  ViewRequest view;  // without its crowd, with the camera that is really used
};

bool equal(const FrameKey& a, const FrameKey& b) {
  return a.scene_time_us == b.scene_time_us && a.older_time_us == b.older_time_us &&
         a.newer_time_us == b.newer_time_us && !a.crowd.owner_before(b.crowd) &&
         !b.crowd.owner_before(a.crowd) && !a.environment.owner_before(b.environment) &&
         !b.environment.owner_before(a.environment) && same_picture(a.view, b.view);
}

/// A frame that may be sent again.
struct Shown {
  FrameKey key;
  std::shared_ptr<const EncodedFrame> frame;  // null until it is encoded
  std::vector<Recipients> waiting;            // for that
  Clock::time_point drawn;
  bool hurried = false;  // kept to a time: worth drawing again where nothing moves
};

struct EncodeJob {
  render::Picture picture;
  std::shared_ptr<EncodedFrame> frame;
  ImageFormat format = ImageFormat::kJpeg;
  int jpeg_quality = 80;
  double target_ms = 0.0;
  Clock::time_point began;
  std::shared_ptr<Shown> shown;  // null: to be sent once
  Recipients recipients;
};

/// How a viewer's budget is found.
struct ViewControl {
  std::unique_ptr<render::BudgetController> controller;
  Clock::time_point drawn;  // when a frame was last rendered for it
  std::uint64_t frame = 0;  // which one; viewers who share have the same
  double rate_hz = 0.0;     // asked for
};

constexpr std::size_t kCachedFrames = 8;
// What has rested for so long is drawn once more without hurry. A hand that moves meets no such
// frame, one that moves on waits for at most one.
constexpr std::chrono::milliseconds kRested{150};

/// What a view is drawn with that need not keep to a time: every agent, each in the cheapest form
/// that is off by less than can be seen, with 16 samples a pixel where that can be.
void draw_in_full(const RenderLoopOptions& options, bool can_oversample,
                  render::ViewSettings& settings) {
  constexpr float kUnseenPx = 0.25F;
  render::Selection& selection = settings.selection;
  selection.form = render::FormRule::kMixed;
  selection.vertex_budget =
      std::max(options.default_vertex_budget, render::ControlSettings().most_budget);
  selection.mixed.error_px = kUnseenPx;
  selection.mixed.least_px = kUnseenPx;
  settings.oversampling = can_oversample ? 2 : 1;
}

/// What a frame took. Of a picture that is still being drawn it is the time without the drawing.
render::FrameCost cost_of(const render::FrameStats& stats, std::uint32_t oversampling);

}  // namespace

struct RenderLoop::State {
  explicit State(RenderLoopOptions loop_options) : options(std::move(loop_options)) {}

  void render_thread(MakeRenderer make_renderer);
  void encode_thread();
  void draw(FrameRenderer& renderer, const PictureRequest& request, Recipients recipients,
            Clock::time_point now);
  bool next_work(std::optional<PictureRequest>& request, Recipients& recipients,
                 Clock::time_point& now);

  double target_ms(Clock::time_point now) const;
  render::FramePlan controlled_plan(const Recipients& recipients, Clock::time_point now);
  std::shared_ptr<Shown> find_shown(const FrameKey& key, const Recipients& recipients) const;
  void remember(const Recipients& recipients, const std::shared_ptr<Shown>& entry);
  bool can_oversample() const;
  void record(const Viewer& viewer, const render::FrameCost& cost);

  const RenderLoopOptions options;

  mutable std::mutex mutex;
  std::condition_variable changed;      // work for the render thread, or stop
  std::condition_variable job_changed;  // `job` came or went, or stop
  bool stop = false;
  bool woken = false;
  bool picture_was_last = false;     // of what the render thread took up
  std::optional<absl::Status> made;  // how making the renderer ended
  std::string compute_name, raster_name, raster_detail;
  std::vector<std::shared_ptr<Viewer>> viewers;
  std::unordered_map<const Viewer*, ViewControl> controls;  // of viewers that name no budget
  render::WorkCost learned;  // by the last of them: what the next one starts from
  std::deque<std::pair<PictureRequest, PictureDone>> pictures;
  std::optional<EncodeJob> job;
  std::vector<render::Picture> spare_pictures;
  std::deque<std::shared_ptr<Shown>> cache;  // newest last
  // what a viewer got last is known however many frames others got since
  std::unordered_map<const Viewer*, std::shared_ptr<Shown>> shown_last;
  double still_ms = 0.0;  // what the last picture without hurry took
  RenderLoopCounters counters;

  /// The render thread's: a frame whose time its device tells with the next one.
  struct LeftOnDevice {
    std::vector<std::weak_ptr<const Viewer>> viewers;
    render::FrameCost cost;
  };
  std::optional<LeftOnDevice> left_on_device;

  std::thread renderer, encoder;
};

RenderLoop::RenderLoop(std::unique_ptr<State> state) : state_(std::move(state)) {}

absl::StatusOr<std::unique_ptr<RenderLoop>> RenderLoop::start(MakeRenderer make_renderer,
                                                              RenderLoopOptions options) {
  if (options.target_ms != 0.0) {  // 0: no controller
    absl::Status status = render::check_control(options.target_ms,
                                                static_cast<double>(options.default_vertex_budget));
    if (!status.ok()) return status;
  }
  std::unique_ptr<RenderLoop> loop(new RenderLoop(std::make_unique<State>(std::move(options))));
  State* state = loop->state_.get();
  state->renderer = std::thread([state, make = std::move(make_renderer)]() mutable {
    state->render_thread(std::move(make));
  });
  state->encoder = std::thread([state] { state->encode_thread(); });
  std::unique_lock lock(state->mutex);
  state->job_changed.wait(lock, [state] { return state->made.has_value(); });
  if (!state->made->ok()) return *state->made;
  return loop;
}

RenderLoop::~RenderLoop() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->stop = true;
  }
  state_->changed.notify_all();
  state_->job_changed.notify_all();
  state_->renderer.join();
  state_->encoder.join();
  for (auto& [request, done] : state_->pictures) {
    done(absl::UnavailableError("the server is stopping"));
  }
}

void RenderLoop::add(std::shared_ptr<Viewer> viewer) {
  const std::lock_guard lock(state_->mutex);
  state_->viewers.push_back(std::move(viewer));
  state_->woken = true;
  state_->changed.notify_one();
}

void RenderLoop::remove(const Viewer* viewer) {
  const std::lock_guard lock(state_->mutex);
  std::erase_if(state_->viewers, [viewer](const auto& entry) { return entry.get() == viewer; });
  state_->controls.erase(viewer);
  state_->shown_last.erase(viewer);
}

void RenderLoop::wake() {
  const std::lock_guard lock(state_->mutex);
  state_->woken = true;
  state_->changed.notify_one();
}

absl::Status RenderLoop::picture(PictureRequest request, PictureDone done) {
  const std::lock_guard lock(state_->mutex);
  if (state_->stop) return absl::UnavailableError("the server is stopping");
  if (state_->pictures.size() >= state_->options.max_pending_pictures) {
    return absl::ResourceExhaustedError(absl::StrCat("picture: ", state_->pictures.size(),
                                                     " wait, at most ",
                                                     state_->options.max_pending_pictures));
  }
  state_->pictures.emplace_back(std::move(request), std::move(done));
  state_->changed.notify_one();
  return absl::OkStatus();
}

std::string RenderLoop::compute_name() const {
  const std::lock_guard lock(state_->mutex);
  return state_->compute_name;
}

std::string RenderLoop::raster_detail() const {
  const std::lock_guard lock(state_->mutex);
  return state_->raster_detail;
}
std::string RenderLoop::raster_name() const {
  const std::lock_guard lock(state_->mutex);
  return state_->raster_name;
}

RenderLoopCounters RenderLoop::counters() const {
  const std::lock_guard lock(state_->mutex);
  return state_->counters;
}

void RenderLoop::State::render_thread(MakeRenderer make_renderer) {
  absl::StatusOr<std::unique_ptr<FrameRenderer>> made_renderer = make_renderer();
  {
    const std::lock_guard lock(mutex);
    made = made_renderer.status();
    if (made_renderer.ok()) {
      compute_name = (*made_renderer)->compute_name();
      raster_name = (*made_renderer)->raster_name();
      raster_detail = (*made_renderer)->raster_detail();
    }
  }
  job_changed.notify_all();
  if (!made_renderer.ok()) return;

  std::optional<PictureRequest> request;
  Recipients recipients;
  Clock::time_point now;
  while (next_work(request, recipients, now)) {
    draw(**made_renderer, *request, std::move(recipients), now);
    request.reset();
    recipients = Recipients();
  }
}

/// Waits for something to draw; false: stop.
bool RenderLoop::State::next_work(std::optional<PictureRequest>& request, Recipients& recipients,
                                  Clock::time_point& now) {
  std::vector<std::shared_ptr<Viewer>> orphans;
  std::unique_lock lock(mutex);
  while (!stop) {
    now = options.now();
    woken = false;
    // The viewer that is due first; viewers whose crowd is gone are told so.
    std::shared_ptr<Viewer> first;
    Clock::time_point first_due = Clock::time_point::max();
    std::erase_if(viewers, [&](const std::shared_ptr<Viewer>& viewer) {
      if (viewer->request().crowd->deleted()) {
        controls.erase(viewer.get());
        shown_last.erase(viewer.get());
        orphans.push_back(viewer);
        return true;
      }
      const std::optional<Clock::time_point> due = viewer->due();
      if (due.has_value() && *due < first_due) {
        first = viewer;
        first_due = *due;
      }
      return false;
    });
    if (!orphans.empty()) {
      lock.unlock();
      for (const auto& viewer : orphans) {
        viewer->end(absl::NotFoundError(
            absl::StrCat("crowd_name: crowd '", viewer->request().crowd->name(), "' was deleted")));
      }
      orphans.clear();
      lock.lock();
      continue;
    }
    // A still picture goes first, but not twice while a viewer waits: who asks for one after the
    // other must not stop the streams.
    const bool viewer_waits = first != nullptr && first_due <= now;
    if (!pictures.empty() && !(picture_was_last && viewer_waits)) {
      request = std::move(pictures.front().first);
      recipients.done = std::move(pictures.front().second);
      pictures.pop_front();
      picture_was_last = true;
      return true;
    }
    picture_was_last = false;
    if (first == nullptr) {
      changed.wait(lock, [this] { return stop || woken || !pictures.empty(); });
      continue;
    }
    if (first_due > now) {
      changed.wait_for(lock, first_due - now,
                       [this] { return stop || woken || !pictures.empty(); });
      continue;
    }

    // Whoever wants the same picture soon gets this one: a frame early is not seen, a frame
    // rendered twice is.
    request.emplace();
    request->view = first->request();
    const auto soon = now + std::chrono::duration_cast<Clock::duration>(
                                std::chrono::duration<double>(0.5 / request->view.max_rate_hz));
    for (const std::shared_ptr<Viewer>& viewer : viewers) {
      const std::optional<Clock::time_point> due = viewer->due();
      if (!due.has_value() || *due > soon) continue;
      const ViewRequest wanted = viewer == first ? request->view : viewer->request();
      if (!same_picture(wanted, request->view)) continue;
      recipients.viewers.emplace_back(viewer, viewer->begin_frame(now, wanted.stamp));
    }
    return true;
  }
  return false;
}

void RenderLoop::State::draw(FrameRenderer& renderer, const PictureRequest& request,
                             Recipients recipients, Clock::time_point now) {
  const ViewRequest& view = request.view;
  const Clock::time_point began = Clock::now();
  const Moment moment = view.crowd->moment(now);
  const std::int64_t scene_time_us = request.scene_time_us.value_or(
      view.playhead.at(now, moment.oldest_time_us, moment.scene_time_us));

  // The same picture again?
  FrameKey key;
  key.crowd = moment.crowd;
  key.environment = moment.crowd->environment();
  key.scene_time_us = scene_time_us;
  key.view = view;
  key.view.crowd = nullptr;
  key.view.playhead = Playhead();  // it is the moment that counts, not the way there
  recipients.history = {moment.oldest_time_us, moment.newest_time_us, moment.live};
  const AgentsAt agents = agents_at(moment, scene_time_us);
  WorldBox overview = overview_of(moment, agents);
  if (const auto box = box_of(agents);
      box.has_value() && scene_time_us != moment.scene_time_us && !recipients.viewers.empty()) {
    overview = recipients.viewers.front().first->overview_of_past(*box, scene_time_us, now);
  }
  if (!view.camera.has_value()) {
    key.view.camera = render::overview_camera(overview.low, overview.high, view.viewport);
  }
  if (agents.bracket.older != nullptr) {
    key.older_time_us = agents.bracket.older->time_us;
    key.newer_time_us = agents.bracket.newer->time_us;
  }
  std::uint64_t followed_agent = 0;
  if (view.follow_agent != 0) {
    if (const auto agent = find_agent(agents, view.follow_agent)) {
      follow(agent->position_world, *key.view.camera);
      followed_agent = view.follow_agent;
    }
  }
  std::shared_ptr<Shown> known;
  if (!recipients.viewers.empty()) {
    std::unique_lock lock(mutex);
    known = find_shown(key, recipients);
    const auto rested = std::max<Clock::duration>(
        kRested, std::chrono::duration_cast<Clock::duration>(
                     std::chrono::duration<double, std::milli>(still_ms)));
    const bool is_again = known != nullptr && known->hurried && known->frame != nullptr &&
                          now - known->drawn >= rested;
    if (known != nullptr && !is_again) {
      counters.shared_frames += recipients.viewers.size();
      remember(recipients, known);
      if (known->frame == nullptr) {
        known->waiting.push_back(std::move(recipients));
        return;
      }
      lock.unlock();
      deliver(recipients, known->frame);
      return;
    }
  }

  EncodeJob next;
  {
    const std::lock_guard lock(mutex);
    if (!spare_pictures.empty()) {
      next.picture = std::move(spare_pictures.back());
      spare_pictures.pop_back();
    }
  }
  render::ViewSettings settings;
  settings.camera = *key.view.camera;
  settings.viewport = view.viewport;
  // a picture out of turn is the same whatever the machine did before
  const bool is_free = view.vertex_budget == 0 && options.target_ms > 0.0;
  const bool controlled = is_free && !recipients.viewers.empty() && known == nullptr;
  settings.selection.vertex_budget =
      view.vertex_budget != 0 ? view.vertex_budget : options.default_vertex_budget;
  settings.far = options.far;
  if (controlled) {
    const render::FramePlan plan = controlled_plan(recipients, now);
    settings.selection.vertex_budget = plan.vertex_budget;
    if (plan.points) settings.selection.form = render::FormRule::kPoints;
    if (plan.mixed) {
      settings.selection.form = render::FormRule::kMixed;
      settings.selection.mixed.budget_ms = plan.budget_ms;
      settings.selection.mixed.least_error_px = plan.least_error_px;
      settings.selection.mixed.cost = plan.cost;
      settings.oversampling = plan.oversampling;
    }
    settings.selection.point_size_px = plan.point_size_px;
    if (settings.far.enabled && !(options.far.distance_m > 0.0F)) {
      settings.far.distance_m = plan.far_distance_m;
      if (plan.far_least_px > 0.0F) settings.far.least_px = plan.far_least_px;
    }
    next.target_ms = plan.budget_ms;
    const std::lock_guard lock(mutex);
    settings.selection.motion = {plan.motion_distance_m, plan.motion_k_per_m,
                                 counters.rendered_frames};
  }
  if (is_free && !controlled) {
    draw_in_full(options, can_oversample(), settings);
    settings.far.wait = true;
  }
  if (options.form.has_value()) settings.selection.form = *options.form;
  settings.look.shadows = view.shadows;
  settings.channel = view.channel.empty() ? -1 : view.crowd->channel_index(view.channel);
  settings.look.color_by_channel = settings.channel >= 0;
  settings.look.channel_low = view.channel_low;
  settings.look.channel_high = view.channel_high;
  settings.look.color_map = view.color_map;
  next.frame = std::make_shared<EncodedFrame>();
  next.picture.may_stay = true;  // the encoder takes it from there
  std::optional<LeftOnDevice> before = std::exchange(left_on_device, std::nullopt);
  const absl::Status status =
      renderer.render(*moment.crowd, scene_time_us, settings, next.picture, next.frame->stats);
  if (!status.ok()) {
    {
      const std::lock_guard lock(mutex);
      ++counters.failed_frames;
      if (known != nullptr) known->hurried = false;  // as good as it gets
    }
    if (known != nullptr) {
      deliver(recipients, known->frame);
    } else {
      fail(recipients, status);
    }
    return;
  }
  if (before.has_value() && next.frame->stats.device_before_ms > 0.0) {
    before->cost.frame_ms = std::max(before->cost.frame_ms, next.frame->stats.device_before_ms);
    for (const auto& viewer : before->viewers) {
      if (const auto there = viewer.lock()) record(*there, before->cost);
    }
  }
  if (controlled) {
    const render::FrameCost cost = cost_of(next.frame->stats, settings.oversampling);
    const bool is_left = next.picture.on_device != nullptr;
    if (is_left) left_on_device = {{}, cost};
    for (const auto& [viewer, index] : recipients.viewers) {
      if (is_left) {
        left_on_device->viewers.emplace_back(viewer);
      } else {
        record(*viewer, cost);
      }
    }
  }
  next.frame->viewport = view.viewport;
  next.frame->camera = settings.camera;
  next.frame->overview = overview;
  // who chose an error by time says what that error asks for
  const render::ComputeCounters& counted = next.frame->stats.counters;
  next.frame->vertex_budget =
      is_free && counted.work.known ? counted.effective_budget : settings.selection.vertex_budget;
  next.frame->target_ms = next.target_ms;
  next.frame->scene_time_us = scene_time_us;
  next.frame->followed_agent = followed_agent;
  next.frame->agents = agents;
  next.format = request.format;
  next.jpeg_quality = view.jpeg_quality;
  next.began = began;
  next.frame->oversampling = settings.oversampling;
  next.frame->in_full = is_free && !controlled;
  next.recipients = std::move(recipients);

  // One picture may wait for the encoder; rendering further ahead would only add lag.
  std::unique_lock lock(mutex);
  ++counters.rendered_frames;
  if (settings.oversampling > 1) ++counters.oversampled_frames;
  if (!next.recipients.viewers.empty()) {
    counters.shared_frames += next.recipients.viewers.size() - 1;
  }
  if (known != nullptr) still_ms = milliseconds(Clock::now() - began);
  job_changed.wait(lock, [this] { return stop || !job.has_value(); });
  if (stop) {
    lock.unlock();
    fail(next.recipients, absl::UnavailableError("the server is stopping"));
    return;
  }
  if (!next.recipients.viewers.empty()) {
    next.shown = std::make_shared<Shown>();
    next.shown->key = std::move(key);
    next.shown->drawn = now;
    next.shown->hurried = controlled;
    if (known != nullptr) std::erase(cache, known);
    cache.push_back(next.shown);
    if (cache.size() > kCachedFrames) cache.pop_front();
    remember(next.recipients, next.shown);
  }
  job = std::move(next);
  job_changed.notify_all();
}

/// The newest frame of this picture; null: it has to be drawn.
std::shared_ptr<Shown> RenderLoop::State::find_shown(const FrameKey& key,
                                                     const Recipients& recipients) const {
  for (auto entry = cache.rbegin(); entry != cache.rend(); ++entry) {
    if (equal((*entry)->key, key)) return *entry;
  }
  for (const auto& [viewer, index] : recipients.viewers) {
    const auto last = shown_last.find(viewer.get());
    if (last != shown_last.end() && equal(last->second->key, key)) return last->second;
  }
  return nullptr;
}

void RenderLoop::State::remember(const Recipients& recipients,
                                 const std::shared_ptr<Shown>& entry) {
  for (const auto& [viewer, index] : recipients.viewers) {
    if (std::find(viewers.begin(), viewers.end(), viewer) == viewers.end()) continue;  // has left
    shown_last[viewer.get()] = entry;
  }
}

/// A device's pictures stay there, which means of four would not.
bool RenderLoop::State::can_oversample() const {
  return compute_name == "cpu" && !options.form.has_value();
}

/// Of one frame: all of the options' unless the views drawn of late ask for more frames than that
/// leaves time for. Then each frame is made shorter, so that detail goes before the rate does.
double RenderLoop::State::target_ms(Clock::time_point now) const {
  const double most_hz = 1000.0 / options.target_ms;
  std::vector<std::pair<std::uint64_t, double>> frames;  // each with the rate it is wanted at
  for (const auto& [viewer, control] : controls) {
    if (now - control.drawn < std::chrono::seconds(1)) {
      frames.emplace_back(control.frame, std::min(control.rate_hz, most_hz));
    }
  }
  std::sort(frames.begin(), frames.end());
  double wanted_hz = 0.0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool shared = i + 1 < frames.size() && frames[i + 1].first == frames[i].first;
    if (!shared) wanted_hz += frames[i].second;  // the highest rate of those who share it
  }
  return wanted_hz > most_hz ? 1000.0 / wanted_hz : options.target_ms;
}

render::FramePlan RenderLoop::State::controlled_plan(const Recipients& recipients,
                                                     Clock::time_point now) {
  const std::lock_guard lock(mutex);
  for (const auto& [viewer, index] : recipients.viewers) {
    if (std::find(viewers.begin(), viewers.end(), viewer) == viewers.end()) continue;  // has left
    ViewControl& control = controls[viewer.get()];
    if (control.controller == nullptr) {
      control.controller =
          render::make_controller({.kind = options.controller,
                                   .start_budget = options.default_vertex_budget,
                                   .cost = learned,
                                   .most_oversampling = can_oversample() ? 2U : 1U});
    }
    control.drawn = now;
    control.frame = counters.rendered_frames + counters.failed_frames;  // attempts so far
    control.rate_hz = viewer->request().max_rate_hz;
  }
  const auto first = controls.find(recipients.viewers.front().first.get());
  if (first == controls.end()) return {.vertex_budget = options.default_vertex_budget};
  return first->second.controller->next_plan(target_ms(now));
}

namespace {
render::FrameCost cost_of(const render::FrameStats& stats, std::uint32_t oversampling) {
  const render::StageTimes& times = stats.times;
  return {.frame_ms = times.advance_ms + times.cull_ms + times.select_ms + times.allocate_ms +
                      times.generate_ms + times.raster_ms + times.resolve_ms + times.read_back_ms,
          .visible = stats.counters.visible,
          .vertices = stats.counters.vertices,
          .farthest_m = stats.counters.farthest_m,
          .work = stats.counters.work,
          .error_px = stats.counters.error_px,
          .oversampling = oversampling,
          .work_ms = stats.work_ms};
}
}  // namespace

void RenderLoop::State::record(const Viewer& viewer, const render::FrameCost& cost) {
  const std::lock_guard lock(mutex);
  const auto control = controls.find(&viewer);
  if (control == controls.end()) return;
  control->second.controller->record(cost);
  learned = control->second.controller->learned();
}

namespace {

/// The picture of a job into its frame, on the device where the picture is and can be encoded
/// there.
absl::Status encode(EncodeJob& job, render::JpegEncoder& jpeg) {
  render::Picture& picture = job.picture;
  const bool is_jpeg = job.format == ImageFormat::kJpeg;
  if (const auto on_device = std::exchange(picture.on_device, nullptr)) {
    std::vector<std::uint8_t> bytes;
    const absl::Status made = is_jpeg ? on_device->encode_jpeg(job.jpeg_quality, bytes)
                                      : absl::UnimplementedError("no PNG there");
    if (made.ok()) {
      job.frame->image.assign(bytes.begin(), bytes.end());
      return made;
    }
    if (!absl::IsUnimplemented(made)) return made;
    if (absl::Status status = on_device->fetch(picture.rgbx); !status.ok()) return status;
  }
  if (is_jpeg) {
    const auto bytes =
        jpeg.encode(picture.rgbx, picture.width_px, picture.height_px, job.jpeg_quality);
    if (bytes.ok()) job.frame->image.assign(bytes->begin(), bytes->end());
    return bytes.status();
  }
  const auto bytes = render::encode_png(picture.rgbx, picture.width_px, picture.height_px);
  if (bytes.ok()) job.frame->image.assign(bytes->begin(), bytes->end());
  return bytes.status();
}

}  // namespace

void RenderLoop::State::encode_thread() {
  render::JpegEncoder jpeg;
  for (;;) {
    EncodeJob current;
    {
      std::unique_lock lock(mutex);
      job_changed.wait(lock, [this] { return stop || job.has_value(); });
      if (!job.has_value()) return;
      current = std::move(*job);
      job.reset();
    }
    job_changed.notify_all();

    const Clock::time_point began = Clock::now();
    const absl::Status status = encode(current, jpeg);
    const Clock::time_point ended = Clock::now();
    current.frame->stats.times.encode_ms = milliseconds(ended - began);
    current.frame->server_ms = milliseconds(ended - current.began);

    std::vector<Recipients> waiting;
    {
      const std::lock_guard lock(mutex);
      if (spare_pictures.size() < 2) spare_pictures.push_back(std::move(current.picture));
      if (status.ok()) {
        counters.encoded_bytes += current.frame->image.size();
      } else {
        ++counters.failed_frames;
      }
      if (current.shown != nullptr) {
        waiting.swap(current.shown->waiting);
        if (status.ok()) {
          current.shown->frame = current.frame;
        } else {
          std::erase(cache, current.shown);
          std::erase_if(shown_last, [&](const auto& last) { return last.second == current.shown; });
        }
      }
    }
    waiting.insert(waiting.begin(), std::move(current.recipients));
    for (Recipients& recipients : waiting) {
      if (status.ok()) {
        deliver(recipients, current.frame);
      } else {
        fail(recipients, status);
      }
    }
  }
}

}  // namespace throng::server
