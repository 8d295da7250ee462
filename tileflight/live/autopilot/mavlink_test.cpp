#include "tileflight/live/autopilot/mavlink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/refusal.h"
#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/autopilot/lockstep.h"
#include "tileflight/live/autopilot/ports.h"
#include "tileflight/live/autopilot/test_px4_client.h"

// That our bytes are MAVLink's is checked against another codec in tests/mavlink.
namespace tileflight::autopilot::mavlink_test {
namespace {

using test_support::frame_of;

HilActuatorControls controls(std::uint64_t time_us) {
  HilActuatorControls message;
  message.time_us = time_us;
  message.controls = {0.25F, 0.5F, 0.75F, 1.0F};
  message.mode = 129;
  return message;
}

std::vector<MavlinkFrame> read_all(const std::string& bytes, MavlinkReader& reader, std::size_t chunk = 1) {
  std::vector<MavlinkFrame> frames;
  for (std::size_t at = 0; at < bytes.size(); at += chunk) {
    reader.push(std::string_view(bytes).substr(at, chunk));
    while (auto frame = reader.next()) frames.push_back(std::move(*frame));
  }
  return frames;
}

/// The check value of CRC-16/MCRF4XX in the catalogue of parametrised CRC algorithms.
TEST(Mavlink, ChecksumIsTheCataloguesOne) { EXPECT_EQ(base::crc16_mcrf4xx("123456789"), 0x6F91); }

TEST(Mavlink, PayloadsHaveTheLengthsOfTheMessageSet) {
  EXPECT_EQ(encode_payload(Heartbeat{}).size(), Heartbeat::kMessage.bytes);
  EXPECT_EQ(encode_payload(HilActuatorControls{}).size(), HilActuatorControls::kMessage.bytes);
  EXPECT_EQ(encode_payload(HilSensor{}).size(), HilSensor::kMessage.bytes);
  EXPECT_EQ(encode_payload(HilGps{}).size(), HilGps::kMessage.bytes);
  EXPECT_EQ(encode_payload(DistanceSensor{}).size(), DistanceSensor::kMessage.bytes);
  EXPECT_EQ(encode_payload(HilStateQuaternion{}).size(), HilStateQuaternion::kMessage.bytes);
}

TEST(Mavlink, ReadsWhatItWritesInPiecesOfAnySize) {
  const std::string bytes = frame_of(controls(7), 3) + frame_of(Heartbeat{}, 4);
  for (const std::size_t chunk : {1U, 5U, 1000U}) {
    MavlinkReader reader;
    const auto frames = read_all(bytes, reader, chunk);
    ASSERT_EQ(frames.size(), 2U);
    EXPECT_EQ(frames[0].sequence, 3);
    const auto read = decode_payload<HilActuatorControls>(frames[0].payload);
    EXPECT_EQ(read.time_us, 7U);
    EXPECT_EQ(read.controls, controls(7).controls);
    EXPECT_EQ(read.mode, 129);
    EXPECT_EQ(frames[1].message, 0U);
    EXPECT_EQ(reader.noise_bytes() + reader.wrong_checksums(), 0U);
  }
}

TEST(Mavlink, LeavesOutZerosAtTheEndAndPutsThemBack) {
  HilActuatorControls zero;
  zero.time_us = 9;
  const std::string bytes = frame_of(zero, 0);
  EXPECT_EQ(bytes.size(), 10U + 1U + 2U);  // one byte of payload: 9
  MavlinkReader reader;
  const auto frames = read_all(bytes, reader);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(decode_payload<HilActuatorControls>(frames[0].payload).time_us, 9U);
  EXPECT_EQ(frame_of(HilActuatorControls{}, 0).size(), 10U + 1U + 2U);  // all zero: one byte stays
}

TEST(Mavlink, SkipsNoiseWrongChecksumsAndUnknownMessages) {
  std::string damaged = frame_of(controls(1), 0);
  damaged[20] = static_cast<char>(damaged[20] ^ 1);
  const std::string unknown = encode_frame({76, 152, 33}, {.payload = "COMMAND_LONG"});
  MavlinkReader reader;
  const auto frames =
      read_all("noise" + damaged + unknown + frame_of(controls(2), 1) + "\xFE\x01" + frame_of(controls(3), 2), reader);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(decode_payload<HilActuatorControls>(frames[0].payload).time_us, 2U);
  EXPECT_EQ(decode_payload<HilActuatorControls>(frames[1].payload).time_us, 3U);
  EXPECT_EQ(reader.wrong_checksums(), 1U);
  EXPECT_GE(reader.noise_bytes(), 7U);
}

/// A start byte in the noise must not make it wait for the length that seems to follow.
TEST(Mavlink, FindsAFrameRightBehindAStartByteThatIsNone) {
  MavlinkReader reader;
  EXPECT_EQ(read_all("\xFD" + frame_of(controls(4), 0), reader).size(), 1U);
  EXPECT_EQ(reader.noise_bytes(), 1U);
}

TEST(Mavlink, PassesOverSignatures) {
  std::string bytes = frame_of(controls(5), 0);
  bytes[2] = 1;  // incompatibility flag: signed
  const std::string body = bytes.substr(1, bytes.size() - 3);
  const char extra = static_cast<char>(HilActuatorControls::kMessage.crc_extra);
  const unsigned sum = base::crc16_mcrf4xx({&extra, 1}, base::crc16_mcrf4xx(body));
  bytes[bytes.size() - 2] = static_cast<char>(sum & 0xFFU);
  bytes[bytes.size() - 1] = static_cast<char>(sum >> 8U);
  MavlinkReader reader;
  const auto frames = read_all(bytes + std::string(13, 's') + frame_of(controls(6), 1), reader);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(decode_payload<HilActuatorControls>(frames[1].payload).time_us, 6U);
}

TEST(ControlGate, StampsDecide) {
  ControlGate gate(4000);
  EXPECT_EQ(gate.receive(1'000'000, 1'000'000), ControlVerdict::kAnswer);
  EXPECT_EQ(gate.receive(1'004'000, 1'004'000), ControlVerdict::kAnswer);
  EXPECT_EQ(gate.receive(1'004'000, 1'008'000), ControlVerdict::kRepetition);
  EXPECT_EQ(gate.receive(1'000'000, 1'008'000), ControlVerdict::kStale);
  EXPECT_EQ(gate.receive(9'000'000, 1'008'000), ControlVerdict::kFuture);
  EXPECT_EQ(gate.receive(1'008'000, 1'008'000), ControlVerdict::kAnswer);
  EXPECT_EQ(gate.receive(1'012'000, 1'016'000), ControlVerdict::kLate);
  EXPECT_EQ(gate.receive(1'016'000, 1'016'000), ControlVerdict::kAnswer);
}

TEST(ControlGate, AFirstAnswerToEarlierSensorsDoesNotMakeLaterOnesAnswers) {
  ControlGate gate(4000);
  EXPECT_EQ(gate.receive(1'000'000, 1'020'000), ControlVerdict::kAnswer);  // the sensors' clock is not known yet
  EXPECT_EQ(gate.receive(1'020'000, 1'024'000), ControlVerdict::kAnswer);
  EXPECT_EQ(gate.receive(1'024'500, 1'024'000), ControlVerdict::kAnswer);
  EXPECT_EQ(gate.receive(1'026'000, 1'030'000), ControlVerdict::kLate);
}

TEST(ControlGate, TheAutopilotsClockMayHaveItsOwnZero) {
  ControlGate gate(4000);
  EXPECT_EQ(gate.receive(5'000, 1'000'000), ControlVerdict::kAnswer);
  EXPECT_EQ(gate.receive(9'000, 1'004'000), ControlVerdict::kAnswer);
  EXPECT_EQ(gate.receive(800'000, 1'008'000), ControlVerdict::kFuture);
}

TEST(TcpPort, OnePeerAtATime) {
  TcpPort port("127.0.0.1", 0);
  EXPECT_FALSE(port.accept(std::chrono::milliseconds(1)));
  {
    const test_support::TcpClient first(port.port());
    ASSERT_TRUE(port.accept(std::chrono::seconds(10)));
    first.send("abc");
    EXPECT_EQ(port.receive(std::chrono::seconds(10)), "abc");
    port.send("de");
    EXPECT_EQ(first.receive(), "de");
  }
  EXPECT_EQ(port.receive(std::chrono::seconds(10)), "");
  EXPECT_FALSE(port.connected());
  const test_support::TcpClient second(port.port());
  EXPECT_TRUE(port.accept(std::chrono::seconds(10)));
  EXPECT_THAT(tests::refusal_of([&] { const TcpPort taken("127.0.0.1", port.port()); }),
              testing::HasSubstr("choose another TcpPort"));
}

/// Its memory stays bounded: what does not fit into the socket ends the connection.
TEST(TcpPort, APeerThatDoesNotReadIsLeft) {
  TcpPort port("127.0.0.1", 0);
  const test_support::TcpClient deaf(port.port());
  ASSERT_TRUE(port.accept(std::chrono::seconds(10)));
  const std::string much(1 << 20, 'x');
  for (int i = 0; i < 100 && port.connected(); ++i) port.send(much);
  EXPECT_FALSE(port.connected());
}

}  // namespace
}  // namespace tileflight::autopilot::mavlink_test
