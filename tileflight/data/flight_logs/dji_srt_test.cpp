#include <gmock/gmock.h>

#include <cmath>

#include "tests/test_data.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/test_log.h"

namespace tileflight::flight_logs::telemetry_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class TelemetryText : public LogTest {
 protected:
  TelemetryText() : LogTest("log.srt", read_dji_srt) {}
};

TEST_F(TelemetryText, BracketedKeysWithHeightsAndGimbal) {
  const Telemetry log = read(
      "1\r\n00:00:01,500 --> 00:00:01,533\r\n<font size=\"28\">FrameCnt: 1, DiffTime: 33ms\r\n2023-02-21 "
      "10:14:03.000\r\n"
      "[iso: 100] [latitude: -0.241013] [longitude: -78.518213] [rel_alt: 38.000 abs_alt: 2933.438] "
      "[gb_yaw: 139.7 gb_pitch: -27.8 gb_roll: 0.5] </font>\r\n\r\n");
  ASSERT_EQ(log.fixes.size(), 1u);
  const TelemetryFix& fix = log.fixes[0];
  EXPECT_DOUBLE_EQ(fix.time_s, 1.5);
  EXPECT_DOUBLE_EQ(fix.latitude_deg, -0.241013);
  EXPECT_DOUBLE_EQ(fix.longitude_deg, -78.518213);
  EXPECT_EQ(fix.absolute_height_m, 2933.438);
  EXPECT_EQ(fix.height_above_takeoff_m, 38.0);
  EXPECT_EQ(fix.gimbal_yaw_deg, 139.7);
  EXPECT_EQ(fix.gimbal_pitch_deg, -27.8);
  EXPECT_EQ(fix.gimbal_roll_deg, 0.5);
  EXPECT_EQ(log.height_datum, HeightDatum::kUnknown);
  EXPECT_TRUE(log.warnings.empty());
}

TEST_F(TelemetryText, EntriesWithoutFixAreDroppedAndCounted) {
  const Telemetry log = read(
      "1\n00:00:00,000 --> 00:00:01,000\n[latitude: 0.000000] [longitude: 0.000000]\n\n"
      "2\n00:00:01,000 --> 00:00:02,000\nGPS(N/A,N/A,3) BAROMETER:0.0\n\n"
      "3\n00:00:02,000 --> 00:00:03,000\n[latitude: 95.0] [longitude: 10.0]\n\n"
      "4\n00:00:03,000 --> 00:00:04,000\n[latitude: 45.0] [longitude: 10.0]\n\n"
      "5\n00:00:03,000 --> 00:00:04,000\n[latitude: 45.1] [longitude: 10.0]\n\n"
      "6\n[latitude: 45.2] [longitude: 10.0]\n");
  ASSERT_EQ(log.fixes.size(), 1u);
  EXPECT_DOUBLE_EQ(log.fixes[0].latitude_deg, 45.0);
  EXPECT_THAT(log.warnings, ElementsAre("1 entries dropped: no time", "2 entries dropped: no position fix",
                                        "1 entries dropped: latitude or longitude out of range",
                                        "1 entries dropped: time does not increase"));
}

/// Entries as published of drones whose files are not among the test data.
TEST_F(TelemetryText, AttitudesAndCorrectedPositions) {
  const auto entry = [](const std::string& text) { return "1\n00:00:35,000 --> 00:00:36,000\n" + text + "\n"; };
  const TelemetryFix rtk =
      read(entry("F/6.3, SS 60, ISO 100, EV 0, RTK (120.083799, 30.213635, 28), HOME (120.084146, 30.214243, 103.55m), "
                 "D 75.36m, H 76.19m, H.S 0.30m/s, V.S 0.00m/s, F.PRY (-5.3\u00B0, 2.1\u00B0, 28.3\u00B0), G.PRY "
                 "(-40.0\u00B0, 0.0\u00B0, 28.2\u00B0)"))
          .fixes.at(0);
  EXPECT_DOUBLE_EQ(rtk.longitude_deg, 120.083799);
  EXPECT_DOUBLE_EQ(rtk.latitude_deg, 30.213635);
  EXPECT_EQ(rtk.absolute_height_m, std::nullopt) << "28 satellites";
  EXPECT_EQ(rtk.height_above_takeoff_m, 76.19);
  EXPECT_EQ(rtk.body_pitch_deg, -5.3);
  EXPECT_EQ(rtk.body_roll_deg, 2.1);
  EXPECT_EQ(rtk.body_yaw_deg, 28.3);
  EXPECT_EQ(rtk.gimbal_pitch_deg, -40.0);
  EXPECT_EQ(rtk.gimbal_yaw_deg, 28.2);
  const TelemetryFix enterprise =
      read(
          entry("<font size=\"36\">FrameCnt : 4, DiffTime : 114ms\n2022-09-08 06:26:55,549,370\n[color_md : default] "
                "[latitude: -36.885326] [longtitude: 174.697242] [altitude: 28.736000] [Drone: Yaw:-146.0, Pitch:-0.6, "
                "Roll:1.3] </font>"))
          .fixes.at(0);
  EXPECT_DOUBLE_EQ(enterprise.longitude_deg, 174.697242);
  EXPECT_EQ(enterprise.absolute_height_m, 28.736);
  EXPECT_EQ(enterprise.body_yaw_deg, -146.0);
  EXPECT_EQ(enterprise.body_pitch_deg, -0.6);
  EXPECT_EQ(enterprise.body_roll_deg, 1.3);
  EXPECT_EQ(enterprise.gimbal_yaw_deg, std::nullopt);
  const TelemetryFix both =
      read(
          entry("[latitude: 41.3] [longitude: -81.3] [rel_alt: 50.6 abs_alt: 300] [Drone: Yaw:1.9,Pitch:-3.1,Roll:1.5] "
                "[Gimbal: Yaw:10.0, Pitch:-45.0, Roll:0.0]"))
          .fixes.at(0);
  EXPECT_EQ(both.body_pitch_deg, -3.1);
  EXPECT_EQ(both.gimbal_yaw_deg, 10.0);
  EXPECT_EQ(both.gimbal_pitch_deg, -45.0);
  const TelemetryFix avata = read(entry("GPS(39.906217,116.391305,69.800) BAROMETER(91.2)")).fixes.at(0);
  EXPECT_DOUBLE_EQ(avata.latitude_deg, 39.906217);
  EXPECT_EQ(avata.absolute_height_m, 69.8);
  EXPECT_EQ(avata.height_above_takeoff_m, 91.2);
  const TelemetryFix spaced = read(entry("[latitude : 40.7128] [longitude : -74.0060] [altitude: 150.0]\n[gb_yaw : "
                                         "45.2] [gb_pitch : -15.3] [gb_roll : 0.1]</font>"))
                                  .fixes.at(0);
  EXPECT_EQ(spaced.gimbal_yaw_deg, 45.2);
  EXPECT_EQ(spaced.gimbal_roll_deg, 0.1);
  const TelemetryFix autel = read(entry("HOME(W: 109.3, N: 40.7) 2025-08-27 13:21:35\nGPS(W: 109.339287, N: 40.768574, "
                                        "2371.76m)"))
                                 .fixes.at(0);
  EXPECT_DOUBLE_EQ(autel.longitude_deg, -109.339287);
  EXPECT_EQ(autel.absolute_height_m, 2371.76);
}

TEST_F(TelemetryText, FeetAndRadiansAreReadByTheirUnits) {
  const auto entry = [](const std::string& text) { return "1\n00:00:01,000 --> 00:00:02,000\n" + text + "\n"; };
  for (const char* const text : {"GPS (8.2, 47.4, 18), D 49.21ft, H 100ft", "GPS (8.2, 47.4, 18), H 100 ft",
                                 "[latitude: 47.4] [longitude: 8.2] [rel_alt: 100.0ft abs_alt: 1000 ft]"}) {
    const Telemetry log = read(entry(text));
    EXPECT_NEAR(log.fixes[0].height_above_takeoff_m.value(), 30.48, 1e-9) << text;
    EXPECT_NEAR(log.fixes[0].absolute_height_m.value_or(304.8), 304.8, 1e-9) << text;
  }
  const Telemetry turned = read(entry("[latitude: 47.4] [longitude: 8.2] [gb_yaw: 0.5rad gb_pitch: -1.5 rad]"));
  EXPECT_NEAR(turned.fixes[0].gimbal_yaw_deg.value(), 28.6479, 1e-3);
  EXPECT_NEAR(turned.fixes[0].gimbal_pitch_deg.value(), -85.9437, 1e-3);
  EXPECT_THAT([&] { read(entry("GPS (8.2, 47.4, 18), H 100yd")); },
              ThrowsMessage<InputError>(HasSubstr("'100yd' is no number")));
}

TEST_F(TelemetryText, ZoomIsReadAndNamedWhereItChanges) {
  const auto warnings = [&](const std::vector<std::string>& entries) {
    std::string text;
    for (std::size_t i = 0; i < entries.size(); ++i)
      text += std::to_string(i + 1) + "\n00:00:0" + std::to_string(i) +
              ",500 --> 00:00:09,000\n[latitude: 47.4] [longitude: 8.2] " + entries[i] + "\n\n";
    return find_zoom_warnings(read(text).zooms, "the subtitles");
  };
  EXPECT_THAT(
      warnings({"[focal_len : 240] [dzoom_ratio: 10000, delta:0]", "[focal_len : 240] [dzoom_ratio: 10000, delta:0]"}),
      testing::IsEmpty());
  EXPECT_THAT(warnings({"[focal_len: 24.00]", "[focal_len: 24.00]", "[focal_len: 30.00]", "[focal_len: 48.00]",
                        "[focal_len: 48.00]"}),
              ElementsAre(HasSubstr("the focal length changes by a factor of 2 (24 to 48) between 1.50 s and 3.50 s")));
  EXPECT_THAT(warnings({"[focal_len: 24.00] [dzoom_ratio: 1.00]", "[focal_len: 24.00] [dzoom_ratio: 2.00]"}),
              ElementsAre(HasSubstr("the digital zoom changes by a factor of 2 (1 to 2) between 0.50 s and 1.50 s")));
  EXPECT_THAT(warnings({"[focal_len: 24.00] [dzoom_ratio: 20000, delta:0]"}),
              ElementsAre(HasSubstr("a digital zoom of 2 was set")));
}

/// Programs and locales write numbers and axes in their own ways; none may become another place.
TEST_F(TelemetryText, NumbersOfOtherLocalesAndMakersAreReadOrRefused) {
  const auto entry = [](const std::string& text) { return "1\n00:00:01,000 --> 00:00:02,000\n" + text + "\n"; };
  const auto expect_place = [&](const std::string& text, double latitude_deg, double longitude_deg,
                                std::optional<double> height_m) {
    const Telemetry log = read(entry(text));
    ASSERT_EQ(log.fixes.size(), 1u) << text;
    EXPECT_DOUBLE_EQ(log.fixes[0].latitude_deg, latitude_deg) << text;
    EXPECT_DOUBLE_EQ(log.fixes[0].longitude_deg, longitude_deg) << text;
    EXPECT_EQ(log.fixes[0].absolute_height_m, height_m) << text;
  };
  expect_place("[latitude: 47,000119] [longitude: -8,5] [rel_alt: 1,5 abs_alt: 511,9]", 47.000119, -8.5, 511.9);
  expect_place("[latitude: 33.5 S] [longitude: 151.25 E] [altitude: 12.0]", -33.5, 151.25, 12.0);
  expect_place("latitude: 33.5 S longitude: 151.25 E altitude: 12.0m", -33.5, 151.25, 12.0);
  expect_place("[latitude: 47° 30' 0\" N] [longitude: 8° 15' 0\" W]", 47.5, -8.25, std::nullopt);
  expect_place("GPS (8,2090, 47,4692, 18), D 49,21m, H 45,60m", 47.4692, 8.209, std::nullopt);
  expect_place("GPS(E:149.022705, N:-35.285755, 600.46m)", -35.285755, 149.022705, 600.46);
  expect_place("GPS(W:70.5, S:33.25, 600.5m)", -33.25, -70.5, 600.5);
  for (const char* text : {"[latitude: 47.0.1] [longitude: 8.0]", "[latitude: 47° 30'] [longitude: 8.0]",
                           "GPS(8,2090,47,4692,18)", "[latitude: 47.1] [longitude: 8.0] [abs_alt: 5x0.0]"})
    EXPECT_THAT(fault(entry(text)), testing::StartsWith((folder_ / "log.srt, entry 1: ").string())) << text;
}

TEST_F(TelemetryText, TimesAreTheNearestNumbersToWhatIsWritten) {
  const auto time_s = [&](const std::string& stamp) {
    return read("1\n" + stamp + " --> 00:00:09,000\n[latitude: 45.0] [longitude: 10.0]\n").fixes.at(0).time_s;
  };
  EXPECT_EQ(time_s("00:00:00,700"), 0.7);
  EXPECT_EQ(time_s("00:00:01,700"), 1.7);
  EXPECT_EQ(time_s("00:00:01.250000"), 1.25);
}

TEST_F(TelemetryText, UnusableFilesAreOneClearLine) {
  EXPECT_THAT(fault(""), HasSubstr("log.srt: no subtitle entries"));
  EXPECT_THAT(fault("hello\nworld\n"), HasSubstr("no subtitle entries"));
  EXPECT_THAT(fault("1"), HasSubstr("none of the 1 entries has a time and a position"));
  EXPECT_THAT(fault("1\n00:00:00,000 --> 00:00:01,000\n[iso: 100]\n"), HasSubstr("no position fix"));
  EXPECT_THAT(fault("1\n00:00:00,000 --> 00:00:01,000\n[latitude: nan] [longitude: 5]\n"),
              HasSubstr("no position fix"));
  EXPECT_THAT([&] { read_dji_srt(folder_ / "absent.srt"); },
              ThrowsMessage<InputError>(HasSubstr("absent.srt: cannot be opened")));
}

TEST_F(TelemetryText, DistinctFixesKeepTheFirstOfEachHeldPosition) {
  std::string text;
  for (int i = 0; i < 9; ++i) {
    text += std::to_string(i + 1) + "\n00:00:0" + std::to_string(i) + ",000 --> 00:00:09,000\n[latitude: 1." +
            std::to_string(i / 3) + "] [longitude: 2.0] [abs_alt: 7]\n\n";
  }
  const std::vector<TelemetryFix> fixes = distinct_fixes(read(text));
  ASSERT_EQ(fixes.size(), 3u);
  EXPECT_DOUBLE_EQ(fixes[0].time_s, 0.0);
  EXPECT_DOUBLE_EQ(fixes[1].time_s, 3.0);
  EXPECT_DOUBLE_EQ(fixes[2].time_s, 6.0);
}

/// Known values of each real log, determined by hand from the text: number of fixes, and the first one.
struct KnownLog {
  const char* name;
  std::size_t fixes;
  double time_s, latitude_deg, longitude_deg;
  std::optional<double> absolute_height_m, height_above_takeoff_m, gimbal_pitch_deg;
};

void PrintTo(const KnownLog& known, std::ostream* out) { *out << known.name; }

class RealLog : public testing::TestWithParam<KnownLog> {};

TEST_P(RealLog, IsReadInItsOwnOrderAndUnits) {
  const KnownLog& known = GetParam();
  TILEFLIGHT_REQUIRE_TEST_DATA(file, std::string("logs/dji_srt/") + known.name);
  const Telemetry log = read_dji_srt(file);
  ASSERT_EQ(log.fixes.size(), known.fixes);
  const TelemetryFix& first = log.fixes.front();
  EXPECT_DOUBLE_EQ(first.time_s, known.time_s);
  EXPECT_DOUBLE_EQ(first.latitude_deg, known.latitude_deg);
  EXPECT_DOUBLE_EQ(first.longitude_deg, known.longitude_deg);
  EXPECT_EQ(first.absolute_height_m, known.absolute_height_m);
  EXPECT_EQ(first.height_above_takeoff_m, known.height_above_takeoff_m);
  EXPECT_EQ(first.gimbal_pitch_deg, known.gimbal_pitch_deg);
}

INSTANTIATE_TEST_SUITE_P(
    Dialects, RealLog,
    testing::Values(
        KnownLog{"air2s.srt", 17, 0, 41.424724, 2.234156, 117.0, {}, {}},
        KnownLog{"mavic_air2.srt", 25, 0, 41.420684, 2.162162, 27.3, {}, {}},
        KnownLog{"mavic_2pro_new.SRT", 8952, 0, -35.080155, -60.286702, {}, {}, {}},
        KnownLog{"mavic_2_style.SRT", 468 - 5, 0, -20.2533, 149.0251, {}, {}, {}},  // five seconds are written twice
        KnownLog{"mavic_mini.SRT", 117, 0, 48.0771, -121.7458, {}, 200.7, {}},
        KnownLog{"p4p_sample.SRT", 5, 0, 47.4692, 8.2090, {}, 45.6, {}},
        KnownLog{"mavic_pro_buggy.SRT", 546 - 16, 1, 42.4668, -1.2218, {}, 0.0, {}},  // 16 entries say GPS(N/A,N/A,n)
        KnownLog{"broken_incomplete.SRT", 19, 1, -34.7383, -58.4563, {}, 20.1, {}},   // the twentieth ends early
        KnownLog{"matrice_300.srt", 381, 0, 36.6146, -6.1120, {}, 0.3, {}},
        KnownLog{"mix_p4rtk_mavic2pro.srt", 12, 904.904, -34.650200, -59.409424, {}, 17.39, -27.3}),
    [](const testing::TestParamInfo<KnownLog>& tested) {
      const std::string name = tested.param.name;
      return name.substr(0, name.find('.'));
    });

TEST(RealLogs, MixedRecordingTakesHeightsOfBothDialects) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "logs/dji_srt/mix_p4rtk_mavic2pro.srt");
  const Telemetry log = read_dji_srt(file);
  EXPECT_EQ(log.fixes.back().absolute_height_m, 120.140999);
  EXPECT_EQ(log.fixes.back().height_above_takeoff_m, std::nullopt);
}

TEST(RealLogs, DatesOfTheDialectWithoutStampsBecomeSeconds) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "logs/dji_srt/mavic_2_style.SRT");
  EXPECT_NEAR(read_dji_srt(file).fixes.back().time_s, 7 * 60 + 48, 1e-6);  // 14:11:51 to 14:19:39
}

TEST(RealLogs, WhatHoldsNoPositionIsAnError) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "logs/dji_srt");
  const auto expect_refused = [&](const char* name, const char* message) {
    EXPECT_THAT([&] { read_dji_srt(folder / name); }, ThrowsMessage<InputError>(HasSubstr(message))) << name;
  };
  expect_refused("broken_empty.SRT", "broken_empty.SRT: no subtitle entries");
  expect_refused("broken_empty2.SRT", "none of the 1 entries has a time and a position");
  expect_refused("mavic_air.SRT", "entries has a time and a position");
}

TEST(RealLogs, MachangaraPositionsAreHeldBetweenFixesAndFollowTheTruePath) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "flights/machangara-a");
  const Telemetry log = read_dji_srt(folder / "telemetry.srt");
  EXPECT_EQ(log.fixes.size(), 600u);
  const std::vector<TelemetryFix> fixes = distinct_fixes(log);
  EXPECT_EQ(fixes.size(), 200u);  // 20 s at 10 Hz
  const geometry::LocalFrame frame({-0.24, -78.52, {0.0}});
  const geometry::Trajectory truth = geometry::read_tum(folder / "groundtruth.txt");
  int compared = 0;
  for (const TelemetryFix& fix : fixes) {
    const auto T_local_camera = geometry::interpolate(truth, fix.time_s);
    if (!T_local_camera) continue;
    ++compared;
    const geometry::Vec3 position =
        frame.local_from_geodetic({fix.latitude_deg, fix.longitude_deg, {*fix.absolute_height_m}});
    EXPECT_LT((position - T_local_camera->translation).norm(), 6.0)
        << fix.time_s;  // noise, a bias of metres, a lag at 10 m/s
  }
  EXPECT_GT(compared, 100);
}

}  // namespace
}  // namespace tileflight::flight_logs::telemetry_test
