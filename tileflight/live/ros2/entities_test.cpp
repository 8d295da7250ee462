#include "tileflight/live/ros2/entities.h"

#include <gmock/gmock.h>

namespace tileflight::ros2::entities_test {
namespace {

/// As ROS 2's tools show them with `ros2 topic list --no-daemon` on the DDS side.
TEST(Ros2Names, AreMangledAsRmwDoes) {
  EXPECT_EQ(dds_topic("/drone/imu"), "rt/drone/imu");
  EXPECT_EQ(dds_request_topic("/drone/reset"), "rq/drone/resetRequest");
  EXPECT_EQ(dds_reply_topic("/drone/reset"), "rr/drone/resetReply");
  EXPECT_EQ(dds_type("sensor_msgs/msg/Imu"), "sensor_msgs::msg::dds_::Imu_");
  EXPECT_EQ(dds_request_type("std_srvs/srv/Trigger"), "std_srvs::srv::dds_::Trigger_Request_");
  EXPECT_EQ(dds_response_type("std_srvs/srv/Trigger"), "std_srvs::srv::dds_::Trigger_Response_");
}

TEST(Ros2Names, BecomeValid) {
  EXPECT_EQ(valid_name("/drone/front_center/image"), "/drone/front_center/image");
  EXPECT_EQ(valid_name("/Drone 1/0/image"), "/Drone_1/id_0/image");
  EXPECT_EQ(valid_name("/dröne//x"), "/dr__ne/x") << "a letter of two bytes; no empty token";
  EXPECT_EQ(valid_name("/a~b/9"), "/a_b/id_9");
}

}  // namespace
}  // namespace tileflight::ros2::entities_test
