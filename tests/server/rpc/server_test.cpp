#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <thread>

#include "server/rpc/test_server.hpp"
#include "support/temporary_folder.hpp"
#include "throng/client/connection.hpp"

namespace throng::test {
namespace {

using testing::HasSubstr;

constexpr const char* kToken = "a-token-that-is-long-enough";
// HealthCheckResponse { status: SERVING } and { status: NOT_SERVING }
const std::string kServing("\x08\x01", 2), kNotServing("\x08\x02", 2);
// ServerReflectionRequest { list_services: "" }
const std::string kListServices("\x3a\x00", 2);
constexpr const char* kReflection =
    "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo";

grpc::Status server_info(const std::shared_ptr<grpc::Channel>& channel,
                         v1::GetServerInfoResponse& response, const std::string& token = {}) {
  grpc::ClientContext context;
  prepare(context);
  if (!token.empty()) context.AddMetadata("authorization", "Bearer " + token);
  return v1::ServerService::NewStub(channel)->GetServerInfo(&context, {}, &response);
}

TEST(ServerTest, TellsWhatItIsAndAllows) {
  server::ServerOptions options;
  options.version = "1.2.3";
  options.limits.max_viewers = 17;
  const TestServer server(options);
  v1::GetServerInfoResponse info;
  ASSERT_TRUE(server_info(server.channel(), info).ok());
  EXPECT_EQ(info.version(), "1.2.3");
  EXPECT_EQ(info.rasterizer(), "painter");
  EXPECT_EQ(info.limits().max_viewers(), 17U);
  EXPECT_EQ(info.limits().max_frames_in_flight(), 3U);
  ASSERT_EQ(info.cast_size(), 1);
  EXPECT_EQ(info.cast(0).name(), "nobody");
}

TEST(ServerTest, HealthServesAndSaysSoNoMoreWhileDraining) {
  TestServer server;
  RawCall check(server.channel(), "/grpc.health.v1.Health/Check", "");
  EXPECT_EQ(check.read(), kServing);
  EXPECT_TRUE(check.finish().ok());
  RawCall watch(server.channel(), "/grpc.health.v1.Health/Watch", "");
  EXPECT_EQ(watch.read(), kServing);
  std::thread draining([&] { server.server->drain(); });
  EXPECT_EQ(watch.read(), kNotServing);
  draining.join();
}

TEST(ServerTest, DrainingEndsStreamsWithUnavailable) {
  TestServer server;
  Publishing publishing(server.channel());
  ASSERT_TRUE(publishing.start("station"));
  ASSERT_TRUE(publishing.read().has_value());
  Viewing viewing(server.channel());
  ASSERT_TRUE(viewing.send(Viewing::options("station", 1.0)));
  ASSERT_TRUE(viewing.next().has_value());
  std::thread draining([&] { server.server->drain(); });
  EXPECT_EQ(publishing.end().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(viewing.end().error_code(), grpc::StatusCode::UNAVAILABLE);
  draining.join();
}

TEST(ServerTest, ReflectionListsTheServices) {
  const TestServer server;
  RawCall call(server.channel(), kReflection, kListServices);
  const auto services = call.read();
  ASSERT_TRUE(services.has_value());
  for (const char* name : {"throng.v1.IngestService", "throng.v1.ViewService",
                           "throng.v1.CrowdService", "throng.v1.ServerService"}) {
    EXPECT_THAT(*services, HasSubstr(name));
  }
}

TEST(ServerTest, APortIsNotShared) {
  const TestServer first;
  server::ServerOptions options;
  options.listen.listen = first.address();
  const auto second = server::Server::start(options, nobody_cast(), painter(first.log));
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(second.status().message()), HasSubstr(first.address()));
}

TEST(ServerTest, RefusesAnOpenAddressWithoutTlsAndToken) {
  server::ServerOptions options;
  options.listen.listen = "0.0.0.0:0";
  const auto server =
      server::Server::start(options, nobody_cast(), painter(std::make_shared<PainterLog>()));
  EXPECT_EQ(server.status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(ServerTest, ListsCrowdsByName) {
  const TestServer server;
  Publishing b(server.channel()), a(server.channel());
  ASSERT_TRUE(b.start("b") && a.start("a"));
  ASSERT_TRUE(b.read().has_value() && a.read().has_value());
  grpc::ClientContext context;
  prepare(context);
  v1::ListCrowdsResponse crowds;
  ASSERT_TRUE(v1::CrowdService::NewStub(server.channel())->ListCrowds(&context, {}, &crowds).ok());
  ASSERT_EQ(crowds.crowds_size(), 2);
  EXPECT_EQ(crowds.crowds(0).name(), "a");
  EXPECT_EQ(crowds.crowds(1).name(), "b");
}

TEST(ServerTest, AsksForTheTokenEverywhereButInHealth) {
  const TemporaryFolder folder;
  std::ofstream(folder.file("tokens")) << kToken << "\n";
  server::ServerOptions options;
  options.listen.token_file = folder.file("tokens");
  const TestServer server(options);
  const auto channel = server.channel();

  v1::GetServerInfoResponse info;
  EXPECT_EQ(server_info(channel, info).error_code(), grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(server_info(channel, info, "not-the-right-token-at-all").error_code(),
            grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_TRUE(server_info(channel, info, kToken).ok());
  Publishing publishing(channel);
  publishing.start("station");
  EXPECT_EQ(publishing.end().error_code(), grpc::StatusCode::UNAUTHENTICATED);
  Viewing viewing(channel);
  viewing.send(Viewing::options("station", 1.0));
  EXPECT_EQ(viewing.end().error_code(), grpc::StatusCode::UNAUTHENTICATED);
  RawCall reflection(channel, kReflection, kListServices);
  EXPECT_FALSE(reflection.read().has_value());
  EXPECT_FALSE(reflection.finish().ok());
  RawCall allowed(channel, kReflection, kListServices, std::string("Bearer ") + kToken);
  EXPECT_TRUE(allowed.read().has_value());
  RawCall health(channel, "/grpc.health.v1.Health/Check", "");
  EXPECT_EQ(health.read(), kServing);
}

TEST(ServerTest, TlsWithATokenForOtherMachines) {
  const TemporaryFolder folder;
  const std::string make_certificate =
      "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 1 "
      "-subj /CN=localhost -addext subjectAltName=DNS:localhost -keyout " +
      folder.file("key.pem") + " -out " + folder.file("cert.pem") + " >/dev/null 2>&1";
  if (std::system(make_certificate.c_str()) != 0) GTEST_SKIP() << "there is no openssl program";
  std::ofstream(folder.file("tokens")) << kToken << "\n";
  server::ServerOptions options;
  options.listen.token_file = folder.file("tokens");
  options.listen.tls_cert_file = folder.file("cert.pem");
  options.listen.tls_key_file = folder.file("key.pem");
  const TestServer server(options);

  const auto ask = [&](client::ConnectionOptions connection_options) {
    connection_options.url = "grpcs://localhost:" + std::to_string(server.server->port());
    const auto connection = client::Connection::open(connection_options);
    EXPECT_TRUE(connection.ok()) << connection.status();
    grpc::ClientContext context;
    prepare(context);
    context.set_wait_for_ready(!connection_options.ca_file.empty());
    (*connection)->prepare(context);
    v1::GetServerInfoResponse info;
    return v1::ServerService::NewStub((*connection)->channel())
        ->GetServerInfo(&context, {}, &info)
        .error_code();
  };
  client::ConnectionOptions good;
  good.ca_file = folder.file("cert.pem");
  good.token_file = folder.file("tokens");
  EXPECT_EQ(ask(good), grpc::StatusCode::OK);
  client::ConnectionOptions no_token;
  no_token.ca_file = folder.file("cert.pem");
  EXPECT_EQ(ask(no_token), grpc::StatusCode::UNAUTHENTICATED);
  client::ConnectionOptions no_trust;
  no_trust.token_file = folder.file("tokens");
  EXPECT_EQ(ask(no_trust), grpc::StatusCode::UNAVAILABLE);
}

}  // namespace
}  // namespace throng::test
