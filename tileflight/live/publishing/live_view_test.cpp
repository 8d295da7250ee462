#include "tileflight/live/publishing/live_view.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "tileflight/core/imaging/image_files.h"
#include "tileflight/live/foxglove/test_web_socket.h"
#include "tileflight/live/publishing/message_sink.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::publishing::live_view_test {
namespace {

using foxglove::TestWebSocket;
using nlohmann::json;
using simulator::test_world::pose;
using testing::Contains;
using testing::HasSubstr;

const char* const kSettings = R"({"SimMode": "ComputerVision", "StepOnDemand": true,
  "CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 64, "Height": 48}, {"ImageType": 1, "Width": 64, "Height": 48}]},
  "Vehicles": {"eye": {"VehicleType": "ComputerVision", "Sensors": {"scanner": {"SensorType": 6, "Enabled": true,
    "NumberOfChannels": 4, "PointsPerSecond": 4000, "VerticalFOVUpper": 5, "VerticalFOVLower": -5}}}}})";

/// A vehicle that stands 10 m south of the northern wall and looks at it.
class LiveViewTest : public testing::Test {
 protected:
  void start(LiveOptions options = {}) {
    simulator_ = simulator::test_world::simulator(kSettings);
    simulator_->vehicles().set_vehicle_pose(pose(10, 0, -5), true, "eye");
    view_ = std::make_unique<LiveView>([this] { return current(); }, options);
    server_ = std::make_unique<foxglove::Server>(foxglove::ServerOptions{}, view_->parameters());
    sink_ = std::make_unique<FoxgloveSink>(*server_);
    view_->start(*sink_);
    viewer_ = std::make_unique<TestWebSocket>(server_->port());
    const json advertised = json::parse(viewer_->read_text_with("advertise"));
    for (const json& channel : advertised["channels"]) channels_[channel["topic"]] = channel;
  }
  ~LiveViewTest() override {
    if (view_) view_->stop();
  }

  void subscribe(const std::string& topic) {
    const json one = {{"id", channels_.at(topic)["id"]}, {"channelId", channels_.at(topic)["id"]}};
    viewer_->send_text(json{{"op", "subscribe"}, {"subscriptions", {one}}}.dump());
  }
  /// The next message of a topic, without its head.
  std::string message(const std::string& topic) {
    const auto wanted = channels_.at(topic)["id"].get<std::uint32_t>();
    while (const auto data = viewer_->read_data()) {
      std::uint32_t id = 0;
      std::memcpy(&id, data->data() + 1, sizeof id);
      if (id == wanted) return data->substr(13);
    }
    ADD_FAILURE() << "the connection ended before a message of " << topic;
    return std::string(1000, '\0');
  }

  std::shared_ptr<simulator::Simulator> current() {
    const std::lock_guard lock(mutex_);
    return simulator_;
  }
  void load_level() {
    std::shared_ptr<simulator::Simulator> other = simulator::test_world::simulator(kSettings);
    const std::lock_guard lock(mutex_);
    simulator_ = std::move(other);
  }

  std::mutex mutex_;  ///< guards the pointer, for the view's threads
  std::shared_ptr<simulator::Simulator> simulator_;
  std::unique_ptr<LiveView> view_;
  std::unique_ptr<foxglove::Server> server_;
  std::unique_ptr<FoxgloveSink> sink_;
  std::unique_ptr<TestWebSocket> viewer_;
  std::map<std::string, json> channels_;
};

std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span(text)); }

TEST_F(LiveViewTest, ChannelsAreThoseOfTheVehicle) {
  start();
  std::vector<std::string> topics;
  for (const auto& [topic, channel] : channels_) topics.push_back(topic);
  for (const char* topic :
       {"/tf", "/tf_static", "/clock", "/place", "/eye/odometry", "/eye/path", "/eye/gnss", "/eye/motion",
        "/eye/scanner/points", "/eye/front_center/image", "/eye/front_center/image/compressed",
        "/eye/front_center/camera_info", "/eye/bottom_center/depth"})
    EXPECT_THAT(topics, Contains(topic));
}

TEST_F(LiveViewTest, NothingIsRenderedForNobody) {
  start();
  viewer_->send_text(R"({"op":"getParameters","parameterNames":[],"id":"x"})");
  viewer_->read_text_with("\"x\"");
  EXPECT_EQ(simulator_->statistics().images, 0U);
  subscribe("/eye/odometry");
  message("/eye/odometry");
  EXPECT_EQ(simulator_->statistics().images, 0U) << "a pose needs no picture";
}

TEST_F(LiveViewTest, APictureShowsTheWall) {
  start();
  subscribe("/eye/front_center/image/compressed");
  const std::string message_bytes = message("/eye/front_center/image/compressed");
  const std::size_t begin = message_bytes.find("\xFF\xD8\xFF");  // a JPEG's first bytes
  ASSERT_NE(begin, std::string::npos);
  const imaging::RgbImage image = imaging::decode_rgb(bytes_of(std::string_view(message_bytes).substr(begin)), "image");
  EXPECT_EQ(image.width, 64);
  EXPECT_EQ(image.height, 48);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(image(32, 20)[c], simulator::test_world::kWallColour[c], 8) << c;
}

TEST_F(LiveViewTest, DepthIsMetresToTheWallAndInfiniteInTheSky) {
  start();
  subscribe("/eye/front_center/depth");
  const std::string bytes = message("/eye/front_center/depth");
  ASSERT_GT(bytes.size(), 64U * 48U * 4U);
  EXPECT_THAT(bytes.substr(0, 100), HasSubstr("32FC1"));
  const auto depth_at = [&](int x, int y) {
    float depth_m = 0.0F;
    std::memcpy(&depth_m, bytes.data() + bytes.size() - 4U * static_cast<std::size_t>(64 * (48 - y) - x), 4);
    return depth_m;
  };
  EXPECT_NEAR(depth_at(32, 24), 10.0F - 0.5F, 0.6F) << "the camera is somewhat ahead of the vehicle's centre";
  EXPECT_NEAR(depth_at(32, 24), depth_at(20, 20), 1e-4F) << "a plane that faces the camera";
}

TEST_F(LiveViewTest, ViewersSeeAVehicleThatIsPlacedWhileTimeStandsStill) {
  start();
  subscribe("/eye/motion");
  const json before = json::parse(message("/eye/motion"));
  EXPECT_NEAR(before["position"]["y"], 10.0, 1e-5);
  EXPECT_NEAR(before["position"]["z"], 5.0, 1e-5);
  EXPECT_NEAR(before["attitude_deg"]["heading"], 0.0, 1e-3);
  simulator_->vehicles().set_vehicle_pose(pose(10, 7, -5), true, "eye");
  json after = before;
  while (after["position"] == before["position"]) after = json::parse(message("/eye/motion"));
  EXPECT_NEAR(after["position"]["x"], 7.0, 1e-5);
}

TEST_F(LiveViewTest, AScanReachesTheWallInTheLidarsAxes) {
  start();
  subscribe("/eye/scanner/points");
  const std::string bytes = message("/eye/scanner/points");
  constexpr std::size_t kStep = 22;
  const std::string points = bytes.substr(bytes.size() - 1 - (bytes.size() - 1) / kStep * kStep);
  int on_wall = 0;
  for (std::size_t at = 0; at + kStep < points.size(); at += kStep) {
    float x = 0.0F, y = 0.0F;
    std::memcpy(&x, points.data() + at, 4);
    std::memcpy(&y, points.data() + at + 4, 4);
    on_wall += std::abs(x - 10.0F) < 0.01F && std::abs(y) < 8.0F ? 1 : 0;
  }
  EXPECT_GT(on_wall, 10) << "x forward: all points of the wall ahead are as far";
}

TEST_F(LiveViewTest, ThePlaceIsSentOnce) {
  start();
  subscribe("/place");
  const json update = json::parse(message("/place"));
  EXPECT_EQ(update["entities"][0]["frame_id"], "map");
  EXPECT_GT(update["entities"][0]["models"][0]["data"].get<std::string>().size(), 500U);
}

TEST_F(LiveViewTest, AnotherLevelIsShownWithItsOwnVehiclesAndPlace) {
  start();
  subscribe("/place");
  message("/place");
  load_level();
  EXPECT_THAT(viewer_->read_text_with("unadvertise"), HasSubstr("channelIds"));
  EXPECT_THAT(viewer_->read_text_with("/eye/odometry"), HasSubstr("advertise"));
  EXPECT_EQ(json::parse(message("/place"))["entities"][0]["frame_id"], "map");
}

TEST_F(LiveViewTest, ViewersSetParametersWithinLimits) {
  start();
  const auto set = [&](const std::string& name, const json& value) {
    viewer_->send_text(
        json{{"op", "setParameters"}, {"id", "x"}, {"parameters", {{{"name", name}, {"value", value}}}}}.dump());
  };
  set("image_rate_hz", 25);
  EXPECT_EQ(json::parse(viewer_->read_text_with("parameterValues"))["parameters"][0]["value"], 25);
  set("paused", true);
  viewer_->read_text_with("parameterValues");
  EXPECT_TRUE(simulator_->clock().is_paused());
  set("image_rate_hz", 1000);
  EXPECT_THAT(viewer_->read_text_with("status"), HasSubstr("from 0.1 to 60"));
  set("paused", "yes");
  EXPECT_THAT(viewer_->read_text_with("status"), HasSubstr("true or false"));
  set("gravity", 1);
  EXPECT_THAT(viewer_->read_text_with("status"), HasSubstr("no parameter"));
}

TEST_F(LiveViewTest, WhereClientsNeedATokenViewersOnlyWatch) {
  start({.may_pause = false});
  viewer_->send_text(R"({"op":"setParameters","parameters":[{"name":"paused","value":true}]})");
  EXPECT_THAT(viewer_->read_text_with("status"), HasSubstr("need a token"));
  EXPECT_FALSE(simulator_->clock().is_paused());
}

TEST_F(LiveViewTest, WhatAClientReadsDoesNotDependOnViewers) {
  const auto flow_after = [](simulator::Simulator& simulator) {
    const simulator::ImageRequest flow{"front_center", static_cast<int>(simulator::ImageType::kOpticalFlow), true,
                                       false};
    simulator.cameras().get_images({flow}, "eye", false);
    simulator.vehicles().set_vehicle_pose(pose(10, 1, -5), true, "eye");
    return [&simulator, flow] { return simulator.cameras().get_images({flow}, "eye", false)[0].image_data_float; };
  };
  const auto alone = simulator::test_world::simulator(kSettings);
  alone->vehicles().set_vehicle_pose(pose(10, 0, -5), true, "eye");
  const std::vector<float> expected = flow_after(*alone)();
  start();
  const auto watched = flow_after(*simulator_);
  subscribe("/eye/front_center/image/compressed");
  message("/eye/front_center/image/compressed");
  EXPECT_EQ(watched(), expected);
}

TEST_F(LiveViewTest, AVehicleThatComesLaterIsAdvertised) {
  start();
  subscribe("/eye/odometry");
  message("/eye/odometry");
  simulator_->vehicles().add_vehicle("second", "ComputerVision", pose(0, 0, -3), "");
  simulator_->vehicles().set_vehicle_pose(pose(11, 0, -5), true, "eye");
  EXPECT_THAT(viewer_->read_text_with("/second/odometry"), HasSubstr("advertise"));
}

}  // namespace
}  // namespace tileflight::publishing::live_view_test
