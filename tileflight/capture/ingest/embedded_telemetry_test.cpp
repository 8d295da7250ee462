#include "tileflight/capture/ingest/embedded_telemetry.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/metadata_track.h"
#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/video/side_tracks.h"
#include "tileflight/data/video/video.h"

namespace tileflight::ingest::embedded_telemetry_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using tests::big_endian;
using tests::refusal_of;

std::string element(const std::string& key, char type, std::size_t size, std::size_t count, std::string value) {
  value.resize((value.size() + 3) / 4 * 4);
  return key + std::string(1, type) + std::string(1, static_cast<char>(size)) +
         big_endian(static_cast<std::uint16_t>(count)) + value;
}
std::string nest(const std::string& key, const std::string& elements) {
  return element(key, '\0', 4, elements.size() / 4, elements);
}

/// A second of a GoPro that flies east and rests upright: two positions, 100 readings, 30 exposures.
std::string gopro_second(int number, std::uint16_t gain = 100) {
  std::string positions, forces, rates, exposures, gains;
  for (int i = 0; i < 2; ++i) {
    for (const std::int32_t value : {471000000, 82000000 + 500 * (2 * number + i), 500000, 0, 0})
      positions += big_endian(value);
  }
  for (int i = 0; i < 100; ++i) {
    for (const std::int16_t value : {4100, 0, 0}) forces += big_endian(value);
    for (const std::int16_t value : {10, 20, 30}) rates += big_endian(value);
  }
  for (int i = 0; i < 30; ++i) exposures += big_endian(0.004F), gains += big_endian(gain);
  std::string scale;
  for (const std::int32_t value : {10000000, 10000000, 1000, 1000, 100}) scale += big_endian(value);
  const std::string axes = element("ORIN", 'c', 1, 3, "ZXY");
  return nest("DEVC", element("DVNM", 'c', 1, 11, "HERO9 Black") +
                          nest("STRM", element("GPSF", 'L', 4, 1, big_endian(std::uint32_t{3})) +
                                           element("SCAL", 'l', 4, 5, scale) + element("GPS5", 'l', 20, 2, positions)) +
                          nest("STRM", axes + element("SCAL", 's', 2, 1, big_endian(std::int16_t{418})) +
                                           element("ACCL", 's', 6, 100, forces)) +
                          nest("STRM", axes + element("SCAL", 's', 2, 1, big_endian(std::int16_t{1000})) +
                                           element("GYRO", 's', 6, 100, rates)) +
                          nest("STRM", element("SHUT", 'f', 4, 30, exposures)) +
                          nest("STRM", element("ISOE", 'S', 2, 30, gains)));
}

/// Videos of two seconds at 30 frames a second, with what a camera writes beside the images.
class EmbeddedTelemetryTest : public testing::Test {
 protected:
  EmbeddedTelemetryTest() {
    imaging::Calibration calibration;
    calibration.camera = imaging::make_fisheye(96, 64, 120.0);
    calibration.assumes_T_cam_imu = true;
    imaging::write_kalibr(folder_ / "camera.yaml", calibration);
    flight_.camera = folder_ / "camera.yaml";
  }

  fs::path make_video(const std::string& name) const {
    video::VideoWriter writer(folder_ / name, 96, 64, {});
    for (int i = 0; i < 60; ++i) writer.add(tests::moving_picture(96, 64, i));
    writer.finish();
    return folder_ / name;
  }
  fs::path make_gopro(const std::string& name, int first_second = 0, std::uint16_t second_gain = 100) const {
    const fs::path file = make_video(name);
    tests::add_metadata_track(file, "gpmd", {gopro_second(first_second), gopro_second(first_second + 1, second_gain)},
                              1000, tests::mp4_box("GPMF", nest("DEVC", element("MINF", 'c', 1, 11, "HERO9 Black"))));
    return file;
  }
  IngestResult ingest_flight() { return ingest_dataset(flight_, {}, folder_ / "set", true); }

  tests::TemporaryFolder folder_;
  IngestedFlightConfig flight_;
};

TEST_F(EmbeddedTelemetryTest, ATrackIsReadWithItsTimes) {
  const fs::path file = make_gopro("a.mp4");
  const std::array<std::string_view, 2> kinds{"djmd", "gpmd"};
  const auto track = video::read_data_track(file, kinds);
  ASSERT_TRUE(track);
  EXPECT_EQ(track->kind, "gpmd");
  ASSERT_EQ(track->samples.size(), 2U);
  EXPECT_EQ(track->samples[1].begin_s, 1.0);
  EXPECT_NEAR(track->samples[1].duration_s, 1.0, 1e-6);
  EXPECT_EQ(base::as_text(track->samples[0].bytes), gopro_second(0));
  EXPECT_EQ(base::as_text(video::read_user_data(file, "GPMF")),
            nest("DEVC", element("MINF", 'c', 1, 11, "HERO9 Black")));
  EXPECT_TRUE(video::read_user_data(file, "GPMX").empty());
  EXPECT_FALSE(video::read_data_track(make_video("b.mp4"), kinds));
  EXPECT_FALSE(read_embedded_telemetry({folder_ / "b.mp4"}));
}

/// A camera writes what it collected in the last part of a second as a whole second.
TEST_F(EmbeddedTelemetryTest, ALastSampleEndsWithTheImages) {
  const fs::path file = make_video("a.mp4");
  tests::add_metadata_track(file, "gpmd", {gopro_second(0), gopro_second(1)}, 1500);
  const std::array<std::string_view, 1> kinds{"gpmd"};
  EXPECT_NEAR(video::read_data_track(file, kinds)->samples[1].duration_s, 0.5, 1e-6);
}

TEST_F(EmbeddedTelemetryTest, AVideosOwnTelemetryIsUsed) {
  flight_.video = make_gopro("a.mp4");
  const IngestResult result = ingest_flight();
  EXPECT_EQ(
      result.embedded,
      "GoPro's metadata (GPMF) in a.mp4: HERO9 Black, 4 positions, 200 readings of the inertial unit, 60 exposures");
  ASSERT_TRUE(result.flight);
  EXPECT_NEAR(result.flight->duration_s, 1.5, 1e-9);
  EXPECT_NEAR(result.flight->length_m, 11.38, 0.01) << "1.5e-4 degrees at 47.1 north";
  const dataset::Dataset dataset = dataset::read_dataset(folder_ / "set");
  ASSERT_EQ(dataset.gps.size(), 4U);
  EXPECT_EQ(dataset.gps[2].time_s, 1.0);
  EXPECT_NEAR(dataset.gps[2].position.height.m, 500.0, 1e-6);
  EXPECT_NEAR(dataset.frames[40].exposure_ms, 4.0, 1e-6);
  EXPECT_FALSE(dataset.calibration.assumes_T_cam_imu);
  EXPECT_TRUE(dataset.calibration.T_cam_imu.matrix().isIdentity());
  const auto readings = dataset::read_imu_csv(dataset.imu);
  ASSERT_EQ(readings.size(), 200U);
  EXPECT_NEAR((readings[7].specific_force_m_s2 - Vec3(0, -4100 / 418.0, 0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((readings[7].angular_rate_rad_s - Vec3(-0.02, -0.01, -0.03)).norm(), 0.0, 1e-12);
  EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("where the inertial unit is in the camera is not recorded")));
  EXPECT_EQ(to_json(result)["embedded"], result.embedded);
}

TEST_F(EmbeddedTelemetryTest, AGivenLogComesFirst) {
  flight_.video = make_gopro("a.mp4");
  flight_.telemetry = folder_ / "log.csv";
  base::write_file(flight_.telemetry, "time,lat,lon,hae\n0,10,20,30\n1,10.00001,20,30\n2,10.00002,20,30\n");
  const IngestResult result = ingest_flight();
  const dataset::Dataset dataset = dataset::read_dataset(folder_ / "set");
  ASSERT_EQ(dataset.gps.size(), 3U);
  EXPECT_EQ(dataset.gps[0].position.latitude_deg, 10.0);
  EXPECT_EQ(result.dataset.imu_readings, 200U) << "the log has none";
}

TEST_F(EmbeddedTelemetryTest, GivenReadingsComeFirst) {
  flight_.video = make_gopro("a.mp4");
  flight_.imu = folder_ / "imu.csv";
  dataset::write_imu_csv(flight_.imu, {{0.5, Vec3(1, 2, 3), Vec3(4, 5, 6)}, {0.6, Vec3(1, 2, 3), Vec3(4, 5, 6)}});
  EXPECT_EQ(ingest_flight().dataset.imu_readings, 2U);
  flight_.imu.clear();
  flight_.imu_time_offset_s = 0.25;
  ingest_flight();
  EXPECT_NEAR(dataset::read_imu_csv(folder_ / "set/imu.csv")[0].time_s, 0.25, 1e-9);
  flight_.video = make_video("b.mp4");
  EXPECT_THAT(refusal_of([&] { ingest_flight(); }), HasSubstr("has no readings of an inertial unit"));
}

TEST_F(EmbeddedTelemetryTest, AVideoMayBeTheLogOfAnother) {
  flight_.video = make_video("b.mp4");
  flight_.telemetry = make_gopro("a.mp4");
  const IngestResult result = ingest_flight();
  EXPECT_EQ(result.dataset.gps_fixes, 4U);
  EXPECT_EQ(result.dataset.imu_readings, 0U);
  EXPECT_THAT(result.warnings, Contains(HasSubstr("inertial unit in a.mp4 are not used")));
  flight_.telemetry = folder_ / "b.mp4";
  EXPECT_THAT(refusal_of([&] { ingest_flight(); }), HasSubstr("is a video without a track of subtitles or of GoPro's"));
}

TEST_F(EmbeddedTelemetryTest, ACalibrationThatContradictsTheAxesLeavesTheReadingsOut) {
  flight_.video = make_gopro("a.mp4");
  imaging::Calibration calibration = imaging::read_kalibr(flight_.camera);
  calibration.assumes_T_cam_imu = false;
  calibration.T_cam_imu = geometry::SE3(geometry::so3_exp({0, 0, 1.57}), {0.01, 0, 0});
  imaging::write_kalibr(flight_.camera, calibration);
  const IngestResult turned = ingest_flight();
  EXPECT_EQ(turned.dataset.imu_readings, 0U);
  EXPECT_FALSE(fs::exists(folder_ / "set/imu.csv"));
  EXPECT_THAT(turned.warnings, Contains(HasSubstr("T_cam_imu of camera.yaml is turned by 90 degrees")));
  calibration.T_cam_imu = geometry::SE3(geometry::so3_exp({0, 0, 0.02}), {0.01, 0, 0});
  imaging::write_kalibr(flight_.camera, calibration);
  EXPECT_EQ(ingest_flight().dataset.imu_readings, 200U);
  EXPECT_NEAR(dataset::read_dataset(folder_ / "set").calibration.T_cam_imu.translation.x(), 0.01, 1e-12);
}

TEST_F(EmbeddedTelemetryTest, ExposuresWithoutAConstantGainAreLeftOut) {
  flight_.video = make_gopro("a.mp4", 0, 150);
  const IngestResult result = ingest_flight();
  EXPECT_EQ(dataset::read_dataset(folder_ / "set").frames[40].exposure_ms, 0.0);
  EXPECT_THAT(result.warnings, Contains(HasSubstr("gain changes by a factor of 1.50")));
}

/// Without a fix in the excerpt, the rest is used.
TEST_F(EmbeddedTelemetryTest, PositionsOutsideTheExcerptAreANote) {
  flight_.video = make_gopro("a.mp4");
  flight_.from_s = 1.6;
  const IngestResult result = ingest_flight();
  EXPECT_EQ(result.dataset.gps_fixes, 0U);
  EXPECT_THAT(result.warnings,
              Contains(HasSubstr("the video's own telemetry (0.00 s to 1.50 s) lies outside the frames")));
}

/// DJI's barometric heights have no stated reference: nobody asked for them, so they are left out with the way to use
/// them.
TEST_F(EmbeddedTelemetryTest, PositionsOfAnUnknownHeightAreLeftOutUnlessTheReferenceIsGiven) {
  const auto bytes = [](const std::string& hex) {
    std::string text;
    for (std::size_t i = 0; i < hex.size(); i += 2) text += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
    return text;
  };
  // protoc --encode of clip_meta.clip_meta_header.proto_file_name "dvtm_Air3.proto", and of a frame whose
  // drone_frame_meta.gps is {gps_coordinates {UNIT_DEG 47.5 8.25} gps_altitude_mm 500000}.
  const std::string header = bytes("0a130a110a0f") + "dvtm_Air3.proto";
  const std::string frame = bytes("1a1e1a1c221a0a140801110000000000c0474019000000000080204010a0c21e");
  flight_.video = make_video("a.mp4");
  tests::add_metadata_track(flight_.video, "djmd", {header + frame, frame}, 33);
  const IngestResult result = ingest_flight();
  EXPECT_EQ(result.embedded, "DJI's metadata (djmd) in a.mp4: DJI Air 3, 2 positions");
  EXPECT_EQ(result.dataset.gps_fixes, 0U);
  EXPECT_THAT(result.warnings, Contains(AllOf(HasSubstr("the positions in the video are left out"),
                                              HasSubstr("give --telemetry-height"))));
  flight_.telemetry_height = "ellipsoid";
  EXPECT_EQ(ingest_flight().dataset.gps_fixes, 1U) << "two equal positions are one";
  EXPECT_NEAR(dataset::read_dataset(folder_ / "set").gps[0].position.height.m, 500.0, 1e-9);
}

TEST_F(EmbeddedTelemetryTest, AnUnknownModelIsAWarningUnlessItIsTheLog) {
  flight_.video = make_video("a.mp4");
  const std::string header = std::string("\x0a\x13\x0a\x11\x0a\x0f") + "dvtm_Air9.proto";
  tests::add_metadata_track(flight_.video, "djmd", {header}, 33);
  EXPECT_THAT(ingest_flight().warnings,
              ElementsAre(AllOf(HasSubstr("own telemetry is not used"), HasSubstr("dvtm_Air9"))));
  flight_.telemetry = flight_.video;
  EXPECT_THAT(refusal_of([&] { ingest_flight(); }), HasSubstr("is defined by dvtm_Air9.proto"));
}

/// Two parts of two seconds: the second one's telemetry is later by two seconds.
TEST_F(EmbeddedTelemetryTest, PartsOfARecordingHaveOneClock) {
  flight_.videos = {{"", make_gopro("GH020123.MP4", 2)}, {"", make_gopro("GH010123.MP4", 0)}};
  const IngestResult result = ingest_flight();
  const dataset::Dataset dataset = dataset::read_dataset(folder_ / "set");
  EXPECT_EQ(dataset.frames.size(), 120U);
  ASSERT_EQ(dataset.gps.size(), 8U);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_NEAR(dataset.gps[i].time_s, 0.5 * static_cast<double>(i), 1e-6);
    EXPECT_NEAR(dataset.gps[i].position.longitude_deg, 8.2 + 5e-5 * static_cast<double>(i), 1e-9);
  }
  EXPECT_EQ(result.dataset.imu_readings, 400U);
  EXPECT_NEAR(dataset.frames[90].exposure_ms, 4.0, 1e-6);
}

TEST_F(EmbeddedTelemetryTest, MissingPartsAndPartsOfOthersAreRefused) {
  EXPECT_NO_THROW(check_chapters({"GH010123.MP4", "GH020123.MP4", "GH030123.MP4"}));
  EXPECT_NO_THROW(check_chapters({"GOPR0123.MP4", "GP010123.MP4", "GP020123.MP4"}));
  EXPECT_NO_THROW(check_chapters({"GX010123_cut.mp4", "GX030123_cut.mp4"})) << "not GoPro's names";
  EXPECT_THAT(refusal_of([] {
                check_chapters({"GH010123.MP4", "GH030123.MP4"});
              }),
              AllOf(HasSubstr("GH010123.MP4 and GH030123.MP4"), HasSubstr("is missing")));
  EXPECT_THAT(refusal_of([] { check_chapters({"GX010123.MP4", "GX010124.MP4"}); }), HasSubstr("different recordings"));
  EXPECT_THAT(refusal_of([] { check_chapters({"GOPR0123.MP4", "GP020123.MP4"}); }), HasSubstr("is missing"));
}

/// GoPro's sample of a Karma (gpmf-parser, samples/karma.mp4). The expected numbers are those of a decoder in Python
/// that shares nothing with the reader; the first fix is also that of the bytes, read by hand:
/// 13be87b8 ba10b334 00003d5f 000007d3.
TEST(EmbeddedTelemetry, TheKarmasFlightIsThatOfItsBytes) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "real/karma/karma.mp4");
  const auto own = read_embedded_telemetry({file});
  ASSERT_TRUE(own);
  EXPECT_EQ(describe(*own, file),
            "GoPro's metadata (GPMF) in karma.mp4: GoPro Karma v1.0, 47 positions, 4792 readings of the inertial unit, "
            "361 exposures");
  const flight_logs::Telemetry& log = own->telemetry;
  ASSERT_EQ(log.fixes.size(), 47U);
  EXPECT_NEAR(log.fixes[0].latitude_deg, 33.1253688, 1e-12);
  EXPECT_NEAR(log.fixes[0].longitude_deg, -117.3310668, 1e-12);
  EXPECT_NEAR(*log.fixes[0].absolute_height_m, 15.711, 1e-12);
  EXPECT_NEAR(*log.fixes[0].height_above_takeoff_m, 2.003, 1e-12);
  EXPECT_NEAR(log.fixes[0].time_s, 0.1559468, 1e-6);
  EXPECT_NEAR(log.fixes[46].time_s, 11.7479468, 1e-6);
  EXPECT_NEAR(*log.fixes[0].body_yaw_deg, -28.438941, 1e-5);
  EXPECT_NEAR(*log.zero_utc_s, 1492457277.371, 1e-3) << "17 April 2017, 19:27:57";
  ASSERT_EQ(log.inertial.size(), 4792U);
  EXPECT_NEAR(log.inertial[0].time_s, 0.0140991, 1e-6);
  EXPECT_NEAR(log.inertial[0].angular_rate_rad_s.y(), 61 / 3755.0, 1e-12)
      << "the second row, -61 9 -285, is -Z, -X, -Y";
  Vec3 sum = Vec3::Zero();
  for (const auto& reading : log.inertial) sum += reading.specific_force_m_s2;
  EXPECT_NEAR((sum / 4792.0 - Vec3(0.161, -9.688, 0.209)).norm(), 0.0, 0.02) << "up is against y";
  EXPECT_NEAR(log.exposures[100].exposure_s, 0.00487029, 1e-8);
}

}  // namespace
}  // namespace tileflight::ingest::embedded_telemetry_test
