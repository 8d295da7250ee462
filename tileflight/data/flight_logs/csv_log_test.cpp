#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>

#include "tests/test_data.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/test_log.h"

namespace tileflight::flight_logs::csv_log_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

class CsvLog : public LogTest {
 protected:
  CsvLog() : LogTest("log.csv", read_csv_log) {}
};

TEST_F(CsvLog, PlainColumns) {
  const Telemetry log =
      read("time,lat,lon,alt,yaw,pitch,roll\n1.5,-0.25,-78.5,2900.5,10,-2,3\n2,-0.26,-78.5,2901,,,\n");
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[0].time_s, 1.5);
  EXPECT_EQ(log.fixes[0].latitude_deg, -0.25);
  EXPECT_EQ(log.fixes[0].longitude_deg, -78.5);
  EXPECT_EQ(log.fixes[0].absolute_height_m, 2900.5);
  EXPECT_EQ(log.fixes[0].body_yaw_deg, 10.0);
  EXPECT_EQ(log.fixes[0].body_pitch_deg, -2.0);
  EXPECT_EQ(log.fixes[0].body_roll_deg, 3.0);
  EXPECT_EQ(log.fixes[1].body_yaw_deg, std::nullopt);
  EXPECT_EQ(log.height_datum, HeightDatum::kUnknown);
  EXPECT_THAT(log.warnings, IsEmpty());
}

/// The header of decoded DJI flight records: the time as a text stands in front of the time in seconds.
TEST_F(CsvLog, AColumnOfTextDoesNotHideTheNumbers) {
  const Telemetry log = read(
      "CUSTOM.date [local],CUSTOM.updateTime [local],OSD.flyTime,OSD.flyTime [s],OSD.latitude,OSD.longitude\n"
      "1/2/2024,10:00:00,0m 0.1s,0.1,45.5,9.25\n1/2/2024,10:00:00,0m 0.2s,0.2,45.5,9.26\n");
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[1].time_s, 0.2);
  EXPECT_THAT(log.warnings, IsEmpty());
}

TEST_F(CsvLog, AColumnOfAnUnknownUnitDoesNotHideTheOneBesideIt) {
  const Telemetry log = read(
      "CUSTOM.date [local],OSD.flyTime [formatted],OSD.flyTime [s],OSD.latitude,OSD.longitude,OSD.height [ft]\n"
      "8/29/2017,0m 2.8s,2.8,39.5,-106.25,10\n8/29/2017,0m 3.2s,3.2,39.5,-106.26,20\n");
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[1].time_s, 3.2);
  EXPECT_DOUBLE_EQ(*log.fixes[1].height_above_takeoff_m, 6.096);
}

/// `rostopic echo -p` of sensor_msgs/NavSatFix, whose altitude is above the ellipsoid.
TEST_F(CsvLog, RosTablesAreReadByTheTimeOfMeasurement) {
  const std::string header =
      "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.status.status,field.status.service,"
      "field.latitude,field.longitude,field.altitude,field.position_covariance0\n";
  const Telemetry log = read(header +
                             "1700000000200000000,1,1700000000000000000,,0,1,47.5,8.25,512.5,1\n"
                             "1700000001300000000,2,1700000001000000000,,0,1,47.6,8.25,513.5,1\n");
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_NEAR(log.fixes[1].time_s, 1.0, 1e-6);
  EXPECT_EQ(log.fixes[1].latitude_deg, 47.6);
  EXPECT_EQ(log.fixes[1].longitude_deg, 8.25);
  EXPECT_EQ(log.fixes[1].absolute_height_m, 513.5);
  EXPECT_EQ(log.height_datum, HeightDatum::kEllipsoid);
  EXPECT_THAT(log.warnings, IsEmpty());
}

TEST_F(CsvLog, RosMessagesInOtherFormsAreNamed) {
  EXPECT_THAT(fault("1700000000,5000,gps,0,1,47.5,8.25,512.5\n1700000001,5000,gps,0,1,47.5,8.25,512.5\n"),
              HasSubstr("has no header, as `ros2 topic echo --csv` writes it: its first line holds numbers "
                        "(1700000000, 5000, gps, 0, 1, 47.5, 8.25, 512.5); add a line that names the columns"));
  std::string text;
  while (text.size() < (std::size_t{1} << 21U))
    text += "header: \n  seq: 1\n  stamp: \n    secs: 1\nlatitude: 47.5\nlongitude: 8.25\naltitude: 512.5\n---\n";
  for (const std::string& start : {text, "---\n" + text}) {
    base::write_file(folder_ / "fix.yaml", start);
    EXPECT_THAT(tests::refusal_of([&] { read_telemetry(folder_ / "fix.yaml"); }),
                HasSubstr("is a ROS message as text: write the topic as a table, rostopic echo -p TOPIC > FILE.csv"));
  }
}

/// FlySight's first generation: the second row states the units.
TEST_F(CsvLog, FlySightsHeightsAreAboveSeaLevel) {
  const Telemetry log = read(
      "time,lat,lon,hMSL,velN,gpsFix\n,(deg),(deg),(m),(m/s),\n2021-04-20T12:34:20.00Z,33.5,-117.75,15.5,-0.63,3\n"
      "2021-04-20T12:34:20.20Z,33.5,-117.76,16.5,-0.63,3\n");
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[1].absolute_height_m, 16.5);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
}

TEST_F(CsvLog, FlySight2sTablesAreToldApart) {
  const std::string head = "$FLYS,1\n$VAR,FIRMWARE_VER,v2024\n";
  const Telemetry log =
      read(head +
           "$COL,BARO,time,pressure\n$COL,GNSS,time,lat,lon,hMSL\n$UNIT,GNSS,s,deg,deg,m\n$DATA\n$BARO,1.5,99000\n"
           "$GNSS,2024-04-20T04:20:00.000Z,33.5,-117.75,630.5\n$GNSS,2024-04-20T04:20:00.200Z,33.5,-117.76,631.5\n");
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_NEAR(log.fixes[1].time_s - log.fixes[0].time_s, 0.2, 1e-6);
  EXPECT_EQ(log.fixes[1].absolute_height_m, 631.5);
  EXPECT_THAT([&] { read(head + "$COL,BARO,time,pressure\n$DATA\n$BARO,1.5,99000\n"); },
              ThrowsMessage<InputError>(HasSubstr("is a FlySight's file without positions: give its TRACK.CSV")));
}

TEST_F(CsvLog, AirDataWithFeetAndPreferredHeight) {
  const Telemetry log = read(
      "time(millisecond),datetime(utc),latitude,longitude,height_above_takeoff(feet),altitude_above_seaLevel(feet),"
      "speed(mph), compass_heading(degrees), pitch(degrees), roll(degrees),gimbal_heading(degrees),"
      "gimbal_pitch(degrees),altitude(feet),message\r\n"
      "200,2024-01-02 03:04:05,45.5,9.25,100,1000,5,90,1,2,91,-30,999,\"Hello, \"\"pilot\"\"\nnext line\"\r\n");
  ASSERT_EQ(log.fixes.size(), 1u);
  const TelemetryFix& fix = log.fixes[0];
  EXPECT_DOUBLE_EQ(fix.time_s, 0.2);
  EXPECT_DOUBLE_EQ(*fix.height_above_takeoff_m, 30.48);
  EXPECT_DOUBLE_EQ(*fix.absolute_height_m, 304.8);
  EXPECT_EQ(fix.body_yaw_deg, 90.0);
  EXPECT_EQ(fix.gimbal_yaw_deg, 91.0);
  EXPECT_EQ(fix.gimbal_pitch_deg, -30.0);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
}

TEST_F(CsvLog, SemicolonsWithDecimalCommasTabsQuotesAndMarks) {
  const Telemetry log =
      read("\xEF\xBB\xBFsep=;\r\n\"Time\";Latitude;Longitude;Height_ellipsoid [m]\r\n1;45,5;9,25;100,5\r\n");
  ASSERT_EQ(log.fixes.size(), 1u);
  EXPECT_EQ(log.fixes[0].latitude_deg, 45.5);
  EXPECT_EQ(log.fixes[0].absolute_height_m, 100.5);
  EXPECT_EQ(log.height_datum, HeightDatum::kEllipsoid);
  EXPECT_EQ(read("\n\nt\tlat\tlon\n \"3\" \t45\t 9 ").fixes.at(0).time_s, 3.0);
}

TEST_F(CsvLog, TimesInEveryUnitAndNotation) {
  const auto last_s = [&](const std::string& name, const std::string& first, const std::string& second) {
    return read(name + ",lat,lon\n" + first + ",45,9\n" + second + ",45,9\n").fixes.at(1).time_s;
  };
  EXPECT_DOUBLE_EQ(last_s("time_ms", "1000", "1250"), 1.25);
  EXPECT_DOUBLE_EQ(last_s("time_us", "1000", "1250000"), 1.25);
  EXPECT_DOUBLE_EQ(last_s("Time [s]", "-1", "1.25"), 1.25);
  EXPECT_NEAR(last_s("#timestamp [ns]", "1403636579763555584", "1403636581013555584"), 1.25, 1e-6);
  EXPECT_NEAR(last_s("timestamp", "1700000000", "1700000001.25"), 1.25, 1e-6);
  EXPECT_NEAR(last_s("timestamp", "1700000000000", "1700000001250"), 1.25, 1e-6);
  EXPECT_NEAR(last_s("timestamp", "1700000000000000", "1700000001250000"), 1.25, 1e-6);
  EXPECT_NEAR(last_s("time", "2024-12-31T23:59:59.75Z", "2025-01-01T01:00:01+01:00"), 1.25, 1e-6);
  EXPECT_NEAR(last_s("datetime(utc)", "2024-12-31 23:59:59", "2025-01-01 00:00:01"), 2.0, 1e-6);
  EXPECT_NEAR(last_s("date,time", "2024/12/31,23:59:59", "2025/01/01,00:00:01.5"), 2.5, 1e-6);
}

TEST_F(CsvLog, DatesWithTheYearLastAreReadWhereTheirOrderIsCertain) {
  const auto table = [](const std::string& first, const std::string& second) {
    return "date,time,lat,lon,gpsAlt\n" + first + ",11:59:59 PM,1,2,3\n" + second + ",12:00:01 AM,1,2,4\n";
  };
  for (const auto& [first, second] : {std::pair("30/04/2024", "01/05/2024"), std::pair("4/30/2024", "5/1/2024"),
                                      std::pair("03.04.2024", "04.04.2024")}) {
    const Telemetry log = read(table(first, second));
    ASSERT_EQ(log.fixes.size(), 2u) << first;
    EXPECT_EQ(log.fixes[1].time_s, 2.0) << first;
    EXPECT_EQ(log.fixes[1].absolute_height_m, 4.0);
  }
  EXPECT_THAT([&] { read(table("03/04/2024", "04/04/2024")); },
              ThrowsMessage<InputError>(HasSubstr("may have the day or the month first ('04/04/2024')")));
  const Telemetry log = read("date,time,lat,lon\n03/04/2024,11:00:00 AM,1,2\n03/04/2024,12:30:00 PM,1,2\n");
  ASSERT_EQ(log.fixes.size(), 2u) << "one day: its month does not matter";
  EXPECT_EQ(log.fixes[1].time_s, 5400.0);
}

TEST_F(CsvLog, UnitsMayEndANameWithoutABreak) {
  const Telemetry log =
      read("timeMs,latitude,longitude,heightFt,gimbalPitchRad,yaw_rad,roll [rad]\n1500,1,2,100,-1.5,0.5,0.1\n");
  ASSERT_EQ(log.fixes.size(), 1u);
  EXPECT_EQ(log.fixes[0].time_s, 1.5);
  EXPECT_NEAR(log.fixes[0].absolute_height_m.value(), 30.48, 1e-9);
  EXPECT_NEAR(log.fixes[0].gimbal_pitch_deg.value(), -85.9437, 1e-3);
  EXPECT_NEAR(log.fixes[0].body_yaw_deg.value(), 28.6479, 1e-3);
  EXPECT_NEAR(log.fixes[0].body_roll_deg.value(), 5.72958, 1e-3);
}

TEST_F(CsvLog, TheDatasetsOwnPositionsKeepTheirDatum) {
  const Telemetry log = read("t,lat,lon,height,horizontal_sigma,vertical_sigma\n0,-0.24,-78.52,2885.25,0.25,0.4\n");
  EXPECT_EQ(log.fixes.at(0).absolute_height_m, 2885.25);
  EXPECT_EQ(log.height_datum, HeightDatum::kEllipsoid);
}

TEST_F(CsvLog, UnusableRowsAreDroppedAndCounted) {
  const Telemetry log =
      read("time,lat,lon,alt\n,45,9,1\n1,,9,1\n2,0,0,1\n3,45,9,1\n3,45,9,1\n4,45,190,1\n5,45,9,\n6,45\n7,45,9,1,9,9\n");
  ASSERT_EQ(log.fixes.size(), 2u);
  EXPECT_EQ(log.fixes[1].time_s, 7.0);
  EXPECT_THAT(log.warnings, ElementsAre("1 entries dropped: no time", "3 entries dropped: no position fix",
                                        "1 entries dropped: latitude or longitude out of range",
                                        "1 entries dropped: time does not increase", "1 entries dropped: no height"));
}

TEST_F(CsvLog, UnusableFilesAreOneClearLine) {
  EXPECT_THAT(fault(""), HasSubstr("log.csv: is empty"));
  EXPECT_THAT(
      fault("a,b\x01,c\n1,2,3\n"),
      HasSubstr("no column for time, latitude, longitude in its first line, which has: a, b?, c; docs/formats.md"));
  EXPECT_THAT(fault("time,lat\n1,2\n"), HasSubstr("no column for longitude"));
  EXPECT_THAT(fault("time(fortnights),lat,lon\n1,2,3\n"),
              HasSubstr("the unit of column 'time(fortnights)' is unknown"));
  EXPECT_THAT(fault("time,lat,lon\nx,2,3\n"), HasSubstr("none of its 1 rows has a time and a position"));
  EXPECT_THAT(fault("time,lat,lon\n"), HasSubstr("contains no rows"));
  EXPECT_LT(fault(std::string(1 << 20, 'x')).size(), 1000u);
  EXPECT_THAT([&] { read_csv_log(folder_ / "absent.csv"); },
              ThrowsMessage<InputError>(HasSubstr("absent.csv: cannot be opened")));
}

TEST_F(CsvLog, CutAtEveryByteIsReadOrRefused) {
  const std::string whole =
      "\xEF\xBB\xBF\"time(millisecond)\";latitude;longitude;altitude(m)\r\n1000;45,5;9,5;\"100\"\r\n2000;45,6;9,6;"
      "101\r\n";
  const std::size_t first_row = whole.find("\n1000") + 1, second_row = whole.find("\n2000") + 1;
  for (std::size_t bytes = 0; bytes <= whole.size(); ++bytes) {
    const std::string text = whole.substr(0, bytes);
    if (bytes <= first_row) {
      EXPECT_NE(fault(text), "no error") << bytes;
    } else if (bytes >= second_row) {
      const Telemetry log = read(text);
      EXPECT_EQ(log.fixes.at(0).latitude_deg, 45.5) << bytes;
    } else {
      fault(text);
    }
  }
  EXPECT_EQ(read(whole).fixes.size(), 2u);
}

TEST_F(CsvLog, IsKnownByItsContent) {
  for (const char* name : {"log.txt", "log", "log.gpx"}) {
    std::ofstream(folder_ / name, std::ios::binary) << "time,lat,lon\n1,2,3\n";
    EXPECT_EQ(read_telemetry(folder_ / name).fixes.size(), 1u) << name;
  }
  for (const char* name : {"log.csv", "log"}) {
    std::ofstream(folder_ / name, std::ios::binary)
        << "\r\n1\r\n00:00:01,500 --> 00:00:01,533\r\n[latitude: 1] [longitude: 2]\r\n";
    EXPECT_EQ(read_telemetry(folder_ / name).fixes.at(0).time_s, 1.5) << name;
  }
}

/// Photos in the order of their folders, from 2025-04-16 06:18:29 to 2025-04-25 12:37:18.
TEST(RealCsvLog, TableOfPhotosByExifTool) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "logs/freetown_exif_csv/image_metadata.csv");
  const Telemetry log = read_telemetry(file);
  ASSERT_EQ(log.fixes.size(), 1452u);
  EXPECT_NEAR(log.fixes.back().time_s, 9 * 86400 + 6 * 3600 + 18 * 60 + 49, 1e-6);
  ASSERT_EQ(log.warnings.size(), 1u);
  EXPECT_THAT(log.warnings[0], HasSubstr("order of time"));
  EXPECT_EQ(log.height_datum, HeightDatum::kUnknown);
  const auto known = std::find_if(log.fixes.begin(), log.fixes.end(), [](const TelemetryFix& fix) {
    return fix.absolute_height_m == 390.734 && fix.body_yaw_deg == -89.6 && fix.gimbal_pitch_deg == -80.0;
  });
  ASSERT_NE(known, log.fixes.end());
  EXPECT_NEAR(known->latitude_deg, 8.0 + 27.0 / 60 + 55.22 / 3600, 1e-12);
  EXPECT_NEAR(known->longitude_deg, -(13.0 + 12.0 / 60 + 0.92 / 3600), 1e-12);
}

}  // namespace
}  // namespace tileflight::flight_logs::csv_log_test
