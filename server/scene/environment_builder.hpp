#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <glm/glm.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "throng/render/crowd.hpp"

namespace throng::server {

/// Raises walls beside the connections, which must not wait for it: a site with many points takes
/// seconds. One thread, one site a second at most; a crowd whose area changes meanwhile gets the
/// newest. Thread safe.
class EnvironmentBuilder {
 public:
  EnvironmentBuilder();
  ~EnvironmentBuilder();  // gives up what is being built; what still waits is left

  /// Checks the area (errors as render::check_environment) and builds it for `crowd` some time
  /// soon; what fails only then is logged under `name`. An empty text takes the crowd's walls away.
  absl::Status build(const std::string& name, const std::shared_ptr<render::Crowd>& crowd,
                     std::string wkt);

  /// Until nothing waits; for tests.
  void wait_idle();

 private:
  struct Job {
    std::string name;
    std::weak_ptr<render::Crowd> crowd;
    std::string wkt;
  };
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  bool is_building_ = false, stop_ = false;
  std::atomic<bool> cancelled_{false};     // stop_, for those who don't hold mutex_
  std::weak_ptr<render::Crowd> building_;  // for whom; none once it wants no walls
  std::thread thread_;
};

}  // namespace throng::server
