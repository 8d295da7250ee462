// Real sequences with known results, if the test data are available: forward driving, which defeats two-frame
// initialization, a static camera, a hand-held camera.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <fstream>
#include <sstream>

#include "tests/test_data.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::odometry::real_sequences_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;

/// Every `every`-th of the first `most` images of a folder; images of the folder are 0.1 s apart.
FrameSource pictures_of(const fs::path& folder, std::size_t most, std::size_t every = 1) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  files.resize(std::min(files.size(), most));
  return [files, every, next = std::size_t{0}]() mutable -> std::optional<InputFrame> {
    if (next >= files.size()) return std::nullopt;
    InputFrame frame;
    frame.index = static_cast<std::int64_t>(next);
    frame.time_s = 0.1 * static_cast<double>(next);
    frame.image = imaging::read_rgb(files[next]);
    next += every;
    return frame;
  };
}

/// RMS distance after alignment by a similarity, metres.
double ate_m(const geometry::Trajectory& estimate, const std::vector<Vec3>& truth) {
  Eigen::Matrix3Xd from(3, estimate.size()), to(3, estimate.size());
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    from.col(i) = estimate.poses[i].T_local_camera.translation;
    to.col(i) = truth.at(static_cast<std::size_t>(std::lround(estimate.poses[i].time_s / 0.1)));
  }
  const Eigen::Matrix4d T = Eigen::umeyama(from, to, true);
  const Eigen::Matrix3Xd moved = (T.topLeftCorner<3, 3>() * from).colwise() + T.topRightCorner<3, 1>();
  return std::sqrt((moved - to).colwise().squaredNorm().mean());
}

struct Drive {
  imaging::Calibration calibration;
  std::vector<Vec3> truth;
};

Drive read_drive(const fs::path& folder) {
  Drive drive;
  std::ifstream poses(folder / "poses.txt");
  for (std::string line; std::getline(poses, line);) {
    std::istringstream numbers(line);
    std::array<double, 12> row{};
    for (double& value : row) numbers >> value;
    drive.truth.emplace_back(row[3], row[7], row[11]);
  }
  drive.calibration.camera =
      imaging::Camera(imaging::PinholeRadtan{707.0912, 707.0912, 601.8873, 183.1104, {}}, 1226, 370);
  return drive;
}

TEST(RealSequences, ForwardDrivingStartsAndKeepsToHalfAPercentOfThePath) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/kitti_seq1_51frames");
  const Drive drive = read_drive(folder);
  const OdometryResult result = run_odometry(drive.calibration, pictures_of(folder / "image_l", 51), {});
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_EQ(result.frames_tracked, 51);
  EXPECT_LT(ate_m(result.trajectory, drive.truth), 0.3);  // of 59.9 m
}

TEST(RealSequences, ForwardDrivingOfTwoAndAHalfMetresAPictureStartsWithinFive) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/kitti_seq1_51frames");
  const Drive drive = read_drive(folder);
  const FrameSource source = pictures_of(folder / "image_l", 51, 2);
  Odometry odometry(drive.calibration);
  std::int64_t start = 0;
  while (auto frame = source()) {
    const bool tracked = odometry.add(std::move(*frame)).status == FrameStatus::kTracked;
    if (tracked && start == 0) start = odometry.frames();
  }
  const OdometryResult result = odometry.finish();
  EXPECT_GT(start, 0);
  EXPECT_LE(start, 5);
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_EQ(result.frames_tracked, 26);
  EXPECT_LT(ate_m(result.trajectory, drive.truth), 0.3);
}

TEST(RealSequences, ACameraThatStandsStillHasNoMap) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/euroc_V1_01_static");
  imaging::Calibration calibration;
  calibration.camera = imaging::Camera(
      imaging::PinholeRadtan{458.654, 457.296, 367.215, 248.375, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}},
      752, 480);
  const OdometryResult result = run_odometry(calibration, pictures_of(folder / "mav0/cam0/data", 25), {});
  EXPECT_TRUE(result.lost);
  EXPECT_EQ(result.frames_tracked, 0);
  EXPECT_TRUE(result.map.empty());
  EXPECT_EQ(result.lost_reason.rfind("no parallax", 0), 0U) << result.lost_reason;
}

TEST(RealSequences, ACameraInTheHandIsFollowedToAFewCentimetres) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/seven_scenes_500");
  std::vector<Vec3> truth;
  for (const auto& pose : geometry::read_tum(folder / "groundtruth.txt").poses)
    truth.push_back(pose.T_local_camera.translation);
  keyframes::OdometryOptions options;
  options.window.active_points = 1200;
  options.selection.points_per_keyframe = 800;
  const auto calibration = imaging::read_calibration(folder / "camera.yaml");
  const OdometryResult result = run_odometry(calibration, pictures_of(folder / "images", 120), options);
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_EQ(result.frames_tracked, 120);
  EXPECT_LT(ate_m(result.trajectory, truth), 0.03);  // the truth itself has an error of about 0.02 m (it is of another
                                                     // camera)
}

}  // namespace
}  // namespace tileflight::odometry::real_sequences_test
