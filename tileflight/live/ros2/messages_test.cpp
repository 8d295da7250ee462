#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/messages/cdr.h"
#include "tileflight/live/ros2/command_messages.h"
#include "tileflight/live/ros2/participant.h"
#include "tileflight/live/ros2/service.h"

namespace tileflight::ros2::messages_test {
namespace {

using messages::CdrReader;
using messages::CdrWriter;
using testing::ElementsAre;
using testing::HasSubstr;

std::string refusal(const std::function<void()>& work) {
  try {
    work();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string twist(double last = 6.0) { return CdrWriter().array(std::array{1.0, 2.0, 3.0, 4.0, 5.0, last}).bytes(); }

std::string pose(double w, const std::string& frame = "map") {
  CdrWriter writer;
  writer.number(std::int32_t{12}).number(std::uint32_t{5}).text(frame);
  return writer.array(std::array{1.0, -2.0, 3.0, 0.0, 0.0, 0.0, w}).bytes();
}

/// The numbers in the other byte order, and the header that says so.
std::string big_endian(std::string cdr) {
  cdr[1] = '\0';
  for (std::size_t at = 4; at < cdr.size(); at += 8)
    std::reverse(cdr.begin() + static_cast<long>(at), cdr.begin() + static_cast<long>(at) + 8);
  return cdr;
}

TEST(Ros2Messages, ATwistIsReadInBothByteOrders) {
  for (const std::string& cdr : {twist(), big_endian(twist())}) {
    const Twist read = read_twist(cdr, "/cmd_vel");
    EXPECT_THAT(read.linear_m_s, ElementsAre(1, 2, 3));
    EXPECT_THAT(read.angular_rad_s, ElementsAre(4, 5, 6));
  }
}

TEST(Ros2Messages, WhatIsMalformedIsRefusedWithItsCause) {
  const std::string whole = twist();
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_THAT(refusal([&] { read_twist(whole.substr(0, size), "/cmd_vel"); }), HasSubstr("/cmd_vel")) << size;
  EXPECT_THAT(refusal([&] { read_twist(whole.substr(0, 20), "/cmd_vel"); }), HasSubstr("cut off (byte 20)"));
  EXPECT_THAT(refusal([] { read_twist(twist(std::nan("")), "/cmd_vel"); }), HasSubstr("not finite"));
  EXPECT_THAT(refusal([] { read_twist(twist(std::numeric_limits<double>::infinity()), "x"); }),
              HasSubstr("not finite"));
  std::string xcdr2 = whole;
  xcdr2[1] = '\7';
  EXPECT_THAT(refusal([&] { read_twist(xcdr2, "/cmd_vel"); }), HasSubstr("not encoded in CDR"));
}

TEST(Ros2Messages, APoseHasAFrameAndARotation) {
  const PoseStamped read = read_pose_stamped(pose(1.0), "/goal");
  EXPECT_EQ(read.frame_id, "map");
  EXPECT_EQ(read.time_ns, 12'000'000'005);
  EXPECT_THAT(read.position_m, ElementsAre(1, -2, 3));
  EXPECT_THAT(read.orientation_xyzw, ElementsAre(0, 0, 0, 1));
  EXPECT_THAT(refusal([] { read_pose_stamped(pose(0.0), "/goal"); }), HasSubstr("quaternion"));
  EXPECT_THAT(refusal([] { read_pose_stamped(pose(1.0, std::string(5000, 'x')), "/goal"); }), HasSubstr("5001 bytes"));
  std::string without_end = pose(1.0, "abc");
  without_end[4 + 12 + 3] = 'x';
  EXPECT_THAT(refusal([&] { read_pose_stamped(without_end, "/goal"); }), HasSubstr("without an end"));
}

/// rmw_cyclonedds_cpp: the client's number and the request's, then the fields, aligned as they were.
TEST(Ros2Messages, AServiceMessageBeginsWithWhoseItIs) {
  const ServiceMessage message{0x1122334455667788U, 9, CdrWriter().number(std::uint8_t{1}).text("done").bytes()};
  const std::string cdr = write_service_message(message);
  EXPECT_EQ(cdr.substr(0, 4), std::string("\0\1\0\0", 4));
  EXPECT_EQ(cdr.substr(4, 8), std::string("\x88\x77\x66\x55\x44\x33\x22\x11", 8));
  EXPECT_EQ(cdr.substr(12, 8), std::string("\x09\0\0\0\0\0\0\0", 8));
  const ServiceMessage read = read_service_message(cdr, "/reset");
  EXPECT_EQ(read.client, message.client);
  EXPECT_EQ(read.sequence_number, 9);
  EXPECT_EQ(read.body, message.body);
  EXPECT_THAT(refusal([] { read_service_message(std::string("\0\1\0\0\0", 5), "/reset"); }),
              HasSubstr("rmw_cyclonedds_cpp"));
}

TEST(Ros2Messages, ABoolIsReadAndAResponseWritten) {
  EXPECT_TRUE(read_set_bool(CdrWriter().number(std::uint8_t{1}).bytes(), "/pause"));
  EXPECT_FALSE(read_set_bool(CdrWriter().number(std::uint8_t{0}).bytes(), "/pause"));
  const std::string cdr = service_response(false, "why");
  CdrReader reader(cdr, "response");
  EXPECT_EQ(reader.number<std::uint8_t>(), 0);
  EXPECT_EQ(reader.text(100), "why");
}

/// Gids of 24 octets (Humble) or 16; the lists of readers and writers in that order.
TEST(Ros2Messages, ANodeTellsWhatIsItsOwn) {
  const Guid participant{1, 2, 3}, reader{4}, writer{5};
  for (const Release release : {Release::kHumble, Release::kIronAndLater}) {
    const int gid = release == Release::kHumble ? 24 : 16;
    const std::string cdr = participant_entities_info(release, participant,
                                                      {.name = "tileflight", .readers = {reader}, .writers = {writer}});
    CdrReader in(cdr, "info");
    const auto octets = [&] {
      Guid guid{};
      for (std::uint8_t& octet : guid) octet = in.number<std::uint8_t>();
      for (int i = 16; i < gid; ++i) EXPECT_EQ(in.number<std::uint8_t>(), 0);
      return guid;
    };
    EXPECT_EQ(octets(), participant);
    EXPECT_EQ(in.number<std::uint32_t>(), 1U) << "one node";
    EXPECT_EQ(in.text(100), "/");
    EXPECT_EQ(in.text(100), "tileflight");
    EXPECT_EQ(in.number<std::uint32_t>(), 1U);
    EXPECT_EQ(octets(), reader);
    EXPECT_EQ(in.number<std::uint32_t>(), 1U);
    EXPECT_EQ(octets(), writer);
  }
}

}  // namespace
}  // namespace tileflight::ros2::messages_test
