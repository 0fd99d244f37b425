#include "server/scene/environment_builder.hpp"

#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "throng/render/environment.hpp"

namespace throng::server {

namespace {
constexpr std::chrono::seconds kPause{1};
}  // namespace

EnvironmentBuilder::EnvironmentBuilder() : thread_([this] { run(); }) {}

EnvironmentBuilder::~EnvironmentBuilder() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    cancelled_ = true;
    if (is_building_) render::interrupt_environments(true);
  }
  changed_.notify_all();
  thread_.join();
  render::interrupt_environments(false);
}

absl::Status EnvironmentBuilder::build(const std::string& name,
                                       const std::shared_ptr<render::Crowd>& crowd,
                                       std::string wkt) {
  if (!wkt.empty()) {
    absl::Status status = render::check_environment(wkt, crowd->settings().origin_world);
    if (!status.ok()) return status;
  }
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(jobs_, [&](const Job& job) { return job.crowd.lock() == crowd; });
    if (wkt.empty()) {
      if (building_.lock() == crowd) building_.reset();
      crowd->set_environment(nullptr);
    } else {
      jobs_.push_back({name, crowd, std::move(wkt)});
    }
  }
  changed_.notify_all();
  return absl::OkStatus();
}

void EnvironmentBuilder::wait_idle() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return jobs_.empty() && !is_building_; });
}

void EnvironmentBuilder::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stop_ || !jobs_.empty(); });
    if (stop_) return;
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    is_building_ = true;
    building_ = job.crowd;
    lock.unlock();
    if (const std::shared_ptr<render::Crowd> crowd = job.crowd.lock()) {
      auto made = render::make_environment(job.wkt, crowd->settings().origin_world,
                                           {.cancelled = &cancelled_});
      if (made.ok()) {
        const std::lock_guard relock(mutex_);
        if (building_.lock() == crowd) crowd->set_environment(*std::move(made));
      } else {
        spdlog::warn("event=no_walls crowd={} error=\"{}\"", job.name,
                     std::string(made.status().message()));
      }
    }
    lock.lock();
    is_building_ = false;
    changed_.notify_all();
    // New walls cost every viewer of the server a moment: an upload. No producer may ask for one
    // after the other.
    if (!job.crowd.expired()) changed_.wait_for(lock, kPause, [this] { return stop_; });
  }
}

}  // namespace throng::server
