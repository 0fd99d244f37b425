#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

namespace throng::test {

struct ProgramRun {
  int code;            // exit status, -1 where it didn't exit
  std::string output;  // both streams
};

/// Runs a command line through the shell.
inline ProgramRun run_program(const std::string& command) {
  ProgramRun run{-1, ""};
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return run;
  std::array<char, 4096> buffer;
  for (std::size_t size; (size = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    run.output.append(buffer.data(), size);
  const int status = ::pclose(pipe);
  run.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return run;
}

}  // namespace throng::test
