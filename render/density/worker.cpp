#include <algorithm>
#include <chrono>

#include "throng/render/density.hpp"

namespace throng::render {

TriangulationWorker::TriangulationWorker(std::chrono::milliseconds least_interval,
                                         TriangulationOptions options)
    : least_interval_(least_interval),
      options_(options),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

TriangulationWorker::~TriangulationWorker() {
  thread_.request_stop();
  thread_.join();
}

void TriangulationWorker::request(std::shared_ptr<const Snapshot> snapshot) {
  {
    const std::lock_guard lock(mutex_);
    wanted_ = std::move(snapshot);
  }
  changed_.notify_all();
}

std::shared_ptr<const Triangulation> TriangulationWorker::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

void TriangulationWorker::wait() const {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return wanted_ == nullptr && !busy_; });
}

void TriangulationWorker::run(const std::stop_token& stop) {
  auto last = std::chrono::steady_clock::time_point::min();
  std::chrono::steady_clock::duration pause = least_interval_;
  for (;;) {
    std::shared_ptr<const Snapshot> snapshot;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [&] { return wanted_ != nullptr; })) return;
      if (last != std::chrono::steady_clock::time_point::min()) {
        changed_.wait_until(lock, stop, last + pause, [] { return false; });
        if (stop.stop_requested()) return;
      }
      snapshot = std::move(wanted_);
      wanted_.reset();
      busy_ = true;
    }
    last = std::chrono::steady_clock::now();
    auto made = std::make_shared<Triangulation>(
        triangulate(snapshot->position_m, snapshot->present, options_));
    made->roster = snapshot->roster;
    made->time_us = snapshot->time_us;
    pause = std::max<std::chrono::steady_clock::duration>(
        least_interval_, 10 * (std::chrono::steady_clock::now() - last));
    {
      const std::lock_guard lock(mutex_);
      newest_ = std::move(made);
      busy_ = false;
    }
    changed_.notify_all();
  }
}

}  // namespace throng::render
