#include "tileflight/live/publishing/message_sink.h"

#include <gmock/gmock.h>

#include <condition_variable>
#include <mutex>
#include <thread>

#include "tileflight/data/messages/ros_messages.h"
#include "tileflight/live/publishing/live_view.h"
#include "tileflight/live/publishing/viewer_channels.h"
#include "tileflight/live/ros2/test_domain.h"
#include "tileflight/live/ros2/topics.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::publishing::message_sink_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// Messages that came, by topic.
class Messages {
 public:
  void add(const std::string& topic, std::string_view bytes) {
    const std::lock_guard lock(mutex_);
    all_[topic].emplace_back(bytes);
    came_.notify_all();
  }
  std::string first(const std::string& topic) {
    std::unique_lock lock(mutex_);
    came_.wait_for(lock, std::chrono::seconds(30), [&] { return all_.contains(topic); });
    return all_.contains(topic) ? all_.at(topic).front() : "";
  }

 private:
  std::mutex mutex_;
  std::condition_variable came_;
  std::map<std::string, std::vector<std::string>> all_;
};

class Ros2SinkTest : public testing::Test {
 protected:
  void subscribe(const std::string& topic, const std::string& type, ros2::QualityOfService quality = {}) {
    subscriptions_.push_back(std::make_unique<ros2::Subscription>(
        participant_, topic, type, quality, [this, topic](std::string_view cdr) { messages_.add(topic, cdr); },
        1'000'000));
  }

  ros2::Participant participant_{{.domain = ros2::test_domain()}};
  Ros2Sink sink_{participant_};
  Messages messages_;
  std::vector<std::unique_ptr<ros2::Subscription>> subscriptions_;
};

TEST_F(Ros2SinkTest, OnlyRosMessagesAreTopics) {
  const auto place = sink_.add_channel(scene_channel("/place"));
  const auto imu = sink_.add_channel(ros_channel("/imu", "sensor_msgs/msg/Imu"));
  EXPECT_FALSE(sink_.is_wanted(place));
  EXPECT_FALSE(sink_.is_wanted(imu));
  sink_.publish(place, 1, "{}");
  subscribe("/imu", "sensor_msgs/msg/Imu");
  EXPECT_TRUE(sink_.is_wanted(imu));
  sink_.publish(imu, 1, messages::ros::imu({5, "imu"}, {}));
  EXPECT_EQ(messages_.first("/imu"), messages::ros::imu({5, "imu"}, {}));
  sink_.remove_channel(imu);
  EXPECT_FALSE(sink_.is_wanted(imu));
  sink_.publish(imu, 1, "gone");
}

TEST_F(Ros2SinkTest, QualityIsByWhatIsSent) {
  const auto image = ros2_quality(ros_channel("/image", "sensor_msgs/msg/Image"));
  EXPECT_TRUE(image.is_reliable && !image.is_latched);
  EXPECT_EQ(image.depth, 5U) << "some images, not more";
  const auto fixed = ros2_quality(ros_channel("/tf_static", "tf2_msgs/msg/TFMessage", true));
  EXPECT_TRUE(fixed.is_reliable && fixed.is_latched);
  EXPECT_EQ(fixed.depth, 1U);
}

/// What the simulator shows arrives as from Foxglove's server: the wall's picture, frames by REP 105.
TEST_F(Ros2SinkTest, ALiveViewIsSeen) {
  const char* const settings = R"({"SimMode": "ComputerVision", "StepOnDemand": true,
    "CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 64, "Height": 48}]},
    "Vehicles": {"eye": {"VehicleType": "ComputerVision", "Sensors": {"imu": {"SensorType": 2, "Enabled": true}}}}})";
  const std::shared_ptr<simulator::Simulator> world = simulator::test_world::simulator(settings);
  world->vehicles().set_vehicle_pose(simulator::test_world::pose(10, 0, -5), true, "eye");
  LiveView view([&] { return world; }, {});
  view.start(sink_);
  subscribe("/eye/front_center/image", "sensor_msgs/msg/Image");
  subscribe("/eye/imu/data_raw", "sensor_msgs/msg/Imu");
  subscribe("/tf", "tf2_msgs/msg/TFMessage");
  const std::string image = messages_.first("/eye/front_center/image");
  EXPECT_THAT(image, HasSubstr("eye/front_center_optical"));
  EXPECT_THAT(image.substr(0, 100), HasSubstr("rgb8"));
  ASSERT_GT(image.size(), 64U * 48U * 3U);
  const std::size_t pixels = image.size() / 4 * 4 - 64U * 48U * 3U;
  const std::size_t middle = pixels + 3U * (20U * 64U + 32U);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_NEAR(static_cast<std::uint8_t>(image[middle + c]), simulator::test_world::kWallColour[c], 3) << c;
  EXPECT_THAT(messages_.first("/eye/imu/data_raw"), HasSubstr("eye/imu"));
  EXPECT_THAT(messages_.first("/tf"), HasSubstr("eye/base_link"));
  subscribe("/tf_static", "tf2_msgs/msg/TFMessage", {.is_latched = true});
  const std::string fixed = messages_.first("/tf_static");
  EXPECT_THAT(fixed, HasSubstr("eye/odom"));
  EXPECT_THAT(fixed, HasSubstr("eye/bottom_center_optical"));
  subscribe("/eye/path", "nav_msgs/msg/Path", {.is_latched = true});
  EXPECT_THAT(messages_.first("/eye/path"), HasSubstr("map")) << "a volatile writer is none for this reader";
  view.stop();
}

/// Both see it, and each waits for its own.
TEST_F(Ros2SinkTest, SeveralSinksAreOne) {
  Ros2Sink other(participant_);
  SeveralSinks both({&sink_, &other});
  const auto imu = both.add_channel(ros_channel("/imu", "sensor_msgs/msg/Imu"));
  EXPECT_FALSE(both.is_wanted(imu));
  std::stop_source stop;
  bool is_found = true;
  std::thread waiting([&] { is_found = both.wait_for_audience(stop.get_token()); });
  stop.request_stop();
  waiting.join();
  EXPECT_FALSE(is_found);
  subscribe("/imu", "sensor_msgs/msg/Imu");
  EXPECT_TRUE(both.wait_for_audience({}));
  EXPECT_TRUE(both.is_wanted(imu));
  both.publish(imu, 1, messages::ros::imu({5, "imu"}, {}));
  EXPECT_EQ(messages_.first("/imu"), messages::ros::imu({5, "imu"}, {}));
}

}  // namespace
}  // namespace tileflight::publishing::message_sink_test
