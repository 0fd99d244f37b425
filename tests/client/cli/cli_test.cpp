#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "client/camera/camera_script.hpp"
#include "client/cli/commands.hpp"
#include "client/cli/output.hpp"
#include "server/rpc/test_server.hpp"
#include "support/temporary_folder.hpp"
#include "throng/render/encode.hpp"

namespace throng::client {
namespace {

using test::TemporaryFolder;
using test::TestServer;
using testing::HasSubstr;

struct Outcome {
  int code = -1;
  std::string out, err;
};

/// Runs the program as a person would.
Outcome run(const std::string& arguments) {
  const TemporaryFolder folder;
  const std::string command = std::string(THRONG_BINARY_DIR) + "/bin/throng " + arguments + " > " +
                              folder.file("out") + " 2> " + folder.file("err") + " < /dev/null";
  const int status = std::system(command.c_str());
  const auto text = [&](const char* name) {
    std::ifstream file(folder.file(name));
    return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  };
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text("out"), text("err")};
}

/// Ten agents that walk for two seconds, ten times a second.
std::string write_csv(const TemporaryFolder& folder) {
  const std::string path = folder.file("walk.csv");
  std::ofstream file(path);
  file << "t,id,x,y\n";
  for (int frame = 0; frame <= 20; ++frame) {
    for (int id = 1; id <= 10; ++id) {
      file << frame * 0.1 << ',' << id << ',' << frame * 0.13 << ',' << id << '\n';
    }
  }
  return path;
}

TEST(CameraTextTest, ReadsEyeAndTarget) {
  const auto script = CameraScript::parse("1,-2.5,3:4,5,6e1");
  ASSERT_TRUE(script.ok()) << script.status();
  const ScriptedCamera camera = script->at(0.0, {});
  EXPECT_EQ(camera.eye_world.y, -2.5);
  EXPECT_EQ(camera.target_world.z, 60.0);
  for (const char* text :
       {"", "1,2,3", "1,2,3,4,5,6", "1,2:3,4,5,6:7", "1,2,3:4,5", "a,2,3:4,5,6", "nan,2,3:4,5,6"}) {
    EXPECT_FALSE(CameraScript::parse(text).ok()) << text;
  }
}

TEST(OutputTest, NumbersPicturesByTheRunOfHashes) {
  const TemporaryFolder folder;
  const std::vector<std::uint8_t> pixels(4 * 16 * 16, 128);
  render::JpegEncoder encoder;
  const auto bytes = *encoder.encode(pixels, 16, 16, 80);
  const std::string jpeg(bytes.begin(), bytes.end());
  auto output = open_output(folder.file("sub/a####.jpg"), 16, 16, 25.0);
  ASSERT_TRUE(output.ok()) << output.status();
  ASSERT_TRUE((*output)->add(jpeg, 0).ok());
  ASSERT_TRUE((*output)->add(jpeg, 40'000).ok());
  EXPECT_THAT((*output)->finish().value(), HasSubstr("a0002.jpg"));
  EXPECT_TRUE(std::filesystem::exists(folder.file("sub/a0001.jpg")));
  EXPECT_FALSE((*open_output(folder.file("b#.png"), 16, 16, 25.0))->single());
  EXPECT_TRUE((*open_output(folder.file("b.png"), 16, 16, 25.0))->single());
}

TEST(OutputTest, RefusesNamesItCanNotMakeSenseOf) {
  const TemporaryFolder folder;
  for (const char* name : {"a#b#.jpg", "film.avi", "film", "####"}) {
    EXPECT_EQ(open_output(folder.file(name), 16, 16, 25.0).status().code(),
              absl::StatusCode::kInvalidArgument)
        << name;
  }
}

TEST(CommandTest, UsageErrorsExitWithTwo) {
  EXPECT_EQ(run("").code, kUsage);
  EXPECT_EQ(run("dance").code, kUsage);
  EXPECT_EQ(run("publish").code, kUsage);
  EXPECT_EQ(run("record --crowd a -o b.mp4 --size big").code, kUsage);
  EXPECT_EQ(run("record --crowd a -o b.mp4 --camera here").code, kUsage);
  EXPECT_EQ(run("record --crowd a -o b.avi").code, kUsage);
  EXPECT_EQ(run("publish a.csv --crowd a --rate 0").code, kUsage);
  const Outcome help = run("--help");
  EXPECT_EQ(help.code, kOk);
  EXPECT_THAT(help.out, HasSubstr("Examples:"));
}

TEST(CommandTest, BadFilesExitWithThreeAndOneClearLine) {
  const TemporaryFolder folder;
  std::ofstream(folder.file("bad.csv")) << "t,id,x,y\n0,1,2,north\n";
  for (const std::string& command :
       {"info " + folder.file("absent.csv"), "info " + folder.file("bad.csv"),
        "publish " + folder.file("bad.csv") + " --crowd a"}) {
    const Outcome outcome = run(command);
    EXPECT_EQ(outcome.code, kBadInput) << command << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(".csv"));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST(CommandTest, NoServerIsAFailureThatSaysWhatToDo) {
  int port = 0;
  {
    const TestServer gone;
    port = gone.server->port();
  }
  const Outcome outcome = run("crowds --server 127.0.0.1:" + std::to_string(port));
  EXPECT_EQ(outcome.code, kFailure);
  EXPECT_THAT(outcome.err, HasSubstr("throng-server"));
}

/// Answers one request after the other as a page would.
class Page {
 public:
  Page() : door_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(door_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(door_, 8), 0);
    EXPECT_EQ(getsockname(door_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] {
      for (int guest; (guest = accept(door_, nullptr, nullptr)) >= 0; close(guest)) {
        char request[256];
        if (recv(guest, request, sizeof request, 0) <= 0) continue;
        static constexpr char kAnswer[] = "HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n";
        (void)send(guest, kAnswer, sizeof kAnswer - 1, MSG_NOSIGNAL);
      }
    });
  }
  ~Page() {
    shutdown(door_, SHUT_RDWR);
    thread_.join();
    close(door_);
  }
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

 private:
  int door_, port_ = 0;
  std::thread thread_;
};

TEST(CommandTest, ThePagesAddressIsToldFromTheServers) {
  const TemporaryFolder folder;
  const Page page;
  for (const std::string& command :
       {std::string("crowds"), "snapshot --crowd a -o " + folder.file("a.png"),
        "snapshot --crowd a --camera top -o " + folder.file("a.png"),
        "record --crowd a -o " + folder.file("a.mp4"),
        "publish " + write_csv(folder) + " --crowd a"}) {
    const Outcome outcome = run(command + " --server " + page.address());
    EXPECT_EQ(outcome.code, kFailure) << command;
    EXPECT_THAT(outcome.err, HasSubstr(page.address() + " answers HTTP")) << command;
  }
}

TEST(CommandTest, RemovesACrowdAndNamesThoseThatAreThere) {
  const TestServer server;
  const TemporaryFolder folder;
  const std::string at = " --server " + server.address();
  EXPECT_THAT(run("remove walk" + at).err, HasSubstr("there are none"));
  ASSERT_EQ(run("publish " + write_csv(folder) + " --crowd walk --rate 50" + at).code, kOk);
  const Outcome unknown = run("remove wlak" + at);
  EXPECT_EQ(unknown.code, kFailure);
  EXPECT_THAT(unknown.err, HasSubstr("there is no crowd 'wlak'; there is walk"));
  EXPECT_THAT(
      run("snapshot --crowd walk --time 999 -o " + folder.file("a.png") + at).err,
      HasSubstr("at 999.00 s there is nothing of crowd 'walk': its history goes from 0.00"));
  const Outcome removed = run("remove walk --json" + at);
  EXPECT_EQ(removed.code, kOk) << removed.err;
  EXPECT_EQ(removed.out, "{\"removed\":\"walk\"}\n");
  EXPECT_THAT(run("crowds" + at).err, HasSubstr("no crowds"));
}

TEST(CommandTest, InfoTellsOfAFile) {
  const TemporaryFolder folder;
  const Outcome outcome = run("info --json " + write_csv(folder));
  EXPECT_EQ(outcome.code, kOk) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("\"agents\": 10"));
  EXPECT_THAT(outcome.out, HasSubstr("\"frames\": 21"));
}

TEST(CommandTest, ConvertsThereAndBack) {
  const TemporaryFolder folder;
  const std::string sqlite = folder.file("walk.sqlite"), csv = folder.file("back.csv");
  const Outcome there = run("convert " + write_csv(folder) + " " + sqlite);
  EXPECT_EQ(there.code, kOk) << there.err;
  EXPECT_THAT(there.err, HasSubstr("21 frames"));
  EXPECT_EQ(run("convert " + sqlite + " " + csv).code, kOk);
  EXPECT_THAT(run("info --json " + csv).out, HasSubstr("\"frames\": 21"));
  EXPECT_EQ(run("convert " + csv + " " + folder.file("walk.xyz")).code, kBadInput);
  EXPECT_EQ(run("convert " + folder.file("absent.csv") + " " + csv).code, kBadInput);
}

TEST(CommandTest, PublishesRecordsAndLists) {
  const TestServer server;
  const TemporaryFolder folder;
  const std::string at = " --quiet --server " + server.address();
  Outcome published;
  std::thread publishing(
      [&] { published = run("publish " + write_csv(folder) + " --crowd walk --rate 2" + at); });
  // Waits for the crowd by itself, and ends after the producer has left.
  const Outcome recorded =
      run("record --crowd walk --wait 60 --size 64x48 -o " + folder.file("film.mp4") + at);
  publishing.join();
  EXPECT_EQ(published.code, kOk) << published.err;
  EXPECT_EQ(recorded.code, kOk) << recorded.err;
  EXPECT_GT(std::filesystem::file_size(folder.file("film.mp4")), 500U);
  EXPECT_EQ(server.crowd("walk").frames(), 21U);

  const Outcome picture = run("record --crowd walk --size 64x48 -o " + folder.file("one.png") + at);
  EXPECT_EQ(picture.code, kOk) << picture.err;
  EXPECT_TRUE(std::filesystem::exists(folder.file("one.png")));
  const std::string snapshot = "snapshot --crowd walk --size 64x48 -o ";
  EXPECT_EQ(run(snapshot + folder.file("now.jpg") + at).code, kOk);
  EXPECT_EQ(run(snapshot + folder.file("then.png") + " --time 0.5" + at).code, kOk);
  EXPECT_TRUE(std::filesystem::exists(folder.file("then.png")));
  EXPECT_EQ(run(snapshot + folder.file("now.gif") + at).code, kUsage);
  EXPECT_EQ(
      run("snapshot " + server.address() + " -q --size 64x48 -o " + folder.file("only.png")).code,
      kOk);
  EXPECT_TRUE(std::filesystem::exists(folder.file("only.png")));
  const Outcome absent = run("snapshot --crowd absent --wait 0.2 -o " + folder.file("no.png") + at);
  EXPECT_EQ(absent.code, kFailure);
  EXPECT_THAT(absent.err, HasSubstr("absent"));
  const Outcome frames =
      run("record --crowd walk --frames 3 --size 64x48 -o " + folder.file("f/###.jpg") + at);
  EXPECT_EQ(frames.code, kOk) << frames.err;
  EXPECT_TRUE(std::filesystem::exists(folder.file("f/003.jpg")));
  const Outcome crowds = run("crowds --json" + at);
  EXPECT_EQ(crowds.code, kOk);
  EXPECT_THAT(crowds.out, HasSubstr("\"name\": \"walk\""));
  EXPECT_THAT(run("info" + at).out, HasSubstr("painter"));
  EXPECT_EQ(run("record --crowd absent --wait 0 -o " + folder.file("no.mp4") + at).code, kFailure);
}

TEST(CommandTest, SnapshotsWaitForTheServerWhateverTheirCamera) {
  const TemporaryFolder folder;
  for (const char* camera : {"overview", "top"}) {
    const auto start = std::chrono::steady_clock::now();
    const Outcome outcome =
        run(absl::StrCat("snapshot --crowd x --wait 0.6 --server 127.0.0.1:1 -o ",
                         folder.file("x.png"), " --camera ", camera));
    EXPECT_EQ(outcome.code, kFailure) << camera << ": " << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("throng-server")) << camera;
    EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(500)) << camera;
  }
}

TEST(CommandTest, DoctorAnswersWithOrWithoutAServerProgram) {
  const Outcome outcome = run("doctor");
  EXPECT_EQ(outcome.code, kOk) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("this machine"));
}

}  // namespace
}  // namespace throng::client
