// An encoder of GPMF written from its documentation, apart from the reader, makes the samples.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tests/metadata_track.h"
#include "tests/refusal.h"
#include "tileflight/data/flight_logs/metadata_tracks.h"

namespace tileflight::flight_logs::gpmf_test {
namespace {

using geometry::Vec3;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pointwise;
using tests::big_endian;

/// A key with its value, padded to whole words.
std::string element(const std::string& key, char type, std::size_t size, std::size_t count, std::string value) {
  value.resize((value.size() + 3) / 4 * 4, '\xEE');  // padding may have any value
  return key + std::string(1, type) + std::string(1, static_cast<char>(size)) +
         big_endian(static_cast<std::uint16_t>(count)) + value;
}
std::string text(const std::string& key, const std::string& value) { return element(key, 'c', 1, value.size(), value); }
/// Elements within an element. Sizes above 255 are made of parts of four bytes.
std::string nest(const std::string& key, const std::string& elements) {
  return element(key, '\0', 4, elements.size() / 4, elements);
}
template <class Number>
std::string numbers(const std::string& key, char type, std::size_t columns, const std::vector<Number>& values) {
  std::string bytes;
  for (const Number value : values) bytes += big_endian(value);
  return element(key, type, columns * sizeof(Number), values.size() / columns, bytes);
}
std::string shorts(const std::string& key, std::size_t columns, const std::vector<std::int16_t>& values) {
  return numbers(key, 's', columns, values);
}
std::string camera(const std::string& streams, const std::string& name = "HERO8 Black") {
  return nest("DEVC", numbers<std::uint32_t>("DVID", 'L', 1, {1}) + text("DVNM", name) + streams);
}

/// Samples of a second each.
std::vector<base::TimedBytes> track(const std::vector<std::string>& samples) {
  std::vector<base::TimedBytes> timed;
  for (const std::string& sample : samples) {
    const auto* const data = reinterpret_cast<const std::byte*>(sample.data());
    timed.push_back({static_cast<double>(timed.size()), 1.0, {data, data + sample.size()}});
  }
  return timed;
}
Telemetry read(const std::vector<std::string>& samples, const MetadataSource& source = {.where = "a.mp4"}) {
  return read_gpmf(track(samples), source);
}
std::string fault(const std::vector<std::string>& samples) {
  return tests::refusal_of([&] { read(samples); });
}

/// A sample's GPS5 of two rows: 47.1 north, 8.2 east, 500 and 501 m, moved by `east` units of 1e-7 degrees.
std::string gps5(int east, std::uint32_t fix = 3, std::uint16_t dilution = 154, const std::string& more = "",
                 const std::string& utc = "191118234514.000") {
  return nest("STRM", numbers<std::uint32_t>("GPSF", 'L', 1, {fix}) + element("GPSU", 'U', 16, 1, utc) +
                          numbers<std::uint16_t>("GPSP", 'S', 1, {dilution}) + more +
                          numbers<std::int32_t>("SCAL", 'l', 1, {10000000, 10000000, 1000, 1000, 100}) +
                          numbers<std::int32_t>("GPS5", 'l', 5,
                                                {471000000, 82000000 + east, 500000, 0, 0, 471000000,
                                                 82000000 + east + 100, 501000, 0, 0}));
}

TEST(Gpmf, PositionsAreSpreadOverTheirSamples) {
  const Telemetry log = read({camera(gps5(0)), camera(gps5(200))});
  ASSERT_EQ(log.fixes.size(), 4U);
  EXPECT_EQ(log.fixes[0].time_s, 0.0);
  EXPECT_EQ(log.fixes[1].time_s, 0.5);
  EXPECT_EQ(log.fixes[3].time_s, 1.5);
  EXPECT_NEAR(log.fixes[3].latitude_deg, 47.1, 1e-12);
  EXPECT_NEAR(log.fixes[3].longitude_deg, 8.20003, 1e-12);
  EXPECT_EQ(*log.fixes[3].absolute_height_m, 501.0);
  EXPECT_EQ(log.height_datum, HeightDatum::kEllipsoid) << "GoPro's developers, gpmf-parser issues 4 and 81";
  EXPECT_EQ(log.device, "HERO8 Black");
  EXPECT_THAT(log.warnings, IsEmpty());
}

/// 18 November 2019, 23:45:14 UTC, of the first sample, which begins with the video.
TEST(Gpmf, TheReceiversTimeIsThatOfTheVideosBeginning) {
  const Telemetry log = read({camera(gps5(0)), camera(gps5(200, 3, 154, "", "191118234515.000"))});
  EXPECT_NEAR(*log.zero_utc_s, 1574120714.0, 1e-6);
}

TEST(Gpmf, AClockThatLeavesTheVideosIsNamed) {
  const Telemetry log = read({camera(gps5(0)), camera(gps5(200, 3, 154, "", "191118234544.000"))});
  EXPECT_THAT(log.warnings, ElementsAre(HasSubstr("the receiver's clock leaves the video's by 29.0 s")));
}

TEST(Gpmf, PositionsWithoutAGoodFixAreDroppedAndCounted) {
  const Telemetry log =
      read({camera(gps5(0, 0, 9999)), camera(gps5(0, 2)), camera(gps5(0, 3, 500)), camera(gps5(200, 3, 499))});
  ASSERT_EQ(log.fixes.size(), 2U);
  EXPECT_EQ(log.fixes[0].time_s, 3.0);
  EXPECT_THAT(log.warnings, ElementsAre("4 positions dropped: the receiver had no three-dimensional fix",
                                        "2 positions dropped: the receiver's dilution of precision was 5 or more"));
}

TEST(Gpmf, ATrackWithoutAnyGoodFixIsRefusedWithTheReason) {
  EXPECT_THAT(fault({camera(gps5(0, 0))}),
              AllOf(HasSubstr("a.mp4"), HasSubstr("holds no positions"), HasSubstr("no three-dimensional fix")));
}

TEST(Gpmf, ZeroCoordinatesAreNoPosition) {
  const std::string zero = nest("STRM", numbers<std::int32_t>("GPS5", 'l', 5, {0, 0, 0, 0, 0}));
  const Telemetry log = read({camera(zero), camera(gps5(0))});
  EXPECT_EQ(log.fixes.size(), 2U);
  EXPECT_THAT(log.warnings, Contains("1 entries dropped: no position fix"));
}

TEST(Gpmf, TheReferenceOfHeightsIsWhatTheCameraSays) {
  EXPECT_EQ(read({camera(gps5(0, 3, 100, text("GPSA", "MSLV")))}).height_datum, HeightDatum::kMeanSeaLevel);
  const Telemetry other = read({camera(gps5(0, 3, 100, text("GPSA", "ABCD")))});
  EXPECT_EQ(other.height_datum, HeightDatum::kUnknown);
  EXPECT_THAT(other.warnings, ElementsAre(HasSubstr("is called 'ABCD' (GPSA)")));
  const Telemetry mixed = read({camera(gps5(0)), camera(gps5(200, 3, 100, text("GPSA", "MSLV")))});
  EXPECT_EQ(mixed.height_datum, HeightDatum::kUnknown);
  EXPECT_THAT(mixed.warnings, Contains(HasSubstr("changes within the recording")));
}

/// GPS9 of a HERO11: each row has its day since 2000, second of the day, dilution and fix.
std::string gps9(const std::vector<std::pair<double, int>>& seconds_and_fix) {
  std::string rows;
  for (const auto& [seconds, fix] : seconds_and_fix) {
    for (const std::int32_t number :
         {471000000, 82000000 + static_cast<int>(1000 * seconds), 500000, 0, 0, 9000, static_cast<int>(1000 * seconds)})
      rows += big_endian(number);
    rows += big_endian(std::uint16_t{120}) + big_endian(static_cast<std::uint16_t>(fix));
  }
  return nest("STRM",
              text("GPSA", "MSLV") + text("TYPE", "lllllllSS") +
                  numbers<std::int32_t>("SCAL", 'l', 1, {10000000, 10000000, 1000, 1000, 100, 1, 1000, 100, 1}) +
                  element("GPS9", '?', 32, seconds_and_fix.size(), rows));
}

TEST(Gpmf, Gps9HasAFixInEachRowAndComesBeforeGps5) {
  const Telemetry log = read({camera(gps9({{0.0, 0}, {0.25, 3}, {0.5, 3}, {0.75, 3}}) + gps5(0))});
  ASSERT_EQ(log.fixes.size(), 3U);
  EXPECT_EQ(log.fixes[0].time_s, 0.25);
  EXPECT_NEAR(log.fixes[0].longitude_deg, 8.200025, 1e-9);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_NEAR(*log.zero_utc_s, 946684800.0 + 9000 * 86400.0, 1e-6);
  EXPECT_THAT(log.warnings, ElementsAre("1 positions dropped: the receiver had no three-dimensional fix"));
}

/// Readings of an inertial unit whose channels have the order of `orin`; no ORIN if it is empty. At rest and upright
/// but for `rate`; values in GoPro's axes: X left, Y back, Z up.
struct Unit {
  std::string orin = "ZXY";
  Vec3 force = Vec3(0, 0, 9.81), rate = Vec3(0.1, 0.2, 0.3);
  std::string more = "";
  int rows = 100;
  std::optional<std::uint64_t> stamp_us{};

  std::string stream(const std::string& key, const Vec3& value, std::int16_t scale, const std::string& unit) const {
    std::vector<std::int16_t> rows_of;
    for (int i = 0; i < rows; ++i) {
      for (const char letter : orin.empty() ? std::string("ZXY") : orin) {
        const bool is_opposite = letter >= 'x';
        const double axis = value[letter - (is_opposite ? 'x' : 'X')];
        rows_of.push_back(static_cast<std::int16_t>(std::lround(scale * (is_opposite ? -axis : axis))));
      }
    }
    return nest("STRM", (stamp_us ? numbers<std::uint64_t>("STMP", 'J', 1, {*stamp_us}) : "") +
                            (orin.empty() ? "" : text("ORIN", orin) + text("ORIO", "ZXY")) + more + text("SIUN", unit) +
                            shorts("SCAL", 1, {scale}) + shorts(key, 3, rows_of));
  }
  std::string both() const { return stream("ACCL", force, 418, "m/s\xB2") + stream("GYRO", rate, 3755, "rad/s"); }
};

TEST(Gpmf, ReadingsAreInTheCamerasAxes) {
  for (const std::string order : {"ZXY", "YxZ", "XzY", "zxY"}) {
    const Telemetry log = read({camera(Unit{.orin = order}.both())});
    ASSERT_EQ(log.inertial.size(), 100U) << order;
    const geometry::ImuSample& reading = log.inertial[50];
    EXPECT_NEAR(reading.time_s, 0.5, 1e-12);
    EXPECT_NEAR((reading.specific_force_m_s2 - Vec3(0, -9.81, 0)).norm(), 0.0, 3e-3) << "up is against y";
    EXPECT_NEAR((reading.angular_rate_rad_s - Vec3(-0.1, -0.3, -0.2)).norm(), 0.0, 3e-4) << order;
    EXPECT_THAT(log.warnings, IsEmpty());
  }
}

/// GoPro's documentation: SCAL 418, ACCL 4418, -628, -571 of a HERO5, in the order up, left, back.
TEST(Gpmf, AHero5SaysNothingOfItsAxesAndHasItsOwn) {
  const std::string example =
      nest("STRM", text("STNM", "Accelerometer (up/down, right/left, forward/back)") + text("SIUN", "m/s\xB2") +
                       shorts("SCAL", 1, {418}) + shorts("ACCL", 3, {4418, -628, -571, 4418, -628, -571}));
  const Unit turning{.orin = "", .rows = 100};
  const Telemetry log = read({camera(example + turning.stream("GYRO", Vec3(0.1, 0.2, 0.3), 3755, "rad/s"), "Camera")});
  ASSERT_FALSE(log.inertial.empty());
  EXPECT_NEAR((log.inertial[10].specific_force_m_s2 - Vec3(628, -4418, 571) / 418.0).norm(), 0.0, 1e-12);
  EXPECT_THAT(log.warnings, ElementsAre(HasSubstr("does not state the axes of its inertial unit")));
  EXPECT_EQ(log.device, "");
}

/// The matrix of a HERO6: MTRX times the channels in the order of ORIN are those in the order of ORIO.
TEST(Gpmf, TheMatrixMayCalibrateTheAxesButNotContradictThem) {
  const auto with = [](const std::vector<float>& matrix) {
    return read({camera(Unit{.orin = "YxZ", .more = numbers<float>("MTRX", 'f', 9, matrix)}.both() + gps5(0))});
  };
  const float tilt = std::sin(0.1F);
  const Telemetry tilted = with({tilt, 0, std::cos(0.1F), 0, -1, 0, std::cos(0.1F), 0, -tilt});
  ASSERT_FALSE(tilted.inertial.empty());
  EXPECT_NEAR((tilted.inertial[9].specific_force_m_s2 - 9.81 * Vec3(0, -std::cos(0.1), std::sin(0.1))).norm(), 0.0,
              5e-3);
  const Telemetry contradicted = with({1, 0, 0, 0, 1, 0, 0, 0, 1});
  EXPECT_THAT(contradicted.inertial, IsEmpty());
  EXPECT_THAT(contradicted.warnings, ElementsAre(HasSubstr("ORIN and by MTRX contradict")));
}

/// A quarter turn clockwise makes what was right in the stored image down in the shown one.
TEST(Gpmf, ReadingsTurnWithTheFrames) {
  Unit lying;
  lying.force = Vec3(-9.81, 0, 0);  // up is to the right of the stored image
  const Telemetry turned = read_gpmf(track({camera(lying.both() + gps5(0))}), {.where = "a.mp4", .quarter_turns = 3});
  ASSERT_FALSE(turned.inertial.empty());
  EXPECT_NEAR((turned.inertial[0].specific_force_m_s2 - Vec3(0, -9.81, 0)).norm(), 0.0, 3e-3);
  const Telemetry over = read_gpmf(track({camera(lying.both() + gps5(0))}), {.where = "a.mp4", .quarter_turns = 1});
  EXPECT_THAT(over.inertial, IsEmpty()) << "upside down";
}

TEST(Gpmf, ReadingsThatWouldMisleadAreLeftOutWithTheReason) {
  const auto reason = [](const std::string& streams, const std::string& settings = "") {
    const auto* const data = reinterpret_cast<const std::byte*>(settings.data());
    const Telemetry log =
        read_gpmf(track({camera(streams + gps5(0))}), {.where = "a.mp4", .settings = {data, settings.size()}});
    EXPECT_THAT(log.inertial, IsEmpty());
    return log.warnings;
  };
  const Unit unit;
  EXPECT_THAT(reason(Unit{.force = Vec3(0, 0, -9.81)}.both()), ElementsAre(HasSubstr("upside down (by 180 degrees)")));
  EXPECT_THAT(reason(Unit{.force = Vec3(0, 0, 1.0)}.both()), ElementsAre(HasSubstr("1.0 m/s^2, which is not gravity")));
  EXPECT_THAT(reason(Unit{.rows = 30}.both()), ElementsAre(HasSubstr("30.0 a second, as in a time lapse")));
  EXPECT_THAT(reason(Unit{.more = text("ORIN", "ABC")}.both()), ElementsAre(HasSubstr("are called 'ABC'")));
  EXPECT_THAT(reason(unit.stream("ACCL", unit.force, 418, "g") + unit.stream("GYRO", unit.rate, 3755, "rad/s")),
              ElementsAre(HasSubstr("their units are not")));
  // GRAV points down in the camera's axes: here to the right.
  const std::string gravity = nest("STRM", shorts("SCAL", 1, {32767}) + shorts("GRAV", 3, {32767, 0, 0}));
  EXPECT_THAT(reason(unit.both() + gravity), ElementsAre(HasSubstr("gravity (GRAV) are 90 degrees apart")));
  const std::string turned = nest("STRM", shorts("SCAL", 1, {32767}) + shorts("IORI", 4, {32642, 2856, 0, 0}));
  EXPECT_THAT(reason(unit.both() + turned), ElementsAre(HasSubstr("by up to 10.0 degrees against its body"),
                                                        HasSubstr("a calibration holds for frames without it")));
  EXPECT_THAT(reason(unit.both(), nest("DEVC", text("MINF", "HERO7 Black") + text("EISE", "Y"))),
              ElementsAre(HasSubstr("stabilisation was on (EISE)"), HasSubstr("a calibration holds")));
}

/// CORI turns from the first frame's axes to the camera's: a camera that turns about its up axis by 0.5 rad/s.
TEST(Gpmf, TheGyroscopeMustTurnAsTheOrientationsDo) {
  const auto orientations = [](int second, double rate) {
    std::vector<std::int16_t> rows;
    for (int i = 0; i < 30; ++i) {
      const double half = -0.5 * rate * (second + i / 30.0);  // about y, which is down; inverse
      for (const double number : {std::cos(half), 0.0, std::sin(half), 0.0})
        rows.push_back(static_cast<std::int16_t>(std::lround(32767 * number)));
    }
    return nest("STRM", shorts("SCAL", 1, {32767}) + shorts("CORI", 4, rows));
  };
  const auto flown = [&](double rate) {
    std::vector<std::string> samples;
    for (int second = 0; second < 6; ++second)
      samples.push_back(
          camera(Unit{.rate = Vec3(0, 0, -0.5)}.both() + orientations(second, rate) + gps5(100 * second)));
    return read(samples);
  };
  EXPECT_FALSE(flown(0.5).inertial.empty());
  const Telemetry contradicted = flown(-0.5);
  EXPECT_THAT(contradicted.inertial, IsEmpty());
  EXPECT_THAT(contradicted.warnings, Contains(HasSubstr("gyroscope and orientation (CORI) differ by 20")));
}

/// Cameras write what they have when a second is over: 99, 101, 100 ... readings. Their clock is steady.
TEST(Gpmf, ReadingsWithoutStampsLieOnALine) {
  std::vector<std::string> samples;
  for (const int rows : {99, 101, 100, 99, 101}) samples.push_back(camera(Unit{.rows = rows}.both()));
  const Telemetry log = read(samples);
  ASSERT_EQ(log.inertial.size(), 500U);
  for (std::size_t i = 1; i < log.inertial.size(); ++i)
    EXPECT_NEAR(log.inertial[i].time_s - log.inertial[i - 1].time_s, 0.01, 1e-4);
}

/// The first frame's exposure (SHUT) is time 0 of the stamps.
TEST(Gpmf, StampsSayWhenReadingsBegin) {
  std::vector<std::string> samples;
  for (std::uint64_t second = 0; second < 3; ++second) {
    const std::string shutter = nest("STRM", numbers<std::uint64_t>("STMP", 'J', 1, {80000 + 1000000 * second}) +
                                                 numbers<float>("SHUT", 'f', 1, std::vector<float>(30, 0.004F)));
    const std::string gain = nest("STRM", numbers<std::uint16_t>("ISOE", 'S', 1, std::vector<std::uint16_t>(30, 100)));
    samples.push_back(camera(Unit{.stamp_us = 95000 + 1001000 * second}.both() + shutter + gain));
  }
  const Telemetry log = read(samples);
  ASSERT_EQ(log.inertial.size(), 300U);
  EXPECT_NEAR(log.inertial[0].time_s, 0.015, 1e-9);
  EXPECT_NEAR(log.inertial[50].time_s, 0.015 + 0.5005, 1e-9);
  EXPECT_NEAR(log.inertial[250].time_s, 0.015 + 2.002 + 0.5005, 1e-9) << "the last has the rate of those before";
  ASSERT_EQ(log.exposures.size(), 90U);
  EXPECT_NEAR(log.exposures[31].time_s, 1.0 + 1.0 / 30, 1e-9);
  EXPECT_NEAR(log.exposures[31].exposure_s, 0.004, 1e-9);
  EXPECT_EQ(*log.exposures[31].gain, 100.0);
}

TEST(Gpmf, StampsThatJumpAreNotUsed) {
  std::vector<std::string> samples;
  for (const std::uint64_t stamp : {95000ULL, 5000000000ULL, 2095000ULL})
    samples.push_back(camera(Unit{.stamp_us = stamp}.both()));
  const Telemetry log = read(samples);
  ASSERT_EQ(log.inertial.size(), 300U);
  EXPECT_NEAR(log.inertial[150].time_s, 1.5, 1e-6);
}

TEST(Gpmf, SamplesWhoseTimeDoesNotIncreaseAreLeftOut) {
  std::vector<base::TimedBytes> samples = track({camera(gps5(0)), camera(gps5(100)), camera(gps5(200))});
  samples[1].begin_s = -7.0;
  const Telemetry log = read_gpmf(samples, {.where = "a.mp4"});
  EXPECT_EQ(log.fixes.size(), 4U);
  EXPECT_THAT(log.warnings, ElementsAre(HasSubstr("1 samples of the metadata track left out: time does not increase")));
}

/// The Karma's streams have MAVLink's numbers on the flight controller's clock, which began 100 s before.
std::string karma(double begin_s, std::uint8_t fix = 3) {
  std::string positions, attitudes, receiver;
  for (int i = 0; i < 4; ++i) {
    const auto ms = static_cast<std::uint32_t>(std::lround(1000 * (100 + begin_s + 0.25 * i)));
    positions += big_endian(ms) + big_endian(471000000) +
                 big_endian(82000000 + static_cast<int>(40 * begin_s) + 10 * i) + big_endian(500000) +
                 big_endian(2000) + std::string(8, '\0');
    attitudes +=
        big_endian(ms - 10) + big_endian(0.1F) + big_endian(-0.2F) + big_endian(1.5F) + std::string(12, '\0') + '\0';
    receiver += std::string(28, '\0') + std::string(1, static_cast<char>(fix)) + "\x14";
  }
  return nest(
      "DEVC",
      numbers<std::uint32_t>("DVID", 'L', 1, {77}) + text("DVNM", "GoPro Karma v1.0") +
          nest("STRM", text("TYPE", "JlllSSSSBB") + element("GPRI", '?', 30, 4, receiver)) +
          nest("STRM", text("TYPE", "LffffffB") + numbers<std::int32_t>("SCAL", 'l', 1, {1000, 1, 1, 1, 1, 1, 1, 1}) +
                           element("ATTD", '?', 29, 4, attitudes)) +
          nest("STRM",
               text("TYPE", "LllllsssS") +
                   numbers<std::int32_t>("SCAL", 'l', 1, {1000, 10000000, 10000000, 1000, 1000, 100, 100, 100, 100}) +
                   element("GLPI", '?', 28, 4, positions)) +
          nest("STRM", text("TYPE", "JJ") + numbers<std::int32_t>("SCAL", 'l', 1, {1000000, 1000}) +
                           element("SYST", '?', 16, 1,
                                   big_endian(std::uint64_t{100000000}) + big_endian(std::uint64_t{1500000000000}))));
}

TEST(Gpmf, TheKarmasPositionsAreOnItsOwnClock) {
  const Telemetry log = read({camera("", "Camera") + karma(0), camera("", "Camera") + karma(1)});
  ASSERT_EQ(log.fixes.size(), 8U);
  EXPECT_NEAR(log.fixes[5].time_s, 1.25, 1e-9);
  EXPECT_NEAR(log.fixes[5].longitude_deg, 8.200005, 1e-12);
  EXPECT_EQ(*log.fixes[5].absolute_height_m, 500.0);
  EXPECT_EQ(*log.fixes[5].height_above_takeoff_m, 2.0);
  EXPECT_NEAR(*log.fixes[5].body_yaw_deg, 1.5 * 180 / std::numbers::pi, 1e-5);
  EXPECT_NEAR(*log.fixes[5].body_pitch_deg, -0.2 * 180 / std::numbers::pi, 1e-5);
  EXPECT_EQ(log.height_datum, HeightDatum::kMeanSeaLevel);
  EXPECT_NEAR(*log.zero_utc_s, 1.5e9, 1e-6);
  EXPECT_EQ(log.device, "GoPro Karma v1.0");
  EXPECT_THAT(log.warnings, ElementsAre(HasSubstr("the Karma's heights are taken as above sea level")));
  EXPECT_THAT(read({karma(0), karma(1, 2)}).warnings,
              Contains("4 positions dropped: the receiver had no three-dimensional fix"));
}

TEST(Gpmf, AClockOfTheKarmaThatJumpsIsNotFollowed) {
  const Telemetry log = read({karma(0), karma(900)});
  ASSERT_EQ(log.fixes.size(), 8U);
  EXPECT_EQ(log.fixes[5].time_s, 1.25);
  EXPECT_THAT(log.warnings, Contains(HasSubstr("the clock of the Karma jumps")));
}

/// Whatever is cut, what stands before it is read, and nothing else is invented.
TEST(Gpmf, ATrackMayEndAnywhere) {
  const std::string whole = camera(Unit{.rows = 3}.both() + gps5(0)), next = camera(gps5(200));
  for (std::size_t size = 0; size < next.size(); ++size) {
    const Telemetry log = read({whole, next.substr(0, size)});
    ASSERT_TRUE(log.fixes.size() == 2 || log.fixes.size() == 4) << size;
    EXPECT_EQ(log.fixes[0].longitude_deg, 8.2);
    if (size > 0 && size % 4 != 0) {
      EXPECT_THAT(log.warnings, Contains(HasSubstr("1 samples of the metadata track are damaged"))) << size;
    }
  }
  for (std::size_t size = 0; size < whole.size(); ++size) fault({whole.substr(0, size)});
}

TEST(Gpmf, HostileElementsAreNotBelieved) {
  EXPECT_THAT(fault({""}), HasSubstr("holds no positions"));
  EXPECT_THAT(fault({"DEVC" + std::string("\0\xFF\xFF\xFF", 4)}),
              HasSubstr("1 samples of the metadata track are damaged"));
  std::string deep;
  for (int i = 0; i < 1000; ++i) deep = nest("DEVC", deep);
  fault({deep});
  const auto stream = [](const std::string& elements) { return camera(nest("STRM", elements)); };
  const std::string rows = numbers<std::int32_t>("GPS5", 'l', 5, {471000000, 82000000, 500000, 0, 0});
  EXPECT_THAT(fault({stream(numbers<std::int32_t>("SCAL", 'l', 1, {1, 0, 1, 1, 1}) + rows)}),
              HasSubstr("readings of GPS5 left out: they have another shape or scale"));
  EXPECT_THAT(fault({stream(numbers<std::int32_t>("SCAL", 'l', 1, {1, 2}) + rows)}),
              HasSubstr("another shape or scale"));
  EXPECT_THAT(fault({stream(text("TYPE", "f[99999999]") + element("GPS9", '?', 36, 1, std::string(36, '\1')))}),
              HasSubstr("readings of GPS9 left out"));
  EXPECT_THAT(fault({stream(element("GPS5", '#', 20, 1, std::string(20, '\1')))}), HasSubstr("compressed"));
  const float nan = std::nanf("");
  EXPECT_THAT(fault({stream(numbers<float>("GPS5", 'f', 5, {nan, nan, nan, nan, nan}))}), HasSubstr("no position fix"));
}

TEST(Gpmf, SettingsStateTheLensMode) {
  const auto mode = [](const std::string& settings) {
    return gopro_lens_mode({reinterpret_cast<const std::byte*>(settings.data()), settings.size()});
  };
  EXPECT_EQ(mode(nest("DEVC", text("MINF", "HERO6 Black") + text("VFOV", "L"))), "Linear");
  EXPECT_EQ(mode(nest("DEVC", text("MINF", "HERO11 Black")) + nest("DEVC", text("VFOV", "W"))), "Wide");
  EXPECT_EQ(mode(nest("DEVC", text("VFOV", "S"))), "SuperView");
  EXPECT_EQ(mode(nest("DEVC", text("VFOV", "?"))), "") << "a letter that nobody documents";
  EXPECT_EQ(mode(nest("DEVC", text("MINF", "HERO9 Black"))), "");
  EXPECT_EQ(mode("DEVC"), "");
}

}  // namespace
}  // namespace tileflight::flight_logs::gpmf_test
