// The web door over real sockets, with a painter instead of a rasterizer.
#include "server/web/door.hpp"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <cstring>
#include <fstream>

#include "server/rpc/test_server.hpp"
#include "throng/render/encode.hpp"
#include "throng/v1/web.pb.h"

namespace throng::test {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using testing::HasSubstr;

/// One browser, spoken by hand.
class Browser {
 public:
  Browser(int port, const std::string& host, const std::string& origin = {}) : stream_(context_) {
    stream_.next_layer().connect(
        {asio::ip::make_address("127.0.0.1"), static_cast<unsigned short>(port)});
    if (!origin.empty()) {
      stream_.set_option(
          websocket::stream_base::decorator([origin](websocket::request_type& request) {
            request.set(http::field::origin, origin);
          }));
    }
    stream_.handshake(response_, host, "/ws", error);
  }

  void send(const std::string& text, bool is_text = true) {
    stream_.text(is_text);
    stream_.write(asio::buffer(text), error);
  }

  /// The next message; frames have their image in it. Empty when the server has closed.
  std::optional<v1::WebResponse> read() {
    beast::flat_buffer buffer;
    stream_.read(buffer, error);
    if (error) return std::nullopt;
    std::string text(static_cast<const char*>(buffer.data().data()), buffer.size());
    std::string image;
    if (!stream_.got_text()) {
      std::uint32_t size = 0;
      std::memcpy(&size, text.data(), 4);
      image = text.substr(4 + size);
      text = text.substr(4, size);
    }
    v1::WebResponse response;
    EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(text, &response).ok()) << text;
    if (response.has_frame()) response.mutable_frame()->set_image(image);
    return response;
  }

  /// The next frame, acknowledged.
  v1::StreamViewResponse frame() {
    while (const auto response = read()) {
      if (!response->has_frame()) {
        ADD_FAILURE() << response->ShortDebugString();
        break;
      }
      send(absl::StrCat("{\"view\":{\"ackedFrameIndex\":", response->frame().frame_index(), "}}"));
      return response->frame();
    }
    return {};
  }

  /// The next error, frames left aside.
  v1::WebError refusal() {
    while (const auto response = read()) {
      if (response->has_error()) return response->error();
    }
    ADD_FAILURE() << "closed: " << error.message();
    return {};
  }

  int status() const { return response_.result_int(); }
  websocket::close_code close_code() const {
    return static_cast<websocket::close_code>(stream_.reason().code);
  }
  void cut() { stream_.next_layer().close(); }

  beast::error_code error;

 private:
  asio::io_context context_;
  websocket::stream<asio::ip::tcp::socket> stream_;
  websocket::response_type response_;
};

class WebDoorTest : public testing::Test {
 protected:
  void open(server::ServerOptions options = {}, server::WebOptions web = {}) {
    server.emplace(std::move(options));
    web.http = "127.0.0.1:0";
    auto opened = server::WebDoor::open(web, server->server->services());
    ASSERT_TRUE(opened.ok()) << opened.status();
    door = *std::move(opened);
  }

  /// A crowd of two with frames at 0.1, 0.2, ... s.
  void publish(int frames = 1) {
    publishing.emplace(server->channel());
    ASSERT_TRUE(publishing->start("station"));
    ASSERT_TRUE(publishing->membership(1, {1, 2}));
    for (int frame = 1; frame <= frames; ++frame) {
      ASSERT_TRUE(publishing->chunk(static_cast<std::uint64_t>(frame), 1, 0, 2));
      ASSERT_EQ(publishing->outcome(), v1::FrameAck::OUTCOME_APPLIED);
    }
  }

  std::unique_ptr<Browser> browser(const std::string& origin = {}) {
    return std::make_unique<Browser>(door->port(), door->address(), origin);
  }

  http::response<http::string_body> get(const std::string& target,
                                        http::verb verb = http::verb::get,
                                        const std::string& host = "localhost",
                                        const std::string& authorization = {}) {
    asio::io_context context;
    asio::ip::tcp::socket socket(context);
    socket.connect(
        {asio::ip::make_address("127.0.0.1"), static_cast<unsigned short>(door->port())});
    http::request<http::string_body> request(verb, target, 11);
    request.set(http::field::host, host);
    if (!authorization.empty()) request.set(http::field::authorization, authorization);
    request.keep_alive(false);
    http::write(socket, request);
    beast::flat_buffer buffer;
    http::response_parser<http::string_body> parser;
    parser.skip(verb == http::verb::head);
    http::read(socket, buffer, parser);
    return parser.release();
  }

  static std::string watch(double red, const std::string& more = {}) {
    return absl::StrCat(
        "{\"view\":{\"options\":{\"crowdName\":\"station\",\"widthPx\":32,\"heightPx\":16,",
        "\"maxRateHz\":60,\"camera\":{\"eye\":{\"x\":", red, ",\"y\":50,\"z\":50},\"target\":{}}",
        more, "}}}");
  }

  std::optional<TestServer> server;
  std::unique_ptr<server::WebDoor> door;
  std::optional<Publishing> publishing;
};

TEST_F(WebDoorTest, ServesThePageAndNothingElse) {
  open();
  const auto page = get("/");
  EXPECT_EQ(page.result_int(), 200U);
  EXPECT_THAT(page.body(), HasSubstr("<canvas"));
  EXPECT_EQ(page[http::field::content_type], "text/html; charset=utf-8");
  EXPECT_THAT(std::string(page["Content-Security-Policy"]), HasSubstr("default-src 'none'"));
  EXPECT_THAT(std::string(page["Content-Security-Policy"]),
              HasSubstr("frame-ancestors 'self' http://127.0.0.1:* http://localhost:* "));
  EXPECT_EQ(get("/main.js")[http::field::content_type], "text/javascript; charset=utf-8");
  EXPECT_EQ(get("/", http::verb::head).body(), "");
  EXPECT_EQ(get("/nothing").result_int(), 404U);
  EXPECT_EQ(get("/../../etc/passwd").result_int(), 404U);
  EXPECT_EQ(get("/", http::verb::post).result_int(), 405U);
  EXPECT_EQ(get("/ws").result_int(), 426U);
  EXPECT_EQ(get("/healthz").body(), "ok\n");
}

TEST_F(WebDoorTest, MetricsCountWhatHappened) {
  open();
  publish(3);
  const std::string text = get("/metrics").body();
  EXPECT_THAT(
      text, HasSubstr("throng_build_info{version=\"0\",compute=\"none\",raster=\"painter\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("throng_ingest_frames_total{crowd=\"station\"} 3\n"));
  EXPECT_THAT(text, HasSubstr("throng_crowd_agents{crowd=\"station\"} 2\n"));
  EXPECT_THAT(text, HasSubstr("throng_web_connections 1\n"));
}

TEST_F(WebDoorTest, RefusesForeignHostsAndOrigins) {
  open();
  EXPECT_EQ(get("/", http::verb::get, "rebound.example").result_int(), 403U);
  EXPECT_EQ(get("/metrics", http::verb::get, "rebound.example").result_int(), 403U);
  EXPECT_EQ(browser("http://evil.example")->error, websocket::error::upgrade_declined);
  EXPECT_EQ(browser(absl::StrCat("http://", door->address()))->status(), 101);
  EXPECT_EQ(Browser(door->port(), "rebound.example").error, websocket::error::upgrade_declined);
}

TEST_F(WebDoorTest, RefusesAnAddressThatOthersReach) {
  server.emplace();
  server::WebOptions web;
  web.http = "0.0.0.0:0";
  const auto refused = server::WebDoor::open(web, server->server->services());
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("--insecure"));
  web.http = "localhost";
  EXPECT_EQ(server::WebDoor::open(web, server->server->services()).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(WebDoorTest, ShowsFramesOfTheViewThatWasAskedFor) {
  open();
  publish();
  const auto viewer = browser();
  viewer->send(watch(200, ",\"stamp\":\"77\""));
  const v1::StreamViewResponse frame = viewer->frame();
  EXPECT_EQ(frame.frame_index(), 1U + frame.skipped_frames());
  EXPECT_EQ(frame.width_px(), 32U);
  EXPECT_EQ(frame.stats().agents(), 2U);
  EXPECT_EQ(frame.stamp(), 77U);
  EXPECT_TRUE(frame.live());
  EXPECT_TRUE(frame.playback().live());
  const auto image = render::decode_jpeg(
      {reinterpret_cast<const std::uint8_t*>(frame.image().data()), frame.image().size()});
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_NEAR(image->rgbx.at(0), 200, 4);
}

TEST_F(WebDoorTest, APictureThatStandsIsSentOnce) {
  open();
  publish();
  const auto viewer = browser();
  viewer->send(watch(9));
  EXPECT_FALSE(viewer->frame().image().empty());
  const v1::StreamViewResponse again = viewer->frame();
  EXPECT_TRUE(again.same_image());
  EXPECT_TRUE(again.image().empty());
  viewer->send(watch(99));
  v1::StreamViewResponse frame;
  do {
    frame = viewer->frame();
  } while (frame.camera().eye().x() != 99.0);
  EXPECT_FALSE(frame.image().empty());
}

TEST_F(WebDoorTest, EachViewerHasItsOwnTime) {
  open();
  publish(20);
  const auto live = browser(), past = browser();
  live->send(watch(1));
  past->send(watch(1, ",\"playback\":{\"sceneTimeUs\":\"500000\",\"paused\":true}"));
  for (int i = 0; i < 3; ++i) {
    const v1::StreamViewResponse then = past->frame();
    EXPECT_EQ(then.scene_time_us(), 500'000);
    EXPECT_TRUE(then.playback().paused());
    EXPECT_EQ(then.oldest_time_us(), 100'000);
    EXPECT_EQ(then.capture_time_us(), 2'000'000);
    EXPECT_TRUE(live->frame().playback().live());
  }
  // A step is a frame of the producer.
  past->send(R"({"view":{"options":{"playback":{"stepFrames":-2},"stamp":"5"}}})");
  v1::StreamViewResponse frame;
  do {
    frame = past->frame();
  } while (frame.stamp() != 5);
  EXPECT_EQ(frame.scene_time_us(), 300'000);
  past->send(R"({"view":{"options":{"playback":{"live":true},"stamp":"6"}}})");
  do {
    frame = past->frame();
  } while (frame.stamp() != 6);
  EXPECT_TRUE(frame.playback().live());
}

TEST_F(WebDoorTest, AnswersCarryTheRequestsNumber) {
  open();
  publish();
  const auto viewer = browser();
  viewer->send(R"({"id":7,"listCrowds":{}})");
  auto response = viewer->read();
  ASSERT_TRUE(response.has_value());
  EXPECT_EQ(response->id(), 7U);
  ASSERT_EQ(response->list_crowds().crowds_size(), 1);
  EXPECT_EQ(response->list_crowds().crowds(0).name(), "station");
  viewer->send(R"({"id":8,"getServerInfo":{}})");
  response = viewer->read();
  ASSERT_TRUE(response.has_value());
  EXPECT_EQ(response->id(), 8U);
  EXPECT_EQ(response->get_server_info().rasterizer(), "painter");
}

TEST_F(WebDoorTest, SendsAgentsAndDensityOnRequest) {
  open();
  publish();
  const auto viewer = browser();
  viewer->send(
      R"({"view":{"options":{"crowdName":"station","maxAgentColumns":1,"density":true,"overview":true}}})");
  const v1::StreamViewResponse frame = viewer->frame();
  EXPECT_EQ(frame.agents().ids().size(), 8U);
  EXPECT_EQ(frame.agents().positions().size(), 12U);
  EXPECT_EQ(frame.agents().left_out(), 1U);
  EXPECT_GT(frame.density().columns(), 4U);
  EXPECT_EQ(frame.density().levels().size() % frame.density().columns(), 0U);
  EXPECT_GT(frame.density().highest(), 0.3);
}

TEST_F(WebDoorTest, PicksTheAgentUnderAPoint) {
  open();
  publish();
  const auto viewer = browser();
  // From above the origin, where both agents of the crowd stand.
  const std::string camera =
      R"("camera":{"eye":{"z":20},"target":{},"up":{"y":1},"orthoHeightM":10},"widthPx":200,"heightPx":100)";
  viewer->send(absl::StrCat(R"({"id":1,"pickAgent":{"options":{"crowdName":"station",)", camera,
                            R"(},"sceneTimeUs":"100000","xPx":100,"yPx":50}})"));
  auto response = viewer->read();
  ASSERT_TRUE(response.has_value() && response->has_pick_agent());
  EXPECT_TRUE(response->pick_agent().found());
  viewer->send(absl::StrCat(R"({"id":1,"pickAgent":{"options":{"crowdName":"station",)", camera,
                            R"(},"sceneTimeUs":"100000","xPx":5,"yPx":5}})"));
  response = viewer->read();
  ASSERT_TRUE(response.has_value() && response->has_pick_agent());
  EXPECT_FALSE(response->pick_agent().found());
}

TEST_F(WebDoorTest, AViewThatIsEndedSendsNoMoreAndAnotherCanBegin) {
  open();
  publish();
  const auto viewer = browser();
  viewer->send(R"({"endView":{}})");  // there is none
  viewer->send(watch(2));
  EXPECT_EQ(viewer->frame().width_px(), 32U);
  viewer->send(R"({"endView":{}})");
  while (server->crowd("station").viewers() != 0U) std::this_thread::yield();
  viewer->send(watch(2));
  EXPECT_EQ(viewer->frame().width_px(), 32U);
}

TEST_F(WebDoorTest, BadMessagesAreAnsweredAndDisturbNobody) {
  open();
  publish();
  const auto honest = browser(), rude = browser();
  honest->send(watch(200));
  EXPECT_EQ(honest->frame().width_px(), 32U);
  struct Case {
    const char *message, *code, *words;
  };
  const Case cases[] = {
      {"", "INVALID_ARGUMENT", "not a WebRequest"},
      {"{", "INVALID_ARGUMENT", "not a WebRequest"},
      {"[]", "INVALID_ARGUMENT", "not a WebRequest"},
      {"null", "INVALID_ARGUMENT", ""},
      {"{}", "INVALID_ARGUMENT", "request"},
      {"{\"fly\":1}", "INVALID_ARGUMENT", "fly"},
      {"{\"view\":{\"options\":{\"widthPx\":-1}}}", "INVALID_ARGUMENT", ""},
      {"{\"view\":{}}", "INVALID_ARGUMENT", "crowd_name"},
      {"{\"view\":{\"options\":{\"crowdName\":\"nowhere\"}}}", "NOT_FOUND", "nowhere"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"widthPx\":1000000}}}",
       "INVALID_ARGUMENT", "width_px"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"camera\":{\"eye\":{\"x\":\"NaN\"}}}}}",
       "INVALID_ARGUMENT", "camera.eye.x"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"maxAgentColumns\":4000000000}}}",
       "INVALID_ARGUMENT", "max_agent_columns"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"playback\":{\"speed\":0}}}}",
       "INVALID_ARGUMENT", "speed"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"playback\":{\"speed\":\"Infinity\"}}}}",
       "INVALID_ARGUMENT", "speed"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"playback\":{\"stepFrames\":2000000000}}"
       "}}",
       "INVALID_ARGUMENT", "step_frames"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"playback\":{\"sceneTimeUs\":"
       "\"9223372036854775807\"}}}}",
       "INVALID_ARGUMENT", "scene_time_us"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"heightPx\":1}}}", "INVALID_ARGUMENT",
       "height_px"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"jpegQuality\":101}}}",
       "INVALID_ARGUMENT", "jpeg_quality"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"maxRateHz\":-1}}}", "INVALID_ARGUMENT",
       "max_rate_hz"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"vertexBudget\":\"99999999999\"}}}",
       "INVALID_ARGUMENT", "vertex_budget"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"followAgent\":\"-1\"}}}",
       "INVALID_ARGUMENT", "not a WebRequest"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"density\":\"much\"}}}",
       "INVALID_ARGUMENT", "not a WebRequest"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"colorMap\":\"COLOR_MAP_JET\"}}}",
       "INVALID_ARGUMENT", "not a WebRequest"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"colorMap\":0}}}", "INVALID_ARGUMENT",
       "color_map"},
      {"{\"view\":{\"options\":{\"crowdName\":\"station\",\"colorMap\":77}}}", "INVALID_ARGUMENT",
       "color_map: 77 is no map; there are viridis, plasma"},
      {"{\"token\":{}}", "INVALID_ARGUMENT", "not a WebRequest"},
      {"{\"id\":-1,\"listCrowds\":{}}", "INVALID_ARGUMENT", "not a WebRequest"},
      {"{\"listCrowds\":7}", "INVALID_ARGUMENT", "not a WebRequest"},
      {"{\"getServerInfo\":[1]}", "INVALID_ARGUMENT", "not a WebRequest"},
      {"{\"endView\":\"now\"}", "INVALID_ARGUMENT", "not a WebRequest"},
      {"{\"pickAgent\":{\"options\":{\"crowdName\":\"nowhere\"}}}", "NOT_FOUND", "nowhere"},
      {"{\"id\":3,\"pickAgent\":{\"options\":{\"crowdName\":\"station\"},\"xPx\":\"NaN\"}}",
       "INVALID_ARGUMENT", "x_px"},
  };
  for (const Case& test : cases) {
    SCOPED_TRACE(test.message);
    rude->send(test.message);
    const v1::WebError error = rude->refusal();
    EXPECT_EQ(error.code(), test.code);
    EXPECT_THAT(error.message(), HasSubstr(test.words));
    EXPECT_EQ(honest->frame().width_px(), 32U);
  }
  rude->send(std::string("\x01\x02\x03", 3), false);
  EXPECT_THAT(rude->refusal().message(), HasSubstr("binary"));
  // It goes on as if nothing had been.
  rude->send(watch(3));
  EXPECT_EQ(rude->frame().width_px(), 32U);
  rude->send(R"({"view":{"ackedFrameIndex":"999999"}})");
  EXPECT_THAT(rude->refusal().message(), HasSubstr("acked_frame_index"));
}

TEST_F(WebDoorTest, TooLargeAndBrokenTextEndThatConnectionOnly) {
  open();
  publish();
  const auto honest = browser(), large = browser(), broken = browser(), deep = browser();
  honest->send(watch(200));
  large->send(std::string(1u << 20, ' '));
  EXPECT_FALSE(large->read().has_value());
  EXPECT_NE(large->error, beast::error::timeout);  // the server ended it
  // What the server left unread resets the connection, which may overtake its reason.
  if (large->close_code() != websocket::close_code::none) {
    EXPECT_EQ(large->close_code(), websocket::close_code::too_big);
  }
  broken->send("\xff\xfe");
  EXPECT_FALSE(broken->read().has_value());
  EXPECT_EQ(broken->close_code(), websocket::close_code::bad_payload);
  deep->send(std::string(30'000, '['));
  EXPECT_EQ(deep->refusal().code(), "INVALID_ARGUMENT");
  EXPECT_EQ(honest->frame().width_px(), 32U);
}

TEST_F(WebDoorTest, AViewerThatVanishesLeavesNothing) {
  open();
  publish();
  auto viewer = browser();
  viewer->send(watch(1));
  viewer->frame();
  EXPECT_EQ(server->crowd("station").viewers(), 1U);
  viewer->cut();
  while (server->crowd("station").viewers() != 0U) std::this_thread::yield();
}

TEST_F(WebDoorTest, ADeletedCrowdIsSaidAndTheNextOneShown) {
  open();
  publish();
  const auto viewer = browser();
  viewer->send(watch(1));
  viewer->frame();
  publishing.reset();
  while (!server->server->registry().remove("station").ok()) std::this_thread::yield();
  server->server->loop().wake();
  EXPECT_EQ(viewer->refusal().code(), "NOT_FOUND");
  publish();
  viewer->send(watch(2));
  EXPECT_EQ(viewer->frame().width_px(), 32U);
}

TEST_F(WebDoorTest, AsksForTheTokenFirst) {
  const std::string file = absl::StrCat(testing::TempDir(), "/web_tokens");
  std::ofstream(file) << "0123456789abcdef\n";
  server::ServerOptions options;
  options.listen.token_file = file;
  open(options);
  const auto guest = browser(), wrong = browser(), friendly = browser();
  guest->send(R"({"id":1,"listCrowds":{}})");
  EXPECT_EQ(guest->refusal().code(), "UNAUTHENTICATED");
  EXPECT_FALSE(guest->read().has_value());
  EXPECT_EQ(guest->close_code(), websocket::close_code::policy_error);
  wrong->send(R"({"token":"0123456789abcdeX"})");
  EXPECT_EQ(wrong->refusal().code(), "UNAUTHENTICATED");
  friendly->send(R"({"token":"0123456789abcdef"})");
  friendly->send(R"({"id":2,"listCrowds":{}})");
  EXPECT_EQ(friendly->read()->id(), 2U);
  EXPECT_EQ(get("/metrics").result_int(), 401U);
  EXPECT_EQ(get("/metrics", http::verb::get, "localhost", "Bearer 0123456789abcdef").result_int(),
            200U);
}

TEST_F(WebDoorTest, KeepsToItsConnections) {
  server::WebOptions web;
  web.max_connections = 2;
  open({}, web);
  const auto one = browser(), two = browser(), three = browser();
  EXPECT_EQ(one->status(), 101);
  EXPECT_EQ(two->status(), 101);
  EXPECT_TRUE(three->error) << "it was let in";
}

TEST_F(WebDoorTest, ClosingSaysGoodbye) {
  open();
  publish();
  const auto viewer = browser();
  viewer->send(watch(1));
  viewer->frame();
  std::thread closing([this] { door.reset(); });
  while (viewer->read()) {
  }
  closing.join();
  EXPECT_EQ(viewer->close_code(), websocket::close_code::going_away);
}

}  // namespace
}  // namespace throng::test
