#include <absl/strings/str_cat.h>

#include <array>
#include <chrono>
#include <ctime>
#include <optional>
#include <utility>
#include <vector>

#include "render/frame/faster_rasterizer.hpp"
#include "render/frame/passes.hpp"
#include "render/frame/shrink.hpp"
#include "throng/render/environment.hpp"
#include "throng/render/far_crowd.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

/// Adds the time since the last call (or construction) to one stage.
class StageClock {
 public:
  StageClock(FrameStats& stats, bool cpu)
      : stats_(stats), cpu_(cpu), last_cpu_ms_(cpu ? cpu_ms() : 0.0) {}

  void stop(double StageTimes::*stage) {
    const auto now = std::chrono::steady_clock::now();
    stats_.times.*stage += std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    const double now_work_ms = work_ms();
    stats_.work_ms += now_work_ms - last_work_ms_;
    last_work_ms_ = now_work_ms;
    if (!cpu_) return;
    const double now_cpu_ms = cpu_ms();
    stats_.cpu_times.*stage += now_cpu_ms - last_cpu_ms_;
    last_cpu_ms_ = now_cpu_ms;
  }

 private:
  static double ms_of(clockid_t clock) {
    timespec time{};
    clock_gettime(clock, &time);
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
  }
  static double cpu_ms() { return ms_of(CLOCK_PROCESS_CPUTIME_ID); }
  /// Of this thread and of those of the pools.
  static double work_ms() {
    return ms_of(CLOCK_THREAD_CPUTIME_ID) + 1e-6 * static_cast<double>(WorkPool::worked_ns());
  }

  FrameStats& stats_;
  bool cpu_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  double last_cpu_ms_, last_work_ms_ = work_ms();
};

/// A backend with what was uploaded to it and its view.
struct Compute {
  BackendKind kind = BackendKind::kCpu;
  std::unique_ptr<ComputeBackend> backend;
  std::unique_ptr<ViewWork> view;

  // What was uploaded last. Views that look at one crowd ask for the same two snapshots, and the
  // newer one of this frame is the older one of the next, so a few entries are enough; the snapshot
  // is kept alive so that its address can't be given to another one.
  struct Uploaded {
    std::shared_ptr<const Snapshot> snapshot;
    std::shared_ptr<const DeviceSnapshot> device;
  };
  std::array<Uploaded, 8> uploads;
  std::size_t next_upload = 0;

  struct Advanced {
    std::shared_ptr<const Snapshot> older, newer;
    std::shared_ptr<const Environment> environment;
    std::int64_t time_us = 0;
    int channel = -1;
    std::shared_ptr<const Instances> instances;
  };
  std::array<Advanced, 4> advanced;
  std::size_t next_advanced = 0;

  absl::StatusOr<std::shared_ptr<const DeviceSnapshot>> device_snapshot(
      const std::shared_ptr<const Snapshot>& snapshot) {
    for (const Uploaded& entry : uploads) {
      if (entry.snapshot == snapshot) return entry.device;
    }
    absl::StatusOr<std::shared_ptr<const DeviceSnapshot>> device = backend->upload(snapshot);
    if (!device.ok()) return device.status();
    uploads[next_upload] = {snapshot, *device};
    next_upload = (next_upload + 1) % uploads.size();
    return *device;
  }

  static absl::StatusOr<std::unique_ptr<Compute>> make(BackendKind kind, unsigned threads) {
    auto compute = std::make_unique<Compute>();
    compute->kind = kind;
    auto backend = make_backend(kind, threads);
    if (!backend.ok()) return backend.status();
    compute->backend = *std::move(backend);
    return compute;
  }
  absl::Status begin(const std::shared_ptr<const Cast>& cast) {
    if (absl::Status status = backend->upload(cast); !status.ok()) return status;
    auto made = backend->make_view();
    if (!made.ok()) return made.status();
    view = *std::move(made);
    return absl::OkStatus();
  }
};

}  // namespace

struct FramePipeline::State {
  std::shared_ptr<const Cast> cast;
  std::unique_ptr<Compute> main;
  std::unique_ptr<Rasterizer> rasterizer;
  PixelFacts facts;
  std::string backend_name;
  std::string why;  // this rasterizer
  GeometryKind geometry = GeometryKind::kBatched;
  bool measure_cpu_times = false;
  unsigned threads = 0;
  std::unique_ptr<FarCrowd> far;  // made when it is first asked for
  std::vector<Splat> splats;      // of a frame with a far crowd
  std::vector<Speck> far_shadows;
  Picture large;                    // of a frame that is oversampled
  std::optional<double> before_ms;  // of the frame before, up to `allocate`, if it was left there
  std::unique_ptr<WorkPool> pool;

  // Environments whose pieces follow the characters in the uploaded cast.
  struct Placed {
    std::weak_ptr<const Environment> environment;
    Surroundings members;
  };
  std::vector<Placed> placed;

  absl::Status upload_to_all(const std::shared_ptr<const Cast>& members) {
    main->advanced = {};
    if (absl::Status status = main->backend->upload(members); !status.ok()) return status;
    return rasterizer->upload(members);
  }

  /// The members that an environment is drawn with. A new one is uploaded behind the cast, which
  /// the processor's stages keep as it is, and those that nobody has any more leave it.
  absl::StatusOr<Surroundings> surroundings_of(
      const std::shared_ptr<const Environment>& environment) {
    if (environment == nullptr || environment->pieces.empty()) return Surroundings();
    for (const Placed& entry : placed) {
      if (entry.environment.lock() == environment) return entry.members;
    }
    auto longer = std::make_shared<Cast>(*cast);
    std::vector<Placed> kept;
    std::vector<std::shared_ptr<const Environment>> alive;
    for (const Placed& entry : placed) {
      if (auto other = entry.environment.lock()) alive.push_back(std::move(other));
    }
    alive.push_back(environment);
    for (const auto& each : alive) {
      kept.push_back({each,
                      {static_cast<std::uint32_t>(longer->members.size()),
                       static_cast<std::uint32_t>(each->pieces.size())}});
      for (const Character& piece : each->pieces) {
        longer->members.push_back({piece, 0.0F, true});
      }
    }
    // should one of the two fail, nothing is known to be where it was
    placed.clear();
    if (absl::Status status = upload_to_all(longer); !status.ok()) {
      // other crowds are drawn on; to the stages more members than are asked for do no harm, and
      // the memory of another copy may not be there
      if (absl::Status back = rasterizer->upload(cast); !back.ok()) return back;
      return status;
    }
    placed = std::move(kept);
    return placed.back().members;
  }

  /// What agents are drawn as: a rasterizer that draws nothing else is given meshes.
  FormRule form_of(FormRule form) const {
    const Representation needed =
        form == FormRule::kPoints ? Representation::kPoints : Representation::kImpostor;
    if (!rasterizer->draws(needed)) return FormRule::kMesh;
    return form;
  }

  absl::StatusOr<std::shared_ptr<const Instances>> instances_at(Compute& compute,
                                                                const Crowd& crowd,
                                                                std::int64_t time_us, int channel) {
    Bracket bracket = crowd.bracket(time_us);
    if (bracket.older == nullptr) return std::shared_ptr<const Instances>();
    const std::shared_ptr<const Environment> environment = crowd.environment();
    const auto surroundings = surroundings_of(environment);
    if (!surroundings.ok()) return surroundings.status();
    for (const Compute::Advanced& entry : compute.advanced) {
      if (entry.instances != nullptr && entry.older == bracket.older &&
          entry.environment == environment && entry.newer == bracket.newer &&
          entry.time_us == time_us && entry.channel == channel) {
        return entry.instances;
      }
    }
    auto older = compute.device_snapshot(bracket.older);
    if (!older.ok()) return older.status();
    auto newer = compute.device_snapshot(bracket.newer);
    if (!newer.ok()) return newer.status();
    auto instances = compute.backend->advance(**older, **newer, time_us, crowd.settings(), channel,
                                              *surroundings);
    if (!instances.ok()) return instances.status();
    compute.advanced[compute.next_advanced] = {bracket.older, bracket.newer, environment,
                                               time_us,       channel,       *instances};
    compute.next_advanced = (compute.next_advanced + 1) % compute.advanced.size();
    return *instances;
  }

  bool takes_far(const ViewSettings& settings) const {
    return rasterizer->draws(Representation::kPoints) && settings.camera.ortho_height_m <= 0.0 &&
           !settings.look.color_by_channel;
  }

  absl::Status make_far() {
    if (far != nullptr) return absl::OkStatus();
    auto made = FarCrowd::make(cast, threads);
    if (made.ok()) far = *std::move(made);
    return made.status();
  }

  /// Who is drawn as the far crowd, for the backend to make its points.
  absl::Status plan_far(const Crowd& crowd, std::int64_t scene_time_us, const FarView& view,
                        const FarSettings& settings, FarCounters& counters) {
    if (absl::Status status = make_far(); !status.ok()) return status;
    const auto points = far->plan(crowd, scene_time_us, view, settings, counters);
    if (points.ok()) main->view->far = *points;
    return points.status();
  }

  /// The far crowd's splats before those of `geometry`.
  absl::Status add_far(const Crowd& crowd, std::int64_t scene_time_us, const FarView& view,
                       const FarSettings& settings, FrameGeometry& geometry, FrameStats& stats) {
    if (absl::Status status = make_far(); !status.ok()) return status;
    FarCounters counters;
    if (absl::Status status =
            far->generate(crowd, scene_time_us, view, settings, splats, far_shadows, counters);
        !status.ok()) {
      return status;
    }
    stats.counters.visible += counters.visible;
    stats.counters.drawn_as[static_cast<std::size_t>(Representation::kPoints)] += counters.drawn;
    stats.counters.vertices += splats.size();
    splats.insert(splats.end(), geometry.splats.begin(), geometry.splats.end());
    geometry.splats = splats;
    geometry.shadows = far_shadows;
    return absl::OkStatus();
  }

  /// Whose agents the instances are; null for null.
  static std::shared_ptr<const Snapshot> shown_at(
      const Compute& compute, const std::shared_ptr<const Instances>& instances) {
    if (instances == nullptr) return nullptr;
    for (const Compute::Advanced& entry : compute.advanced) {
      if (entry.instances != instances) continue;
      return entry.time_us < entry.newer->time_us ? entry.older : entry.newer;
    }
    return nullptr;
  }
};

FramePipeline::FramePipeline() : state_(std::make_unique<State>()) {}
FramePipeline::~FramePipeline() = default;

absl::StatusOr<std::unique_ptr<FramePipeline>> FramePipeline::make(
    std::shared_ptr<const Cast> cast, const FramePipelineOptions& options) {
  if (cast == nullptr || cast->members.empty()) {
    return absl::InvalidArgumentError("make: the cast has 0 characters, must have at least 1");
  }
  std::unique_ptr<FramePipeline> pipeline(new FramePipeline());
  State& state = *pipeline->state_;
  state.cast = cast;
  state.measure_cpu_times = options.measure_cpu_times;
  state.threads = options.threads;
  auto compute = Compute::make(options.backend, options.threads);
  if (!compute.ok()) return compute.status();
  state.main = *std::move(compute);
  state.backend_name = options.backend == BackendKind::kCpu ? "cpu" : "cuda";
  RasterKind kind = options.raster;
  if (kind == RasterKind::kAuto && options.backend == BackendKind::kCuda) {
    kind = faster_rasterizer(cast, options, state.why);
  }
  auto rasterizer = make_rasterizer(kind, options.threads, options.backend);
  if (!rasterizer.ok()) return rasterizer.status();
  state.rasterizer = *std::move(rasterizer);
  const bool takes_fused = state.rasterizer->takes_fused();
  state.geometry =
      options.geometry.value_or(takes_fused ? GeometryKind::kFused : GeometryKind::kBatched);
  if (state.geometry == GeometryKind::kFused && !takes_fused) {
    return absl::InvalidArgumentError(absl::StrCat("make: ", state.rasterizer->info().name,
                                                   " draws batched geometry only, not fused"));
  }
  if (absl::Status status = state.main->begin(cast); !status.ok()) return status;
  if (absl::Status status = state.rasterizer->upload(cast); !status.ok()) return status;
  return pipeline;
}

absl::Status FramePipeline::render(const Crowd& crowd, std::int64_t scene_time_us,
                                   const ViewSettings& settings, Picture& picture,
                                   FrameStats& stats, FramePasses* passes) {
  State& state = *state_;
  if (settings.oversampling < 1 || settings.oversampling > 2 ||
      (settings.oversampling == 2 && passes != nullptr)) {
    return absl::InvalidArgumentError(
        absl::StrCat("render: oversampling is ", settings.oversampling,
                     ", must be 1 or 2, and 1 where passes are asked for"));
  }
  if (settings.oversampling == 2)
    return render_large(crowd, scene_time_us, settings, picture, stats);
  stats = {};
  stats.scene_time_us = scene_time_us;
  StageClock clock(stats, state.measure_cpu_times);

  const FormRule form = state.form_of(settings.selection.form);
  Compute& compute = *state.main;
  auto instances = state.instances_at(compute, crowd, scene_time_us, settings.channel);
  if (!instances.ok()) return instances.status();
  clock.stop(&StageTimes::advance_ms);

  FrameGeometry geometry;
  if (*instances != nullptr) {
    ViewWork& view = *compute.view;
    const bool has_far = settings.far.enabled && state.takes_far(settings) && passes == nullptr;
    FarView far_view;
    if (has_far) {
      far_view = make_far_view(settings.camera, settings.viewport, crowd.settings().origin_world);
      far_view.least_m = FarCrowd::distance_m(settings.far, far_view.px_per_tangent);
    }
    view.far_m = far_view.least_m;
    view.far = nullptr;
    // gl's passes take splats from the host
    const bool is_far_planned =
        has_far && compute.backend->makes_far_points() && state.rasterizer->takes_fused();
    FarCounters far_counters;
    absl::Status status =
        compute.backend->cull(view, *instances, settings.camera, settings.viewport);
    if (!status.ok()) return status;
    clock.stop(&StageTimes::cull_ms);
    Selection selection = settings.selection;
    selection.pose_mode = settings.pose_mode;
    // from here to a device geometry goes in batched form
    const bool is_handed_over =
        compute.kind == BackendKind::kCpu && state.rasterizer->takes_device();
    selection.geometry = is_handed_over ? GeometryKind::kBatched : state.geometry;
    // gl's passes take forms other than meshes from the host
    selection.on_device = compute.kind == BackendKind::kCuda && state.rasterizer->takes_device() &&
                          (form == FormRule::kMesh || state.rasterizer->takes_fused());
    selection.read_instances = passes != nullptr;
    selection.form = form;
    // who is in a picture is asked of figures that are drawn one by one
    selection.mixed.specks = selection.mixed.specks && passes == nullptr &&
                             state.rasterizer->draws(Representation::kSpeck);
    if (is_far_planned) {
      status = state.plan_far(crowd, scene_time_us, far_view, settings.far, far_counters);
      if (!status.ok()) return status;
      clock.stop(&StageTimes::generate_ms);
    }
    for (;;) {
      status = compute.backend->select(view, selection);
      if (!status.ok()) return status;
      clock.stop(&StageTimes::select_ms);
      status = compute.backend->allocate(view);
      if (!status.ok()) return status;
      clock.stop(&StageTimes::allocate_ms);
      status = compute.backend->generate(view);
      clock.stop(&StageTimes::generate_ms);
      if (!absl::IsResourceExhausted(status) || selection.pose_mode == PoseMode::kExact) break;
      // a cast with more poses than the bank holds is drawn without sharing, slower but whole
      selection.pose_mode = PoseMode::kExact;
    }
    if (!status.ok()) return status;
    geometry = compute.backend->geometry(view);
    stats.counters = compute.backend->counters(view);
    stats.counters.agents = (*instances)->present;
    if (is_far_planned) {
      stats.counters.visible += far_counters.visible;
      stats.counters.drawn_as[static_cast<std::size_t>(Representation::kPoints)] +=
          stats.counters.far_agents;
      stats.counters.vertices += stats.counters.far_points;
    } else if (has_far) {
      status = state.add_far(crowd, scene_time_us, far_view, settings.far, geometry, stats);
      if (!status.ok()) return status;
      clock.stop(&StageTimes::generate_ms);
    }
  }
  if (passes != nullptr) {
    if (absl::Status kept = state.rasterizer->keep_facts(&state.facts); !kept.ok()) return kept;
  }
  absl::Status status =
      state.rasterizer->draw(geometry, settings.camera, settings.viewport,
                             crowd.settings().origin_world, settings.look, picture);
  clock.stop(&StageTimes::raster_ms);
  stats.raster = state.rasterizer->counters();
  if (compute.kind != BackendKind::kCpu || !state.rasterizer->takes_fused() ||
      state.rasterizer->takes_device()) {
    stats.work_ms = 0.0;  // a driver's threads or a device worked too
  }
  const DeviceTimes& device = stats.counters.device;
  const std::optional<double> before_ms = std::exchange(state.before_ms, std::nullopt);
  if (picture.on_device != nullptr) {
    if (before_ms.has_value() && stats.raster.device_ms > 0.0) {
      stats.device_before_ms = *before_ms + device.generate_ms + stats.raster.device_ms;
    }
    state.before_ms = device.cull_ms + device.select_ms + device.allocate_ms;
  }
  if (passes == nullptr) return status;
  if (absl::Status left = state.rasterizer->keep_facts(nullptr); !left.ok()) return left;
  if (!status.ok()) return status;
  fill_passes(state.facts, geometry, State::shown_at(compute, *instances), settings,
              crowd.settings().origin_world, *passes);
  return absl::OkStatus();
}

absl::Status FramePipeline::render_large(const Crowd& crowd, std::int64_t scene_time_us,
                                         const ViewSettings& settings, Picture& picture,
                                         FrameStats& stats) {
  State& state = *state_;
  ViewSettings large = settings;
  large.oversampling = 1;
  large.viewport = {2 * settings.viewport.width_px, 2 * settings.viewport.height_px};
  Selection& selection = large.selection;
  selection.mixed.error_px *= 2.0F;
  selection.mixed.least_px *= 2.0F;
  // what specks are better at than meshes of four samples is little against sixteen
  selection.mixed.speck_error *= 3.0F;
  selection.mixed.least_error_px *= 2.0F;
  selection.mixed.most_error_px *= 2.0F;
  selection.mixed.near_error_px *= 2.0F;
  selection.pose_error_px *= 2.0F;
  selection.point_size_px *= 2.0F;
  if (absl::Status status = render(crowd, scene_time_us, large, state.large, stats); !status.ok()) {
    return status;
  }
  stats.counters.error_px *= 0.5F;
  StageClock clock(stats, state.measure_cpu_times);
  if (state.pool == nullptr) state.pool = std::make_unique<WorkPool>(state.threads);
  shrink(state.large, *state.pool, picture);
  const double drawn_ms = stats.work_ms;
  clock.stop(&StageTimes::raster_ms);
  if (!(drawn_ms > 0.0)) stats.work_ms = 0.0;
  return absl::OkStatus();
}

RasterInfo FramePipeline::raster_info() const {
  RasterInfo info = state_->rasterizer->info();
  if (!state_->why.empty()) absl::StrAppend(&info.detail, "; auto: ", state_->why);
  return info;
}
std::string FramePipeline::backend_name() const { return state_->backend_name; }

}  // namespace throng::render
