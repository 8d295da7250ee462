#include <gmock/gmock.h>

#include <cstdio>

#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/test_log.h"

namespace tileflight::flight_logs::nmea_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A sentence with its checksum.
std::string sentence(const std::string& body) {
  unsigned sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  char digits[8];
  std::snprintf(digits, sizeof digits, "*%02X\r\n", sum);
  return "$" + body + digits;
}

std::string gga(const std::string& clock,
                const std::string& more = "4807.038,N,01131.500,W,1,08,0.9,545.4,M,46.9,M,,") {
  return sentence("GPGGA," + clock + "," + more);
}
std::string rmc(const std::string& clock, const std::string& date) {
  return sentence("GNRMC," + clock + ",A,4807.038,N,01131.500,W,022.4,084.4," + date + ",003.1,W");
}

class Nmea : public LogTest {
 protected:
  Nmea() : LogTest("log.nmea", read_telemetry) {}
};

TEST_F(Nmea, DegreesAndMinutesHemisphereAndHeightsAreRead) {
  const Telemetry log = read(rmc("123519.00", "230394") + gga("123519.00") + gga("123519.50"));
  ASSERT_EQ(log.fixes.size(), 2U);
  EXPECT_NEAR(log.fixes[0].latitude_deg, 48.0 + 7.038 / 60, 1e-12);
  EXPECT_NEAR(log.fixes[0].longitude_deg, -(11.0 + 31.5 / 60), 1e-12) << "W is west";
  EXPECT_NEAR(*log.fixes[0].absolute_height_m, 545.4 + 46.9, 1e-9) << "sea level and the geoid's height";
  EXPECT_EQ(log.height_datum, HeightDatum::kEllipsoid);
  EXPECT_NEAR(log.fixes[1].time_s, 0.5, 1e-6);
  EXPECT_EQ(log.zero_utc_s, 3920186119.0) << "two digits of the year are of this century";
  EXPECT_THAT(log.warnings, testing::IsEmpty());
}

TEST_F(Nmea, MidnightIsPassed) {
  const Telemetry log = read(rmc("235959.00", "311223") + gga("235959.00") + gga("000001.00"));
  ASSERT_EQ(log.fixes.size(), 2U);
  EXPECT_NEAR(log.fixes[1].time_s, 2.0, 1e-6);
  EXPECT_EQ(log.zero_utc_s, 1704067199.0);
}

TEST_F(Nmea, WithoutTheGeoidHeightsAreAboveSeaLevel) {
  const Telemetry log = read(gga("123519", "4807.038,S,01131.500,E,1,08,0.9,545.4,M,,M,,"));
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_LT(log.fixes.at(0).latitude_deg, 0.0);
  EXPECT_THAT(log.warnings, ElementsAre(HasSubstr("no sentence states the date")));
}

TEST_F(Nmea, WhatIsDamagedOrWithoutAFixIsCounted) {
  const Telemetry log =
      read("header of a logger\r\n" + gga("123519") + "$GPGGA,123520,4807.038,N,01131.5,E,1,8,1,1,M,1,M,,*00\n" +
           gga("123521", ",,,,0,00,,,M,,M,,") + rmc("123521", "230324"));
  EXPECT_EQ(log.fixes.size(), 1U);
  EXPECT_THAT(log.warnings, ElementsAre(HasSubstr("1 entries dropped: no position fix"),
                                        HasSubstr("1 sentences dropped: their checksum")));
}

TEST_F(Nmea, SentencesWithoutAPositionAreOneClearLine) {
  EXPECT_THAT(fault(sentence("GPGSA,A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1")),
              HasSubstr("contains no GGA and RMC sentences"));
}

TEST_F(Nmea, WrongChecksumsAreNamedWhereTheyLeaveNoPosition) {
  std::string wrong = gga("123519");
  wrong[10] ^= 1;
  EXPECT_THAT(fault(wrong + wrong), HasSubstr("that can be read (2 sentences dropped: their checksum is wrong)"));
}

}  // namespace
}  // namespace tileflight::flight_logs::nmea_test
