#include "tileflight/live/foxglove/messages.h"

#include <gmock/gmock.h>

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
