#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "server/rpc/bind_rules.hpp"
#include "server/rpc/token_gate.hpp"
#include "support/temporary_folder.hpp"

namespace throng::server {
namespace {

using testing::HasSubstr;

absl::Status check(const std::string& listen, bool tls, bool token, bool insecure = false) {
  ListenOptions options;
  options.listen = listen;
  if (tls) options.tls_cert_file = options.tls_key_file = "file.pem";
  if (token) options.token_file = "tokens";
  options.insecure = insecure;
  return check_bind(options);
}

TEST(BindRulesTest, LoopbackNeedsNothing) {
  for (const char* listen : {"127.0.0.1:0", "127.1.2.3:7447", "localhost:7447", "[::1]:7447"}) {
    EXPECT_TRUE(check(listen, false, false).ok()) << listen;
  }
}

TEST(BindRulesTest, OtherAddressesNeedTlsAndTokenOrInsecure) {
  for (const char* listen : {"0.0.0.0:7447", "[::]:7447", "192.168.0.1:1", "example.org:7447",
                             "127.0.0.1.example.org:1", "[::ffff:7f00:1]:1"}) {
    EXPECT_EQ(check(listen, false, false).code(), absl::StatusCode::kFailedPrecondition) << listen;
    EXPECT_EQ(check(listen, true, false).code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_EQ(check(listen, false, true).code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_TRUE(check(listen, true, true).ok());
    EXPECT_TRUE(check(listen, false, false, true).ok());
  }
  const std::string text(check("0.0.0.0:1", true, false).message());
  EXPECT_THAT(text, HasSubstr("--token-file"));
  EXPECT_THAT(text, testing::Not(HasSubstr("--tls-cert")));
}

TEST(BindRulesTest, RefusesWhatIsNoAddress) {
  for (const char* listen : {"", "7447", ":7447", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536",
                             "127.0.0.1:x", "::1:7447"}) {
    EXPECT_EQ(check(listen, false, false).code(), absl::StatusCode::kInvalidArgument) << listen;
  }
}

TEST(BindRulesTest, RefusesACertificateWithoutItsKey) {
  ListenOptions options;
  options.tls_cert_file = "cert.pem";
  EXPECT_EQ(check_bind(options).code(), absl::StatusCode::kInvalidArgument);
}

TEST(TokenGateTest, ComparesWholeTokens) {
  EXPECT_TRUE(equal_in_constant_time("", ""));
  EXPECT_TRUE(equal_in_constant_time("abc", "abc"));
  EXPECT_FALSE(equal_in_constant_time("abc", "abd"));
  EXPECT_FALSE(equal_in_constant_time("abc", "ab"));
  EXPECT_FALSE(equal_in_constant_time("ab", "abc"));
  EXPECT_FALSE(equal_in_constant_time("abab", "ab"));
  EXPECT_FALSE(equal_in_constant_time("", "a"));
  EXPECT_FALSE(equal_in_constant_time("a", ""));
}

TEST(TokenGateTest, AsksForABearerOfOneOfItsTokens) {
  const TokenGate gate({"a-long-enough-token", "another-good-token!"});
  const auto check = [&](std::string_view header) { return gate.check(&header).ok(); };
  EXPECT_TRUE(check("Bearer a-long-enough-token"));
  EXPECT_TRUE(check("Bearer another-good-token!"));
  EXPECT_FALSE(check("Bearer a-long-enough-tokem"));
  EXPECT_FALSE(check("a-long-enough-token"));
  EXPECT_FALSE(check("Bearer "));
  EXPECT_FALSE(check(""));
  EXPECT_EQ(gate.check(nullptr).code(), absl::StatusCode::kUnauthenticated);
  EXPECT_TRUE(TokenGate().check(nullptr).ok());
}

TEST(TokenGateTest, ReadsTokensFromAFileAndRefusesWeakOnes) {
  const test::TemporaryFolder folder;
  const auto written = [&](const char* name, const char* text) {
    std::ofstream(folder.file(name)) << text;
    return TokenGate::read(folder.file(name));
  };
  const auto gate =
      written("good", "# for the lab\n\n  a-long-enough-token \nanother-good-token!\n");
  ASSERT_TRUE(gate.ok()) << gate.status();
  const std::string_view header = "Bearer a-long-enough-token";
  EXPECT_TRUE(gate->check(&header).ok());
  EXPECT_EQ(written("weak", "short\n").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(written("empty", "# nothing\n").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(TokenGate::read(folder.file("absent")).status().code(), absl::StatusCode::kNotFound);
  EXPECT_FALSE(TokenGate::read("")->asks());
}

}  // namespace
}  // namespace throng::server
