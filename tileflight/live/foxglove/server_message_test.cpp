#include "tileflight/live/foxglove/server_message.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace tileflight::foxglove::server_message_test {
namespace {

using nlohmann::json;

std::string bytes(std::initializer_list<int> values) {
  std::string text;
  for (const int value : values) text += static_cast<char>(value);
  return text;
}

// The expected bytes are written by hand from the tables of the specification's "Binary messages".
TEST(ServerMessage, MessageDataIsOpcodeSubscriptionAndTime) {
  EXPECT_EQ(message_data_head(0x01020304, 0x1122334455667788),
            bytes({1, 0x04, 0x03, 0x02, 0x01, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11}));
}

TEST(ServerMessage, TimeIsOpcodeAndTime) {
  EXPECT_EQ(time_message(0x1122334455667788), bytes({2, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11}));
}

TEST(ServerMessage, ServerInfoHasNameAndCapabilities) {
  const json info = json::parse(server_info_text("a place", "17"));
  EXPECT_EQ(info, (json{{"op", "serverInfo"},
                        {"name", "a place"},
                        {"capabilities", {"parameters", "parametersSubscribe", "time"}},
                        {"metadata", json::object()},
                        {"sessionId", "17"}}));
}

TEST(ServerMessage, AdvertiseAndUnadvertise) {
  const Channel channel{"/imu", "cdr", "sensor_msgs/msg/Imu", "ros2msg", "float64 x\n"};
  EXPECT_EQ(json::parse(advertise_text({{7, channel}})), (json{{"op", "advertise"},
                                                               {"channels",
                                                                {{{"id", 7},
                                                                  {"topic", "/imu"},
                                                                  {"encoding", "cdr"},
                                                                  {"schemaName", "sensor_msgs/msg/Imu"},
                                                                  {"schemaEncoding", "ros2msg"},
                                                                  {"schema", "float64 x\n"}}}}}));
  EXPECT_EQ(json::parse(unadvertise_text({7, 9})), (json{{"op", "unadvertise"}, {"channelIds", {7, 9}}}));
}

TEST(ServerMessage, ParametersHaveTheirKinds) {
  const json values = json::parse(
      parameter_values_text({{"paused", true}, {"rate", 2.0}, {"name", std::string("x")}}, std::string("request")));
  EXPECT_EQ(values["id"], "request");
  EXPECT_EQ(values["parameters"], (json{{{"name", "paused"}, {"value", true}},
                                        {{"name", "rate"}, {"value", 2.0}, {"type", "float64"}},
                                        {{"name", "name"}, {"value", "x"}}}));
  EXPECT_FALSE(json::parse(parameter_values_text({}, std::nullopt)).contains("id"));
}

TEST(ServerMessage, TextThatIsNotUtf8IsReplaced) {
  EXPECT_EQ(json::parse(status_text(StatusLevel::kError, "a\xff")),
            (json{{"op", "status"}, {"level", 2}, {"message", "a\xef\xbf\xbd"}}));
}

}  // namespace
}  // namespace tileflight::foxglove::server_message_test
