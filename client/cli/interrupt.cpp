#include "client/cli/interrupt.hpp"

#include <pthread.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <mutex>
#include <thread>
#include <utility>

namespace throng::client {
namespace {

std::atomic<int> came{0};
std::mutex mutex;
std::function<void()> on_interrupt;  // guarded by mutex

}  // namespace

void catch_interrupts() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::thread([signals] {
    for (;;) {
      int signal = 0;
      sigwait(&signals, &signal);
      if (came.exchange(signal) != 0) std::_Exit(128 + signal);
      const std::lock_guard lock(mutex);
      if (on_interrupt) on_interrupt();
    }
  }).detach();
}

int interrupted() { return came.load(); }

OnInterrupt::OnInterrupt(std::function<void()> action) {
  const std::lock_guard lock(mutex);
  on_interrupt = std::move(action);
  if (came.load() != 0) on_interrupt();
}

OnInterrupt::~OnInterrupt() {
  const std::lock_guard lock(mutex);
  on_interrupt = nullptr;
}

}  // namespace throng::client
