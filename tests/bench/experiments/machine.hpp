#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace throng::bench {

/// Where numbers were measured: processor, cores, instruction set, memory, kernel, commit.
struct Machine {
  std::string processor, instructions, memory, system, commit, date;
  unsigned cores = 0;
  double load = 0;  // average of the last minute when the program started: who else was busy

  static Machine describe();
  std::string line() const;  // one line for the head of a report
  nlohmann::ordered_json json() const;
};

}  // namespace throng::bench
