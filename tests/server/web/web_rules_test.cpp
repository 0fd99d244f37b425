#include "server/web/web_rules.hpp"

#include <gtest/gtest.h>

#include "server/web/page.hpp"

namespace throng::server {
namespace {

TEST(WebRulesTest, LoopbackDoorKnowsLoopbackNamesOnly) {
  const WebRules rules{"127.0.0.1", {}};
  for (const char* host :
       {"127.0.0.1:7480", "localhost:7480", "LOCALHOST", "127.8.8.8", "[::1]:99"}) {
    EXPECT_TRUE(rules.check(host, "").ok()) << host;
  }
  // The last ones are what a name that was rebound to 127.0.0.1 looks like.
  for (const char* host : {"", "192.168.0.7:7480", "crowd.example", "localhost.example:7480",
                           "127.0.0.1.example", "[::1", "[2001:db8::1]:7480"}) {
    EXPECT_EQ(rules.check(host, "").code(), absl::StatusCode::kPermissionDenied) << host;
  }
}

TEST(WebRulesTest, NamesThatWereGivenAreKnown) {
  const WebRules rules{"127.0.0.1", {"crowd.example"}};
  EXPECT_TRUE(rules.check("Crowd.example", "https://crowd.example").ok());
  EXPECT_FALSE(rules.check("other.example", "").ok());
}

TEST(WebRulesTest, PublicDoorTakesAddressesButNoForeignNames) {
  const WebRules rules{"0.0.0.0", {}};
  EXPECT_TRUE(rules.check("192.168.0.7:7480", "http://192.168.0.7:7480").ok());
  EXPECT_TRUE(rules.check("localhost:7480", "").ok());
  EXPECT_FALSE(rules.check("rebound.example:7480", "").ok());
}

TEST(WebRulesTest, OnlyTheDoorsOwnPageMayAsk) {
  const WebRules rules{"127.0.0.1", {}};
  EXPECT_TRUE(rules.check("127.0.0.1:7480", "http://127.0.0.1:7480").ok());
  EXPECT_TRUE(rules.check("LocalHost:7480", "http://localhost:7480").ok());
  for (const char* origin :
       {"http://evil.example", "http://127.0.0.1:7481", "http://localhost:7480", "null",
        "127.0.0.1:7480", "file://", "http://127.0.0.1:7480.evil.example"}) {
    EXPECT_EQ(rules.check("127.0.0.1:7480", origin).code(), absl::StatusCode::kPermissionDenied)
        << origin;
  }
}

TEST(WebRulesTest, RefusalShowsNoControlCharacters) {
  const WebRules rules{"127.0.0.1", {}};
  const std::string message(rules.check("a\x1b[31m\nb", "").message());
  EXPECT_EQ(message.find('\x1b'), std::string::npos);
  EXPECT_EQ(message.find('\n'), std::string::npos);
}

TEST(WebRulesTest, AssetNamesNeverLeaveTheFolder) {
  EXPECT_EQ(asset_name("/"), "index.html");
  EXPECT_EQ(asset_name("/?x=1"), "index.html");
  EXPECT_EQ(asset_name("/main.js?v=2"), "main.js");
  EXPECT_EQ(asset_name("/icons/play.svg"), "icons/play.svg");
  for (const char* target :
       {"", "main.js", "//main.js", "/..", "/../secret", "/a/../b", "/.git/config", "/a/.b",
        "/a//b", "/a/", "/%2e%2e/x", "/a\\b", "http://x/"}) {
    EXPECT_FALSE(asset_name(target).has_value()) << target;
  }
  EXPECT_FALSE(asset_name("/" + std::string(500, 'a')).has_value());
}

TEST(WebRulesTest, ThePageIsBuiltIn) {
  const auto page = read_page("", "index.html");
  ASSERT_TRUE(page.ok()) << page.status();
  EXPECT_NE(page->find("<canvas"), std::string::npos);
  EXPECT_EQ(content_type("index.html"), "text/html; charset=utf-8");
  EXPECT_FALSE(read_page("", "nothing.js").ok());
  EXPECT_FALSE(read_page("/nowhere/at/all", "index.html").ok());
}

}  // namespace
}  // namespace throng::server
