#include "tileflight/live/foxglove/messages.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace tileflight::foxglove::client_message_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(ClientMessage, SubscriptionsAreRead) {
  const auto message = std::get<Subscribe>(parse_client_message(
      R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":4294967295,"channelId":5}]})"));
  ASSERT_EQ(message.subscriptions.size(), 2U);
  EXPECT_EQ(message.subscriptions[0].channel, 3U);
  EXPECT_EQ(message.subscriptions[1].id, 4294967295U);
  const auto end = std::get<Unsubscribe>(parse_client_message(R"({"op":"unsubscribe","subscriptionIds":[1,2]})"));
  EXPECT_EQ(end.ids, (std::vector<std::uint32_t>{1, 2}));
}

TEST(ClientMessage, ParametersAreRead) {
  const auto get = std::get<GetParameters>(parse_client_message(R"({"op":"getParameters","parameterNames":["a"]})"));
  EXPECT_EQ(get.names, std::vector<std::string>{"a"});
  EXPECT_EQ(get.id, std::nullopt);
  const auto set = std::get<SetParameters>(parse_client_message(
      R"({"op":"setParameters","id":"r","parameters":[{"name":"a","value":2},{"name":"b","value":[1]},{"name":"c"},{"name":"d","value":true},{"name":"e","value":"x"}]})"));
  EXPECT_EQ(set.id, "r");
  ASSERT_EQ(set.parameters.size(), 5U);
  EXPECT_EQ(set.parameters[0].value, ParameterValue(2.0));
  EXPECT_EQ(set.parameters[1].value, ParameterValue());
  EXPECT_EQ(set.parameters[2].value, ParameterValue());
  EXPECT_EQ(set.parameters[3].value, ParameterValue(true));
  EXPECT_EQ(set.parameters[4].value, ParameterValue(std::string("x")));
  EXPECT_TRUE(std::holds_alternative<SubscribeParameters>(
      parse_client_message(R"({"op":"subscribeParameterUpdates","parameterNames":[]})")));
  EXPECT_TRUE(std::holds_alternative<UnsubscribeParameters>(
      parse_client_message(R"({"op":"unsubscribeParameterUpdates","parameterNames":[]})")));
}

TEST(ClientMessage, OtherOperationsAreNamed) {
  EXPECT_EQ(std::get<UnsupportedOperation>(parse_client_message(R"({"op":"fetchAsset","uri":"x"})")).op, "fetchAsset");
}

TEST(ClientMessage, WhatIsNotOfTheProtocolIsRefused) {
  const auto refused = [](const std::string& text, const std::string& why) {
    EXPECT_THAT([&] { parse_client_message(text); }, ThrowsMessage<ProtocolError>(HasSubstr(why))) << text;
  };
  refused("", "is not JSON");
  refused("{", "is not JSON");
  refused("\xff\xfe", "is not JSON");
  refused("[1e999]", "is not JSON");
  refused("[]", "is not a JSON object");
  refused(R"({"no":"op"})", "\"op\" is missing");
  refused(R"({"op":5})", "\"op\" is not a string");
  refused(R"({"op":"subscribe"})", "\"subscriptions\" is missing");
  refused(R"({"op":"subscribe","subscriptions":{}})", "is not an array");
  refused(R"({"op":"subscribe","subscriptions":[1]})", "is not an object");
  refused(R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})", "\"id\" is not a number");
  refused(R"({"op":"subscribe","subscriptions":[{"id":1.5,"channelId":1}]})", "\"id\" is not a number");
  refused(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":4294967296}]})", "\"channelId\" is not a number");
  refused(R"({"op":"unsubscribe","subscriptionIds":["1"]})", "\"subscriptionIds\" is not a number");
  refused(R"({"op":"getParameters","parameterNames":[1]})", "\"parameterNames\" is not a string");
  refused(R"({"op":"getParameters","parameterNames":[],"id":1})", "\"id\" is not a string");
  refused(R"({"op":"setParameters","parameters":[{"value":1}]})", "\"name\" is missing");
}

TEST(ClientMessage, DeepNestingIsNoDanger) {
  EXPECT_THAT([] { parse_client_message(std::string(1000000, '[')); },
              ThrowsMessage<ProtocolError>(HasSubstr("is not JSON")));
  EXPECT_THAT([] { parse_client_message(std::string(500000, '[') + std::string(500000, ']')); },
              ThrowsMessage<ProtocolError>(HasSubstr("is not a JSON object")));
}

}  // namespace
}  // namespace tileflight::foxglove::client_message_test

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
