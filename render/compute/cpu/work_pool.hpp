#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace throng::render {

/// Threads that share the chunks of one job at a time; the caller works along.
///
/// Which chunks a job has depends on the caller's numbers alone, never on the number of threads,
/// and a chunk writes only its own results: so results don't depend on the number of threads
/// either. `run` may be called from several threads; the jobs then follow each other. A job must
/// not start another one on the same pool.
class WorkPool {
 public:
  /// @param threads  the caller's included; 0: one for each core.
  explicit WorkPool(unsigned threads = 0);
  ~WorkPool();
  WorkPool(const WorkPool&) = delete;
  WorkPool& operator=(const WorkPool&) = delete;

  /// Processor time that threads of pools took so far, of all in the process and without callers.
  static std::uint64_t worked_ns();

  unsigned thread_count() const { return static_cast<unsigned>(workers_.size()) + 1; }

  /// Calls `body(chunk, worker)` for each chunk in [0, chunk_count), worker in [0, thread_count()).
  /// Returns when all are done.
  template <typename Body>
  void run(std::size_t chunk_count, Body&& body) {
    using Plain = std::remove_reference_t<Body>;
    run_job(
        chunk_count,
        [](void* context, std::size_t chunk, unsigned worker) {
          (*static_cast<Plain*>(context))(chunk, worker);
        },
        const_cast<void*>(static_cast<const void*>(&body)));
  }

  /// Calls `body(begin, end)` for ranges of `chunk_size` that cover [0, count).
  template <typename Body>
  void for_chunks(std::size_t count, std::size_t chunk_size, Body&& body) {
    run((count + chunk_size - 1) / chunk_size, [&](std::size_t chunk, unsigned) {
      const std::size_t begin = chunk * chunk_size;
      body(begin, std::min(count, begin + chunk_size));
    });
  }

 private:
  using Function = void (*)(void* context, std::size_t chunk, unsigned worker);
  void run_job(std::size_t chunk_count, Function function, void* context);
  void work(unsigned worker);
  void take_chunks(unsigned worker);

  std::mutex caller_mutex_;  // one job at a time
  std::mutex mutex_;
  std::condition_variable start_, done_;
  std::uint64_t job_ = 0;  // number of the current job
  unsigned busy_ = 0;      // workers that have not finished the current job
  bool stopping_ = false;
  Function function_ = nullptr;
  void* context_ = nullptr;
  std::size_t chunk_count_ = 0;
  std::atomic<std::size_t> next_chunk_{0};
  std::vector<std::jthread> workers_;
};

}  // namespace throng::render
