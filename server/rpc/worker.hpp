#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace throng::server {

/// Threads for work that a gRPC reaction must not do itself: gRPC has few threads for reactions,
/// and one that computes for milliseconds holds up every other stream. A stream posts one task at a
/// time, so the queue is never longer than there are streams.
class Worker {
 public:
  explicit Worker(unsigned threads);
  /// Runs what was posted, then ends.
  ~Worker();
  void post(std::function<void()> task);

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;
  bool stop_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace throng::server
