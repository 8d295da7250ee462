#include <gtest/gtest.h>

#include <cmath>

#include "tests/temporary_folder.h"
#include "tileflight/capture/recording/sensor_recorder.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/slam/inertial/preintegration.h"

namespace tileflight::recording::recorded_imu_test {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr double kGravity_m_s2 = 9.80665;
const SE3 kT_camera_imu(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), Vec3(0.3, -0.05, -0.2));

/// Four seconds of a curve, the camera turning; frames at 10 Hz from 3 s on.
geometry::Trajectory frames() {
  geometry::Trajectory trajectory;
  for (int i = 0; i <= 40; ++i) {
    const double t = 0.1 * i;
    SE3 pose = render::test_scenes::looking_down(Vec3(8.0 * std::sin(0.6 * t), 3.0 * t, 20.0 + std::cos(0.9 * t)));
    pose.rotation = Eigen::AngleAxisd(0.5 * std::sin(0.7 * t), Vec3::UnitZ()) * pose.rotation *
                    Eigen::AngleAxisd(0.3 * std::sin(1.1 * t), Vec3::UnitX());
    trajectory.poses.push_back({3.0 + t, pose});
  }
  return trajectory;
}

std::vector<geometry::ImuSample> recorded(const std::filesystem::path& folder) {
  sensors::SensorSuite suite;
  suite.imu = sensors::imu_preset("perfect");
  suite.imu->rate_hz = 400.0;
  suite.imu->T_camera_imu = kT_camera_imu;
  SensorRecorder files(suite, flight_path::path_through_poses(frames()), frames());
  files.write({}, 3.0, folder);
  return dataset::read_imu_csv(folder / "imu.csv");
}

/// The unit's pose at a frame, by T_cam_imu.
SE3 imu_pose(std::size_t frame) { return frames().poses[frame].T_local_camera * kT_camera_imu; }

// imu.csv is of the poses that the frames have at their times: its readings, integrated from frame to frame, turn the
// unit as the frames do, and change its mean velocity from one pair of frames to the next as the frames do. That holds
// with the specific force upwards at rest, standard gravity, T_cam_imu from the unit to the camera, and no delay: a
// delay of a thousandth of a second would be 5e-4 m/s and 5e-4 rad.
TEST(RecordedImu, AgreesWithTheFramesPoses) {
  const tests::TemporaryFolder folder;
  const auto samples = recorded(folder.path());
  for (std::size_t i = 2; i + 6 <= 38; i += 3) {
    const double begin_s = frames().poses[i].time_s, middle_s = frames().poses[i + 3].time_s,
                 end_s = frames().poses[i + 6].time_s;
    const auto one = inertial::preintegrate(samples, begin_s, middle_s, {}, {}).value();
    const auto two = inertial::preintegrate(samples, middle_s, end_s, {}, {}).value();
    const SE3 a = imu_pose(i), b = imu_pose(i + 3), c = imu_pose(i + 6);
    EXPECT_LT((a.rotation * one.increment.rotation).angularDistance(b.rotation), 2e-5) << i;
    const Vec3 change =
        (c.translation - b.translation) / two.duration_s - (b.translation - a.translation) / one.duration_s;
    const Vec3 felt = a.rotation * one.increment.velocity + b.rotation * two.increment.position / two.duration_s -
                      a.rotation * one.increment.position / one.duration_s -
                      0.5 * (one.duration_s + two.duration_s) * kGravity_m_s2 * Vec3::UnitZ();
    EXPECT_LT((change - felt).norm(), 1e-4) << i;
  }
}

}  // namespace
}  // namespace tileflight::recording::recorded_imu_test
