#include "tileflight/live/ros2/participant.h"

#include <gmock/gmock.h>

#include <condition_variable>
#include <mutex>

#include "tests/refusal.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/messages/cdr.h"
#include "tileflight/live/ros2/command_messages.h"
#include "tileflight/live/ros2/entities.h"
#include "tileflight/live/ros2/raw_type.h"
#include "tileflight/live/ros2/service.h"
#include "tileflight/live/ros2/test_domain.h"
#include "tileflight/live/ros2/topics.h"

namespace tileflight::ros2::participant_test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

/// Collects received messages, so that a test can wait for them.
class Received {
 public:
  void add(std::string_view text) {
    const std::lock_guard lock(mutex_);
    all_.emplace_back(text);
    came_.notify_all();
  }
  std::vector<std::string> wait_for(std::size_t count) {
    std::unique_lock lock(mutex_);
    came_.wait_for(lock, std::chrono::seconds(20), [&] { return all_.size() >= count; });
    return all_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable came_;
  std::vector<std::string> all_;
};

class ParticipantTest : public testing::Test {
 protected:
  static ParticipantOptions options() {
    ParticipantOptions options;
    options.domain = test_domain();
    return options;
  }
  std::unique_ptr<Subscription> read(const std::string& topic, Received& to, const QualityOfService& quality = {},
                                     std::size_t max_bytes = 1000) {
    return std::make_unique<Subscription>(
        participant_, topic, "std_msgs/msg/String", quality, [&to](std::string_view cdr) { to.add(cdr); }, max_bytes);
  }

  Received lines_;
  Participant participant_{options(), [this](const std::string& line) { lines_.add(line); }};
};

std::string message(const std::string& text) { return messages::CdrWriter().text(text).bytes(); }

std::string text_of(std::string_view cdr) { return messages::CdrReader(cdr, "message").text(100'000'000); }

TEST_F(ParticipantTest, MessagesArriveWithTheirBytesAndInOrder) {
  Publisher publisher(participant_, "/a/b", "std_msgs/msg/String", {});
  EXPECT_FALSE(publisher.has_readers());
  Received received;
  const auto subscription = read("/a/b", received);
  EXPECT_TRUE(publisher.has_readers());
  EXPECT_TRUE(participant_.wait_for_reader({}));
  for (const char* text : {"one", "three", "fourteen"}) publisher.publish(message(text));
  const auto all = received.wait_for(3);
  ASSERT_EQ(all.size(), 3U);
  EXPECT_EQ(all[0], message("one"));
  EXPECT_EQ(all[1].size() % 4, 0U) << "padded";
  EXPECT_EQ(text_of(all[1]), "three");
  EXPECT_EQ(text_of(all[2]), "fourteen");
  EXPECT_EQ(publisher.sent(), 3U);
}

TEST_F(ParticipantTest, ReadersAreCounted) {
  Publisher publisher(participant_, "/x", "std_msgs/msg/String", {});
  const std::uint64_t before = participant_.audience_changes();
  Received received;
  auto subscription = read("/x", received);
  EXPECT_EQ(participant_.audience_changes(), before + 1);
  subscription.reset();
  EXPECT_EQ(participant_.audience_changes(), before + 2);
  EXPECT_FALSE(publisher.has_readers());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(participant_.wait_for_reader(stop.get_token()));
}

TEST_F(ParticipantTest, WhatIsLatchedReachesThoseWhoComeLater) {
  Publisher publisher(participant_, "/tf_static", "std_msgs/msg/String", {.is_latched = true, .depth = 1});
  publisher.publish(message("old"));
  publisher.publish(message("new"));
  Received received;
  const auto subscription = read("/tf_static", received, {.is_latched = true, .depth = 10});
  EXPECT_THAT(received.wait_for(1), ElementsAre(message("new")));
}

TEST_F(ParticipantTest, ALargeMessageIsLeftOutAndReportedOnce) {
  Publisher publisher(participant_, "/x", "std_msgs/msg/String", {});
  Received received;
  const auto subscription = read("/x", received);
  for (int i = 0; i < 3; ++i) publisher.publish(message(std::string(2000, 'x')));
  publisher.publish(message("end"));
  EXPECT_THAT(received.wait_for(1), ElementsAre(message("end")));
  EXPECT_THAT(lines_.wait_for(1), ElementsAre("ROS 2: /x: a message is too large and is left out"));
}

TEST_F(ParticipantTest, AnImageOfManyMegabytesArrives) {
  Publisher publisher(participant_, "/x", "std_msgs/msg/String", {});
  Received received;
  const auto subscription = read("/x", received, {}, 100'000'000);
  const std::string image(30'000'000, 'x');
  publisher.publish(message(image));
  EXPECT_EQ(text_of(received.wait_for(1).at(0)), image);
}

TEST_F(ParticipantTest, WhatAHandlerThrowsIsReportedAndEndsNothing) {
  Publisher publisher(participant_, "/x", "std_msgs/msg/String", {});
  Received received;
  const Subscription subscription(participant_, "/x", "std_msgs/msg/String", {}, [&](std::string_view cdr) {
    if (text_of(cdr) == "bad") throw InputError("/x", "bad order");
    received.add(cdr);
  });
  for (const char* text : {"bad", "bad", "yes"}) publisher.publish(message(text));
  EXPECT_THAT(received.wait_for(1), ElementsAre(message("yes")));
  EXPECT_THAT(lines_.wait_for(1), ElementsAre(HasSubstr("bad order"))) << "once";
}

/// Other participants can cause only a bounded number of log lines.
TEST_F(ParticipantTest, LinesAreAHundredAtMost) {
  for (int i = 0; i < 1000; ++i) participant_.report("line " + std::to_string(i));
  participant_.report(std::string(100'000, 'x'));
  EXPECT_EQ(lines_.wait_for(101).size(), 101U);
  EXPECT_THAT(lines_.wait_for(101).back(), HasSubstr("further lines are not shown"));
}

TEST_F(ParticipantTest, AServiceAnswersItsClientsWithTheirNumbers) {
  const Service service(participant_, "/echo", "std_srvs/srv/SetBool", [](std::string_view request) {
    return service_response(read_set_bool(request, "/echo"), "answered");
  });
  const Entity writer(participant_, Participant::Kind::kWriter,
                      {dds_request_topic("/echo"), dds_request_type("std_srvs/srv/SetBool"), {}, "clientid=1;"},
                      nullptr);
  const Entity reader(participant_, Participant::Kind::kReader,
                      {dds_reply_topic("/echo"), dds_response_type("std_srvs/srv/SetBool"), {}, "clientid=1;"},
                      nullptr);
  const std::string yes = messages::CdrWriter().number(std::uint8_t{1}).bytes();
  writer.write(std::string("\0\1\0\0\1", 5));  // without the numbers: rmw_fastrtps_cpp
  writer.write(write_service_message({77, 3, yes}));
  std::vector<ServiceMessage> replies;
  for (int i = 0; i < 2000 && replies.empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    take_all(reader.handle(), [&](const RawMessage& reply, std::uint64_t) {
      replies.push_back(read_service_message(reply.cdr, "/echo"));
    });
  }
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].client, 77U);
  EXPECT_EQ(replies[0].sequence_number, 3);
  messages::CdrReader response(replies[0].body, "response");
  EXPECT_EQ(response.number<std::uint8_t>(), 1);
  EXPECT_EQ(response.text(100), "answered");
  EXPECT_THAT(lines_.wait_for(1), Contains(HasSubstr("RMW_IMPLEMENTATION=rmw_cyclonedds_cpp")));
}

TEST_F(ParticipantTest, AnUnknownInterfaceIsNamed) {
  ParticipantOptions options;
  options.domain = test_domain() == 100 ? 101 : test_domain() - 1;
  options.interface_name = "nothing0";
  try {
    const Participant other(options);
    FAIL() << "there is no such interface";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("--ros2-interface 'nothing0'"));
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace tileflight::ros2::participant_test

namespace tileflight::ros2::configuration_test {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(Ros2Configuration, IsLoopbackUnlessToldOtherwise) {
  EXPECT_THAT(configuration("", ""), HasSubstr("<NetworkInterface address=\"127.0.0.1\"/>"));
  const std::string of_user = configuration("", "file:///etc/dds.xml");
  EXPECT_THAT(of_user, HasSubstr(",file:///etc/dds.xml,"));
  EXPECT_THAT(of_user, Not(HasSubstr("127.0.0.1")));
  const std::string of_option = configuration("eth0", "file:///etc/dds.xml");
  EXPECT_THAT(of_option, HasSubstr("<NetworkInterface name=\"eth0\"/>"));
  EXPECT_THAT(of_option, Not(HasSubstr("dds.xml")));
  EXPECT_THAT(configuration("192.168.1.7", ""), HasSubstr("address=\"192.168.1.7\""));
}

TEST(Ros2Configuration, LimitsAndNoSharedMemoryAlways) {
  for (const std::string& one : {configuration("", ""), configuration("eth0", ""), configuration("", "<x/>")}) {
    EXPECT_THAT(one, HasSubstr("<WhcHigh>1 GB</WhcHigh>"));
    EXPECT_THAT(one, HasSubstr("<SharedMemory><Enable>false"));
  }
}

TEST(Ros2Configuration, ANameIsNoXml) {
  EXPECT_THAT(tests::refusal_of([] { configuration("lo\"/><Tracing>", ""); }), HasSubstr("is no name or address"));
  EXPECT_THAT(tests::refusal_of([] { configuration(std::string(100, 'x'), ""); }), HasSubstr("is no name or address"));
}

}  // namespace
}  // namespace tileflight::ros2::configuration_test
