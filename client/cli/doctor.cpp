#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/cli/commands.hpp"
#include "client/cli/output.hpp"
#include "throng/v1/crowd.grpc.pb.h"
#include "throng/v1/server.grpc.pb.h"

extern char** environ;

namespace throng::client {
namespace {

/// throng-server beside this program, else the first on PATH; empty: not installed here.
std::string find_server() {
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) {
    const auto beside = self.parent_path() / "throng-server";
    if (access(beside.c_str(), X_OK) == 0) return beside.string();
  }
  const char* path = std::getenv("PATH");
  if (path == nullptr) return {};
  for (const std::string& folder : std::vector<std::string>(absl::StrSplit(path, ':'))) {
    const auto candidate = std::filesystem::path(folder) / "throng-server";
    if (!folder.empty() && access(candidate.c_str(), X_OK) == 0) return candidate.string();
  }
  return {};
}

/// What a program prints; its stderr goes nowhere (drivers like to talk).
absl::StatusOr<std::string> output_of(const std::string& program,
                                      std::vector<std::string> arguments) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return absl::InternalError("pipe2 failed");
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  std::string name = program;
  std::vector<char*> argv{name.data()};
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  // The interrupts that this program blocks must reach the other one.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  pid_t child = 0;
  const int spawned =
      posix_spawn(&child, program.c_str(), &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  std::string text;
  if (spawned == 0) {
    char buffer[4096];
    for (ssize_t got = 0; (got = read(ends[0], buffer, sizeof buffer)) > 0;) {
      text.append(buffer, static_cast<std::size_t>(got));
    }
  }
  close(ends[0]);
  if (spawned != 0) return absl::UnavailableError(absl::StrCat("can't start ", program));
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    return absl::UnavailableError(absl::StrCat(program, " failed"));
  }
  return text;
}

void print_part(const char* part, const nlohmann::json& report) {
  std::string line = report.value("available", false) ? "yes" : "no";
  for (const char* key : {"name", "detail", "folder", "why"}) {
    if (report.contains(key)) absl::StrAppend(&line, ", ", report.value(key, std::string()));
  }
  if (report.contains("characters"))
    absl::StrAppend(&line, ", ", report["characters"].size(), " characters");
  std::printf("  %-22s %s\n", part, line.c_str());
}

struct ServerAnswer {
  std::string url;
  absl::Status status;
  v1::GetServerInfoResponse info;
  v1::ListCrowdsResponse crowds;
};

ServerAnswer ask_server(const Common& common) {
  ServerAnswer answer;
  const auto connection = Connection::open(common.connection);
  if (!connection.ok()) {
    answer.url = common.connection.url;
    answer.status = connection.status();
    return answer;
  }
  answer.url = (*connection)->address();
  const auto call = [&](auto&& ask) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(3));
    (*connection)->prepare(context);
    return from_grpc(ask(context), **connection);
  };
  const auto channel = (*connection)->channel();
  answer.status = call([&](grpc::ClientContext& context) {
    return v1::ServerService::NewStub(channel)->GetServerInfo(&context, {}, &answer.info);
  });
  if (!answer.status.ok()) return answer;
  answer.status = call([&](grpc::ClientContext& context) {
    return v1::CrowdService::NewStub(channel)->ListCrowds(&context, {}, &answer.crowds);
  });
  return answer;
}

/// @param named  a server was asked for: that it does not answer is a failure.
int print_server(const ServerAnswer& answer, bool named) {
  if (!answer.status.ok()) {
    std::printf("server: %s\n", std::string(answer.status.message()).c_str());
    return named ? kFailure : kOk;
  }
  std::printf("server: %s answers, throng %s, %s, %s\n", answer.url.c_str(),
              answer.info.version().c_str(), answer.info.compute_backend().c_str(),
              answer.info.rasterizer().c_str());
  if (answer.crowds.crowds_size() == 0) {
    std::printf("  no crowds; publish one with 'throng publish FILE --crowd NAME'\n");
  }
  for (const v1::CrowdInfo& crowd : answer.crowds.crowds()) {
    std::printf("  crowd %s: %u agents, %s\n", crowd.name().c_str(), crowd.agents(),
                crowd.live() ? "live" : "ended");
  }
  return kOk;
}

}  // namespace

int run_doctor(const Common& common, bool named, bool json) {
  const ServerAnswer server = ask_server(common);
  const std::string program = find_server();
  nlohmann::json local = nlohmann::json::object();
  if (!program.empty()) {
    const auto text = output_of(program, {"--doctor", "--json"});
    if (!text.ok()) return report("doctor", text.status());
    local = nlohmann::json::parse(*text, nullptr, false);
    if (!local.is_object()) {
      return report("doctor", absl::InternalError(absl::StrCat(program, " printed no report")));
    }
  }
  if (json) {
    nlohmann::json all = {{"throng_server", program}, {"local", local}};
    all["server"] = {{"url", server.url}, {"answers", server.status.ok()}};
    if (server.status.ok()) {
      all["server"]["version"] = server.info.version();
      for (const v1::CrowdInfo& crowd : server.crowds.crowds()) {
        all["server"]["crowds"].push_back(crowd.name());
      }
    } else {
      all["server"]["why"] = std::string(server.status.message());
    }
    // A path need not be UTF-8.
    const std::string text = all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
    std::printf("%s\n", text.c_str());
    return named && !server.status.ok() ? kFailure : kOk;
  }
  if (program.empty()) {
    std::printf(
        "this machine: no throng-server beside this program or on PATH; it can view and "
        "publish, not draw\n");
  } else {
    std::printf("this machine: %s %s, %d cores\n", program.c_str(),
                local.value("version", std::string("?")).c_str(), local.value("cores", 0));
    print_part("cast", local.value("cast", nlohmann::json::object()));
    for (const char* group : {"compute", "rasterizer"}) {
      const nlohmann::json parts = local.value(group, nlohmann::json::object());
      for (const auto& [name, part] : parts.items()) {
        if (part.is_object()) print_part(absl::StrCat(group, " ", name).c_str(), part);
      }
    }
    const nlohmann::json egl = local.value("egl", nlohmann::json::array());
    for (const auto& line : egl) {
      if (line.is_string()) std::printf("  egl: %s\n", line.get<std::string>().c_str());
    }
  }
  return print_server(server, named);
}

}  // namespace throng::client
