#include "server/rpc/token_gate.hpp"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>
#include <grpcpp/grpcpp.h>

#include <cstring>
#include <fstream>
#include <utility>

namespace throng::server {
namespace {

constexpr std::size_t kShortestToken = 16;

class TokenInterceptor final : public grpc::experimental::Interceptor {
 public:
  TokenInterceptor(std::shared_ptr<const TokenGate> gate, grpc::experimental::ServerRpcInfo* info)
      : gate_(std::move(gate)), info_(info) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    using grpc::experimental::InterceptionHookPoints;
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_INITIAL_METADATA)) {
      const auto* metadata = methods->GetRecvInitialMetadata();
      const auto found = metadata->find("authorization");
      if (found != metadata->end()) {
        const std::string_view value(found->second.data(), found->second.size());
        verdict_ = gate_->check(&value);
      } else {
        verdict_ = gate_->check(nullptr);
      }
      // Handlers of throng.v1 ask the gate themselves and finish in order.
      const bool ours = std::strncmp(info_->method(), "/throng.v1.", 11) == 0;
      if (!verdict_.ok() && !ours) info_->server_context()->TryCancel();
    }
    if (!verdict_.ok() &&
        methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      methods->ModifySendStatus(
          grpc::Status(grpc::StatusCode::UNAUTHENTICATED, std::string(verdict_.message())));
    }
    methods->Proceed();
  }

 private:
  std::shared_ptr<const TokenGate> gate_;
  grpc::experimental::ServerRpcInfo* info_;
  absl::Status verdict_;
};

class TokenInterceptorFactory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit TokenInterceptorFactory(std::shared_ptr<const TokenGate> gate)
      : gate_(std::move(gate)) {}

  grpc::experimental::Interceptor* CreateServerInterceptor(
      grpc::experimental::ServerRpcInfo* info) override {
    // A probe of health carries no token.
    constexpr const char kHealth[] = "/grpc.health.v1.Health/";
    if (std::strncmp(info->method(), kHealth, sizeof kHealth - 1) == 0) return nullptr;
    return new TokenInterceptor(gate_, info);
  }

 private:
  std::shared_ptr<const TokenGate> gate_;
};

}  // namespace

bool equal_in_constant_time(std::string_view a, std::string_view b) {
  // The loop's length depends on `a` alone, which is what came from outside.
  volatile unsigned char difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const char other = b.empty() ? '\0' : b[i % b.size()];
    difference = static_cast<unsigned char>(difference | (a[i] ^ other));
  }
  return difference == 0;
}

absl::StatusOr<TokenGate> TokenGate::read(const std::string& token_file) {
  if (token_file.empty()) return TokenGate();
  std::ifstream file(token_file);
  if (!file) return absl::NotFoundError(absl::StrCat("--token-file: can't read ", token_file));
  std::vector<std::string> tokens;
  std::string line;
  while (std::getline(file, line)) {
    const std::string token(absl::StripAsciiWhitespace(line));
    if (token.empty() || token.front() == '#') continue;
    if (token.size() < kShortestToken) {
      return absl::InvalidArgumentError(
          absl::StrCat("--token-file: ", token_file, " has a token of ", token.size(),
                       " characters, at least ", kShortestToken, " are asked for"));
    }
    tokens.push_back(token);
  }
  if (tokens.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("--token-file: ", token_file, " has no token"));
  }
  return TokenGate(std::move(tokens));
}

absl::Status TokenGate::check(const std::string_view* authorization) const {
  if (tokens_.empty()) return absl::OkStatus();
  if (authorization == nullptr) {
    return absl::UnauthenticatedError("authorization: a token is asked for and none was sent");
  }
  constexpr std::string_view kScheme = "Bearer ";
  std::string_view token = *authorization;
  if (token.substr(0, kScheme.size()) == kScheme) {
    token.remove_prefix(kScheme.size());
    bool good = false;
    // All of them, so that the time does not tell which one came near.
    for (const std::string& known : tokens_) {
      if (equal_in_constant_time(token, known)) good = true;
    }
    if (good) return absl::OkStatus();
  }
  return absl::UnauthenticatedError("authorization: the token is wrong");
}

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> make_token_interceptors(
    std::shared_ptr<const TokenGate> gate) {
  return std::make_unique<TokenInterceptorFactory>(std::move(gate));
}

}  // namespace throng::server
