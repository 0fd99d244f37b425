#include "render/compute/cpu/work_pool.hpp"

#include <ctime>
#include <exception>

namespace throng::render {
namespace {

std::atomic<std::uint64_t> all_worked_ns{0};

std::uint64_t thread_ns() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1'000'000'000ULL * static_cast<std::uint64_t>(time.tv_sec) +
         static_cast<std::uint64_t>(time.tv_nsec);
}

}  // namespace

std::uint64_t WorkPool::worked_ns() { return all_worked_ns.load(std::memory_order_relaxed); }

WorkPool::WorkPool(unsigned threads) {
  if (threads == 0) threads = std::max(1U, std::thread::hardware_concurrency());
  workers_.reserve(threads - 1);
  for (unsigned worker = 1; worker < threads; ++worker) {
    workers_.emplace_back([this, worker] { work(worker); });
  }
}

WorkPool::~WorkPool() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  start_.notify_all();
}

void WorkPool::take_chunks(unsigned worker) {
  for (;;) {
    const std::size_t chunk = next_chunk_.fetch_add(1, std::memory_order_relaxed);
    if (chunk >= chunk_count_) return;
    function_(context_, chunk, worker);
  }
}

void WorkPool::run_job(std::size_t chunk_count, Function function, void* context) {
  if (chunk_count == 0) return;
  if (chunk_count == 1 || workers_.empty()) {
    // scratch is by worker, so even a small job waits for its turn
    const std::lock_guard turn(caller_mutex_);
    for (std::size_t chunk = 0; chunk < chunk_count; ++chunk) function(context, chunk, 0);
    return;
  }
  const std::lock_guard turn(caller_mutex_);
  // What a chunk throws (there is no memory) ends the job and goes to the caller, as if it had done
  // the chunk itself; out of a thread of the pool it would end the process.
  struct Guarded {
    Function function;
    void* context;
    std::atomic<bool> has_failed{false};
    std::exception_ptr error{};
  } guarded{function, context};
  {
    const std::lock_guard lock(mutex_);
    function_ = [](void* job, std::size_t chunk, unsigned worker) {
      auto& self = *static_cast<Guarded*>(job);
      if (self.has_failed.load(std::memory_order_relaxed)) return;
      try {
        self.function(self.context, chunk, worker);
      } catch (...) {
        if (!self.has_failed.exchange(true)) self.error = std::current_exception();
      }
    };
    context_ = &guarded;
    chunk_count_ = chunk_count;
    next_chunk_.store(0, std::memory_order_relaxed);
    busy_ = static_cast<unsigned>(workers_.size());
    ++job_;
  }
  start_.notify_all();
  take_chunks(0);
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return busy_ == 0; });
  lock.unlock();
  if (guarded.error != nullptr) std::rethrow_exception(guarded.error);
}

void WorkPool::work(unsigned worker) {
  std::uint64_t finished = 0, counted_ns = thread_ns();
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      start_.wait(lock, [&] { return stopping_ || job_ != finished; });
      if (stopping_) return;
      finished = job_;
    }
    take_chunks(worker);
    const std::uint64_t now_ns = thread_ns();
    all_worked_ns.fetch_add(now_ns - counted_ns, std::memory_order_relaxed);
    counted_ns = now_ns;
    bool last = false;
    {
      const std::lock_guard lock(mutex_);
      last = --busy_ == 0;
    }
    if (last) done_.notify_one();
  }
}

}  // namespace throng::render
