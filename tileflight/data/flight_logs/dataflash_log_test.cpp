#include <gmock/gmock.h>

#include <cmath>
#include <cstdint>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/test_bytes.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/test_log.h"

namespace tileflight::flight_logs::dataflash_log_test {
namespace {

using testing::AnyOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

std::string padded(std::string text, std::size_t length) {
  text.resize(length, '\0');
  return text;
}

std::string message(std::uint8_t type, const std::string& fields) {
  return "\xA3\x95" + base::to_raw_bytes(type) + fields;
}

/// Size of a field by the table in ArduPilot's notes on its logger.
std::size_t bytes_of(const std::string& letters) {
  std::size_t bytes = 0;
  for (const char letter : letters) {
    bytes += std::string("bBM").find(letter) != std::string::npos       ? 1
             : std::string("hHcC").find(letter) != std::string::npos    ? 2
             : std::string("iIeELfn").find(letter) != std::string::npos ? 4
             : std::string("qQd").find(letter) != std::string::npos     ? 8
             : letter == 'N'                                            ? 16
                                                                        : 64;
  }
  return bytes;
}

std::string format(std::uint8_t type, const std::string& name, const std::string& letters, const std::string& labels) {
  return message(128, base::to_raw_bytes(type) + base::to_raw_bytes(static_cast<std::uint8_t>(3 + bytes_of(letters))) +
                          padded(name, 4) + padded(letters, 16) + padded(labels, 64));
}

std::uint64_t us(double time_s) { return static_cast<std::uint64_t>(std::llround(1e6 * time_s)); }
std::int32_t e7(double degrees) { return static_cast<std::int32_t>(std::llround(1e7 * degrees)); }

const std::string kFormats =
    message(128, base::to_raw_bytes(std::uint8_t{128}) + base::to_raw_bytes(std::uint8_t{89}) + padded("FMT", 4) +
                     padded("BBnNZ", 16) + padded("Type,Length,Name,Format,Columns", 64));
const std::string kUnits = format(1, "UNIT", "QbZ", "TimeUS,Id,Label") + format(2, "MULT", "Qbd", "TimeUS,Id,Mult") +
                           format(3, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds");
const std::string kGps =
    format(10, "GPS", "QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U");
const std::string kGpa = format(11, "GPA", "QBCCCCfBIHe", "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta,AEl");
const std::string kAtt = format(12, "ATT", "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw");
const std::string kImu = format(13, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ");
const std::string kPos = format(14, "POS", "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt");

struct GpsRow {
  double time_s, latitude_deg;
  std::uint8_t status = 3, instance = 0;
};

std::string gps(const GpsRow& row) {
  return message(10, base::to_raw_bytes(us(row.time_s)) + base::to_raw_bytes(row.instance) +
                         base::to_raw_bytes(row.status) + base::to_raw_bytes(std::uint32_t{250}) +
                         base::to_raw_bytes(std::uint16_t{2000}) + base::to_raw_bytes(std::uint8_t{12}) +
                         base::to_raw_bytes(std::int16_t{70}) + base::to_raw_bytes(e7(row.latitude_deg)) +
                         base::to_raw_bytes(e7(-78.5)) + base::to_raw_bytes(std::int32_t{290050}) +
                         std::string(16, '\0') + base::to_raw_bytes(std::uint8_t{1}));
}

std::string gpa(double time_s, std::int32_t above_ellipsoid_cm, std::uint8_t instance = 0) {
  return message(11, base::to_raw_bytes(us(time_s)) + base::to_raw_bytes(instance) + std::string(8, '\0') +
                         base::to_raw_bytes(0.0F) + base::to_raw_bytes(std::uint8_t{1}) +
                         base::to_raw_bytes(std::uint32_t{0}) + base::to_raw_bytes(std::uint16_t{200}) +
                         base::to_raw_bytes(above_ellipsoid_cm));
}

std::string att(double time_s, double roll_deg, double pitch_deg, double yaw_deg) {
  const auto centi = [](double degrees) {
    return base::to_raw_bytes(static_cast<std::uint16_t>(std::lround(100 * degrees)));
  };
  return message(12, base::to_raw_bytes(us(time_s)) + centi(0) + centi(roll_deg) + centi(0) + centi(pitch_deg) +
                         centi(0) + centi(yaw_deg));
}

std::string imu(double time_s, float x, std::uint8_t instance = 0) {
  return message(13, base::to_raw_bytes(us(time_s)) + base::to_raw_bytes(instance) + base::to_raw_bytes(x) +
                         base::to_raw_bytes(0.5F) + base::to_raw_bytes(-0.25F) + std::string(12, '\0'));
}

std::string pos(double time_s, double latitude_deg, float above_home_m) {
  return message(14, base::to_raw_bytes(us(time_s)) + base::to_raw_bytes(e7(latitude_deg)) + base::to_raw_bytes(e7(9)) +
                         base::to_raw_bytes(120.5F) + base::to_raw_bytes(above_home_m) + base::to_raw_bytes(0.F));
}

class Dataflash : public LogTest {
 protected:
  Dataflash() : LogTest("log.bin", read_dataflash) {}
};

TEST_F(Dataflash, PositionsAttitudesRatesAndHeights) {
  const Telemetry log =
      read(kFormats + kGps + kAtt + kImu + kPos + att(20, 5.5, -10.25, 270) + imu(19.5, 0.125F) + gps({20, -0.25}) +
           imu(20.5, 0.75F) + imu(20.5, 9, 1) + pos(20.1, -0.25, 12.5F) + gps({20.2, -0.26}) + gps({22, -0.27}));
  ASSERT_EQ(log.fixes.size(), 3u);
  EXPECT_EQ(log.fixes[0].time_s, 0.0);
  EXPECT_NEAR(log.fixes[1].time_s, 0.2, 1e-9);
  EXPECT_NEAR(log.fixes[1].latitude_deg, -0.26, 1e-12);
  EXPECT_NEAR(log.fixes[0].longitude_deg, -78.5, 1e-12);
  EXPECT_NEAR(*log.fixes[0].absolute_height_m, 2900.5, 1e-9);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_EQ(log.fixes[0].height_above_takeoff_m, 12.5);
  EXPECT_EQ(log.fixes[2].height_above_takeoff_m, std::nullopt);
  EXPECT_NEAR(*log.fixes[0].body_roll_deg, 5.5, 1e-9);
  EXPECT_NEAR(*log.fixes[0].body_pitch_deg, -10.25, 1e-9);
  EXPECT_NEAR(*log.fixes[0].body_yaw_deg, 270, 1e-9);
  EXPECT_EQ(log.fixes[2].body_yaw_deg, std::nullopt);
  ASSERT_EQ(log.body_rates.size(), 2u);  // only of the first unit
  EXPECT_NEAR(log.body_rates[0].time_s, -0.5, 1e-9);
  EXPECT_EQ(log.body_rates[1].rate_rad_s, geometry::Vec3(0.75, 0.5, -0.25));
  EXPECT_THAT(log.warnings, IsEmpty());
}

TEST_F(Dataflash, IsToldByItsContent) {
  base::write_file(folder_ / "log.srt", kFormats + kGps + gps({20, -0.25}));
  EXPECT_EQ(read_telemetry(folder_ / "log.srt").fixes.size(), 1u);
}

/// Week 2000 began on 6 May 2018 at midnight of GPS time, which was 18 s ahead of UTC.
TEST_F(Dataflash, UtcByTheReceiversWeek) {
  const Telemetry log = read(kFormats + kGps + gps({20, 45, 1}) + gps({21, 45}) + gps({22, 46}));
  EXPECT_NEAR(*log.zero_utc_s, *base::parse_iso_time_s("2018-05-05T23:59:42.25Z"), 1e-6);
}

TEST(GpsTime, LeapSeconds) {
  const auto shift_s = [](const char* utc) {
    const double gps_s = *base::parse_iso_time_s(utc) - *base::parse_iso_time_s("1980-01-06T00:00:00");
    const double week = std::floor(gps_s / 604800);
    return gps_s - (utc_from_gps_s(week, gps_s - 604800 * week) - *base::parse_iso_time_s("1980-01-06T00:00:00"));
  };
  EXPECT_EQ(utc_from_gps_s(0, 0), *base::parse_iso_time_s("1980-01-06T00:00:00"));
  EXPECT_NEAR(shift_s("1981-06-30T23:59:59"), 0, 1e-6);
  EXPECT_NEAR(shift_s("1981-07-01T00:00:02"), 1, 1e-6);
  EXPECT_NEAR(shift_s("1998-12-31T23:59:00"), 12, 1e-6);
  EXPECT_NEAR(shift_s("1999-01-01T00:01:00"), 13, 1e-6);
  EXPECT_NEAR(shift_s("2016-12-31T23:59:00"), 17, 1e-6);
  EXPECT_NEAR(shift_s("2017-01-01T00:01:00"), 18, 1e-6);
  EXPECT_NEAR(shift_s("2026-01-01T00:00:00"), 18, 1e-6);
}

/// Multipliers replace the scale implied by the format's letters, wherever they are in the file.
TEST_F(Dataflash, MultipliersOfTheLogItself) {
  const auto multiplier = [](char letter, double value) {
    return message(2, base::to_raw_bytes(std::uint64_t{0}) + letter + base::to_raw_bytes(value));
  };
  const auto multipliers = [](std::uint8_t type, const std::string& letters) {
    return message(3, base::to_raw_bytes(std::uint64_t{0}) + base::to_raw_bytes(type) + std::string(16, '\0') +
                          padded(letters, 16));
  };
  const std::string flown = kFormats + kUnits + kGps + gps({20, 45}) + gps({21, 45});
  const std::string known = multiplier('F', 1e-6) + multiplier('C', 1e-3) + multiplier('G', 1e-7) + multiplier('-', 0);
  const Telemetry same = read(flown + known + multipliers(10, "F--C---GG------"));
  EXPECT_NEAR(same.fixes.at(0).latitude_deg, 45, 1e-12);
  EXPECT_NEAR(same.fixes.at(1).time_s, 1, 1e-9);
  EXPECT_NEAR(*same.fixes.at(0).absolute_height_m, 2900.5, 1e-9);
  EXPECT_NEAR(*same.zero_utc_s, *base::parse_iso_time_s("2018-05-05T23:59:42.25Z"), 1e-6);
  const Telemetry other = read(flown + known + multipliers(10, "F--C---GGC?????"));
  EXPECT_NEAR(*other.fixes.at(0).absolute_height_m, 290.05, 1e-9);
}

const std::string kXkf1 =
    format(15, "XKF1", "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH");
const std::string kOrgn = format(16, "ORGN", "QBLLe", "TimeUS,Type,Lat,Lng,Alt");
const std::string kRfnd = format(17, "RFND", "QBfBBb", "TimeUS,Instance,Dist,Stat,Orient,Quality");

struct KalmanRow {
  double time_s, roll_deg, pitch_deg, yaw_deg;
  float north_m, east_m, down_m;
  std::uint8_t core = 0;
};

std::string xkf1(const KalmanRow& row) {
  const auto centi = [](double degrees) {
    return base::to_raw_bytes(static_cast<std::int16_t>(std::lround(100 * degrees)));
  };
  return message(15, base::to_raw_bytes(us(row.time_s)) + base::to_raw_bytes(row.core) + centi(row.roll_deg) +
                         centi(row.pitch_deg) +
                         base::to_raw_bytes(static_cast<std::uint16_t>(std::lround(100 * row.yaw_deg))) +
                         std::string(16, '\0') + base::to_raw_bytes(row.north_m) + base::to_raw_bytes(row.east_m) +
                         base::to_raw_bytes(row.down_m) + std::string(10, '\0'));
}

std::string orgn(double time_s, std::uint8_t type, double latitude_deg, double longitude_deg, double sea_level_m) {
  return message(16, base::to_raw_bytes(us(time_s)) + base::to_raw_bytes(type) + base::to_raw_bytes(e7(latitude_deg)) +
                         base::to_raw_bytes(e7(longitude_deg)) +
                         base::to_raw_bytes(static_cast<std::int32_t>(std::lround(100 * sea_level_m))));
}

TEST_F(Dataflash, AttitudeOfTheKalmanFilterWhereThereIsNoOther) {
  const std::string flown = kFormats + kGps + kXkf1 + xkf1({20, 9, 9, 9, 0, 0, 0, 1}) +
                            xkf1({20, -5.25, 10.5, 350, 1, 2, 3}) + gps({20, 45}) + gps({21, 45.1});
  const Telemetry log = read(flown);  // of the lowest core
  EXPECT_NEAR(*log.fixes.at(0).body_roll_deg, -5.25, 1e-9);
  EXPECT_NEAR(*log.fixes.at(0).body_pitch_deg, 10.5, 1e-9);
  EXPECT_NEAR(*log.fixes.at(0).body_yaw_deg, 350, 1e-9);
  EXPECT_EQ(log.fixes.at(1).body_yaw_deg, std::nullopt);
  const Telemetry with_att = read(flown + kAtt + att(20, 1, 2, 3));
  EXPECT_NEAR(*with_att.fixes.at(0).body_yaw_deg, 3, 1e-9);
}

/// A kilometre north and half of one east of an origin at 60 degrees, where a degree of longitude is half as long as at
/// the equator, on the sphere of 6378100 m that the filter uses.
TEST_F(Dataflash, PositionsOfTheKalmanFilterAboutItsOrigin) {
  const std::string home = orgn(18, 1, 10, 10, 0), origin = orgn(19, 0, 60, 25, 120.5);
  const std::string rows = xkf1({20, 0, 0, 90, 0, 0, -10}) + xkf1({20.1, 0, 0, 90, 1000, 500, -11.5F});
  const Telemetry log = read(kFormats + kGps + kXkf1 + kOrgn + gps({20, 45, 1}) + home + origin + rows);
  ASSERT_EQ(log.fixes.size(), 2u);
  constexpr double kMetresADegree = 6378100.0 * 3.14159265358979323846 / 180.0;
  EXPECT_NEAR(log.fixes[0].latitude_deg, 60, 1e-12);
  EXPECT_NEAR(log.fixes[1].latitude_deg, 60 + 1000 / kMetresADegree, 1e-9);
  // At 60.0045 degrees, the middle of the way, the cosine is 0.499932.
  EXPECT_NEAR(log.fixes[1].longitude_deg, 25 + 500 / (kMetresADegree * 0.499932), 1e-7);
  EXPECT_NEAR(*log.fixes[1].absolute_height_m, 132.0, 1e-4);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_NEAR(*log.fixes[0].body_yaw_deg, 90, 1e-9);
  EXPECT_THAT(fault(kFormats + kXkf1 + kOrgn + home + rows), HasSubstr("contains no position messages"));
}

TEST_F(Dataflash, AnglesInTheUnitsThatTheLogSays) {
  const auto unit = [](char letter, const std::string& label) {
    return message(1, base::to_raw_bytes(std::uint64_t{0}) + letter + padded(label, 64));
  };
  const auto units_of = [](std::uint8_t type, const std::string& letters) {
    return message(3, base::to_raw_bytes(std::uint64_t{0}) + base::to_raw_bytes(type) + padded(letters, 16) +
                          padded("F---------------", 16));
  };
  const std::string att_in_floats = format(12, "ATT", "Qffffff", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw");
  const auto angles = [](float roll, float pitch, float yaw) {
    return message(12, base::to_raw_bytes(us(20)) + base::to_raw_bytes(0.F) + base::to_raw_bytes(roll) +
                           base::to_raw_bytes(0.F) + base::to_raw_bytes(pitch) + base::to_raw_bytes(0.F) +
                           base::to_raw_bytes(yaw));
  };
  const std::string flown = kFormats + kUnits + kGps + kImu + att_in_floats + gps({20, 45}) + imu(20, 90.0F) +
                            unit('d', "deg") + unit('h', "degheading") + unit('r', "rad") + unit('k', "deg/s") +
                            unit('E', "rad/s");
  const Telemetry degrees = read(flown + angles(1, 2, 3) + units_of(12, "sdddddh") + units_of(13, "s#EEEooo"));
  EXPECT_NEAR(*degrees.fixes.at(0).body_roll_deg, 1, 1e-9);
  EXPECT_NEAR(*degrees.fixes.at(0).body_yaw_deg, 3, 1e-9);
  EXPECT_NEAR(degrees.body_rates.at(0).rate_rad_s.x(), 90, 1e-9);
  const Telemetry radians =
      read(flown + angles(0.5F, -0.25F, 1.5F) + units_of(12, "srrrrrr") + units_of(13, "s#kkkooo"));
  EXPECT_NEAR(*radians.fixes.at(0).body_roll_deg, 28.6478898, 1e-6);
  EXPECT_NEAR(*radians.fixes.at(0).body_pitch_deg, -14.3239449, 1e-6);
  EXPECT_NEAR(*radians.fixes.at(0).body_yaw_deg, 85.9436693, 1e-6);
  EXPECT_NEAR(radians.body_rates.at(0).rate_rad_s.x(), 1.5707963, 1e-6);
}

TEST_F(Dataflash, RangesOfTheFinderThatLooksDown) {
  const auto rfnd = [](double time_s, float range_m, std::uint8_t instance, std::uint8_t status,
                       std::uint8_t orientation) {
    return message(17, base::to_raw_bytes(us(time_s)) + base::to_raw_bytes(instance) + base::to_raw_bytes(range_m) +
                           base::to_raw_bytes(status) + base::to_raw_bytes(orientation) +
                           base::to_raw_bytes(std::uint8_t{100}));
  };
  const std::string flown = kFormats + kGps + kRfnd + gps({20, 45}) + gps({21, 45.1});
  base::write_file(folder_ / "log.bin", flown + rfnd(19.5, 7.5F, 1, 4, 25) + rfnd(20, 3, 0, 4, 0) +  // forward
                                            rfnd(20.25, 8, 1, 4, 25) + rfnd(20.5, 0.2F, 1, 2, 25) +  // too near
                                            rfnd(20.75, 9, 2, 4, 25));                               // another one
  const std::vector<RangeReading> ranges = read_dataflash_ranges(folder_ / "log.bin");
  ASSERT_EQ(ranges.size(), 2u);
  EXPECT_NEAR(ranges[0].time_s, -0.5, 1e-9);
  EXPECT_EQ(ranges[0].range_m, 7.5);
  EXPECT_NEAR(ranges[1].time_s, 0.25, 1e-9);
  EXPECT_EQ(ranges[1].range_m, 8.0);
  base::write_file(folder_ / "log.bin", flown);
  EXPECT_TRUE(read_dataflash_ranges(folder_ / "log.bin").empty());
}

TEST_F(Dataflash, HeightsAboveTheEllipsoidWhereAllFixesHaveThem) {
  const std::string begin = kFormats + kGps + kGpa + gps({20, 45}) + gpa(20, 292625) + gpa(20, 5, 1) + gps({21, 45.1});
  const Telemetry all = read(begin + gpa(21, 292700));
  EXPECT_EQ(all.height_datum, HeightDatum::kEllipsoid);
  EXPECT_NEAR(*all.fixes.at(0).absolute_height_m, 2926.25, 1e-9);
  EXPECT_NEAR(*all.fixes.at(1).absolute_height_m, 2927, 1e-9);
  const Telemetry unknown = read(begin + gpa(21, std::numeric_limits<std::int32_t>::min()));
  EXPECT_EQ(unknown.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_NEAR(*unknown.fixes.at(0).absolute_height_m, 2900.5, 1e-9);
}

TEST_F(Dataflash, AnotherReceiverOrTheEstimatorWhereThereIsNoFix) {
  const Telemetry second = read(kFormats + kGps + gps({20, 45, 1, 0}) + gps({20, 46, 4, 1}) + gps({21, 45, 2, 0}));
  ASSERT_EQ(second.fixes.size(), 1u);
  EXPECT_NEAR(second.fixes[0].latitude_deg, 46, 1e-12);
  const Telemetry estimator = read(kFormats + kGps + kPos + gps({20, 45, 1}) + pos(20, 47, 3) + pos(20.1F, 47.1, 4));
  ASSERT_EQ(estimator.fixes.size(), 2u);
  EXPECT_NEAR(estimator.fixes[0].latitude_deg, 47, 1e-12);
  EXPECT_EQ(*estimator.fixes[0].absolute_height_m, 120.5);
  EXPECT_EQ(estimator.zero_utc_s, std::nullopt);
}

/// As written by ArduCopter 3.1: no microseconds, only a barometer's height.
TEST_F(Dataflash, OldLogsCountMilliseconds) {
  const std::string old =
      kFormats + format(20, "GPS", "BIHBcLLeeEefI", "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T") +
      format(21, "BARO", "IffcH", "TimeMS,Alt,Press,Temp,CRt");
  const auto row = [](std::uint32_t start_ms, double latitude_deg) {
    return message(20, base::to_raw_bytes(std::uint8_t{3}) + base::to_raw_bytes(std::uint32_t{250}) +
                           base::to_raw_bytes(std::uint16_t{2000}) + base::to_raw_bytes(std::uint8_t{9}) +
                           base::to_raw_bytes(std::int16_t{150}) + base::to_raw_bytes(e7(latitude_deg)) +
                           base::to_raw_bytes(e7(9)) + base::to_raw_bytes(std::int32_t{100}) +
                           base::to_raw_bytes(std::int32_t{58400}) + std::string(12, '\0') +
                           base::to_raw_bytes(start_ms));
  };
  const Telemetry log = read(old + row(4000, 45) +
                             message(21, base::to_raw_bytes(std::uint32_t{4100}) + base::to_raw_bytes(7.5F) +
                                             base::to_raw_bytes(1e5F) + std::string(4, '\0')) +
                             row(4200, 45.1));
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_NEAR(log.fixes[1].time_s, 0.2, 1e-9);
  EXPECT_NEAR(*log.fixes[0].absolute_height_m, 584, 1e-9);
  EXPECT_EQ(log.fixes[0].height_above_takeoff_m, 7.5);
  EXPECT_NEAR(*log.zero_utc_s, *base::parse_iso_time_s("2018-05-05T23:59:42.25Z"), 1e-6);
}

TEST_F(Dataflash, WhatIsNoMessageIsPassedOverAndCounted) {
  const Telemetry log = read(kFormats + kGps + gps({1, 45, 2}) + gps({2, 45}) + std::string(50, '\xEE') +
                             "\xA3\x95\xC8" + gps({3, 45}) + gps({4, 45}).substr(0, 30));
  EXPECT_EQ(log.fixes.size(), 2u);
  EXPECT_THAT(log.warnings, ElementsAre("1 entries dropped: no position fix", "53 unreadable bytes skipped",
                                        "the file ends within a message; everything before it is used"));
}

TEST_F(Dataflash, UnusableFilesAreOneClearLine) {
  EXPECT_THAT(fault(""), HasSubstr("log.bin: is not an ArduPilot log"));
  EXPECT_THAT(fault(gps({1, 45})), HasSubstr("is not an ArduPilot log"));
  EXPECT_THAT(fault(kFormats + kGps), HasSubstr("contains no position messages"));
  EXPECT_THAT(fault(kFormats + kGps + gps({1, 45, 1})),
              HasSubstr("none of its 1 position messages has a time and a position"));
  EXPECT_THAT([&] { read_dataflash(folder_ / "absent.bin"); },
              ThrowsMessage<InputError>(HasSubstr("absent.bin: cannot be opened")));
}

/// Formats shorter than their fields, without length, with unknown letters, or of FMT's own type.
TEST_F(Dataflash, FormatsThatCannotBe) {
  const auto claimed = [](std::uint8_t type, std::uint8_t length, const std::string& letters) {
    return message(128, base::to_raw_bytes(type) + base::to_raw_bytes(length) + padded("GPS", 4) + padded(letters, 16) +
                            padded("TimeUS,Lat,Lng", 64));
  };
  EXPECT_THAT(fault(kFormats + claimed(10, 0, "QLL") + gps({1, 45})), HasSubstr("contains no position"));
  EXPECT_THAT(fault(kFormats + claimed(10, 12, "QLL") + message(10, std::string(9, '\1'))), HasSubstr("no position"));
  EXPECT_THAT(fault(kFormats + claimed(10, 19, "?LL") + message(10, std::string(16, '\1'))), HasSubstr("no position"));
  EXPECT_THAT(fault(claimed(128, 4, "QLL") + claimed(10, 3, "") + "\xA3\x95\x0A"), HasSubstr("no position"));
}

TEST_F(Dataflash, CutAtEveryByteGivesTheWholeMessagesBefore) {
  const std::string first = kFormats + kGps + kAtt + att(1, 0, 0, 0) + gps({1, 45});
  const std::string whole = first + gps({2, 45});
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    const std::string text = whole.substr(0, bytes);
    if (bytes < first.size()) {
      EXPECT_NE(fault(text), "no error") << bytes;
      continue;
    }
    const Telemetry log = read(text);
    EXPECT_EQ(log.fixes.size(), 1u) << bytes;
    EXPECT_EQ(log.warnings.size(), bytes == first.size() ? 0u : 1u) << bytes;
  }
  EXPECT_EQ(read(whole).fixes.size(), 2u);
}

TEST_F(Dataflash, EachByteChangedIsReadOrRefused) {
  const std::string whole = kFormats + kUnits + kGps + kImu +
                            message(3, base::to_raw_bytes(std::uint64_t{0}) + base::to_raw_bytes(std::uint8_t{10}) +
                                           padded("", 16) + padded("F--C---GG", 16)) +
                            imu(1, 2) + gps({1, 45}) + gps({2, 45});
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const char changed : {'\0', '\x7F', '\xFF'}) {
      std::string bytes = whole;
      bytes[at] = changed;
      EXPECT_THAT(fault(bytes), AnyOf("no error", HasSubstr("log.bin: "))) << at;
    }
  }
}

}  // namespace
}  // namespace tileflight::flight_logs::dataflash_log_test
