#include "tileflight/live/foxglove/server.h"

#include <gmock/gmock.h>

#include <cstring>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/refusal.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/foxglove/messages.h"
#include "tileflight/live/foxglove/test_web_socket.h"

namespace tileflight::foxglove::server_test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

bool soon(const std::function<bool()>& condition) {
  for (int i = 0; i < 10000 && !condition(); ++i) std::this_thread::sleep_for(milliseconds(1));
  return condition();
}

class FoxgloveServer : public testing::Test {
 protected:
  void start(const ServerOptions& options = {}) {
    ParameterAccess access;
    access.read = [this] { return std::vector<Parameter>{{"rate", rate_}, {"paused", false}}; };
    access.write = [this](const Parameter& wanted) {
      if (wanted.name != "rate" || !std::holds_alternative<double>(wanted.value))
        throw InputError(wanted.name, "cannot be set");
      rate_ = std::get<double>(wanted.value);
    };
    server_ = std::make_unique<Server>(options, access, [this](const std::string& line) {
      const std::lock_guard lock(mutex_);
      log_.push_back(line);
    });
    images_ = server_->add_channel({"/image", "cdr", "sensor_msgs/msg/CompressedImage", "ros2msg", "uint8[] data"});
    place_ = server_->add_channel({"/place", "json", "foxglove.SceneUpdate", "jsonschema", "{}", true});
  }
  TestWebSocket client(const std::string& protocol = "foxglove.websocket.v1") {
    return TestWebSocket(server_->port(), protocol);
  }
  static std::string subscribe_text(ChannelId channel, std::uint32_t id = 5) {
    return json{{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", channel}}}}}.dump();
  }
  void subscribe(TestWebSocket& client, ChannelId channel, std::uint32_t id = 5) {
    client.send_text(subscribe_text(channel, id));
    ASSERT_TRUE(soon([&] { return server_->is_subscribed(channel); }));
  }
  std::vector<std::string> log() {
    const std::lock_guard lock(mutex_);
    return log_;
  }

  std::mutex mutex_;
  std::vector<std::string> log_;
  double rate_ = 1.0;
  ChannelId images_ = 0, place_ = 0;
  std::unique_ptr<Server> server_;
};

TEST_F(FoxgloveServer, BothSubProtocolsBeginWithInfoAndChannels) {
  start();
  for (const char* protocol : {"foxglove.websocket.v1", "foxglove.sdk.v1"}) {
    TestWebSocket client(server_->port(), protocol);
    ASSERT_TRUE(client.is_open()) << client.answer();
    EXPECT_THAT(client.answer(), HasSubstr(protocol));
    // RFC 6455, section 1.3, gives this answer to the key that the client sent.
    EXPECT_THAT(client.answer(), HasSubstr("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="));
    EXPECT_EQ(json::parse(client.read()->bytes)["op"], "serverInfo");
    const json channels = json::parse(client.read()->bytes)["channels"];
    ASSERT_EQ(channels.size(), 2U);
    EXPECT_EQ(channels[0]["topic"], "/image");
    EXPECT_EQ(channels[1]["schemaName"], "foxglove.SceneUpdate");
  }
}

TEST_F(FoxgloveServer, OtherSubProtocolsAndPagesAreRefusedInOneLine) {
  start();
  TestWebSocket wrong(server_->port(), "mqtt");
  EXPECT_FALSE(wrong.is_open());
  TestWebSocket page(server_->port(), "");
  page.send_raw("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
  EXPECT_TRUE(page.is_closed_by_server());
  EXPECT_TRUE(soon([&] { return log().size() == 2; })) << log().size();
}

TEST_F(FoxgloveServer, SubscribersGetMessagesAndOthersNone) {
  start();
  TestWebSocket viewer(server_->port());
  TestWebSocket other(server_->port());
  subscribe(viewer, images_, 77);
  subscribe(other, place_, 1);
  EXPECT_FALSE(server_->is_subscribed(999));
  server_->publish(images_, 123, "pixels");
  server_->publish(place_, 124, "mesh");
  EXPECT_EQ(viewer.read_data(), message_data_head(77, 123) + "pixels");
  EXPECT_EQ(other.read_data(), message_data_head(1, 124) + "mesh");
}

TEST_F(FoxgloveServer, ALatchedMessageReachesThoseWhoComeLater) {
  start();
  server_->publish(place_, 1, "old");
  server_->publish(place_, 2, "mesh");
  server_->publish(images_, 3, "gone");
  TestWebSocket viewer(server_->port());
  subscribe(viewer, images_, 1);
  subscribe(viewer, place_, 2);
  EXPECT_EQ(viewer.read_data(), message_data_head(2, 2) + "mesh");
}

TEST_F(FoxgloveServer, ALargeMessageArrivesWholeInFragments) {
  start();
  TestWebSocket viewer(server_->port());
  subscribe(viewer, images_, 3);
  std::string large(3000000, '\0');
  for (std::size_t i = 0; i < large.size(); ++i) large[i] = static_cast<char>(i * 2654435761U >> 13U);
  server_->publish(images_, 9, large);
  const auto read = viewer.read_data();
  ASSERT_TRUE(read);
  EXPECT_TRUE(*read == message_data_head(3, 9) + large);
  EXPECT_GT(viewer.fragments(), 10);
}

TEST_F(FoxgloveServer, UnsubscribedChannelsAreSilentAndMayBeSubscribedAgain) {
  start();
  TestWebSocket viewer(server_->port());
  subscribe(viewer, images_, 5);
  const std::uint64_t before = server_->subscription_changes();
  viewer.send_text(R"({"op":"unsubscribe","subscriptionIds":[5]})");
  ASSERT_TRUE(soon([&] { return !server_->is_subscribed(images_); }));
  EXPECT_GT(server_->subscription_changes(), before);
  server_->publish(images_, 1, "unseen");
  subscribe(viewer, images_, 5);
  server_->publish(images_, 2, "seen");
  EXPECT_EQ(viewer.read_data(), message_data_head(5, 2) + "seen");
}

TEST_F(FoxgloveServer, ChannelsComeAndGo) {
  start();
  TestWebSocket viewer(server_->port());
  viewer.read_text_with("advertise");
  const ChannelId added = server_->add_channel({"/new", "json", "x", "jsonschema", "{}"});
  EXPECT_EQ(json::parse(viewer.read_text_with("advertise"))["channels"][0]["id"], added);
  subscribe(viewer, added, 4);
  server_->remove_channel(added);
  EXPECT_EQ(json::parse(viewer.read_text_with("unadvertise"))["channelIds"], json{added});
  EXPECT_FALSE(server_->is_subscribed(added));
  server_->publish(added, 1, "nobody");
  EXPECT_GT(server_->add_channel({"/new", "json", "x", "jsonschema", "{}"}), added) << "numbers are not used again";
}

TEST_F(FoxgloveServer, SubscriptionsThatCannotBeAreAnsweredByAStatus) {
  start();
  TestWebSocket viewer(server_->port());
  viewer.send_text(subscribe_text(999));
  EXPECT_THAT(viewer.read_text_with("status"), HasSubstr("there is no channel 999"));
  subscribe(viewer, images_, 1);
  viewer.send_text(subscribe_text(images_, 2));
  EXPECT_THAT(viewer.read_text_with("status"), HasSubstr("subscribed to already"));
  viewer.send_text(subscribe_text(place_, 1));
  EXPECT_THAT(viewer.read_text_with("status"), HasSubstr("id 1 is in use"));
  viewer.send_text(R"({"op":"unsubscribe","subscriptionIds":[44]})");
  EXPECT_THAT(viewer.read_text_with("status"), HasSubstr("there is no id 44"));
  viewer.send_text(R"({"op":"fetchAsset","uri":"package://x","requestId":1})");
  EXPECT_THAT(viewer.read_text_with("status"), HasSubstr("fetchAsset is not supported"));
  EXPECT_THAT(log(), IsEmpty());
}

TEST_F(FoxgloveServer, ParametersAreReadSetAndWatched) {
  start();
  TestWebSocket viewer(server_->port());
  TestWebSocket watcher(server_->port());
  watcher.send_text(R"({"op":"subscribeParameterUpdates","parameterNames":["rate"]})");
  watcher.send_text(R"({"op":"getParameters","parameterNames":[],"id":"all"})");
  EXPECT_EQ(json::parse(watcher.read_text_with("\"all\""))["parameters"].size(), 2U);
  viewer.send_text(R"({"op":"setParameters","parameters":[{"name":"rate","value":2.5}],"id":"set"})");
  EXPECT_EQ(json::parse(viewer.read_text_with("\"set\""))["parameters"][0]["value"], 2.5);
  EXPECT_EQ(json::parse(watcher.read_text_with("parameterValues"))["parameters"],
            (json{{{"name", "rate"}, {"value", 2.5}, {"type", "float64"}}}));
  viewer.send_text(R"({"op":"setParameters","parameters":[{"name":"rate","value":[1]}]})");
  EXPECT_THAT(viewer.read_text_with("status"), HasSubstr("rate: cannot be set"));
}

TEST_F(FoxgloveServer, OfSeveralTimesTheLastIsSent) {
  start();
  TestWebSocket viewer(server_->port());
  viewer.read_text_with("advertise");
  server_->publish_time(1);
  server_->publish_time(0x0102);
  std::string last;
  while (last != time_message(0x0102)) last = viewer.read()->bytes;
}

TEST_F(FoxgloveServer, WarningsReachAllClients) {
  start();
  TestWebSocket viewer(server_->port());
  viewer.read_text_with("advertise");
  server_->warn("a tile is missing");
  EXPECT_EQ(json::parse(viewer.read_text_with("status"))["message"], "a tile is missing");
}

TEST_F(FoxgloveServer, GarbageClosesItsConnectionWithOneLine) {
  start();
  TestWebSocket good(server_->port());
  subscribe(good, images_);
  const std::vector<std::pair<std::string, std::string>> kFaults{
      {TestWebSocket::frame_head(0x81, 4) + "rust", "is not JSON"},
      {TestWebSocket::frame_head(0x82, 4) + "rust", "binary"},
      {TestWebSocket::frame_head(0x81, 12) + "{\"op\":\"subsc", "is not JSON"},
      {TestWebSocket::frame_head(0x81, 18) + "{\"op\":\"subscribe\"}\n", "\"subscriptions\" is missing"},
      {TestWebSocket::frame_head(0x81, std::uint64_t{1} << 30U) + std::string(1000, ' '), "more than 1048576 bytes"}};
  std::size_t lines = 0;
  for (const auto& [bytes, why] : kFaults) {
    TestWebSocket bad(server_->port());
    bad.send_raw(bytes);
    EXPECT_TRUE(bad.is_closed_by_server()) << why;
    ++lines;
    ASSERT_TRUE(soon([&] { return log().size() == lines; })) << why << ": " << log().size();
    EXPECT_THAT(log().back(), HasSubstr(why));
  }
  TestWebSocket noise(server_->port(), "");
  noise.send_raw(std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11) + std::string(500, '\x7f'));
  EXPECT_TRUE(noise.is_closed_by_server());
  EXPECT_TRUE(soon([&] { return log().size() == lines + 1; }));
  server_->publish(images_, 1, "still here");
  EXPECT_THAT(*good.read_data(), HasSubstr("still here"));
}

TEST_F(FoxgloveServer, OnlyAnEndWithoutAGoodbyeIsLogged) {
  start();
  {
    TestWebSocket polite(server_->port());
    polite.send_raw(TestWebSocket::frame_head(0x88, 0));
    EXPECT_TRUE(polite.is_closed_by_server());
  }
  ASSERT_TRUE(soon([&] { return server_->statistics().clients == 0; }));
  EXPECT_THAT(log(), IsEmpty());
  {
    TestWebSocket rude(server_->port());
    rude.send_raw(TestWebSocket::frame_head(0xF1, 2) + "{}");  // reserved bits are set (section 5.2)
    EXPECT_TRUE(rude.is_closed_by_server());
  }
  EXPECT_TRUE(soon([&] { return log().size() == 1; }));
  EXPECT_THAT(log(), ElementsAre(HasSubstr("without a goodbye")));
}

TEST_F(FoxgloveServer, AMessageInSmallPiecesIsPutTogether) {
  start();
  TestWebSocket viewer(server_->port());
  const std::string text = subscribe_text(images_, 6);
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int first = (i == 0 ? 1 : 0) | (i + 1 == text.size() ? 0x80 : 0);
    viewer.send_raw(TestWebSocket::frame_head(first, 1) + text[i]);
  }
  EXPECT_TRUE(soon([&] { return server_->is_subscribed(images_); }));
}

TEST_F(FoxgloveServer, TooManyFragmentsAreRefusedLikeOneLargeMessage) {
  ServerOptions options;
  options.max_message_bytes = 1000;
  start(options);
  TestWebSocket bad(server_->port());
  bad.send_raw(TestWebSocket::frame_head(0x01, 600) + std::string(600, ' '));
  bad.send_raw(TestWebSocket::frame_head(0x00, 600) + std::string(600, ' '));
  EXPECT_TRUE(bad.is_closed_by_server());
  EXPECT_THAT(log(), ElementsAre(HasSubstr("more than 1000 bytes")));
}

TEST_F(FoxgloveServer, MoreClientsThanAllowedAreRefused) {
  ServerOptions options;
  options.max_clients = 10;
  start(options);
  std::vector<std::unique_ptr<TestWebSocket>> clients;
  int open = 0;
  for (int i = 0; i < 100; ++i) {
    clients.push_back(std::make_unique<TestWebSocket>(server_->port()));
    open += clients.back()->is_open() ? 1 : 0;
  }
  EXPECT_EQ(open, 10);
  EXPECT_EQ(server_->statistics().clients, 10U);
  EXPECT_EQ(server_->statistics().clients_refused, 90U);
  EXPECT_EQ(log().size(), 90U);
  EXPECT_THAT(log(), Contains(HasSubstr("there are 10 clients already")));
  clients.clear();
  ASSERT_TRUE(soon([&] { return server_->statistics().clients == 0; }));
  EXPECT_TRUE(TestWebSocket(server_->port()).is_open()) << "there is room again";
}

TEST_F(FoxgloveServer, IdleConnectionsKeepNobodyOut) {
  ServerOptions options;
  options.max_clients = 4;
  start(options);
  std::vector<std::unique_ptr<TestWebSocket>> idle;
  for (int i = 0; i < 20; ++i) idle.push_back(std::make_unique<TestWebSocket>(server_->port(), ""));
  EXPECT_TRUE(TestWebSocket(server_->port()).is_open());
}

TEST_F(FoxgloveServer, AClientThatNeverReadsMissesMessagesAndOthersDoNot) {
  ServerOptions options;
  options.queue.max_bytes = 2000000;
  start(options);
  TestWebSocket lazy(server_->port(), "foxglove.websocket.v1", 4096);
  subscribe(lazy, images_);
  TestWebSocket viewer(server_->port());
  viewer.send_text(subscribe_text(images_, 1));
  viewer.send_text(R"({"op":"getParameters","parameterNames":[],"id":"ready"})");
  viewer.read_text_with("ready");
  constexpr int kMessages = 300;
  for (int i = 0; i < kMessages; ++i) {
    const auto time_ns = static_cast<std::uint64_t>(i);
    server_->publish(images_, time_ns, std::string(400000, static_cast<char>(i)));
    const auto read = viewer.read_data();
    ASSERT_TRUE(read);
    EXPECT_EQ(read->substr(0, 13), message_data_head(1, time_ns));
    EXPECT_EQ(read->back(), static_cast<char>(i));
  }
  EXPECT_GT(server_->statistics().messages_dropped, 200U) << "of those that the other one did not read";
  EXPECT_THAT(log(), IsEmpty());
}

TEST_F(FoxgloveServer, AMessageThatIsTooLargeIsToldOnce) {
  ServerOptions options;
  options.queue.max_bytes = 1000;
  start(options);
  TestWebSocket viewer(server_->port());
  subscribe(viewer, images_, 1);
  for (int i = 0; i < 2; ++i) server_->publish(images_, 1, std::string(1001, 'x'));
  server_->publish(images_, 2, std::string(1000, 'x'));
  EXPECT_THAT(viewer.read_text_with("status"), HasSubstr("/image: a message of 1001 bytes is not sent"));
  EXPECT_EQ(viewer.read_data()->substr(0, 13), message_data_head(1, 2));
  EXPECT_THAT(log(), ElementsAre(HasSubstr("at most 1000 are")));
}

TEST_F(FoxgloveServer, AClientThatReadsNothingForLongIsClosed) {
  ServerOptions options;
  options.max_silence = milliseconds(100);
  start(options);
  TestWebSocket lazy(server_->port(), "foxglove.websocket.v1", 4096);
  subscribe(lazy, images_);
  for (int i = 0; i < 20; ++i) server_->publish(images_, 1, std::string(1000000, 'x'));
  EXPECT_TRUE(soon([&] { return server_->statistics().clients == 0; }));
  EXPECT_THAT(log(), ElementsAre(HasSubstr("does not read")));
}

TEST_F(FoxgloveServer, AClientThatAsksAndDoesNotReadIsClosed) {
  start();
  TestWebSocket lazy(server_->port(), "foxglove.websocket.v1", 4096);
  std::thread asking([&] {
    for (int i = 0; i < 200000 && log().empty(); ++i)
      lazy.send_text(R"({"op":"getParameters","parameterNames":[],"id":")" + std::string(80, 'i') + "\"}");
  });
  EXPECT_TRUE(soon([&] { return !log().empty(); }));
  asking.join();
  EXPECT_THAT(log(), ElementsAre(HasSubstr("does not read the answers")));
}

TEST_F(FoxgloveServer, AnAddressInUseIsAnInputError) {
  start();
  ServerOptions taken;
  taken.port = server_->port();
  EXPECT_THAT(tests::refusal_of([&] { const Server server(taken); }), HasSubstr("cannot listen there"));
  ServerOptions foreign;
  foreign.address = "192.0.2.1";  // RFC 5737: no machine's
  EXPECT_THAT(tests::refusal_of([&] { const Server server(foreign); }), HasSubstr("cannot listen there"));
}

TEST_F(FoxgloveServer, TheEndIsSaidToClients) {
  start();
  TestWebSocket viewer(server_->port());
  viewer.read_text_with("advertise");
  server_.reset();
  EXPECT_TRUE(viewer.is_closed_by_server());
}

TEST_F(FoxgloveServer, WaitingForASubscriberEndsWithOneOrWithAStop) {
  start();
  std::stop_source stop;
  std::jthread later([&] { stop.request_stop(); });
  EXPECT_FALSE(server_->wait_for_subscriber(stop.get_token()));
  TestWebSocket viewer(server_->port());
  viewer.send_text(subscribe_text(images_));
  EXPECT_TRUE(server_->wait_for_subscriber(std::stop_token()));
  EXPECT_FALSE(server_->wait_for_subscriber(stop.get_token())) << "a stop comes before a subscriber";
}

TEST_F(FoxgloveServer, WhatWaitsIsSentBeforeTheEnd) {
  start();
  TestWebSocket viewer(server_->port());
  subscribe(viewer, images_, 2);
  std::thread reading([&] { EXPECT_EQ(viewer.read_data()->size(), 3000013U); });
  server_->publish(images_, 1, std::string(3000000, 'x'));
  server_->wait_until_sent(milliseconds(10000));
  server_.reset();
  reading.join();
}

}  // namespace
}  // namespace tileflight::foxglove::server_test
