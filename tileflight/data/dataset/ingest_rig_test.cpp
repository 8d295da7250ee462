#include "tileflight/data/dataset/ingest_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/moving_picture.h"
#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/rig.h"

// Rigs that were flown: their pictures and videos become the dataset that `render` writes of a rig.
// Times of a rig's pictures, made so that what is wrong with them is known.
namespace tileflight::dataset::ingest_rig_test {
namespace {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Vec3;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using tests::refusal_of;

constexpr int kWidth = 64, kHeight = 48, kFrames = 12;
constexpr double kPeriod_s = 0.05;
const SE3 kTurned({geometry::so3_exp(Vec3(0.02, 0.4, -0.1)), Vec3(0.2, 0.05, 0.1)});

SE3 body_pose(double time_s) {
  return {geometry::so3_exp(Vec3(0.1 * time_s, 0.2, -0.05 * time_s)), Vec3(time_s, 2.0 * time_s, 30.0)};
}

imaging::RgbImage picture(int camera, int frame) {
  imaging::RgbImage image(kWidth, kHeight);
  for (auto& pixel : image.pixels)
    pixel = {static_cast<std::uint8_t>(15 * frame), static_cast<std::uint8_t>(camera), 9};
  return image;
}

class IngestRigTest : public testing::Test {
 protected:
  IngestRigTest() {
    calibration_.camera = imaging::Camera(imaging::PinholeRadtan{50, 50, 31.5, 23.5, {}}, kWidth, kHeight);
    calibration_.T_cam_imu = SE3(geometry::so3_exp(Vec3(0, 0.3, 0)), Vec3(0.01, 0.02, 0.03));
    options_.common.calibration = folder_ / "camchain.yaml";
    options_.cameras = {{.name = "left", .calibration = calibration_},
                        {.name = "right", .calibration = calibration_, .T_body_camera = kTurned}};
    options_.cameras[1].calibration.T_cam_imu = kTurned.inverse() * calibration_.T_cam_imu;
  }

  /// A folder of pictures of camera number `camera` at body times that start at 1 s, with their times on its own clock.
  void take(int camera, double timeshift_s = 0.0, const std::vector<int>& dropped = {}, double late_s = 0.0) {
    IngestedCamera& of = options_.cameras[static_cast<std::size_t>(camera)];
    DatasetWriter writer(folder_ / of.name, of.calibration, {.png = true});
    geometry::Trajectory poses;
    std::size_t index = 0;
    for (int i = 0; i < kFrames; ++i) {
      if (std::ranges::find(dropped, i) != dropped.end()) continue;
      const double time_s = 1.0 + kPeriod_s * i;
      writer.add_frame(index++, time_s - timeshift_s + late_s, 2.5, picture(camera, i));
      poses.poses.push_back({time_s - timeshift_s, body_pose(time_s) * of.T_body_camera});
    }
    writer.set_groundtruth(poses);
    writer.finish();
    of.video_or_images = folder_ / of.name;
    of.timeshift_s = timeshift_s;
    if (camera == 0) options_.common.groundtruth = folder_ / of.name / "groundtruth.txt";
  }
  RigIngestResult ingested() const { return ingest_rig(options_, folder_ / "set"); }
  Rig rig() const { return read_rig(folder_ / "set"); }
  std::string refusal() const {
    const std::string message = refusal_of([&] { ingested(); });
    EXPECT_FALSE(fs::exists(folder_ / "set"));
    for (const auto& entry : fs::directory_iterator(folder_.path()))
      EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
    return message;
  }

  tests::TemporaryFolder folder_;
  imaging::Calibration calibration_;
  RigIngestOptions options_;
};

TEST_F(IngestRigTest, HasOfEachCameraWhatItTook) {
  take(0);
  take(1, -0.0125);
  const RigIngestResult result = ingested();
  EXPECT_THAT(result.synchronisation.faults, IsEmpty());
  EXPECT_EQ(result.synchronisation.cameras[1].matched, kFrames);
  EXPECT_THAT(rig_camera_names(folder_ / "set"), ElementsAre("left", "right"));
  const Rig rig = this->rig();
  EXPECT_EQ(rig.sync_tolerance_s, 1e-3);
  EXPECT_EQ(rig.cameras[1].timeshift_s, -0.0125);
  EXPECT_LT((rig.cameras[1].T_body_camera.matrix() - kTurned.matrix()).cwiseAbs().maxCoeff(), 1e-12);
  for (std::size_t c = 0; c < 2; ++c) {
    const Dataset& set = rig.cameras[c].dataset;
    const Dataset taken = read_dataset(folder_ / options_.cameras[c].name);
    ASSERT_EQ(set.frames.size(), std::size_t{kFrames});
    ASSERT_EQ(set.groundtruth->size(), std::size_t{kFrames});
    EXPECT_EQ(set.metadata.at("camera"), options_.cameras[c].name);
    EXPECT_EQ(set.metadata.at("cameras"), "left, right");
    EXPECT_EQ(base::read_text(set.folder / "camera.yaml"), base::read_text(taken.folder / "camera.yaml"));
    for (std::size_t i = 0; i < kFrames; ++i) {
      EXPECT_EQ(set.frames[i].time_s, taken.frames[i].time_s);
      EXPECT_EQ(set.frames[i].exposure_ms, 2.5);
      EXPECT_EQ(base::read_bytes(set.frames[i].image), base::read_bytes(taken.frames[i].image));
      const geometry::StampedPose &a = set.groundtruth->poses[i], &b = taken.groundtruth->poses[i];
      EXPECT_NEAR(a.time_s, b.time_s, 1e-9);
      EXPECT_LT((a.T_local_camera.matrix() - b.T_local_camera.matrix()).cwiseAbs().maxCoeff(), 1e-8);
    }
  }
}

TEST_F(IngestRigTest, TheChainIsThatOfARenderedRig) {
  take(0);
  take(1, 0.004);
  ingested();
  imaging::write_camchain(folder_ / "expected.yaml",
                          {{"left", ".", calibration_, {}, 0.0},
                           {"right", "cameras/right", options_.cameras[1].calibration, kTurned, 0.004}});
  EXPECT_EQ(base::read_text(folder_ / "set/camchain.yaml"), base::read_text(folder_ / "expected.yaml"));
}

TEST_F(IngestRigTest, ADroppedFrameIsCountedAndEveryNthStaysPaired) {
  take(0);
  take(1, 0.0, {3, 6});
  options_.common.excerpt.every = 2;
  const RigIngestResult every = ingested();
  EXPECT_EQ(every.cameras[0].frames, std::size_t{kFrames} / 2);
  // Of the instants 0, 2, 4, 6, 8, 10 the second camera has no picture at 6.
  EXPECT_EQ(every.cameras[1].frames, std::size_t{kFrames} / 2 - 1);
  EXPECT_EQ(every.synchronisation.cameras[1].matched, 5U);
  EXPECT_THAT(every.synchronisation.faults, ElementsAre("right: 1 image is missing, at 1.3 s"));
  options_.common.excerpt.every = 1;
  options_.common.replace = true;
  EXPECT_THAT(ingested().synchronisation.faults, ElementsAre("right: 2 images are missing, the first at 1.15 s"));
  EXPECT_EQ(rig().cameras[0].dataset.metadata.at("synchronisation.right.missing"), "2");
  const std::vector<RigInstant> instants = rig_instants(rig());
  ASSERT_EQ(instants.size(), std::size_t{kFrames});
  EXPECT_FALSE(instants[3].frames[1].has_value());
  EXPECT_EQ(instants[4].frames[1], 3U);
}

TEST_F(IngestRigTest, AnExcerptIsOnTheClockOfTheBody) {
  take(0);
  take(1, 0.025);
  options_.common.excerpt.from_s = 1.1;
  options_.common.excerpt.to_s = 1.3;
  const RigIngestResult result = ingested();
  EXPECT_EQ(result.cameras[0].frames, 4U);
  EXPECT_EQ(result.cameras[1].frames, 4U);
  EXPECT_NEAR(result.cameras[1].times_s.front(), 1.075, 1e-12);
  EXPECT_EQ(rig_instants(rig()).size(), 4U);
}

TEST_F(IngestRigTest, TimesOfOneCameraAreWrong) {
  take(0);
  take(1, 0.0, {}, 0.1);
  EXPECT_THAT(ingested().synchronisation.faults,
              ElementsAre(HasSubstr("right begins and ends 100 ms after left with as many images")));
  EXPECT_THAT(rig().cameras[0].dataset.metadata.at("synchronisation.faults"), HasSubstr("100 ms"));
}

TEST_F(IngestRigTest, APictureIsOfTheInstantWithinTheTolerance) {
  take(0);
  take(1, 0.0, {}, 0.003);
  options_.sync_tolerance_s = 0.005;
  EXPECT_THAT(ingested().synchronisation.faults, IsEmpty());
  EXPECT_EQ(rig_instants(rig()).size(), std::size_t{kFrames}) << "as those who read the dataset see it";
}

TEST_F(IngestRigTest, TheLogIsOfTheBody) {
  take(0, 0.2);
  take(1);
  for (int i = 0; i < 8; ++i) options_.common.gps.push_back({1.0 + 0.1 * i, {-0.24, -78.52, {2880.0 + i}}, 0.25, 0.4});
  const RigIngestResult result = ingested();
  EXPECT_EQ(result.cameras[0].gps_fixes, 7U) << "from 1 to 1.55 s, and one beyond";
  EXPECT_EQ(rig().cameras[1].dataset.gps.size(), 7U);
  EXPECT_FALSE(fs::exists(folder_ / "set/cameras/right/gps.csv"));
}

TEST_F(IngestRigTest, VideosAreCamerasToo) {
  for (std::size_t c = 0; c < 2; ++c) {
    options_.cameras[c].video_or_images = folder_ / (options_.cameras[c].name + ".mp4");
    video::VideoWriter writer(options_.cameras[c].video_or_images, kWidth, kHeight, {.frames_per_second = 20.0});
    for (int i = 0; i < kFrames; ++i) writer.add(tests::moving_picture(kWidth, kHeight, i + static_cast<int>(c)));
    writer.finish();
  }
  options_.cameras[1].timeshift_s = kPeriod_s;  // it was switched on one frame later
  const RigIngestResult result = ingested();
  const std::vector<RigInstant> instants = rig_instants(rig());
  ASSERT_EQ(instants.size(), std::size_t{kFrames} + 1);
  for (std::size_t i = 1; i + 1 < instants.size(); ++i) {
    EXPECT_EQ(instants[i].frames[0], i);
    EXPECT_EQ(instants[i].frames[1], i - 1);
  }
  EXPECT_EQ(result.cameras[1].frames, std::size_t{kFrames});
}

TEST_F(IngestRigTest, WhatIsWrongIsSaidInOneLineAndNothingRemains) {
  take(0);
  options_.cameras[1].video_or_images = folder_ / "none";
  EXPECT_THAT(refusal(), HasSubstr("none: no such video file or image folder"));
  options_.common.groundtruth.clear();
  take(1, 0.0, {}, 100.0);
  EXPECT_THAT(refusal(), HasSubstr("camera right: takes no image while left does"));
  options_.cameras[1].calibration.camera = imaging::Camera(imaging::PinholeRadtan{50, 50, 31.5, 31.5, {}}, 64, 64);
  EXPECT_THAT(refusal(), HasSubstr("aspect ratio differs"));
  options_.cameras[1].name = "lidar";
  EXPECT_THAT(refusal(), HasSubstr("camchain.yaml: no camera can be called 'lidar'"));
}

}  // namespace
}  // namespace tileflight::dataset::ingest_rig_test

namespace tileflight::dataset::synchronisation_test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// `count` pictures, the first at `begin_s`.
std::vector<double> times(int count, double begin_s, double period_s) {
  std::vector<double> all;
  for (int i = 0; i < count; ++i) all.push_back(begin_s + period_s * i);
  return all;
}

std::vector<double> without(std::vector<double> all, std::initializer_list<std::ptrdiff_t> dropped) {
  std::ptrdiff_t gone = 0;
  for (const std::ptrdiff_t i : dropped) all.erase(all.begin() + i - gone++);
  return all;
}

Synchronisation of_pair(const std::vector<double>& left, const std::vector<double>& right, double tolerance_s = 1e-3) {
  return check_synchronisation({{"left", left}, {"right", right}}, tolerance_s);
}

TEST(Synchronisation, OfOneTriggerIsWithoutFault) {
  const Synchronisation found = of_pair(times(40, 5.0, 0.05), times(40, 5.0, 0.05));
  EXPECT_THAT(found.faults, IsEmpty());
  EXPECT_EQ(found.cameras[1].matched, 40U);
  EXPECT_EQ(found.cameras[1].pairs, 40U);
  EXPECT_EQ(found.cameras[1].largest_skew_s, 0.0);
  EXPECT_EQ(found.cameras[1].missing + found.cameras[0].missing, 0U);
}

TEST(Synchronisation, TheLargestSkewOfMatchedPairsIsSaid) {
  std::vector<double> right = times(40, 5.0, 0.05);
  for (std::size_t i = 0; i < right.size(); ++i) right[i] += 1e-5 * static_cast<double>(i % 7);
  right[11] -= 0.0007;
  const Synchronisation found = of_pair(times(40, 5.0, 0.05), right);
  EXPECT_THAT(found.faults, IsEmpty());
  EXPECT_NEAR(found.cameras[1].largest_skew_s, 0.0007 - 4e-5, 1e-9);
  EXPECT_EQ(of_pair(times(40, 5.0, 0.05), right, 1e-4).cameras[1].matched, 39U);
}

TEST(Synchronisation, AHundredMillisecondsAreNamedWhateverTheRate) {
  // The delay is less than half a period at 4 images a second, and whole frames at 20 and 10.
  EXPECT_THAT(of_pair(times(40, 5.0, 0.25), times(40, 5.1, 0.25)).faults,
              ElementsAre("right is not synchronised with left: its images are 100 ms later (median), 0 of 40 are "
                          "within 1 ms; give the camchain a timeshift_cam_imu, or a larger tolerance"));
  EXPECT_THAT(of_pair(times(40, 5.0, 0.25), times(40, 4.9, 0.25)).faults[0],
              testing::HasSubstr("its images are 100 ms earlier (median)"));
  EXPECT_THAT(
      of_pair(times(40, 5.0, 0.05), times(40, 5.1, 0.05)).faults,
      ElementsAre("right begins and ends 100 ms after left with as many images, so its time stamps may be late; "
                  "give the camchain a timeshift_cam_imu"));
  EXPECT_THAT(of_pair(times(40, 5.0, 0.1), times(40, 4.9, 0.1)).faults[0],
              testing::HasSubstr("right begins and ends 100 ms before left"));
  EXPECT_THAT(of_pair(times(40, 5.0, 0.25), times(40, 5.1, 0.25), 0.11).faults, IsEmpty()) << "a tolerance of the user";
}

TEST(Synchronisation, DroppedFramesAreCounted) {
  const std::vector<double> all = times(40, 5.0, 0.05);
  const Synchronisation found = of_pair(all, without(all, {3, 4, 20}));
  EXPECT_EQ(found.cameras[1].missing, 3U);
  EXPECT_EQ(found.cameras[0].missing, 0U);
  EXPECT_EQ(found.cameras[1].matched, 37U);
  EXPECT_THAT(found.faults, ElementsAre("right: 3 images are missing, the first at 5.15 s"));
  EXPECT_THAT(of_pair(without(all, {9}), all).faults, ElementsAre("left: 1 image is missing, at 5.45 s"));
  // One that triggers when it likes has no gaps of its own.
  const std::vector<double> irregular{1.0, 1.4, 3.0, 3.1, 5.0, 5.5, 9.0};
  EXPECT_THAT(of_pair(irregular, irregular).faults, IsEmpty());
  EXPECT_THAT(of_pair(irregular, without(irregular, {4})).faults, ElementsAre("right: 1 image is missing, at 5 s"));
}

TEST(Synchronisation, ACameraThatStopsEarlyOrStartsLateIsNamed) {
  const Synchronisation found = of_pair(times(40, 5.0, 0.05), times(20, 5.0, 0.05));
  EXPECT_THAT(found.faults, ElementsAre("right stops at 5.95 s, 1 s before the last image of the rig"));
  EXPECT_NEAR(found.cameras[1].stops_early_s, 1.0, 1e-9);
  EXPECT_EQ(found.cameras[1].matched, 20U);
  EXPECT_EQ(found.cameras[1].missing, 0U);
  EXPECT_THAT(of_pair(times(40, 5.0, 0.05), times(36, 5.2, 0.05)).faults,
              ElementsAre("right starts at 5.2 s, 0.2 s after the first image of the rig"));
}

TEST(Synchronisation, ASlowerCameraIsMatchedByItsOwnPictures) {
  const std::vector<double> down = times(10, 5.0, 0.2);
  EXPECT_THAT(of_pair(times(40, 5.0, 0.05), down).faults, IsEmpty());
  EXPECT_THAT(of_pair(down, times(40, 5.0, 0.05)).faults, IsEmpty());
  EXPECT_EQ(of_pair(down, times(40, 5.0, 0.05)).cameras[1].pairs, 10U);
  EXPECT_THAT(of_pair(times(40, 5.0, 0.05), without(down, {5})).faults,
              ElementsAre("right: 1 image is missing, at 6 s"));
  EXPECT_THAT(of_pair(times(40, 5.0, 0.05), times(10, 5.02, 0.2)).faults[0], testing::HasSubstr("20 ms later"));
}

TEST(Synchronisation, CamerasThatNeverRunTogetherAreRefused) {
  EXPECT_EQ(tests::refusal_of([] { of_pair(times(10, 5.0, 0.05), times(10, 1.7e9, 0.05)); }),
            "camera right: takes no image while left does (1700000000 s to 1700000000.45 s against 5 s to 5.45 s): "
            "check their times");
}

TEST(Synchronisation, SinglePicturesHaveNoPeriod) {
  EXPECT_THAT(of_pair({2.0}, {2.0}).faults, IsEmpty());
  EXPECT_THAT(of_pair(times(3, 2.0, 0.1), {2.1}).cameras[1].matched, 1U);
}

}  // namespace
}  // namespace tileflight::dataset::synchronisation_test
