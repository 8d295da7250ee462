#include "tileflight/live/publishing/dataset_player.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/messages/ros_messages.h"
#include "tileflight/live/foxglove/messages.h"
#include "tileflight/live/foxglove/test_web_socket.h"
#include "tileflight/live/publishing/message_sink.h"

namespace tileflight::publishing::dataset_player_test {
namespace {

using foxglove::TestWebSocket;
using nlohmann::json;
using testing::HasSubstr;

constexpr int kFrames = 3;

class DatasetPlayerTest : public testing::Test {
 protected:
  DatasetPlayerTest() {
    dataset::DatasetWriter writer(folder_ / "flight", {imaging::make_pinhole(8, 6, 90.0), {}, 0.0}, {.png = true});
    geometry::Trajectory truth;
    for (int i = 0; i < kFrames; ++i) {
      const auto shade = static_cast<std::uint8_t>(50 * i);
      writer.add_frame(static_cast<std::size_t>(i), 10.0 + 0.1 * i, 0.0, imaging::RgbImage(8, 6, {shade, 1, 2}));
      truth.poses.push_back({10.0 + 0.1 * i, {Eigen::Quaterniond::Identity(), {1.0 * i, 0, 5}}});
    }
    writer.set_groundtruth(truth);
    writer.finish();
    rig_ = dataset::read_rig(folder_ / "flight");
  }

  /// Subscribes to a topic, and returns what was advertised of it.
  static json subscribe(TestWebSocket& viewer, const std::string& topic) {
    const json channels = json::parse(viewer.read_text_with("advertise"))["channels"];
    for (const json& channel : channels) {
      if (channel["topic"] != topic) continue;
      viewer.send_text(
          json{{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", channel["id"]}}}}}.dump());
      return channel;
    }
    ADD_FAILURE() << topic << " was not advertised";
    return {};
  }
  static std::string set_text(const std::string& name, const json& value) {
    return json{{"op", "setParameters"}, {"id", name}, {"parameters", {{{"name", name}, {"value", value}}}}}.dump();
  }

  tests::TemporaryFolder folder_;
  dataset::Rig rig_;
};

TEST_F(DatasetPlayerTest, PlaysAfterTheFirstSubscriptionUntilTheEnd) {
  DatasetPlayer player(rig_, {.rate = 100.0});
  foxglove::Server server({}, player.parameters());
  FoxgloveSink sink(server);
  player.open(sink, std::nullopt);
  EXPECT_THAT(player.topics(), testing::UnorderedElementsAre("/camera/image/compressed", "/camera/camera_info", "/tf",
                                                             "/tf_static", "/clock", "/odometry", "/path"));
  EXPECT_NEAR(player.duration_s(), 0.2, 1e-9);
  TestWebSocket viewer(server.port());
  const json channel = subscribe(viewer, "/odometry");
  EXPECT_EQ(channel["schemaName"], "nav_msgs/msg/Odometry");
  EXPECT_EQ(player.play(sink, {}), std::uint64_t{kFrames}) << "nothing else is sent";
  for (int i = 0; i < kFrames; ++i) {
    const auto time_ns = static_cast<std::uint64_t>(std::llround((10.0 + 0.1 * i) * 1e9));
    EXPECT_EQ(viewer.read_data()->substr(0, 13), foxglove::message_data_head(1, time_ns));
  }
}

/// A dataset whose times begin at 0 is played from 1 s on, or after the epoch that is asked for.
TEST_F(DatasetPlayerTest, NoMessageHasTheTime0UnlessThatIsAskedFor) {
  dataset::DatasetWriter writer(folder_ / "early", {imaging::make_pinhole(8, 6, 90.0), {}, 0.0}, {.png = true});
  writer.add_frame(0, 0.0, 0.0, imaging::RgbImage(8, 6, {1, 1, 2}));
  geometry::Trajectory truth;
  truth.poses.push_back({0.0, {}});
  writer.set_groundtruth(truth);
  writer.finish();
  const dataset::Rig early = dataset::read_rig(folder_ / "early");
  const auto path_of = [&](std::optional<double> epoch_s, std::int64_t time_ns) {
    DatasetPlayer player(early, {.rate = 100.0, .epoch_s = epoch_s});
    foxglove::Server server({}, player.parameters());
    FoxgloveSink sink(server);
    player.open(sink, std::nullopt);
    TestWebSocket viewer(server.port());
    subscribe(viewer, "/path");
    const std::string seen = *viewer.read_data();
    EXPECT_EQ(seen, foxglove::message_data_head(1, static_cast<std::uint64_t>(time_ns)) +
                        messages::ros::path({time_ns, "map"}, {{1e-9 * static_cast<double>(time_ns), {}}}));
    return player.notes();
  };
  EXPECT_THAT(path_of({}, 1'000'000'000), testing::ElementsAre(HasSubstr("times are 1 s later")));
  EXPECT_THAT(path_of(5.0, 5'000'000'000), testing::IsEmpty());
  EXPECT_THAT(path_of(0.0, 0), testing::IsEmpty());
  EXPECT_THAT(tests::refusal_of([&] { path_of(-1.0, 0); }), HasSubstr("--epoch"));
}

TEST_F(DatasetPlayerTest, AViewerStartsItChangesItsRateAndSeesBoth) {
  DatasetPlayer player(rig_, {.rate = 100.0, .is_paused = true});
  foxglove::Server server({}, player.parameters());
  FoxgloveSink sink(server);
  player.open(sink, PlaceGlb{"glTF", {}});
  TestWebSocket viewer(server.port());
  std::uint64_t sent = 0;
  std::jthread playing([&](const std::stop_token& stop) { sent = player.play(sink, stop); });
  EXPECT_EQ(subscribe(viewer, "/place")["schemaName"], "foxglove.SceneUpdate");
  EXPECT_THAT(*viewer.read_data(), HasSubstr("Z2xURg==")) << "what is sent once is there in a pause, too";
  for (const auto& [name, value, why] :
       std::vector<std::tuple<std::string, json, std::string>>{{"rate", 0, "above 0"},
                                                               {"rate", "fast", "above 0"},
                                                               {"paused", 1, "true or false"},
                                                               {"speed", 1, "no parameter"}}) {
    viewer.send_text(set_text(name, value));
    EXPECT_THAT(viewer.read_text_with("status"), HasSubstr(why));
  }
  viewer.send_text(set_text("rate", 500));
  EXPECT_THAT(viewer.read_text_with("500.0"), HasSubstr("parameterValues"));
  viewer.send_text(set_text("paused", false));
  playing.join();
  EXPECT_EQ(sent, 0U);
}

TEST_F(DatasetPlayerTest, ALoopBeginsAgainUntilItIsStopped) {
  DatasetPlayer player(rig_, {.rate = 10.0, .loop = true});
  foxglove::Server server({}, player.parameters());
  FoxgloveSink sink(server);
  player.open(sink, std::nullopt);
  TestWebSocket viewer(server.port());
  subscribe(viewer, "/odometry");
  std::jthread playing([&](const std::stop_token& stop) { player.play(sink, stop); });
  for (int i = 0; i < 3 * kFrames; ++i) {
    const auto time_ns = static_cast<std::uint64_t>(std::llround((10.0 + 0.1 * (i % kFrames)) * 1e9));
    EXPECT_EQ(viewer.read_data()->substr(0, 13), foxglove::message_data_head(1, time_ns));
  }
}

TEST_F(DatasetPlayerTest, AStopEndsAWaitAndAPause) {
  DatasetPlayer player(rig_, {.is_paused = true});
  foxglove::Server server({}, player.parameters());
  FoxgloveSink sink(server);
  player.open(sink, std::nullopt);
  std::uint64_t sent = 1;
  std::jthread waiting([&](const std::stop_token& stop) { sent = player.play(sink, stop); });
  waiting = {};
  EXPECT_EQ(sent, 0U);
  TestWebSocket viewer(server.port());
  subscribe(viewer, "/odometry");
  server.wait_for_subscriber({});
  waiting = std::jthread([&](const std::stop_token& stop) { sent = player.play(sink, stop); });
  waiting = {};
  EXPECT_EQ(sent, 0U);
}

TEST_F(DatasetPlayerTest, ARigHasTopicsOfEachCameraOrOfThoseChosen) {
  dataset::Rig rig;
  const geometry::SE3 beside(Eigen::Quaterniond::Identity(), {0.25, 0, 0});
  for (const auto& [name, mount] : {std::pair("left", geometry::SE3()), std::pair("right", beside)})
    rig.cameras.push_back({name, mount, 0.0, rig_.cameras[0].dataset});
  const auto topics_of = [&](std::vector<std::string> cameras) {
    DatasetPlayer player(rig, {.rate = 100.0, .cameras = std::move(cameras)});
    foxglove::Server server({}, player.parameters());
    FoxgloveSink sink(server);
    player.open(sink, std::nullopt);
    return player.topics();
  };
  EXPECT_THAT(topics_of({}),
              testing::UnorderedElementsAre("/left/image/compressed", "/left/camera_info", "/right/image/compressed",
                                            "/right/camera_info", "/tf", "/tf_static", "/clock", "/odometry", "/path"));
  EXPECT_THAT(topics_of({"right"}), testing::UnorderedElementsAre("/right/image/compressed", "/right/camera_info",
                                                                  "/tf", "/tf_static", "/clock", "/odometry", "/path"));
}

TEST_F(DatasetPlayerTest, AFileThatVanishesIsAnInputError) {
  DatasetPlayer player(rig_, {.rate = 100.0});
  foxglove::Server server({}, player.parameters());
  FoxgloveSink sink(server);
  player.open(sink, std::nullopt);
  TestWebSocket viewer(server.port());
  subscribe(viewer, "/camera/image/compressed");
  const std::filesystem::path image = rig_.cameras[0].dataset.frames[1].image;
  std::filesystem::remove(image);
  EXPECT_THAT(tests::refusal_of([&] { player.play(sink, {}); }), testing::HasSubstr(image.filename().string()));
}

}  // namespace
}  // namespace tileflight::publishing::dataset_player_test

namespace tileflight::publishing::playback_clock_test {
namespace {

using std::chrono::milliseconds;

constexpr std::int64_t kSecond = 1'000'000'000;
const PlaybackClock::WallTime kBegin{std::chrono::hours(5)};

TEST(PlaybackClock, MessagesAreDueAtTheRate) {
  PlaybackClock clock(2.0, false);
  clock.set_time(10 * kSecond, kBegin);
  EXPECT_EQ(clock.due(10 * kSecond), kBegin);
  EXPECT_EQ(clock.due(14 * kSecond), kBegin + milliseconds(2000));
  EXPECT_EQ(clock.time_ns(kBegin + milliseconds(500)), 11 * kSecond);
}

TEST(PlaybackClock, AChangeOfRateKeepsTheTime) {
  PlaybackClock clock(1.0, false);
  clock.set_time(0, kBegin);
  clock.set_rate(4.0, kBegin + milliseconds(1000));
  EXPECT_EQ(clock.time_ns(kBegin + milliseconds(1000)), kSecond);
  EXPECT_EQ(clock.due(5 * kSecond), kBegin + milliseconds(2000));
}

TEST(PlaybackClock, NothingIsDueInAPause) {
  PlaybackClock clock(1.0, true);
  clock.set_time(kSecond, kBegin);
  EXPECT_EQ(clock.due(kSecond), std::nullopt);
  EXPECT_EQ(clock.time_ns(kBegin + milliseconds(9000)), kSecond);
  clock.set_paused(false, kBegin + milliseconds(9000));
  EXPECT_EQ(clock.due(2 * kSecond), kBegin + milliseconds(10000));
  clock.set_paused(true, kBegin + milliseconds(9500));
  EXPECT_EQ(clock.time_ns(kBegin + milliseconds(20000)), 3 * kSecond / 2);
}

}  // namespace
}  // namespace tileflight::publishing::playback_clock_test
