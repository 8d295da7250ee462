#include "tileflight/data/dataset/ingest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tests/track_matrix.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/sensor_files.h"

namespace tileflight::dataset::ingest_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using tests::moving_picture;
using tests::refusal_of;

constexpr int kWidth = 96;
constexpr int kHeight = 64;

/// A flight of two seconds at 30 frames a second, with its log at 10 Hz (half a second late) and its true poses.
class IngestTest : public testing::Test {
 protected:
  IngestTest() {
    video::VideoWriter writer(folder / "flight.mp4", kWidth, kHeight, {});
    for (int i = 0; i < 60; ++i) writer.add(moving_picture(kWidth, kHeight, i));
    writer.finish();
    imaging::Calibration calibration;
    calibration.camera = imaging::make_fisheye(kWidth, kHeight, 155.0);
    imaging::write_kalibr(folder / "camera.yaml", calibration);
    geometry::Trajectory poses;
    for (int i = 0; i < 60; ++i)
      poses.poses.push_back({i / 30.0, geometry::SE3(geometry::so3_exp({0, 0, 0}), {1.0 * i, 0, 0})});
    geometry::write_tum(folder / "poses.txt", poses);

    options.video_or_images = folder / "flight.mp4";
    options.calibration = folder / "camera.yaml";
    options.groundtruth = folder / "poses.txt";
    for (int i = 0; i < 20; ++i) options.gps.push_back({0.5 + 0.1 * i, {-0.24, -78.52, {2880.0 + i}}, 0.25, 0.4});
    options.gps_time_offset_s = -0.5;
    options.description = {{"place", "test"}};
  }

  std::string error() {
    const std::string message = refusal_of([&] { ingest(options, folder / "set"); });
    EXPECT_FALSE(fs::exists(folder / "set"));
    for (const auto& entry : fs::directory_iterator(folder.path()))
      EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
    return message;
  }

  tileflight::tests::TemporaryFolder folder;
  IngestOptions options;
};

TEST_F(IngestTest, VideoBecomesADataset) {
  std::int64_t last_done = 0;
  const IngestResult result =
      ingest(options, folder / "set", [&](std::int64_t done, std::int64_t, std::string_view) { last_done = done; });
  EXPECT_EQ(result.frames, 60U);
  EXPECT_EQ(last_done, 60);
  EXPECT_TRUE(result.notes.empty());
  const Dataset dataset = read_dataset(folder / "set");
  ASSERT_EQ(dataset.frames.size(), 60U);
  EXPECT_NEAR(dataset.frames[59].time_s, 59 / 30.0, 1e-4);
  EXPECT_GT(tests::psnr(imaging::read_rgb(dataset.frames[31].image), moving_picture(kWidth, kHeight, 31)), 30.0);
  ASSERT_EQ(dataset.gps.size(), 20U);
  EXPECT_NEAR(dataset.gps[3].time_s, 0.3, 1e-12);  // on the video's clock
  EXPECT_EQ(dataset.gps[3].position.height.m, 2883.0);
  EXPECT_EQ(dataset.groundtruth->size(), 60U);
  EXPECT_EQ(dataset.metadata.at("source"), "flight.mp4");
  EXPECT_EQ(dataset.metadata.at("place"), "test");
}

TEST_F(IngestTest, PartsOfARecordingAreReadOneAfterTheOther) {
  options.groundtruth.clear();
  options.gps.clear();
  for (int part = 0; part < 2; ++part) {
    video::VideoWriter writer(folder / ("part" + std::to_string(part) + ".mp4"), kWidth, kHeight, {});
    for (int i = 30 * part; i < 30 * (part + 1); ++i) writer.add(moving_picture(kWidth, kHeight, i));
    writer.finish();
  }
  options.video_or_images = folder / "part0.mp4";
  options.further_parts = {folder / "part1.mp4"};
  options.excerpt = {.from_s = 0.5, .to_s = 1.6, .every = 2};
  const IngestResult result = ingest(options, folder / "set");
  ASSERT_EQ(result.frames, 17U);  // 15, 17, ... 47
  const Dataset dataset = read_dataset(folder / "set");
  for (std::size_t k = 0; k < 17; ++k) {
    const int frame = 15 + 2 * static_cast<int>(k);
    EXPECT_NEAR(dataset.frames[k].time_s, frame / 30.0, 1e-3);
    EXPECT_GT(tests::psnr(imaging::read_rgb(dataset.frames[k].image), moving_picture(kWidth, kHeight, frame)), 28.0);
  }
  video::VideoWriter other(folder / "other.mp4", 2 * kWidth, kHeight, {});
  other.add(moving_picture(2 * kWidth, kHeight, 0));
  other.finish();
  options.further_parts = {folder / "other.mp4"};
  EXPECT_THAT(refusal_of([&] { ingest(options, folder / "set2"); }), HasSubstr("no parts of one recording"));
}

TEST_F(IngestTest, ExcerptKeepsTheVideosClock) {
  options.excerpt = {0.5, 1.5, 3};
  const IngestResult result = ingest(options, folder / "set");
  EXPECT_EQ(result.frames, 10U);
  EXPECT_NEAR(result.times_s.front(), 0.5, 1e-4);
  EXPECT_NEAR(result.times_s.back(), 1.4, 1e-4);
  const Dataset dataset = read_dataset(folder / "set");
  EXPECT_NEAR(dataset.frames[1].time_s, 0.6, 1e-4);
  // Log and truth: what lies within, and one on each side.
  EXPECT_NEAR(dataset.gps.front().time_s, 0.4, 0.11);
  EXPECT_LE(dataset.gps.front().time_s, 0.5);
  EXPECT_GE(dataset.gps.back().time_s, 1.4);
  EXPECT_LE(dataset.gps.back().time_s, 1.51);
  EXPECT_LE(dataset.groundtruth->poses.front().time_s, result.times_s.front());
  EXPECT_GE(dataset.groundtruth->poses.back().time_s, result.times_s.back());
  EXPECT_EQ(dataset.groundtruth->size(), result.groundtruth_poses);
}

TEST_F(IngestTest, SameBytesForAnyNumberOfThreads) {
  ingest(options, folder / "a");
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  ingest(options, folder / "b");
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder / "a")) {
    if (!entry.is_regular_file()) continue;
    ++files;
    EXPECT_EQ(base::read_bytes(entry.path()), base::read_bytes(folder / "b" / fs::relative(entry.path(), folder / "a")))
        << entry.path();
  }
  EXPECT_EQ(files, 60U + 7U);
}

TEST_F(IngestTest, CalibrationOfAnotherSize) {
  imaging::Calibration calibration;
  calibration.camera = imaging::make_fisheye(2 * kWidth, 2 * kHeight, 155.0);
  calibration.line_delay_s = 1e-5;
  imaging::write_kalibr(options.calibration, calibration);
  const IngestResult result = ingest(options, folder / "set");
  EXPECT_THAT(result.notes, ElementsAre(AllOf(HasSubstr("192x128"), HasSubstr("96x64"), HasSubstr("scaled"))));
  const imaging::Calibration scaled = read_dataset(folder / "set").calibration;
  EXPECT_EQ(scaled.camera.width(), kWidth);
  EXPECT_NEAR(scaled.camera.horizontal_fov_deg(), 155.0, 1e-9);
  EXPECT_DOUBLE_EQ(scaled.line_delay_s, 2e-5);
  fs::remove_all(folder / "set");

  calibration.camera = imaging::make_fisheye(kWidth, kWidth, 155.0);
  imaging::write_kalibr(options.calibration, calibration);
  EXPECT_THAT(error(), AllOf(HasSubstr("96x96"), HasSubstr("96x64"), HasSubstr("camera.yaml")));
}

TEST_F(IngestTest, ARotationFlagIsNamedWhereTheCalibrationDoesNotFit) {
  tests::set_track_matrix(folder / "flight.mp4", {0, 1, -1, 0});
  EXPECT_THAT(error(), AllOf(HasSubstr("rotation flag turns them to 64x96"), HasSubstr("is for images of 96x64")));
  imaging::Calibration turned;
  turned.camera = imaging::make_fisheye(kHeight, kWidth, 120.0);
  imaging::write_kalibr(folder / "camera.yaml", turned);
  const IngestResult result = ingest(options, folder / "set");
  EXPECT_EQ(result.width, kHeight);
  EXPECT_THAT(result.notes, ElementsAre(HasSubstr("turned by 90 degrees")));
  EXPECT_EQ(imaging::read_rgb(read_dataset(folder / "set").frames[0].image).width, kHeight);
}

TEST_F(IngestTest, PixelsThatAreNotSquareAreNamedWhereTheCalibrationDoesNotFit) {
  tests::set_track_matrix(folder / "flight.mp4", {2, 0, 0, 1});
  EXPECT_THAT(ingest(options, folder / "stored").notes, ElementsAre(HasSubstr("not square")));
  imaging::Calibration shown;
  shown.camera = imaging::make_fisheye(2 * kWidth, kHeight, 155.0);
  imaging::write_kalibr(folder / "camera.yaml", shown);
  EXPECT_THAT(error(), AllOf(HasSubstr("shown as 192x64"), HasSubstr("multiply fx and cx by 0.5")));
}

TEST_F(IngestTest, ImagesTurnedUpsideDownAreNamed) {
  tests::set_track_matrix(folder / "flight.mp4", {-1, 0, 0, -1});
  EXPECT_THAT(ingest(options, folder / "set").notes, ElementsAre(HasSubstr("turned by 180 degrees")));
}

TEST_F(IngestTest, CalibrationsOfOtherFormsAreScaledOrRefusedToo) {
  const auto files = [](int width, int height) {
    const std::string w = std::to_string(width), h = std::to_string(height);
    return std::map<std::string, std::string>{
        {"opencv.yml", "%YAML:1.0\n---\nimage_width: " + w + "\nimage_height: " + h +
                           "\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                           "   data: [ 160., 0., 95.5, 0., 161., 63.5, 0., 0., 1. ]\n"
                           "distortion_coefficients: [-0.1, 0.02, 0., 0., 0.]\n"},
        {"opencv.xml", "<?xml version=\"1.0\"?>\n<opencv_storage><image_width>" + w + "</image_width><image_height>" +
                           h +
                           "</image_height><K><data>160 0 95.5 0 161 63.5 0 0 1</data></K>"
                           "<D><data>-0.1 0.02 0 0 0</data></D></opencv_storage>\n"},
        {"cameras.txt", "1 RADIAL " + w + " " + h + " 160 96 64 -0.1 0.02\n"},
        {"camera.txt", "RadTan 160 161 95.5 63.5 -0.1 0.02 0 0\n" + w + " " + h + "\nnone\n" + w + " " + h + "\n"}};
  };
  // Half the size: half the focal length, and the middle of the picture stays its middle.
  for (const auto& [name, content] : files(2 * kWidth, 2 * kHeight)) {
    options.calibration = folder / name;
    base::write_file(options.calibration, content);
    const IngestResult result = ingest(options, folder / "set");
    EXPECT_THAT(result.notes, ElementsAre(AllOf(HasSubstr(name), HasSubstr("192x128"), HasSubstr("scaled"))));
    const Dataset dataset = read_dataset(folder / "set");
    const auto pixel = dataset.calibration.camera.project({0.3, 0.0, 1.0});
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x(), 80 * 0.3 * (1 - 0.1 * 0.09 + 0.02 * 0.09 * 0.09) + 47.5, 1e-9) << name;
    EXPECT_NEAR(pixel->y(), 31.5, 1e-9) << name;
    EXPECT_EQ(dataset.metadata.at("calibration.file"), name);
    EXPECT_EQ(dataset.metadata.at("calibration.scaled_from"), "192x128");
    fs::remove_all(folder / "set");
  }
  for (const auto& [name, content] : files(kWidth, kWidth)) {
    options.calibration = folder / name;
    base::write_file(options.calibration, content);
    EXPECT_THAT(error(), AllOf(HasSubstr("96x96"), HasSubstr("96x64"), HasSubstr(name), HasSubstr("aspect")));
  }
}

TEST_F(IngestTest, RangesOfTheLogAreOnTheVideosClock) {
  options.excerpt = {.from_s = 0.5, .to_s = 1.0};
  for (int i = 0; i < 20; ++i) options.ranges.push_back({0.45 + 0.2 * i, 10.0 + i});
  ingest(options, folder / "set");
  const NumberTable table = read_number_table(folder / "set/range.csv");
  ASSERT_EQ(table.rows.size(), 5U);  // 0.35 and 1.15 are one on each side
  EXPECT_NEAR(table.rows[0][0], 0.35, 1e-9);
  EXPECT_EQ(table.rows[0][1], 12.0);
  EXPECT_NEAR(table.rows[3][0], 0.95, 1e-9);
}

TEST_F(IngestTest, ReadingsOfAnInertialUnitAreOnTheVideosClock) {
  options.excerpt = {.from_s = 0.5, .to_s = 1.0};
  std::string readings = "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n";
  for (int i = 0; i < 500; ++i) readings += std::to_string(100'000'000'000 + 10'000'000LL * i) + ",0.1,0,0,0,0,9.8\n";
  options.imu = folder / "readings.csv";
  options.imu_noise = folder / "noise.yaml";
  base::write_file(options.imu, readings);
  write_imu_yaml(options.imu_noise, {100.0, 2e-3, 3e-3, 1.7e-4, 2e-5});
  EXPECT_THAT(error(), AllOf(HasSubstr("readings.csv"), HasSubstr("do not overlap in time; check the time offset")));
  options.imu_time_offset_s = -101.0;
  const IngestResult result = ingest(options, folder / "set");
  const Dataset dataset = read_dataset(folder / "set");
  const std::vector<geometry::ImuSample> kept = read_imu_csv(dataset.imu);
  ASSERT_EQ(kept.size(), result.imu_readings);
  EXPECT_NEAR(kept.front().time_s, result.times_s.front() - 1.0, 0.011);  // a second beyond the frames, and one more
  EXPECT_NEAR(kept.back().time_s, result.times_s.back() + 1.0, 0.011);
  EXPECT_EQ(kept[7].angular_rate_rad_s.x(), 0.1);
  EXPECT_EQ(read_imu_noise(dataset.imu_noise).accelerometer_random_walk, 3e-3);
  EXPECT_EQ(dataset.metadata.at("imu_time_offset_s"), "-101");
}

TEST_F(IngestTest, FaultsOfReadingsAreFoundBeforeTheFirstImage) {
  int images = 0;
  options.is_wanted = [&](double, double) { return ++images > 0; };
  options.imu = folder / "readings.csv";
  base::write_file(options.imu, "3000000000,0,0,0,0,0,9.8\n2000000000,0,0,0,0,0,9.8\n");
  EXPECT_THAT(error(), AllOf(HasSubstr("readings.csv"), HasSubstr("line 2")));
  EXPECT_EQ(images, 0);
}

TEST_F(IngestTest, ACameraOfSeveralIsNamed) {
  options.calibration = folder / "cameras.txt";
  base::write_file(options.calibration, "1 PINHOLE 96 64 80 80 48 32\n4 PINHOLE 192 128 180 180 96 64\n");
  EXPECT_THAT(error(), HasSubstr("holds 2 cameras (1, 4): choose the one that took the images (--camera-id)"));
  options.camera_id = "4";
  ingest(options, folder / "set");
  const Dataset dataset = read_dataset(folder / "set");
  EXPECT_EQ(std::get<imaging::PinholeRadtan>(dataset.calibration.camera.model()).fx, 90.0);  // scaled
  EXPECT_EQ(dataset.metadata.at("calibration.camera"), "4");
}

TEST_F(IngestTest, TelemetryAndTruthWithoutOverlap) {
  options.gps_time_offset_s = 100.0;
  EXPECT_THAT(error(), AllOf(HasSubstr("telemetry"), HasSubstr("do not overlap in time")));
  options.gps_time_offset_s = -0.5;
  base::write_file(options.groundtruth, "1000 0 0 0 0 0 0 1\n1001 0 0 0 0 0 0 1\n");
  EXPECT_THAT(error(), AllOf(HasSubstr("poses.txt"), HasSubstr("do not overlap in time")));
}

TEST_F(IngestTest, VideoShorterThanTheExcerpt) {
  options.excerpt = {0.0, 5.0, 1};
  EXPECT_THAT(error(), AllOf(HasSubstr("2.00 s"), HasSubstr("5.00 s")));
  options.excerpt = {3.0, {}, 1};
  EXPECT_THAT(error(), HasSubstr("flight.mp4"));
  options.excerpt = {0.0, 2.0, 7};  // ends with the last frame: nothing is missing
  EXPECT_EQ(ingest(options, folder / "set").frames, 9U);
}

TEST_F(IngestTest, WhatIsNotThereOrBrokenIsNamed) {
  options.calibration = folder / "none.yaml";
  EXPECT_THAT(error(), HasSubstr("none.yaml"));
  options.calibration = folder / "camera.yaml";
  options.video_or_images = folder / "none.mp4";
  EXPECT_THAT(error(), HasSubstr("none.mp4"));
  const std::string whole = base::read_text(folder / "flight.mp4");
  base::write_file(folder / "cut.mp4", whole.substr(0, whole.size() / 2));
  options.video_or_images = folder / "cut.mp4";
  EXPECT_THAT(error(), HasSubstr("cut.mp4"));
  options.video_or_images = folder / "flight.mp4";
  options.jpeg_quality = 0;
  EXPECT_THAT(error(), HasSubstr("jpeg_quality"));
}

TEST_F(IngestTest, ExistingFolder) {
  ingest(options, folder / "set");
  EXPECT_THAT(refusal_of([&] { ingest(options, folder / "set"); }), HasSubstr("exists already"));
  options.replace = true;
  EXPECT_EQ(ingest(options, folder / "set").frames, 60U);
}

TEST_F(IngestTest, ImagesAreCopiedAsTheyAre) {
  fs::create_directory(folder / "photos");
  for (int i = 0; i < 4; ++i)
    imaging::write_rgb(folder / ("photos/p" + std::to_string(i) + ".jpg"), moving_picture(kWidth, kHeight, i), 80);
  base::write_file(folder / "times.txt", "p0 0.1 4\np1 0.2 4\np2 0.3 4\np3 0.4 4\n");
  options.video_or_images = folder / "photos";
  options.excerpt = {0.15, {}, 2};
  const IngestResult result = ingest(options, folder / "set");
  EXPECT_EQ(result.frames, 2U);
  const Dataset dataset = read_dataset(folder / "set");
  EXPECT_EQ(dataset.frames[1].time_s, 0.4);
  EXPECT_EQ(dataset.frames[1].exposure_ms, 4.0);
  EXPECT_EQ(base::read_bytes(dataset.frames[1].image), base::read_bytes(folder / "photos/p3.jpg"));
}

TEST_F(IngestTest, ImagesWithoutTimes) {
  fs::create_directory(folder / "photos");
  for (int i = 0; i < 4; ++i)
    imaging::write_rgb(folder / ("photos/p" + std::to_string(i) + ".png"), moving_picture(kWidth, kHeight, i));
  options.video_or_images = folder / "photos";
  options.image_rate_hz = 10.0;
  const IngestResult result = ingest(options, folder / "set");
  EXPECT_EQ(result.frames, 4U);
  EXPECT_DOUBLE_EQ(result.times_s.back(), 0.3);
  EXPECT_THAT(result.notes, IsEmpty()) << "the rate was given";
  EXPECT_EQ(read_dataset(folder / "set").frames[2].image.filename(), "000002.png");
  fs::remove_all(folder / "set");
  options.image_rate_hz.reset();
  EXPECT_THAT(ingest(options, folder / "set").notes, ElementsAre(HasSubstr("30.000 frames per second is assumed")));
  fs::remove_all(folder / "set");

  imaging::write_rgb(folder / "photos/p2.png", moving_picture(kWidth, kHeight / 2, 2));
  EXPECT_THAT(error(), AllOf(HasSubstr("p2.png"), HasSubstr("96x32")));
  base::write_file(folder / "photos/p2.png", "broken");
  EXPECT_THAT(error(), HasSubstr("p2.png"));
}

TEST_F(IngestTest, ImagesWithoutLossStayWithoutLoss) {
  fs::create_directory(folder / "scans");
  const std::string pixels(static_cast<std::size_t>(kWidth * kHeight), '\x12');
  for (int i = 1; i <= 10; ++i)  // 16 bits: 0x1212 of 65535
    base::write_file(folder / ("scans/s" + std::to_string(i) + ".pgm"),
                     "P5\n" + std::to_string(kWidth) + " " + std::to_string(kHeight) + "\n65535\n" + pixels + pixels);
  options.video_or_images = folder / "scans";
  const IngestResult result = ingest(options, folder / "set");
  EXPECT_THAT(result.notes, testing::Contains(HasSubstr("(s9.pgm before s10.pgm)")));
  const Dataset dataset = read_dataset(folder / "set");
  ASSERT_EQ(dataset.frames.size(), 10U);
  EXPECT_EQ(dataset.frames[0].image.extension(), ".png");
  EXPECT_EQ(imaging::read_gray16(dataset.frames[0].image)(3, 4), 0x1212);
}

TEST_F(IngestTest, ImagesThatSayWhenTheyWereTaken) {
  fs::create_directory(folder / "photos");
  for (int i = 0; i < 4; ++i)
    imaging::write_rgb(folder / ("photos/p" + std::to_string(i) + ".jpg"), moving_picture(kWidth, kHeight, i), 80);
  options.video_or_images = folder / "photos";
  options.image_times = {{"p0.jpg", {7.5, 4.0}}, {"p1.jpg", {0.0, 2.0}}, {"p3.jpg", {3.0, 0.0}}};
  const IngestResult result = ingest(options, folder / "set");
  EXPECT_THAT(result.notes, ElementsAre(HasSubstr("1 images skipped"),
                                        HasSubstr("(p3.jpg is earlier than p0.jpg); the times decide")));
  const Dataset dataset = read_dataset(folder / "set");
  ASSERT_EQ(dataset.frames.size(), 3U);
  const std::array<const char*, 3> photos{"p1.jpg", "p3.jpg", "p0.jpg"};
  const std::array<double, 3> times_s{0.0, 3.0, 7.5}, exposures_ms{2.0, 0.0, 4.0};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(dataset.frames[i].time_s, times_s[i]);
    EXPECT_EQ(dataset.frames[i].exposure_ms, exposures_ms[i]);
    EXPECT_TRUE(base::read_bytes(dataset.frames[i].image) == base::read_bytes(folder / "photos" / photos[i]));
  }
}

TEST(Ingest, Machangara) {
  TILEFLIGHT_REQUIRE_TEST_DATA(flight, "flights/machangara-a");
  tileflight::tests::TemporaryFolder folder;
  IngestOptions options;
  options.video_or_images = flight / "video.mp4";
  options.calibration = flight / "camera.yaml";
  options.groundtruth = flight / "groundtruth.txt";
  options.excerpt = {4.0, 8.0, 6};
  const IngestResult result = ingest(options, folder / "set");
  EXPECT_EQ(result.frames, 20U);
  EXPECT_EQ(result.width, 1008);
  const Dataset dataset = read_dataset(folder / "set");
  EXPECT_NEAR(dataset.calibration.camera.horizontal_fov_deg(), 155.0, 0.05);
  ASSERT_EQ(dataset.frames.size(), 20U);
  for (const Frame& frame : dataset.frames)
    EXPECT_TRUE(geometry::interpolate(*dataset.groundtruth, frame.time_s).has_value());
}

}  // namespace
}  // namespace tileflight::dataset::ingest_test
