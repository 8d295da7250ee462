#include <gmock/gmock.h>

#include <cmath>

#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/test_log.h"

namespace tileflight::flight_logs::mavlink_log_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::uint64_t kStart_us = 1'700'000'000'000'000;

std::string stamped(std::uint64_t time_us, const std::string& frame) {
  std::string bytes;
  for (int shift = 56; shift >= 0; shift -= 8) bytes += static_cast<char>(time_us >> shift & 0xFFU);
  return bytes + frame;
}

/// A frame of MAVLink 2, or 1, from a vehicle.
std::string frame(int version, unsigned char number, unsigned char extra, std::string payload, char system = 1) {
  while (version == 2 && payload.size() > 1 && payload.back() == '\0') payload.pop_back();
  std::string bytes =
      version == 2 ? std::string{static_cast<char>(payload.size()), 0, 0, 7, system, 1, static_cast<char>(number), 0, 0}
                   : std::string{static_cast<char>(payload.size()), 7, system, 1, static_cast<char>(number)};
  bytes += payload;
  const std::uint16_t sum = base::crc16_mcrf4xx(bytes + static_cast<char>(extra));
  base::append_raw(bytes, sum);
  return (version == 2 ? '\xFD' : '\xFE') + bytes;
}

std::string position(int version, std::uint32_t boot_ms, std::int32_t lat_e7, char system = 1,
                     std::int32_t height_mm = 512'250, std::int32_t above_home_mm = 12'250) {
  std::string payload;
  base::append_raw(payload, boot_ms);
  base::append_raw(payload, lat_e7);
  base::append_raw(payload, std::int32_t{80'000'000});
  base::append_raw(payload, height_mm);
  base::append_raw(payload, above_home_mm);
  payload += std::string(8, '\0');
  return frame(version, 33, 104, payload, system);
}

std::string attitude(std::uint32_t boot_ms, float roll, float yaw) {
  std::string payload;
  base::append_raw(payload, boot_ms);
  for (const float value : {roll, 0.0F, yaw, 0.1F, 0.2F, 0.3F}) base::append_raw(payload, value);
  return frame(2, 30, 39, payload);
}

class MavlinkLog : public LogTest {
 protected:
  MavlinkLog() : LogTest("flight.tlog", read_telemetry) {}
};

TEST_F(MavlinkLog, PositionsOfBothVersionsOnTheVehiclesClock) {
  const Telemetry log = read(stamped(kStart_us, frame(1, 0, 50, std::string(9, '\1'))) +
                             stamped(kStart_us + 100'000, position(1, 5000, 470'000'000)) +
                             stamped(kStart_us + 110'000, attitude(5010, 0.5F, -1.0F)) +
                             stamped(kStart_us + 900'000, position(2, 5250, 470'000'100)));
  ASSERT_EQ(log.fixes.size(), 2U);
  EXPECT_NEAR(log.fixes[1].time_s, 0.25, 1e-9) << "not the times of arrival";
  EXPECT_NEAR(log.fixes[1].latitude_deg, 47.00001, 1e-12);
  EXPECT_NEAR(log.fixes[0].longitude_deg, 8.0, 1e-12);
  EXPECT_NEAR(*log.fixes[0].absolute_height_m, 512.25, 1e-9);
  EXPECT_NEAR(*log.fixes[0].height_above_takeoff_m, 12.25, 1e-9);
  EXPECT_NEAR(log.fixes[0].body_roll_deg.value_or(0), 0.5 * 180 / 3.14159265358979, 1e-5);
  EXPECT_FALSE(log.fixes[1].body_roll_deg) << "the attitude is 0.24 s old";
  ASSERT_EQ(log.body_rates.size(), 1U);
  EXPECT_NEAR(log.body_rates[0].rate_rad_s.z(), 0.3, 1e-6);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_NEAR(log.zero_utc_s.value_or(0), 1.7e9 + 0.1, 1e-5);
  EXPECT_THAT(log.warnings, testing::IsEmpty());
}

TEST_F(MavlinkLog, DamageAndOtherVehiclesAreCounted) {
  std::string wrong = position(2, 5100, 470'000'000);
  wrong[14] ^= 1;
  const Telemetry log = read(stamped(kStart_us, position(2, 5000, 470'000'000)) + "noise" + stamped(kStart_us, wrong) +
                             stamped(kStart_us, position(2, 5200, 480'000'000, 2)) +
                             stamped(kStart_us, position(2, 5300, 470'000'000)) + "cut");
  EXPECT_EQ(log.fixes.size(), 2U);
  EXPECT_THAT(log.warnings,
              ElementsAre(HasSubstr("8 bytes of the file"), HasSubstr("1 messages dropped: their checksum"),
                          HasSubstr("1 positions of other vehicles are not used; those of system 1")));
}

TEST_F(MavlinkLog, ARestartOfTheVehicleContinuesItsClock) {
  const Telemetry log =
      read(stamped(kStart_us, position(2, 100'000, 470'000'000)) +
           stamped(kStart_us + 200'000'000, position(2, 300'000, 470'001'000)) +
           stamped(kStart_us + 219'000'000, position(2, 18'900, 470'002'000)) +  // switched on 0.1 s after the last one
           stamped(kStart_us + 300'000'000, attitude(99'990, 0.5F, -1.0F)) +
           stamped(kStart_us + 300'010'000, position(2, 100'000, 470'003'000)));
  ASSERT_EQ(log.fixes.size(), 4U);
  EXPECT_NEAR(log.fixes[1].time_s, 200.0, 1e-6);
  EXPECT_NEAR(log.fixes[2].time_s, 219.0, 1e-6);
  EXPECT_NEAR(log.fixes[3].time_s, 300.1, 1e-6);
  EXPECT_FALSE(log.fixes[0].body_roll_deg) << "an attitude of the second flight at the same time since the start";
  EXPECT_TRUE(log.fixes[3].body_roll_deg);
  ASSERT_EQ(log.body_rates.size(), 1U);
  EXPECT_NEAR(log.body_rates[0].time_s, 300.09, 1e-6);
  EXPECT_NEAR(log.zero_utc_s.value_or(0), 1.7e9, 1e-5);
  EXPECT_THAT(log.warnings, ElementsAre(HasSubstr("the vehicle restarted 1 time")));
}

TEST_F(MavlinkLog, AMessageThatArrivesLateIsNoRestart) {
  const Telemetry log = read(stamped(kStart_us, position(2, 100'000, 470'000'000)) +
                             stamped(kStart_us + 5'000'000, position(2, 105'000, 470'001'000)) +
                             stamped(kStart_us + 5'100'000, position(2, 101'000, 470'000'500)) +
                             stamped(kStart_us + 6'000'000, position(2, 106'000, 470'002'000)));
  ASSERT_EQ(log.fixes.size(), 3U);
  EXPECT_NEAR(log.fixes[2].time_s, 6.0, 1e-6);
  EXPECT_THAT(log.warnings, ElementsAre(HasSubstr("1 entries dropped: time does not increase")));
}

TEST_F(MavlinkLog, HeightsBeforeTheVehicleKnowsItsHomeAreNotAboveSeaLevel) {
  // ArduPilot then sends the height above the place where it was switched on as both heights.
  const Telemetry log = read(stamped(kStart_us - 60'000'000, position(2, 9000, 469'999'900, 1, 0, 0)) +  // a start
                             stamped(kStart_us, position(2, 5000, 470'000'000, 1, 990, 990)) +
                             stamped(kStart_us + 1'000'000, position(2, 6000, 470'000'100, 1, 1250, 1250)) +
                             stamped(kStart_us + 2'000'000, position(2, 7000, 470'000'200, 1, 589'750, 10)) +
                             stamped(kStart_us + 3'000'000, position(2, 8000, 470'000'300, 1, 589'950, 210)));
  ASSERT_EQ(log.fixes.size(), 2U);
  EXPECT_NEAR(*log.fixes[0].absolute_height_m, 589.75, 1e-9);
  EXPECT_NEAR(log.fixes[1].time_s, 1.0, 1e-6);
  EXPECT_NEAR(log.zero_utc_s.value_or(0), 1.7e9 + 2, 1e-5);
  EXPECT_THAT(log.warnings,
              ElementsAre(HasSubstr("before the vehicle knew its home"), HasSubstr("3 entries dropped: no height"),
                          HasSubstr("the vehicle restarted 1 time")));
}

TEST_F(MavlinkLog, AHomeAtSeaLevelKeepsItsHeights) {
  const Telemetry log = read(stamped(kStart_us, position(2, 5000, 470'000'000, 1, 20, 20)) +
                             stamped(kStart_us + 1'000'000, position(2, 6000, 470'000'100, 1, 40, 28)));
  EXPECT_EQ(log.fixes.size(), 2U);
  EXPECT_THAT(log.warnings, testing::IsEmpty());
}

TEST_F(MavlinkLog, ALogWithoutPositionsIsOneClearLine) {
  EXPECT_THAT(fault(stamped(kStart_us, attitude(5010, 0.5F, -1.0F))),
              HasSubstr("contains no messages GLOBAL_POSITION_INT"));
}

TEST_F(MavlinkLog, WrongChecksumsAreNamedWhereTheyLeaveNoPosition) {
  std::string wrong = position(2, 5100, 470'000'000);
  wrong[14] ^= 1;
  EXPECT_THAT(fault(stamped(kStart_us, wrong) + stamped(kStart_us, wrong)),
              HasSubstr("contains no messages GLOBAL_POSITION_INT that can be read (2 messages dropped: their checksum "
                        "is wrong); copy or export the log again"));
}

}  // namespace
}  // namespace tileflight::flight_logs::mavlink_log_test
