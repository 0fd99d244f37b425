#include "render/compute/cpu/cpu_backend.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#include "render/compute/common.hpp"
#include "render/compute/cpu/speck_table.hpp"
#include "render/compute/cpu/stages.hpp"

namespace throng::render {
namespace {

/// Instances nobody uses any more, whose memory the next frame takes.
class InstancesPool {
 public:
  static std::shared_ptr<CpuInstances> take(const std::shared_ptr<InstancesPool>& pool) {
    std::unique_ptr<CpuInstances> instances;
    {
      const std::lock_guard lock(pool->mutex_);
      if (!pool->idle_.empty()) {
        instances = std::move(pool->idle_.back());
        pool->idle_.pop_back();
      }
    }
    if (instances == nullptr) instances = std::make_unique<CpuInstances>();
    return {instances.release(), [pool](CpuInstances* returned) {
              returned->cast.reset();
              returned->older.reset();
              returned->newer.reset();
              const std::lock_guard lock(pool->mutex_);
              pool->idle_.emplace_back(returned);
            }};
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<CpuInstances>> idle_;
};

absl::Status out_of_memory(const char* call) {
  return absl::ResourceExhaustedError(absl::StrCat(call, ": out of memory"));
}

const ViewStage* stage_of(const CpuView* view) { return view == nullptr ? nullptr : &view->stage; }

class CpuBackend final : public ComputeBackend {
 public:
  CpuBackend(unsigned threads, KernelLevel level)
      : kernels_(kernels(level)), pool_(threads), scratch_(pool_.thread_count()) {}

  absl::Status upload(std::shared_ptr<const Cast> cast) override {
    auto table = make_cast_table(std::move(cast), this->cast().get());
    if (!table.ok()) return table.status();
    const std::lock_guard lock(mutex_);
    cast_ = *std::move(table);
    return absl::OkStatus();
  }

  absl::StatusOr<std::shared_ptr<const DeviceSnapshot>> upload(
      std::shared_ptr<const Snapshot> snapshot) override {
    const std::shared_ptr<const CastTable> cast = this->cast();
    if (cast == nullptr) return absl::FailedPreconditionError("upload: the cast comes first");
    if (absl::Status status = check_snapshot(snapshot.get(), cast->characters.size());
        !status.ok()) {
      return status;
    }
    auto result = std::make_shared<CpuSnapshot>();
    result->snapshot = std::move(snapshot);
    return result;
  }

  absl::StatusOr<std::shared_ptr<const Instances>> advance(
      const DeviceSnapshot& older, const DeviceSnapshot& newer, std::int64_t scene_time_us,
      const CrowdSettings& settings, int channel, Surroundings surroundings) override {
    const auto* older_cpu = dynamic_cast<const CpuSnapshot*>(&older);
    const auto* newer_cpu = dynamic_cast<const CpuSnapshot*>(&newer);
    if (older_cpu == nullptr || newer_cpu == nullptr) {
      return absl::InvalidArgumentError("advance: a snapshot is of another backend");
    }
    if (absl::Status status =
            check_bracket(older_cpu->snapshot->time_us, newer_cpu->snapshot->time_us);
        !status.ok()) {
      return status;
    }
    try {
      std::shared_ptr<CpuInstances> instances = InstancesPool::take(instances_pool_);
      instances->cast = cast();
      if (absl::Status status =
              check_surroundings(surroundings, instances->cast->characters.size());
          !status.ok()) {
        return status;
      }
      render::advance(older_cpu->snapshot, newer_cpu->snapshot, scene_time_us, settings, channel,
                      surroundings, machine(), *instances);
      return instances;
    } catch (const std::bad_alloc&) {
      return out_of_memory("advance");
    }
  }

  absl::StatusOr<std::unique_ptr<ViewWork>> make_view() override {
    return std::make_unique<CpuView>();
  }

  absl::Status cull(ViewWork& view, std::shared_ptr<const Instances> instances,
                    const Camera& camera, const Viewport& viewport) override {
    auto* own = dynamic_cast<CpuView*>(&view);
    auto own_instances = std::dynamic_pointer_cast<const CpuInstances>(std::move(instances));
    if (own == nullptr || own_instances == nullptr) {
      return absl::InvalidArgumentError("cull: the view or the instances are of another backend");
    }
    if (absl::Status status = check_camera(camera, viewport); !status.ok()) return status;
    try {
      own->stage = ViewStage::kNew;
      own->instances = std::move(own_instances);
      render::cull(*own, camera, viewport, machine());
      own->stage = ViewStage::kCulled;
      return absl::OkStatus();
    } catch (const std::bad_alloc&) {
      return out_of_memory("cull");
    }
  }

  absl::Status select(ViewWork& view, const Selection& selection) override {
    auto* own = dynamic_cast<CpuView*>(&view);
    if (absl::Status status = check_stage("select", stage_of(own), ViewStage::kCulled, "cull");
        !status.ok()) {
      return status;
    }
    if (absl::Status status = check_selection(selection); !status.ok()) return status;
    try {
      if (selection.form == FormRule::kMixed && selection.mixed.specks) {
        const std::lock_guard lock(generate_mutex_);
        if (specks_ == nullptr || specks_->cast != own->instances->cast) {
          specks_ = make_speck_table(own->instances->cast, machine(), scratch_, specks_.get());
        }
        own->speck_table = specks_;
      }
      render::select(*own, selection, machine());
      own->stage = ViewStage::kSelected;
      return absl::OkStatus();
    } catch (const std::bad_alloc&) {
      return out_of_memory("select");
    }
  }

  absl::Status allocate(ViewWork& view) override {
    auto* own = dynamic_cast<CpuView*>(&view);
    if (absl::Status status =
            check_stage("allocate", stage_of(own), ViewStage::kSelected, "select");
        !status.ok()) {
      return status;
    }
    try {
      own->stage = ViewStage::kSelected;
      if (absl::Status status = render::allocate(*own); !status.ok()) return status;
      own->stage = ViewStage::kAllocated;
      return absl::OkStatus();
    } catch (const std::bad_alloc&) {
      return out_of_memory("allocate");
    }
  }

  absl::Status generate(ViewWork& view) override {
    auto* own = dynamic_cast<CpuView*>(&view);
    if (absl::Status status =
            check_stage("generate", stage_of(own), ViewStage::kAllocated, "allocate");
        !status.ok()) {
      return status;
    }
    try {
      // scratch is by worker and shared by the views, so one view is generated at a time
      const std::lock_guard lock(generate_mutex_);
      own->stage = ViewStage::kAllocated;
      if (absl::Status status = render::generate(*own, machine(), bank_, point_bank_, scratch_);
          !status.ok()) {
        return status;
      }
      own->stage = ViewStage::kGenerated;
      return absl::OkStatus();
    } catch (const std::bad_alloc&) {
      return out_of_memory("generate");
    }
  }

  FrameGeometry geometry(const ViewWork& view) const override {
    const auto* own = dynamic_cast<const CpuView*>(&view);
    if (own == nullptr || own->stage != ViewStage::kGenerated) return {};
    return {own->visible.span(),
            own->vertex_offset.span(),
            own->triangle_offset.span(),
            own->vertices.span(),
            own->indices.span(),
            own->shared.span(),
            own->posed != nullptr ? own->posed->data() : nullptr,
            own->representation.span(),
            own->jointed.span(),
            {reinterpret_cast<const float*>(own->joints.data()), 16 * own->joints.size()},
            own->splats.span(),
            own->specks.span(),
            own->speck_runs,
            own->speck_table.get(),
            own->speck_detail};
  }

  ComputeCounters counters(const ViewWork& view) const override {
    const auto* own = dynamic_cast<const CpuView*>(&view);
    ComputeCounters counters;
    if (own == nullptr || own->stage < ViewStage::kCulled) return counters;
    counters.agents = own->instances->present;
    counters.visible = own->visible_agents;
    if (own->stage < ViewStage::kSelected) return counters;
    counters.work = own->work;
    counters.error_px = own->error_px;
    counters.drawn_as[static_cast<std::size_t>(Representation::kSpeck)] = own->speck_count;
    counters.drawn_as[static_cast<std::size_t>(Representation::kNone)] = own->left_out;
    // the surroundings come last
    const std::uint32_t listed = counters.visible - own->speck_count - own->left_out;
    for (std::uint32_t i = 0; i < listed; ++i) {
      counters.farthest_m = std::max(counters.farthest_m, own->distance_m[i]);
      const Representation form =
          own->representation.size() == 0 ? Representation::kMesh : own->representation[i];
      ++counters.drawn_as[static_cast<std::size_t>(form)];
    }
    counters.effective_budget = own->effective_budget;
    for (const VisibleInstance& instance : own->visible.span()) {
      counters.vertices += instance.vertex_count;
      counters.triangles += instance.triangle_count;
    }
    for (const std::uint8_t tier : own->tier.span()) {
      counters.shared_poses += tier != kOwnPose ? 1U : 0U;
    }
    counters.view_bytes = own->size_bytes();
    if (own->stage < ViewStage::kGenerated) return counters;
    for (const std::uint32_t held : own->held_poses) counters.held_poses += held;
    counters.posed_meshes = own->posed_meshes;
    counters.posed_bytes = own->posed_bytes;
    return counters;
  }

  absl::Status read_visible(const ViewWork& view, std::span<std::uint8_t> visible) override {
    const auto* own = dynamic_cast<const CpuView*>(&view);
    if (absl::Status status =
            check_stage("read_visible", stage_of(own), ViewStage::kCulled, "cull");
        !status.ok()) {
      return status;
    }
    if (absl::Status status = check_mask(visible.size(), own->mask.size()); !status.ok()) {
      return status;
    }
    std::copy_n(own->mask.data(), own->mask.size(), visible.begin());
    return absl::OkStatus();
  }

 private:
  Machine machine() { return {pool_, kernels_}; }

  std::shared_ptr<const CastTable> cast() const {
    const std::lock_guard lock(mutex_);
    return cast_;
  }

  mutable std::mutex mutex_;
  std::shared_ptr<const CastTable> cast_;
  std::shared_ptr<InstancesPool> instances_pool_ = std::make_shared<InstancesPool>();
  std::mutex generate_mutex_;
  PosedBank bank_, point_bank_;               // guarded by generate_mutex_
  std::shared_ptr<const SpeckTable> specks_;  // likewise: of the cast that was last asked for
  const Kernels& kernels_;
  WorkPool pool_;
  std::vector<WorkerScratch> scratch_;
};

}  // namespace

std::unique_ptr<ComputeBackend> make_cpu_backend(unsigned threads, KernelLevel level) {
  return std::make_unique<CpuBackend>(threads, level);
}

}  // namespace throng::render
