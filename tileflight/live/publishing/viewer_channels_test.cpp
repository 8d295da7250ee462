#include "tileflight/live/publishing/viewer_channels.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

namespace tileflight::publishing::viewer_channels_test {
namespace {

using geometry::Vec3;
using nlohmann::json;

TEST(ViewerChannels, RosChannelsBringTheirDefinition) {
  const foxglove::Channel channel = ros_channel("/imu", "sensor_msgs/msg/Imu");
  EXPECT_EQ(channel.encoding, "cdr");
  EXPECT_EQ(channel.schema_name, "sensor_msgs/msg/Imu");
  EXPECT_EQ(channel.schema_encoding, "ros2msg");
  EXPECT_THAT(channel.schema, testing::HasSubstr("MSG: geometry_msgs/Quaternion"));
  EXPECT_FALSE(channel.is_latched);
}

TEST(ViewerChannels, ASceneHoldsTheModel) {
  const json update = json::parse(scene_update("glTF\x02", "map", 12'000'000'345, {"someone, CC0"}));
  const json& entity = update["entities"].at(0);
  EXPECT_EQ(entity["id"], "place");
  EXPECT_EQ(entity["frame_id"], "map");
  EXPECT_EQ(entity["timestamp"], (json{{"sec", 12}, {"nsec", 345}}));
  EXPECT_EQ(entity["metadata"], (json{{{"key", "attribution"}, {"value", "someone, CC0"}}}));
  EXPECT_EQ(entity["models"].at(0)["data"], "Z2xURgI=");
  EXPECT_EQ(entity["models"].at(0)["media_type"], "model/gltf-binary");
}

/// Every key of the message is in the schema, with the kind that the schema gives it.
void expect_described(const json& value, const json& schema, const std::string& where) {
  if (value.is_object()) {
    EXPECT_EQ(schema["type"], "object") << where;
    for (const auto& [key, member] : value.items()) {
      ASSERT_TRUE(schema["properties"].contains(key)) << where << "." << key;
      expect_described(member, schema["properties"][key], where + "." + key);
    }
  } else if (value.is_array()) {
    EXPECT_EQ(schema["type"], "array") << where;
    for (const json& item : value) expect_described(item, schema["items"], where + "[]");
  } else {
    const std::string type = schema["type"];
    const bool fits = value.is_string()    ? type == "string"
                      : value.is_boolean() ? type == "boolean"
                                           : type == "number" || (type == "integer" && value.is_number_integer());
    EXPECT_TRUE(fits) << where << ": " << value << " is no " << type;
  }
}

TEST(ViewerChannels, SchemasDescribeTheMessages) {
  expect_described(json::parse(scene_update("x", "map", 1, {"a"})), json::parse(scene_channel("/place").schema),
                   "scene");
  expect_described(json::parse(motion_text({})), json::parse(motion_channel("/motion").schema), "motion");
}

TEST(ViewerChannels, MotionIsInTheLocalFrame) {
  // Nose to the east, 30 degrees up, then rolled to the right by 20 degrees, flying forward.
  const double rad = std::numbers::pi / 180.0;
  const Eigen::Quaterniond R = Eigen::AngleAxisd(-30 * rad, Vec3::UnitY()) * Eigen::AngleAxisd(20 * rad, Vec3::UnitX());
  const json motion = json::parse(motion_text({{R, Vec3(1, 2, 3)}, Vec3(2, 0, 0), Vec3(0, 0, 0.5)}));
  EXPECT_EQ(motion["position"], (json{{"x", 1.0}, {"y", 2.0}, {"z", 3.0}}));
  EXPECT_NEAR(motion["velocity"]["x"], 2 * std::cos(30 * rad), 1e-12);
  EXPECT_NEAR(motion["velocity"]["z"], 1.0, 1e-12);
  EXPECT_NEAR(motion["attitude_deg"]["heading"], 90.0, 1e-9);
  EXPECT_NEAR(motion["attitude_deg"]["pitch"], 30.0, 1e-9);
  EXPECT_NEAR(motion["attitude_deg"]["roll"], 20.0, 1e-9);
  EXPECT_EQ(motion["speed"], 2.0);
  EXPECT_EQ(motion["angular_velocity"]["z"], 0.5);
}

}  // namespace
}  // namespace tileflight::publishing::viewer_channels_test
