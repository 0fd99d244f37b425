#pragma once

#include <functional>

namespace throng::client {

/// SIGINT and SIGTERM: the first one asks the command to end in order, the second ends the program.
/// Call once, before any thread is made.
void catch_interrupts();

/// The signal that came, 0: none.
int interrupted();

/// While it lives, `action` is called (once, from another thread) when an interrupt comes, also if
/// it came before.
class OnInterrupt {
 public:
  explicit OnInterrupt(std::function<void()> action);
  ~OnInterrupt();
  OnInterrupt(const OnInterrupt&) = delete;
  OnInterrupt& operator=(const OnInterrupt&) = delete;
};

}  // namespace throng::client
