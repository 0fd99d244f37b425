#include "render/compute/cuda/cuda_backend.hpp"

#include <absl/strings/str_cat.h>
#include <cuda_runtime_api.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "render/compute/common.hpp"
#include "render/compute/cpu/fit.hpp"
#include "render/compute/cpu/slabs.hpp"
#include "render/compute/cuda/cast.hpp"
#include "render/compute/cuda/device.hpp"
#include "render/compute/cuda/device_frame.hpp"
#include "render/compute/cuda/far_store.hpp"
#include "render/compute/cuda/graph.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/cuda/memory.hpp"
#include "render/compute/cuda/speck_store.hpp"
#include "render/compute/cuda/stage_events.hpp"

namespace throng::render {
namespace cuda {

namespace {

/// Page-locked memory that one block after the other is copied through.
struct Staging {
  PinnedBuffer bytes;
  cudaEvent_t copied = nullptr;
  Staging() = default;
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;
  ~Staging() {
    if (copied == nullptr) return;
    cudaEventSynchronize(copied);  // the copy is done before its memory goes
    cudaEventDestroy(copied);
  }

  cudaError_t make() { return cudaEventCreateWithFlags(&copied, cudaEventDisableTiming); }

  /// `write(to)` fills `size_bytes` of it, which are then copied. Waits for the copy before.
  template <typename Write>
  cudaError_t copy(std::size_t size_bytes, const Write& write, void* to, cudaStream_t stream) {
    if (const cudaError_t error = cudaEventSynchronize(copied); error != cudaSuccess) return error;
    if (const cudaError_t error = bytes.resize(size_bytes); error != cudaSuccess) return error;
    write(bytes.data());
    if (const cudaError_t error =
            cudaMemcpyAsync(to, bytes.data(), size_bytes, cudaMemcpyHostToDevice, stream);
        error != cudaSuccess) {
      return error;
    }
    return cudaEventRecord(copied, stream);
  }
};

/// The columns of a roster, uploaded once for all snapshots that share it.
struct DeviceRoster {
  explicit DeviceRoster(cudaStream_t stream) : bytes(stream) {}
  std::shared_ptr<const Roster> roster;
  DeviceBuffer<std::byte> bytes;
  element::SnapshotColumns columns;  // id, character, scale, seed
};

struct CudaSnapshot final : DeviceSnapshot, std::enable_shared_from_this<CudaSnapshot> {
  explicit CudaSnapshot(cudaStream_t stream) : bytes(stream) {}
  std::int64_t time_us = 0;
  std::uint32_t present = 0;
  std::shared_ptr<const DeviceRoster> roster;
  DeviceBuffer<std::byte> bytes;
  element::SnapshotColumns columns;  // without a channel
  std::vector<const float*> channels;
};

struct CudaInstances final : Instances {
  explicit CudaInstances(cudaStream_t stream) : sphere_m(stream), state(stream) {}
  std::shared_ptr<const CudaCast> cast;
  std::shared_ptr<const CudaSnapshot> older, newer;  // which `moment` looks into
  element::Bracketed moment;
  DeviceBuffer<glm::vec4> sphere_m;            // [I]
  DeviceBuffer<element::InstanceState> state;  // [I]
};

struct CudaView final : ViewWork {
  explicit CudaView(cudaStream_t stream)
      : mask(stream),
        order(stream),
        visible(stream),
        distance_m(stream),
        work_size(stream),
        fate(stream),
        speck_order(stream),
        specks(stream),
        representation(stream),
        jointed(stream),
        first_joint(stream),
        palettes(stream),
        first_splat(stream),
        pointed(stream),
        joints(stream),
        splats(stream),
        far_share(stream),
        far_place(stream),
        far_first(stream),
        far_order(stream),
        far_shadows(stream),
        tier(stream),
        own(stream),
        mesh(stream),
        wanted(stream),
        size(stream),
        is_made(stream),
        list(stream),
        posed_table(stream),
        posed(stream),
        shared(stream),
        share(stream),
        vertex_count(stream),
        triangle_count(stream),
        vertex_offset(stream),
        triangle_offset(stream),
        vertices(stream),
        held_vertices(stream),
        held(stream),
        indices(stream),
        scratch(stream),
        sums(stream),
        command(stream),
        counters(stream) {}

  ~CudaView() override {
    if (frame.drawn == nullptr) return;
    cudaEventSynchronize(frame.drawn);
    cudaEventDestroy(frame.drawn);
  }

  ViewStage stage = ViewStage::kNew;
  std::shared_ptr<const CudaInstances> instances;
  // what is to be launched still: all stages up to `allocate` go to the device as one graph
  std::optional<CullJob> cull_job;
  std::optional<SplitJob> split_job;
  CullJob cull_seen;  // of this frame, launched or not
  std::optional<SelectJob> select_job;
  LaunchGraph graph;
  enum Moment : std::size_t {
    kBegun,
    kCullEnds,
    kSelectEnds,
    kAllocateEnds,
    kGenerateBegins,
    kGenerateEnds,
    kMoments
  };
  StageEvents<kMoments> moments;
  DeviceTimes times;
  element::Projection projection;
  element::Frustum frustum;
  DeviceCounters seen;  // as of the last stage that read them back
  DeviceBuffer<std::uint8_t> mask;
  DeviceBuffer<std::uint32_t> order;
  DeviceBuffer<VisibleInstance> visible;
  DeviceBuffer<float> distance_m;
  // of a frame that is to take some time
  std::optional<Selection> asked;  // as it came
  float selected_px = 0.0F;        // the error that was selected by
  float error_px = 0.0F;           // chosen, and kept by the next frame as long as it fits
  FrameWork work;
  DeviceBuffer<element::WorkSize> work_size;
  // of the mixed frame
  glm::vec3 forward{0.0F, 1.0F, 0.0F};
  std::shared_ptr<const SpeckStore> speck_store;  // null: nobody is a speck
  float speck_detail = 1.0F;
  DeviceBuffer<std::uint8_t> fate;
  DeviceBuffer<std::uint32_t> speck_order;
  DeviceBuffer<Speck> specks;
  // of forms other than meshes
  bool has_forms = false;
  DeviceBuffer<Representation> representation;
  DeviceBuffer<JointedInstance> jointed;
  DeviceBuffer<std::uint32_t> first_joint, palettes, first_splat, pointed;
  DeviceBuffer<element::JointMatrix> joints;
  DeviceBuffer<Splat> splats;  // the far crowd's first
  // of the far crowd
  std::shared_ptr<const FarStore::Shape> far_shape;
  std::shared_ptr<const FarStore::Agents> far_agents;
  std::uint64_t far_version = 0;  // of far_share
  Staging far_staging;            // which the shares are copied through
  DeviceBuffer<FarShare> far_share;
  DeviceBuffer<FarPlaced> far_place;
  DeviceBuffer<std::uint32_t> far_first, far_order;
  DeviceBuffer<Speck> far_shadows;
  std::array<SpeckRun, 1> speck_run;
  bool share_poses = false, fused = false;
  DeviceBuffer<std::uint8_t> tier;
  DeviceBuffer<std::uint32_t> own, mesh, wanted, size, is_made, list;
  // posed meshes, which stay from frame to frame: of one cast, so many values of `posed`
  std::shared_ptr<const CudaCast> posed_cast;
  DeviceBuffer<PosedMesh> posed_table;
  DeviceBuffer<float> posed;
  std::uint64_t posed_used = 0;
  std::uint32_t posed_made = 0;  // in this frame
  DeviceBuffer<SharedInstance> shared;
  DeviceBuffer<std::uint32_t> share, vertex_count, triangle_count, vertex_offset, triangle_offset;
  DeviceBuffer<BatchVertex> vertices, held_vertices;  // of this frame and of the one before
  MotionUpdate motion;
  DeviceBuffer<element::HeldVertices> held;
  std::uint32_t held_slots = 0;  // 0: nothing is held
  bool remembers = false;        // `held` tells where the vertices of the last frame are
  std::uint64_t made_vertices = 0, held_total = 0;
  DeviceBuffer<std::uint32_t> indices;
  DeviceBuffer<std::byte> scratch;
  DeviceBuffer<SelectSums> sums;
  DeviceBuffer<DrawCommand> command;
  DeviceBuffer<DeviceCounters> counters;
  PinnedBuffer read_back;  // what a rasterizer on the processor draws from
  bool on_device = false;  // nothing but the counters is read back
  bool read_instances = false;
  DeviceFrame frame;
  FrameGeometry geometry;  // spans of read_back, or the frame

  /// Of all buffers but that of posed meshes, which is told apart.
  std::uint64_t size_bytes() const {
    std::uint64_t sum = 0;
    for_buffers(*this, [&](const auto& buffer) { sum += buffer.size_bytes(); });
    return sum;
  }

  /// Gives back all that it holds, and what it knows of frames before: others may need the room.
  void release() {
    for_buffers(*this, [](auto& buffer) { buffer.release(); });
    posed.release();
    posed_cast.reset();
    instances.reset();
    posed_used = far_version = held_total = 0;
    held_slots = 0;
    remembers = false;
    stage = ViewStage::kNew;
  }

 private:
  template <typename Self, typename Visit>
  static void for_buffers(Self& view, const Visit& visit) {
    const auto each = [&](auto&... buffer) { (visit(buffer), ...); };
    each(view.mask, view.order, view.visible, view.distance_m, view.work_size, view.fate,
         view.speck_order, view.specks, view.representation, view.jointed, view.first_joint,
         view.palettes, view.first_splat, view.pointed, view.joints, view.splats, view.far_share,
         view.far_place, view.far_first, view.far_order, view.far_shadows);
    each(view.tier, view.own, view.mesh, view.wanted, view.size, view.is_made, view.list,
         view.posed_table, view.shared, view.share, view.vertex_count, view.triangle_count,
         view.vertex_offset, view.triangle_offset, view.vertices, view.held_vertices, view.held,
         view.indices, view.scratch, view.sums, view.command, view.counters);
  }
};

/// Packs columns into one block, each on a 16-byte boundary.
class Packer {
 public:
  template <typename T>
  std::size_t add(const std::vector<T>& column, std::size_t rows) {
    const std::size_t at = (size_ + 15) / 16 * 16;
    parts_.push_back({column.data(), at, rows * sizeof(T)});
    size_ = at + rows * sizeof(T);
    return at;
  }
  std::size_t size_bytes() const { return size_; }
  void write(void* to) const {
    for (const Part& part : parts_) {
      if (part.size_bytes > 0) {
        std::memcpy(static_cast<std::byte*>(to) + part.at, part.from, part.size_bytes);
      }
    }
  }

 private:
  struct Part {
    const void* from;
    std::size_t at, size_bytes;
  };
  std::vector<Part> parts_;
  std::size_t size_ = 0;
};

/// Of a view's posed meshes, as on the processor.
constexpr std::uint64_t kPosedLimitBytes = std::uint64_t{256} << 20;

/// Where in what is read back of a frame the sizes of agents begin, after the counters.
constexpr std::size_t kSizesAt = (sizeof(DeviceCounters) + 63) / 64 * 64;

class CudaBackend final : public ComputeBackend {
 public:
  static absl::StatusOr<std::unique_ptr<ComputeBackend>> make() {
    constexpr char kCall[] = "make_backend: cuda";
    const auto device = open_device(kCall);
    if (!device.ok()) return device.status();
    auto backend = std::unique_ptr<CudaBackend>(new CudaBackend(*device));
    if (absl::Status status = backend->begin(); !status.ok()) {
      return absl::UnavailableError(absl::StrCat(kCall, ": ", status.message()));
    }
    return backend;
  }

  ~CudaBackend() override {
    cast_.reset();
    roster_.reset();
    specks_.reset();
    far_store_.clear();
    if (stream_ != nullptr) {
      cudaStreamSynchronize(stream_);
      cudaStreamDestroy(stream_);
    }
  }

  absl::Status upload(std::shared_ptr<const Cast> cast) override {
    THRONG_CUDA_TRY(cudaSetDevice(device_), "upload: the cast");
    auto uploaded = CudaCast::upload(std::move(cast), stream_);
    if (!uploaded.ok()) return uploaded.status();
    const std::lock_guard lock(mutex_);
    cast_ = *std::move(uploaded);
    return absl::OkStatus();
  }

  absl::StatusOr<std::shared_ptr<const DeviceSnapshot>> upload(
      std::shared_ptr<const Snapshot> snapshot) override {
    const std::lock_guard lock(mutex_);
    if (cast_ == nullptr) return absl::FailedPreconditionError("upload: the cast comes first");
    if (absl::Status status = check_snapshot(snapshot.get(), cast_->character_count());
        !status.ok()) {
      return status;
    }
    constexpr char kCall[] = "upload: the snapshot";
    THRONG_CUDA_TRY(cudaSetDevice(device_), kCall);
    auto result = std::make_shared<CudaSnapshot>(stream_);
    result->time_us = snapshot->time_us;
    result->present = snapshot->present_count;
    element::SnapshotColumns& columns = result->columns;
    const std::size_t slots = snapshot->present.size();
    columns.slots = static_cast<std::uint32_t>(slots);
    result->channels.assign(snapshot->channels.size(), nullptr);
    if (slots == 0) return result;
    if (absl::Status status = upload_roster(snapshot->roster); !status.ok()) return status;
    result->roster = roster_;
    columns.id = roster_->columns.id;
    columns.character = roster_->columns.character;
    columns.scale = roster_->columns.scale;
    columns.seed = roster_->columns.seed;

    Packer packer;
    const std::size_t walked = packer.add(snapshot->walked_cycles, slots);
    const std::size_t position = packer.add(snapshot->position_m, slots);
    const std::size_t velocity = packer.add(snapshot->velocity_mps, slots);
    const std::size_t heading = packer.add(snapshot->heading_rad, slots);
    const std::size_t speed = packer.add(snapshot->speed_mps, slots);
    const std::size_t turn = packer.add(snapshot->turn_radps, slots);
    const std::size_t present = packer.add(snapshot->present, slots);
    const std::size_t motion = packer.add(snapshot->motion, snapshot->motion.size());
    std::vector<std::size_t> channels;
    for (const std::vector<float>& channel : snapshot->channels) {
      channels.push_back(packer.add(channel, slots));
    }
    THRONG_CUDA_TRY(copy(packer, result->bytes), kCall);
    const std::byte* base = result->bytes.data();
    columns.walked_cycles = reinterpret_cast<const double*>(base + walked);
    columns.position_m = reinterpret_cast<const glm::vec3*>(base + position);
    columns.velocity_mps = reinterpret_cast<const glm::vec3*>(base + velocity);
    columns.heading_rad = reinterpret_cast<const float*>(base + heading);
    columns.speed_mps = reinterpret_cast<const float*>(base + speed);
    columns.turn_radps = reinterpret_cast<const float*>(base + turn);
    columns.present = reinterpret_cast<const std::uint8_t*>(base + present);
    if (!snapshot->motion.empty()) {
      columns.motion = reinterpret_cast<const std::uint32_t*>(base + motion);
    }
    for (std::size_t c = 0; c < channels.size(); ++c) {
      result->channels[c] = reinterpret_cast<const float*>(base + channels[c]);
    }
    return result;
  }

  absl::StatusOr<std::shared_ptr<const Instances>> advance(
      const DeviceSnapshot& older, const DeviceSnapshot& newer, std::int64_t scene_time_us,
      const CrowdSettings& settings, int channel, Surroundings surroundings) override {
    const auto* from = dynamic_cast<const CudaSnapshot*>(&older);
    const auto* to = dynamic_cast<const CudaSnapshot*>(&newer);
    if (from == nullptr || to == nullptr) {
      return absl::InvalidArgumentError("advance: a snapshot is of another backend");
    }
    if (absl::Status status = check_bracket(from->time_us, to->time_us); !status.ok()) {
      return status;
    }
    THRONG_CUDA_TRY(cudaSetDevice(device_), "advance");
    AdvanceJob job;
    job.moment.between =
        element::between(from->time_us, to->time_us, scene_time_us, settings.extrapolate_limit_us);
    const CudaSnapshot& shown = job.moment.between.at_newer ? *to : *from;
    auto instances = std::make_shared<CudaInstances>(stream_);
    instances->scene_time_us = scene_time_us;
    instances->count = shown.columns.slots + surroundings.member_count;
    instances->surrounding = surroundings.member_count;
    instances->present = shown.present;
    instances->origin_world = settings.origin_world;
    {
      const std::lock_guard lock(mutex_);
      instances->cast = cast_;
    }
    if (absl::Status status = check_surroundings(surroundings, instances->cast->character_count());
        !status.ok()) {
      return status;
    }
    job.first_surrounding = surroundings.first_member;
    job.surrounding = surroundings.member_count;
    THRONG_CUDA_TRY(instances->sphere_m.resize(instances->count), "advance");
    THRONG_CUDA_TRY(instances->state.resize(instances->count), "advance");
    const auto with_channel = [&](const CudaSnapshot& snapshot) {
      element::SnapshotColumns columns = snapshot.columns;
      if (channel == kSpeedChannel) {
        columns.channel = columns.speed_mps;
      } else if (channel >= 0 && static_cast<std::size_t>(channel) < snapshot.channels.size()) {
        columns.channel = snapshot.channels[static_cast<std::size_t>(channel)];
      }
      return columns;
    };
    job.cast = instances->cast->device();
    job.moment.shown = with_channel(shown);
    job.moment.newer = with_channel(*to);
    job.moment.same_roster = from->roster == to->roster;
    job.moment.scene_time_us = scene_time_us;
    instances->older = from->shared_from_this();
    instances->newer = to->shared_from_this();
    instances->moment = job.moment;
    job.sphere_m = instances->sphere_m.data();
    job.state = instances->state.data();
    THRONG_CUDA_TRY(launch_advance(job, stream_), "advance");
    return instances;
  }

  absl::StatusOr<std::unique_ptr<ViewWork>> make_view() override {
    auto view = std::make_unique<CudaView>(stream_);
    THRONG_CUDA_TRY(cudaSetDevice(device_), "make_view");
    THRONG_CUDA_TRY(cudaEventCreateWithFlags(&view->frame.drawn, cudaEventDisableTiming),
                    "make_view");
    THRONG_CUDA_TRY(view->far_staging.make(), "make_view");
    return view;
  }

  bool makes_far_points() const override { return true; }

  absl::Status cull(ViewWork& view, std::shared_ptr<const Instances> instances,
                    const Camera& camera, const Viewport& viewport) override {
    auto* own = dynamic_cast<CudaView*>(&view);
    auto own_instances = std::dynamic_pointer_cast<const CudaInstances>(std::move(instances));
    if (own == nullptr || own_instances == nullptr) {
      return absl::InvalidArgumentError("cull: the view or the instances are of another backend");
    }
    if (absl::Status status = check_camera(camera, viewport); !status.ok()) return status;
    THRONG_CUDA_TRY(cudaSetDevice(device_), "cull");
    own->stage = ViewStage::kNew;
    // the frame before may still be drawn
    THRONG_CUDA_TRY(cudaStreamWaitEvent(stream_, own->frame.drawn, 0), "cull");
    own->cull_job.reset();
    own->split_job.reset();
    own->select_job.reset();
    own->speck_store.reset();
    own->forward = -glm::vec3(glm::transpose(view_from_relative(camera))[2]);
    own->instances = std::move(own_instances);
    return or_release(*own, prepare_cull(*own, camera, viewport));
  }

  absl::Status select(ViewWork& view, const Selection& selection) override {
    auto* own = dynamic_cast<CudaView*>(&view);
    if (absl::Status status = check_stage("select", stage_of(own), ViewStage::kCulled, "cull");
        !status.ok()) {
      return status;
    }
    if (absl::Status status = check_selection(selection); !status.ok()) return status;
    THRONG_CUDA_TRY(cudaSetDevice(device_), "select");
    own->work = {};
    own->asked.reset();
    if (selection.form != FormRule::kMixed || !(selection.mixed.budget_ms > 0.0)) {
      own->error_px = 0.0F;
      return or_release(*own, prepare_select(*own, selection));
    }
    // by the error of the frame before; who is in view is known once the device has told
    own->asked = selection;
    Selection before = selection;
    if (own->error_px > 0.0F) set_error(before, kept_error(selection.mixed, own->error_px));
    return or_release(*own, prepare_select(*own, before));
  }

  absl::Status allocate(ViewWork& view) override {
    auto* own = dynamic_cast<CudaView*>(&view);
    if (absl::Status status =
            check_stage("allocate", stage_of(own), ViewStage::kSelected, "select");
        !status.ok()) {
      return status;
    }
    own->stage = ViewStage::kSelected;
    THRONG_CUDA_TRY(cudaSetDevice(device_), "allocate");
    absl::Status status = run_stages(*own);
    if (status.ok() && own->asked.has_value()) status = fit(*own);
    if (status.ok()) status = make_room(*own);
    return or_release(*own, std::move(status));
  }

  absl::Status generate(ViewWork& view) override {
    auto* own = dynamic_cast<CudaView*>(&view);
    if (absl::Status status =
            check_stage("generate", stage_of(own), ViewStage::kAllocated, "allocate");
        !status.ok()) {
      return status;
    }
    own->stage = ViewStage::kAllocated;
    THRONG_CUDA_TRY(cudaSetDevice(device_), "generate");
    THRONG_CUDA_TRY(own->moments.record(CudaView::kGenerateBegins, stream_, false), "generate");
    if (absl::Status status = make_posed(*own); !status.ok()) return status;
    GenerateJob job;
    job.cast = own->instances->cast->device();
    job.visible = own->seen.visible;
    job.own = own->seen.own;
    job.list = own->own.data();
    job.mesh = own->mesh.data();
    job.table = own->posed_table.data();
    job.posed = own->posed.data();
    job.shared = own->fused ? own->shared.data() : nullptr;
    job.most_joints = own->instances->cast->most_joints();
    job.instance = own->visible.data();
    job.state = own->instances->state.data();
    job.vertex_offset = own->vertex_offset.data();
    job.triangle_offset = own->triangle_offset.data();
    job.vertices = own->vertices.data();
    job.indices = own->indices.data();
    if (own->held_slots > 0) {
      job.held = own->held.data();
      job.slots = own->held_slots;
      job.held_vertices = own->held_vertices.data();
      job.held_total = own->held_total;
      job.motion = own->motion;
      job.distance_m = own->distance_m.data();
      job.counters = own->counters.data();
    }
    THRONG_CUDA_TRY(launch_generate(job, stream_), "generate");
    THRONG_CUDA_TRY(launch_remember(job, stream_), "generate");
    own->remembers = own->held_slots > 0;
    FormsJob forms;
    if (absl::Status status = forms_job(*own, forms); !status.ok()) return status;
    THRONG_CUDA_TRY(launch_make_forms(forms, stream_), "generate");
    FarJob far;
    if (absl::Status status = far_job(*own, far); !status.ok()) return status;
    THRONG_CUDA_TRY(launch_make_far(far, stream_), "generate");
    THRONG_CUDA_TRY(own->moments.record(CudaView::kGenerateEnds, stream_, false), "generate");
    if (own->on_device) {
      if (absl::Status status = leave_geometry(*own); !status.ok()) return status;
    } else if (absl::Status status = read_geometry(*own); !status.ok()) {
      return status;
    }
    own->stage = ViewStage::kGenerated;
    return absl::OkStatus();
  }

  FrameGeometry geometry(const ViewWork& view) const override {
    const auto* own = dynamic_cast<const CudaView*>(&view);
    return own == nullptr || own->stage != ViewStage::kGenerated ? FrameGeometry() : own->geometry;
  }

  ComputeCounters counters(const ViewWork& view) const override {
    // a view is used by one thread at a time, and what it waits for changes nothing of it
    auto* own = const_cast<CudaView*>(dynamic_cast<const CudaView*>(&view));
    ComputeCounters counters;
    if (own == nullptr || own->stage < ViewStage::kCulled) return counters;
    counters.agents = own->instances->present;
    DeviceCounters seen = own->seen;
    if (own->stage < ViewStage::kAllocated &&
        (!launch_pending(*own, stream_).ok() ||
         cudaMemcpyAsync(&seen, own->counters.data(), sizeof seen, cudaMemcpyDeviceToHost,
                         stream_) != cudaSuccess ||
         cudaStreamSynchronize(stream_) != cudaSuccess)) {
      return counters;
    }
    const std::uint32_t listed = seen.visible - seen.surrounding;
    counters.visible = listed;
    counters.drawn_as[static_cast<std::size_t>(Representation::kMesh)] = listed;
    if (own->stage < ViewStage::kSelected) return counters;
    if (own->has_forms) {
      for (std::uint32_t form = 0; form < kRepresentations; ++form) {
        counters.drawn_as[form] = static_cast<std::uint32_t>(seen.drawn_as[form]);
      }
      std::memcpy(&counters.farthest_m, &seen.farthest, sizeof counters.farthest_m);
    }
    if (own->speck_store != nullptr) {
      const auto left_out = static_cast<std::uint32_t>(seen.left_out);
      counters.visible += seen.specks + left_out;
      counters.drawn_as[static_cast<std::size_t>(Representation::kSpeck)] += seen.specks;
      counters.drawn_as[static_cast<std::size_t>(Representation::kNone)] += left_out;
    }
    counters.vertices = seen.vertices;
    counters.triangles = seen.triangles;
    counters.effective_budget = seen.effective_budget;
    counters.shared_poses = seen.shared;
    counters.work = own->work;
    counters.error_px = own->error_px;
    counters.far_agents = seen.far_agents;
    counters.far_points = seen.far_points;
    counters.view_bytes = own->size_bytes();
    counters.device = own->times;
    if (own->stage < ViewStage::kGenerated) return counters;
    counters.posed_meshes = own->posed_made;
    counters.posed_bytes = own->posed.size_bytes();
    counters.held_poses = seen.held_before;
    return counters;
  }

  absl::Status read_visible(const ViewWork& view, std::span<std::uint8_t> visible) override {
    auto* own = const_cast<CudaView*>(dynamic_cast<const CudaView*>(&view));
    if (absl::Status status =
            check_stage("read_visible", stage_of(own), ViewStage::kCulled, "cull");
        !status.ok()) {
      return status;
    }
    if (absl::Status status = check_mask(visible.size(), own->instances->count); !status.ok()) {
      return status;
    }
    if (absl::Status status = launch_pending(*own, stream_); !status.ok()) return status;
    THRONG_CUDA_TRY(cudaMemcpyAsync(visible.data(), own->mask.data(), visible.size(),
                                    cudaMemcpyDeviceToHost, stream_),
                    "read_visible");
    THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), "read_visible");
    return absl::OkStatus();
  }

 private:
  explicit CudaBackend(int device) : device_(device) {}

  absl::Status begin() {
    THRONG_CUDA_TRY(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "stream");
    for (Staging& staging : staging_) THRONG_CUDA_TRY(staging.make(), "event");
    return absl::OkStatus();
  }

  static const ViewStage* stage_of(const CudaView* view) {
    return view == nullptr ? nullptr : &view->stage;
  }

  /// Copies packed columns to the device, through the staging memory whose last copy is done.
  cudaError_t copy(const Packer& packer, DeviceBuffer<std::byte>& to) {
    Staging& staging = staging_[next_staging_];
    next_staging_ = (next_staging_ + 1) % staging_.size();
    const std::size_t size_bytes = packer.size_bytes();
    if (const cudaError_t error = to.resize(size_bytes); error != cudaSuccess) return error;
    return staging.copy(
        size_bytes, [&](void* bytes) { packer.write(bytes); }, to.data(), stream_);
  }

  /// Leaves the roster in roster_.
  absl::Status upload_roster(const std::shared_ptr<const Roster>& roster) {
    if (roster_ != nullptr && roster_->roster == roster) return absl::OkStatus();
    auto result = std::make_shared<DeviceRoster>(stream_);
    result->roster = roster;
    Packer packer;
    const std::size_t id = packer.add(roster->id, roster->id.size());
    const std::size_t scale = packer.add(roster->scale, roster->scale.size());
    const std::size_t seed = packer.add(roster->seed, roster->seed.size());
    const std::size_t character = packer.add(roster->character, roster->character.size());
    THRONG_CUDA_TRY(copy(packer, result->bytes), "upload: the roster");
    const std::byte* base = result->bytes.data();
    result->columns.id = reinterpret_cast<const std::uint64_t*>(base + id);
    result->columns.scale = reinterpret_cast<const float*>(base + scale);
    result->columns.seed = reinterpret_cast<const std::uint32_t*>(base + seed);
    result->columns.character = reinterpret_cast<const std::uint16_t*>(base + character);
    roster_ = std::move(result);
    return absl::OkStatus();
  }

  /// A crowd for which there is no room takes none from others.
  static absl::Status or_release(CudaView& view, absl::Status status) {
    if (absl::IsResourceExhausted(status)) view.release();
    return status;
  }

  /// Takes note of who is looked for, with room for all.
  absl::Status prepare_cull(CudaView& view, const Camera& camera, const Viewport& viewport) {
    view.projection = projection_of(camera, viewport);
    view.frustum = element::frustum_from(clip_from_relative(camera, viewport));
    const std::uint32_t slots = view.instances->count;
    std::size_t scratch_bytes = 0;
    THRONG_CUDA_TRY(scan_scratch_bytes(slots + 1, scratch_bytes), "cull");
    THRONG_CUDA_TRY(view.scratch.resize(scratch_bytes), "cull");
    THRONG_CUDA_TRY(view.mask.resize(slots), "cull");
    THRONG_CUDA_TRY(view.order.resize(slots), "cull");
    THRONG_CUDA_TRY(view.visible.resize(slots), "cull");
    THRONG_CUDA_TRY(view.distance_m.resize(slots), "cull");
    if (view.counters.data() == nullptr) {
      THRONG_CUDA_TRY(view.counters.resize(1), "cull");
      THRONG_CUDA_TRY(cudaMemsetAsync(view.counters.data(), 0, sizeof(DeviceCounters), stream_),
                      "cull");
    }
    CullJob job;
    job.frustum = view.frustum;
    job.eye_offset_m = camera.eye_world - view.instances->origin_world;
    job.slots = slots;
    job.sphere_m = view.instances->sphere_m.data();
    job.state = view.instances->state.data();
    job.mask = view.mask.data();
    job.order = view.order.data();
    job.visible = view.visible.data();
    job.distance_m = view.distance_m.data();
    job.counters = view.counters.data();
    job.agents = slots - view.instances->surrounding;
    job.far_m = view.far_m;
    job.is_near = camera.ortho_height_m <= 0.0;
    view.cull_job = view.cull_seen = job;
    view.seen = DeviceCounters();
    view.stage = ViewStage::kCulled;
    return absl::OkStatus();
  }

  /// Takes note of the selection, which goes to the device with the other stages.
  absl::Status prepare_select(CudaView& view, const Selection& selection) {
    const std::uint32_t slots = view.instances->count;
    view.has_forms = selection.form != FormRule::kMesh;
    if (view.has_forms) THRONG_CUDA_TRY(view.representation.resize(slots), "select");
    view.speck_store.reset();
    view.split_job.reset();
    view.selected_px = selection.mixed.error_px;
    view.cull_job = view.cull_seen;  // what was selected before changed the list
    if (view.asked.has_value()) {
      THRONG_CUDA_TRY(view.work_size.resize(element::kWorkSamples), "select");
      view.cull_job->work_size = view.work_size.data();
      view.cull_job->projection = view.projection;
      view.cull_job->character = view.instances->cast->device().character;
    }
    if (selection.form == FormRule::kMixed && selection.mixed.specks) {
      if (absl::Status status = prepare_split(view, selection.mixed); !status.ok()) return status;
    }
    THRONG_CUDA_TRY(view.share.resize(slots), "select");
    THRONG_CUDA_TRY(view.tier.resize(slots), "select");
    THRONG_CUDA_TRY(view.own.resize(slots), "select");
    THRONG_CUDA_TRY(view.vertex_count.resize(slots + 1), "select");
    THRONG_CUDA_TRY(view.triangle_count.resize(slots + 1), "select");
    THRONG_CUDA_TRY(view.sums.resize(1), "select");
    view.on_device = selection.on_device;
    view.read_instances = selection.read_instances;
    view.motion = selection.motion;
    view.share_poses = selection.pose_mode == PoseMode::kShared;
    view.fused = selection.geometry == GeometryKind::kFused;
    SelectJob job;
    job.cast = view.instances->cast->device();
    job.projection = view.projection;
    job.vertex_budget = selection.vertex_budget;
    job.deal_again = selection.rule == LodRule::kBudget;
    job.slots = slots;
    job.frustum = view.frustum;
    job.share_poses = view.share_poses;
    job.fused = view.fused;
    job.pose_error_px = selection.pose_error_px;
    job.form = selection.form;
    job.mixed = selection.mixed;
    job.point_size_px = selection.point_size_px;
    job.agents = slots - view.instances->surrounding;
    job.representation = view.has_forms ? view.representation.data() : nullptr;
    job.state = view.instances->state.data();
    job.visible = view.visible.data();
    job.distance_m = view.distance_m.data();
    job.share = view.share.data();
    job.tier = view.tier.data();
    job.own = view.own.data();
    job.vertex_count = view.vertex_count.data();
    job.triangle_count = view.triangle_count.data();
    job.sums = view.sums.data();
    job.counters = view.counters.data();
    view.select_job = job;
    view.stage = ViewStage::kSelected;
    return absl::OkStatus();
  }

  /// All stages up to `allocate` on the device, and what they counted.
  absl::Status run_stages(CudaView& view) {
    const std::uint32_t slots = view.instances->count;
    const CudaCast& cast = *view.instances->cast;
    FarJob far;
    if (absl::Status status = far_job(view, far); !status.ok()) return status;
    std::size_t scratch_bytes = 0;
    THRONG_CUDA_TRY(
        scan_scratch_bytes(std::max(slots + cast.mesh_count(), far.shares) + 1, scratch_bytes),
        "allocate");
    THRONG_CUDA_TRY(view.scratch.resize(scratch_bytes), "allocate");
    THRONG_CUDA_TRY(view.vertex_offset.resize(slots + 1), "allocate");
    THRONG_CUDA_TRY(view.triangle_offset.resize(slots + 1), "allocate");
    THRONG_CUDA_TRY(view.command.resize(1), "allocate");
    AllocateJob job;
    job.slots = slots;
    job.vertex_count = view.vertex_count.data();
    job.triangle_count = view.triangle_count.data();
    job.vertex_offset = view.vertex_offset.data();
    job.triangle_offset = view.triangle_offset.data();
    job.command = view.command.data();
    PosedJob posed;
    if (absl::Status status = posed_job(view, posed); !status.ok()) return status;
    FormsJob forms;
    if (absl::Status status = forms_job(view, forms); !status.ok()) return status;
    THRONG_CUDA_TRY(view.moments.make(), "allocate");
    const auto launches = [&](cudaStream_t stream, bool recorded) -> absl::Status {
      const auto passes = [&](CudaView::Moment moment) {
        return view.moments.record(moment, stream, recorded);
      };
      THRONG_CUDA_TRY(passes(CudaView::kBegun), "cull");
      if (absl::Status status = launch_pending_cull(view, stream); !status.ok()) return status;
      THRONG_CUDA_TRY(passes(CudaView::kCullEnds), "cull");
      if (absl::Status status = launch_pending(view, stream); !status.ok()) return status;
      THRONG_CUDA_TRY(passes(CudaView::kSelectEnds), "select");
      THRONG_CUDA_TRY(launch_allocate(job, view.scratch.data(), scratch_bytes, stream), "allocate");
      THRONG_CUDA_TRY(launch_want_poses(posed, stream), "allocate");
      THRONG_CUDA_TRY(launch_want_forms(forms, view.scratch.data(), scratch_bytes, stream),
                      "allocate");
      THRONG_CUDA_TRY(launch_place_far(far, view.scratch.data(), scratch_bytes, stream),
                      "allocate");
      THRONG_CUDA_TRY(passes(CudaView::kAllocateEnds), "allocate");
      return absl::OkStatus();
    };
    absl::Status launched = view.graph.run(stream_, "allocate", launches);
    if (!launched.ok()) return launched;
    // the one look of the host at a frame: how much room its buffers need
    if (absl::Status status = read_counters(view); !status.ok()) return status;
    view.times.cull_ms = view.moments.ms(CudaView::kBegun, CudaView::kCullEnds);
    view.times.select_ms = view.moments.ms(CudaView::kCullEnds, CudaView::kSelectEnds);
    view.times.allocate_ms = view.moments.ms(CudaView::kSelectEnds, CudaView::kAllocateEnds);
    view.times.generate_ms = view.moments.ms(CudaView::kGenerateBegins, CudaView::kGenerateEnds);
    if (far.shares == 0) view.seen.far_agents = view.seen.far_points = 0;
    if (!view.has_forms) view.seen.splats = 0;
    return absl::OkStatus();
  }

  /// Chooses the error by who is in view, as on the processor. Where it is another one than was
  /// selected by, because much has changed since the frame before, the stages run once more.
  absl::Status fit(CudaView& view) {
    const CudaCast& cast = *view.instances->cast;
    WorkSamples samples;
    samples.projection = view.projection;
    const bool has_agents = view.instances->count > view.instances->surrounding;
    const std::uint32_t in_view = has_agents ? view.seen.in_view : 0;
    samples.every = element::work_step(in_view);
    samples.sample.resize((in_view + samples.every - 1) / samples.every);
    const auto* sizes = reinterpret_cast<const element::WorkSize*>(
        static_cast<const std::byte*>(view.read_back.data()) + kSizesAt);
    for (std::size_t i = 0; i < samples.sample.size(); ++i) {
      WorkSample& sample = samples.sample[i];
      static_cast<element::WorkSize&>(sample) = sizes[i];
      sample.error = &cast.errors()[sample.character];
      sample.may_be_speck = view.speck_store != nullptr &&
                            view.speck_store->table().has_images[sample.character] != 0;
      sample.may_share = cast.may_share()[sample.character];
    }
    Selection fitted = *view.asked;
    view.work = fit_error(samples, fitted, view.error_px);
    if (fitted.mixed.error_px == view.selected_px) return absl::OkStatus();
    const std::uint32_t held_before = view.seen.held_before;
    if (absl::Status status = prepare_select(view, fitted); !status.ok()) return status;
    if (absl::Status status = run_stages(view); !status.ok()) return status;
    view.seen.held_before = held_before;
    return absl::OkStatus();
  }

  /// The frame's buffers, as large as what was counted.
  absl::Status make_room(CudaView& view) {
    const DeviceCounters& seen = view.seen;
    if (absl::Status status = check_batch(seen.own_vertices, seen.own_triangles); !status.ok()) {
      return status;
    }
    if (absl::Status status = hold_vertices(view, view.instances->count); !status.ok())
      return status;
    THRONG_CUDA_TRY(view.vertices.resize(seen.own_vertices), "allocate");
    view.made_vertices = seen.own_vertices;
    THRONG_CUDA_TRY(view.indices.resize(3 * seen.own_triangles), "allocate");
    if (view.fused) THRONG_CUDA_TRY(view.shared.resize(seen.visible), "allocate");
    if (absl::Status status = check_forms(seen); !status.ok()) return status;
    if (view.has_forms) THRONG_CUDA_TRY(view.joints.resize(seen.joints), "allocate");
    THRONG_CUDA_TRY(view.splats.resize(seen.far_points + seen.splats), "allocate");
    THRONG_CUDA_TRY(view.far_shadows.resize(seen.far_agents), "allocate");
    view.stage = ViewStage::kAllocated;
    return absl::OkStatus();
  }

  /// Stages that were only taken note of so far.
  static absl::Status launch_pending_cull(CudaView& view, cudaStream_t stream) {
    const bool splits = view.split_job.has_value();
    if (const auto job = std::exchange(view.cull_job, std::nullopt); job.has_value() && splits) {
      THRONG_CUDA_TRY(launch_mask(*job, view.scratch.data(), view.scratch.size_bytes(), stream),
                      "cull");
    } else if (job.has_value()) {
      THRONG_CUDA_TRY(launch_cull(*job, view.scratch.data(), view.scratch.size_bytes(), stream),
                      "cull");
    }
    return absl::OkStatus();
  }
  static absl::Status launch_pending(CudaView& view, cudaStream_t stream) {
    if (absl::Status status = launch_pending_cull(view, stream); !status.ok()) return status;
    if (const auto job = std::exchange(view.split_job, std::nullopt); job.has_value()) {
      THRONG_CUDA_TRY(launch_split(*job, view.scratch.data(), view.scratch.size_bytes(), stream),
                      "select");
    }
    if (const auto job = std::exchange(view.select_job, std::nullopt); job.has_value()) {
      THRONG_CUDA_TRY(
          job->form == FormRule::kMixed ? launch_mix(*job, stream) : launch_select(*job, stream),
          "select");
    }
    return absl::OkStatus();
  }

  /// What the mixed frame's visible list is split by. The pictures of specks are made when they
  /// are first asked for.
  absl::Status prepare_split(CudaView& view, const MixedForms& mixed) {
    const CudaCast& cast = *view.instances->cast;
    {
      // of its own: making them takes a while, in which others go on with snapshots
      const std::lock_guard lock(specks_mutex_);
      if (specks_ == nullptr || specks_->cast() != cast.cast().get()) {
        auto made = SpeckStore::make(cast.cast(), specks_.get(), stream_);
        if (!made.ok()) return made.status();
        specks_ = *std::move(made);
      }
      view.speck_store = specks_;
    }
    view.speck_detail = 0.5F / slab_px(mixed.error_px);
    const CudaInstances& instances = *view.instances;
    THRONG_CUDA_TRY(view.fate.resize(instances.count), "select");
    THRONG_CUDA_TRY(view.speck_order.resize(instances.count), "select");
    THRONG_CUDA_TRY(view.specks.resize(instances.count), "select");
    SplitJob job;
    job.cull = view.cull_seen;
    job.cast = cast.device();
    job.rule = {view.projection, view.forward, mixed};
    job.rule.mixed.least_px = least_px_of(mixed, mixed.error_px);
    job.rule.mixed.error_px = speck_error_of(mixed, view.projection);
    job.moment = instances.moment;
    job.has_images = view.speck_store->has_images();
    job.fate = view.fate.data();
    job.speck_order = view.speck_order.data();
    job.specks = view.specks.data();
    view.split_job = job;
    return absl::OkStatus();
  }

  static absl::Status check_forms(const DeviceCounters& seen) {
    const std::uint64_t splats = seen.splats + seen.far_points;
    if (splats > kMostSplats) {
      return absl::ResourceExhaustedError(absl::StrCat("allocate: ", splats, " points, at most ",
                                                       kMostSplats, "; make them larger"));
    }
    return absl::OkStatus();
  }

  /// What the kernels of impostors and points are given, with room for it.
  absl::Status forms_job(CudaView& view, FormsJob& job) {
    if (!view.has_forms) return absl::OkStatus();
    const CudaCast& cast = *view.instances->cast;
    job.cast = cast.device();
    job.slots = view.instances->count;
    job.poses = view.share_poses ? cast.mesh_count() : 0;
    job.most_joints = cast.most_joints();
    const std::size_t palettes = std::size_t{job.slots} + job.poses;
    THRONG_CUDA_TRY(view.jointed.resize(job.slots), "allocate");
    THRONG_CUDA_TRY(view.first_joint.resize(palettes + 1), "allocate");
    THRONG_CUDA_TRY(view.palettes.resize(palettes), "allocate");
    THRONG_CUDA_TRY(view.first_splat.resize(job.slots + 1), "allocate");
    THRONG_CUDA_TRY(view.pointed.resize(job.slots), "allocate");
    job.visible = view.visible.data();
    job.state = view.instances->state.data();
    job.tier = view.tier.data();
    job.representation = view.representation.data();
    job.jointed = view.jointed.data();
    job.first_joint = view.first_joint.data();
    job.palettes = view.palettes.data();
    job.first_splat = view.first_splat.data();
    job.pointed = view.pointed.data();
    job.joints = view.joints.data();
    job.splats = view.splats.data() + view.seen.far_points;
    job.counters = view.counters.data();
    job.to_pose = view.seen.palettes;
    job.to_point = view.seen.pointed;
    return absl::OkStatus();
  }

  /// What the kernels of the far crowd are given, with room for it; without shares: nobody is far.
  absl::Status far_job(CudaView& view, FarJob& job) {
    constexpr char kCall[] = "allocate: the far crowd";
    const FarPoints* far = view.far;
    if (far == nullptr || far->shares.empty() || view.instances->count == 0) {
      return absl::OkStatus();
    }
    if (far->most_points > kMostSplats) {
      return absl::ResourceExhaustedError(
          absl::StrCat(kCall, ": ", far->most_points, " points, at most ", kMostSplats));
    }
    {
      const std::lock_guard lock(far_mutex_);
      auto shape = far_store_.shape(*far, stream_);
      if (!shape.ok()) return shape.status();
      auto agents = far_store_.agents(*far, stream_);
      if (!agents.ok()) return agents.status();
      view.far_shape = *std::move(shape);
      view.far_agents = *std::move(agents);
    }
    if (view.far_version != far->shares_version) {
      view.far_version = 0;
      THRONG_CUDA_TRY(view.far_share.resize(far->shares.size()), kCall);
      const auto write = [&](void* to) {
        std::memcpy(to, far->shares.data(), far->shares.size_bytes());
      };
      THRONG_CUDA_TRY(
          view.far_staging.copy(far->shares.size_bytes(), write, view.far_share.data(), stream_),
          kCall);
      view.far_version = far->shares_version;
    }
    const CudaInstances& instances = *view.instances;
    job.cast = instances.cast->device();
    job.moment = instances.moment;
    job.state = instances.state.data();
    job.eye_offset_m = view.cull_seen.eye_offset_m;
    job.least_m = far->least_m;
    job.shares = static_cast<std::uint32_t>(far->shares.size());
    job.share = view.far_share.data();
    const CudaSnapshot& shown =
        instances.moment.between.at_newer ? *instances.newer : *instances.older;
    const bool same_agents = shown.roster == nullptr || shown.roster->roster == far->roster;
    job.id = same_agents ? nullptr : view.far_agents->id.data();
    job.height_m = view.far_agents->height_m.data();
    job.colors = view.far_agents->colors.data();
    job.member = view.far_agents->member.data();
    if (!far->figure.empty()) job.figure = view.far_shape->figure.data();
    job.block = view.far_shape->block.data();
    job.cloud_position = view.far_shape->position.data();
    job.cloud_normal = view.far_shape->normal.data();
    job.cloud_region = view.far_shape->region.data();
    const std::size_t shares = far->shares.size();
    THRONG_CUDA_TRY(view.far_place.resize(shares), kCall);
    THRONG_CUDA_TRY(view.far_first.resize(shares + 1), kCall);
    THRONG_CUDA_TRY(view.far_order.resize(shares + 1), kCall);
    job.place = view.far_place.data();
    job.first = view.far_first.data();
    job.order = view.far_order.data();
    job.agents = view.seen.far_agents;
    job.points = view.seen.far_points;
    job.splats = view.splats.data();
    job.shadows = view.far_shadows.data();
    job.counters = view.counters.data();
    return absl::OkStatus();
  }

  /// What the kernels of shared poses are given, with room for it. Another cast's meshes go.
  absl::Status posed_job(CudaView& view, PosedJob& job) {
    const CudaCast& cast = *view.instances->cast;
    job.cast = cast.device();
    job.slots = view.instances->count;
    job.meshes = view.share_poses ? cast.mesh_count() : 0;
    job.most_joints = cast.most_joints();
    THRONG_CUDA_TRY(view.mesh.resize(job.slots), "allocate");
    THRONG_CUDA_TRY(view.wanted.resize(job.meshes), "allocate");
    THRONG_CUDA_TRY(view.size.resize(job.meshes), "allocate");
    THRONG_CUDA_TRY(view.is_made.resize(job.meshes), "allocate");
    THRONG_CUDA_TRY(view.list.resize(job.meshes), "allocate");
    if (view.share_poses && view.posed_cast != view.instances->cast) {
      if (job.meshes > 0) {
        THRONG_CUDA_TRY(view.posed_table.resize(job.meshes), "allocate");
        THRONG_CUDA_TRY(
            cudaMemsetAsync(view.posed_table.data(), 0, job.meshes * sizeof(PosedMesh), stream_),
            "allocate");
      }
      view.posed_cast = view.instances->cast;
      view.posed_used = 0;
    }
    job.visible = view.visible.data();
    job.state = view.instances->state.data();
    job.tier = view.tier.data();
    job.representation = view.has_forms ? view.representation.data() : nullptr;
    job.mesh = view.mesh.data();
    job.wanted = view.wanted.data();
    job.table = view.posed_table.data();
    job.size = view.size.data();
    job.is_made = view.is_made.data();
    job.list = view.list.data();
    job.counters = view.counters.data();
    return absl::OkStatus();
  }

  /// The posed meshes that are not there yet. ResourceExhausted beyond the limit.
  absl::Status make_posed(CudaView& view) {
    const DeviceCounters& seen = view.seen;
    view.posed_made = 0;
    if (!view.share_poses || seen.all_meshes == 0) return absl::OkStatus();
    const std::uint64_t room = view.posed.size_bytes() / sizeof(float);
    PosedJob job;
    if (absl::Status status = posed_job(view, job); !status.ok()) return status;
    job.from_scratch = view.posed_used == 0 || view.posed_used + seen.new_values > room;
    if (job.from_scratch) {
      if (seen.all_values > kPosedLimitBytes / sizeof(float)) {
        return absl::ResourceExhaustedError(absl::StrCat(
            "generate: the posed meshes of one frame need ", sizeof(float) * seen.all_values,
            " bytes, at most ", kPosedLimitBytes, "; lower the vertex budget"));
      }
      // twice as much, so that it is not soon full again
      view.posed_used = 0;
      THRONG_CUDA_TRY(
          view.posed.resize(std::min(2 * seen.all_values, kPosedLimitBytes / sizeof(float))),
          "generate");
    }
    job.posed = view.posed.data();
    job.used = static_cast<std::uint32_t>(view.posed_used);
    job.to_make = static_cast<std::uint32_t>(job.from_scratch ? seen.all_meshes : seen.new_meshes);
    THRONG_CUDA_TRY(launch_make_posed(job, view.scratch.data(), view.scratch.size_bytes(), stream_),
                    "generate");
    view.posed_used += job.from_scratch ? seen.all_values : seen.new_values;
    view.posed_made = job.to_make;
    return absl::OkStatus();
  }

  absl::Status read_counters(CudaView& view) {
    constexpr std::size_t kSizes = element::kWorkSamples * sizeof(element::WorkSize);
    THRONG_CUDA_TRY(view.read_back.resize(kSizesAt + (view.asked.has_value() ? kSizes : 0)),
                    "allocate");
    THRONG_CUDA_TRY(cudaMemcpyAsync(view.read_back.data(), view.counters.data(),
                                    sizeof(DeviceCounters), cudaMemcpyDeviceToHost, stream_),
                    "allocate");
    if (view.asked.has_value()) {
      THRONG_CUDA_TRY(
          cudaMemcpyAsync(static_cast<std::byte*>(view.read_back.data()) + kSizesAt,
                          view.work_size.data(), kSizes, cudaMemcpyDeviceToHost, stream_),
          "allocate");
    }
    THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), "allocate");
    std::memcpy(&view.seen, view.read_back.data(), sizeof view.seen);
    return absl::OkStatus();
  }

  /// For a rasterizer that draws from the device's memory.
  absl::Status leave_geometry(CudaView& view) {
    view.frame.stream = stream_;
    view.frame.instance_count = view.seen.visible;
    view.frame.vertex_count = view.seen.own_vertices;
    view.frame.triangle_count = view.seen.own_triangles;
    view.frame.triangles_drawn = view.seen.triangles;
    view.frame.shared = view.fused ? view.shared.data() : nullptr;
    view.frame.posed = view.posed.data();
    view.frame.instances = view.visible.data();
    view.frame.vertex_offset = view.vertex_offset.data();
    view.frame.triangle_offset = view.triangle_offset.data();
    view.frame.vertices = view.vertices.data();
    view.frame.indices = view.indices.data();
    view.frame.command = view.command.data();
    const bool has_forms = view.has_forms && view.seen.visible > 0;
    view.frame.representation = has_forms ? view.representation.data() : nullptr;
    view.frame.jointed = view.jointed.data();
    view.frame.joints = reinterpret_cast<const float*>(view.joints.data());
    view.frame.splats = view.splats.data();
    view.frame.splat_count = static_cast<std::uint32_t>(view.seen.far_points + view.seen.splats);
    view.frame.shadows = view.far_shadows.data();
    view.frame.shadow_count = view.seen.far_agents;
    const SpeckStore* store = view.speck_store.get();
    view.frame.specks = view.specks.data();
    view.frame.speck_count = store == nullptr ? 0 : view.seen.specks;
    view.frame.speck_detail = view.speck_detail;
    view.frame.speck_image = store == nullptr ? nullptr : store->image();
    view.frame.speck_slab = store == nullptr ? nullptr : store->slab();
    view.geometry = FrameGeometry();
    view.geometry.on_device = &view.frame;
    const std::size_t count = view.seen.visible;
    if (!view.read_instances || count == 0) return absl::OkStatus();
    THRONG_CUDA_TRY(view.read_back.resize(count * sizeof(VisibleInstance)), "generate");
    THRONG_CUDA_TRY(
        cudaMemcpyAsync(view.read_back.data(), view.visible.data(), count * sizeof(VisibleInstance),
                        cudaMemcpyDeviceToHost, stream_),
        "generate");
    THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), "generate");
    view.geometry.instances = {static_cast<const VisibleInstance*>(view.read_back.data()), count};
    return absl::OkStatus();
  }

  /// The vertices of the frame before, for who is moved as it was (MotionUpdate).
  absl::Status hold_vertices(CudaView& view, std::uint32_t slots) {
    if (!(view.motion.distance_m > 0.0F) || slots == 0) {
      view.held_slots = 0;
      view.remembers = false;
      return absl::OkStatus();
    }
    view.vertices.swap(view.held_vertices);
    // a frame that was left half-way has neither vertices nor told where they are
    view.held_total = std::exchange(view.remembers, false) ? view.made_vertices : 0;
    if (slots <= view.held_slots) return absl::OkStatus();
    DeviceBuffer<element::HeldVertices> held(stream_);
    THRONG_CUDA_TRY(held.resize(slots), "allocate");
    THRONG_CUDA_TRY(
        cudaMemsetAsync(held.data(), 0xff, slots * sizeof(element::HeldVertices), stream_),
        "allocate");
    if (view.held_slots > 0) {
      THRONG_CUDA_TRY(cudaMemcpyAsync(held.data(), view.held.data(),
                                      view.held_slots * sizeof(element::HeldVertices),
                                      cudaMemcpyDeviceToDevice, stream_),
                      "allocate");
    }
    view.held.swap(held);
    view.held_slots = slots;
    return absl::OkStatus();
  }

  /// Copies the frame to the host, where all other rasterizers draw it from.
  absl::Status read_geometry(CudaView& view) {
    const std::size_t visible = view.seen.visible;
    const std::size_t vertices = view.seen.own_vertices, indices = 3 * view.seen.own_triangles;
    const std::size_t shared = view.fused ? visible : 0;
    const std::size_t posed = view.fused ? view.posed_used : 0;
    const std::size_t forms = view.has_forms ? visible : 0;
    const std::size_t joints = view.has_forms ? view.seen.joints : 0;
    const std::size_t splats = view.seen.far_points + view.seen.splats;
    const std::size_t shadows = view.seen.far_agents;
    const std::size_t specks = view.speck_store != nullptr ? view.seen.specks : 0;
    std::size_t size_bytes = 0;
    const auto place = [&](std::size_t bytes) {
      const std::size_t at = size_bytes;
      size_bytes = (size_bytes + bytes + 63) / 64 * 64;
      return at;
    };
    const std::size_t instance_at = place(visible * sizeof(VisibleInstance));
    const std::size_t vertex_offset_at = place((visible + 1) * sizeof(std::uint32_t));
    const std::size_t triangle_offset_at = place((visible + 1) * sizeof(std::uint32_t));
    const std::size_t vertices_at = place(vertices * sizeof(BatchVertex));
    const std::size_t indices_at = place(indices * sizeof(std::uint32_t));
    const std::size_t shared_at = place(shared * sizeof(SharedInstance));
    const std::size_t posed_at = place(posed * sizeof(float));
    const std::size_t form_at = place(forms * sizeof(Representation));
    const std::size_t jointed_at = place(forms * sizeof(JointedInstance));
    const std::size_t joints_at = place(joints * sizeof(element::JointMatrix));
    const std::size_t splats_at = place(splats * sizeof(Splat));
    const std::size_t specks_at = place(specks * sizeof(Speck));
    const std::size_t shadows_at = place(shadows * sizeof(Speck));
    THRONG_CUDA_TRY(view.read_back.resize(size_bytes), "generate");
    auto* base = static_cast<std::byte*>(view.read_back.data());
    const auto fetch = [&](std::size_t at, const void* from, std::size_t bytes) {
      return bytes == 0 ? cudaSuccess
                        : cudaMemcpyAsync(base + at, from, bytes, cudaMemcpyDeviceToHost, stream_);
    };
    THRONG_CUDA_TRY(fetch(instance_at, view.visible.data(), visible * sizeof(VisibleInstance)),
                    "generate");
    THRONG_CUDA_TRY(
        fetch(vertex_offset_at, view.vertex_offset.data(), (visible + 1) * sizeof(std::uint32_t)),
        "generate");
    THRONG_CUDA_TRY(fetch(triangle_offset_at, view.triangle_offset.data(),
                          (visible + 1) * sizeof(std::uint32_t)),
                    "generate");
    THRONG_CUDA_TRY(fetch(vertices_at, view.vertices.data(), vertices * sizeof(BatchVertex)),
                    "generate");
    THRONG_CUDA_TRY(fetch(indices_at, view.indices.data(), indices * sizeof(std::uint32_t)),
                    "generate");
    THRONG_CUDA_TRY(fetch(shared_at, view.shared.data(), shared * sizeof(SharedInstance)),
                    "generate");
    THRONG_CUDA_TRY(fetch(posed_at, view.posed.data(), posed * sizeof(float)), "generate");
    THRONG_CUDA_TRY(fetch(form_at, view.representation.data(), forms * sizeof(Representation)),
                    "generate");
    THRONG_CUDA_TRY(fetch(jointed_at, view.jointed.data(), forms * sizeof(JointedInstance)),
                    "generate");
    THRONG_CUDA_TRY(fetch(joints_at, view.joints.data(), joints * sizeof(element::JointMatrix)),
                    "generate");
    THRONG_CUDA_TRY(fetch(splats_at, view.splats.data(), splats * sizeof(Splat)), "generate");
    THRONG_CUDA_TRY(fetch(specks_at, view.specks.data(), specks * sizeof(Speck)), "generate");
    THRONG_CUDA_TRY(fetch(shadows_at, view.far_shadows.data(), shadows * sizeof(Speck)),
                    "generate");
    THRONG_CUDA_TRY(cudaStreamSynchronize(stream_), "generate");
    view.geometry = FrameGeometry();
    view.geometry.instances = {reinterpret_cast<const VisibleInstance*>(base + instance_at),
                               visible};
    view.geometry.vertex_offset = {reinterpret_cast<const std::uint32_t*>(base + vertex_offset_at),
                                   visible + 1};
    view.geometry.triangle_offset = {
        reinterpret_cast<const std::uint32_t*>(base + triangle_offset_at), visible + 1};
    view.geometry.vertices = {reinterpret_cast<const BatchVertex*>(base + vertices_at), vertices};
    view.geometry.indices = {reinterpret_cast<const std::uint32_t*>(base + indices_at), indices};
    view.geometry.shared = {reinterpret_cast<const SharedInstance*>(base + shared_at), shared};
    view.geometry.posed = reinterpret_cast<const float*>(base + posed_at);
    view.geometry.representation = {reinterpret_cast<const Representation*>(base + form_at), forms};
    view.geometry.jointed = {reinterpret_cast<const JointedInstance*>(base + jointed_at), forms};
    view.geometry.joints = {reinterpret_cast<const float*>(base + joints_at), 16 * joints};
    view.geometry.splats = {reinterpret_cast<const Splat*>(base + splats_at), splats};
    view.geometry.specks = {reinterpret_cast<const Speck*>(base + specks_at), specks};
    view.geometry.shadows = {reinterpret_cast<const Speck*>(base + shadows_at), shadows};
    view.speck_run[0] = {0, static_cast<std::uint32_t>(specks)};
    if (specks > 0) view.geometry.speck_runs = view.speck_run;
    view.geometry.speck_detail = view.speck_detail;
    if (view.speck_store != nullptr) view.geometry.speck_table = &view.speck_store->table();
    return absl::OkStatus();
  }

  int device_;
  cudaStream_t stream_ = nullptr;
  std::mutex mutex_;  // guards what follows
  std::shared_ptr<const CudaCast> cast_;
  std::shared_ptr<const DeviceRoster> roster_;
  std::array<Staging, 3> staging_;
  std::size_t next_staging_ = 0;
  std::mutex specks_mutex_;
  std::shared_ptr<const SpeckStore> specks_;  // of the cast that was last asked for
  std::mutex far_mutex_;
  FarStore far_store_;
};

}  // namespace
}  // namespace cuda

absl::StatusOr<std::unique_ptr<ComputeBackend>> make_cuda_backend() {
  return cuda::CudaBackend::make();
}

}  // namespace throng::render
