#include "tileflight/core/geometry/trajectory_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::geometry::trajectory_files_test {
namespace {

using ::testing::HasSubstr;

class TrajectoryFiles : public ::testing::Test {
 protected:
  TrajectoryFile read(const std::string& text) const {
    base::write_file(folder_ / "poses", text);
    return read_trajectory(folder_ / "poses");
  }
  std::string refusal(const std::string& text) const {
    return tests::refusal_of([&] { read(text); });
  }

  tests::TemporaryFolder folder_;
};

/// Some pose whose numbers all differ.
const SE3 kPose(so3_exp({0.3, -0.8, 1.1}), {1.5, -2.25, 3.125});

void expect_pose(const SE3& pose, double tolerance = 1e-12) {
  EXPECT_LT((pose.translation - kPose.translation).norm(), tolerance);
  EXPECT_LT(pose.rotation.angularDistance(kPose.rotation), 10.0 * tolerance);
}

/// The numbers, one after the other.
std::string row(const std::vector<double>& numbers, char separator) {
  std::string text;
  for (const double number : numbers) {
    if (!text.empty()) text += separator;
    base::append_number(text, number);
  }
  return text;
}

TEST_F(TrajectoryFiles, TheSamePoseInEachFormat) {
  const Vec3& t = kPose.translation;
  const Eigen::Quaterniond& q = kPose.rotation;
  const TrajectoryFile tum = read("# a comment\n" + row({12.5, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}, ' '));
  EXPECT_EQ(tum.format, TrajectoryFormat::kTum);
  EXPECT_EQ(tum.trajectory.poses.at(0).time_s, 12.5);
  expect_pose(tum.trajectory.poses[0].T_local_camera);

  const std::string w_first = row({t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()}, ',');
  for (const std::string& text :
       {"#timestamp [ns], p_RS_R_x [m], …\n12500000000," + w_first + ",0.1,0.2\r\n", "12500000000," + w_first + "\n",
        "timestamp,x,y,z,qw,qx,qy,qz\n12500000000, " + w_first}) {
    const TrajectoryFile euroc = read(text);
    EXPECT_EQ(euroc.format, TrajectoryFormat::kEuroc) << text;
    ASSERT_EQ(euroc.trajectory.size(), 1u) << text;
    EXPECT_DOUBLE_EQ(euroc.trajectory.poses[0].time_s, 12.5);
    expect_pose(euroc.trajectory.poses[0].T_local_camera);
  }

  const Mat4 M = kPose.matrix();
  std::vector<double> numbers;
  for (int i = 0; i < 12; ++i) numbers.push_back(M(i / 4, i % 4));
  const TrajectoryFile kitti = read(row(numbers, ' ') + "\n" + row(numbers, ' ') + "\n");
  EXPECT_EQ(kitti.format, TrajectoryFormat::kKitti);
  EXPECT_FALSE(kitti.has_times());
  ASSERT_EQ(kitti.trajectory.size(), 2u);
  EXPECT_EQ(kitti.trajectory.poses[1].time_s, 1.0) << "the index";
  expect_pose(kitti.trajectory.poses[1].T_local_camera);
}

TEST_F(TrajectoryFiles, AHeaderTellsTheOrderAndTheUnit) {
  const Vec3& t = kPose.translation;
  const Eigen::Quaterniond& q = kPose.rotation;
  const std::string w_last = row({t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}, ',');
  const TrajectoryFile ns = read("ts (ns),tx (m),ty (m),tz (m),qx,qy,qz,qw\n12500000000," + w_last + "\n");
  EXPECT_DOUBLE_EQ(ns.trajectory.poses.at(0).time_s, 12.5);
  expect_pose(ns.trajectory.poses[0].T_local_camera);
  const TrajectoryFile seconds = read("#timestamp [s],tx,ty,tz,q_x [],q_y [],q_z [],q_w []\n12.5," + w_last + "\n");
  EXPECT_EQ(seconds.trajectory.poses.at(0).time_s, 12.5);
  expect_pose(seconds.trajectory.poses[0].T_local_camera);
}

TEST_F(TrajectoryFiles, KeepsTheFirstOfPosesWithOneTime) {
  EXPECT_EQ(read("1,1,0,0,1,0,0,0\n1,2,0,0,1,0,0,0\n2,3,0,0,1,0,0,0\n").trajectory.size(), 2u);
}

TEST_F(TrajectoryFiles, RefusesBadInput) {
  EXPECT_THAT(refusal(""), HasSubstr("holds no poses"));
  EXPECT_THAT(refusal("# nothing\n\n"), HasSubstr("holds no poses"));
  EXPECT_THAT(refusal("1 2 3\n"), HasSubstr("line 1: is a trajectory of no known format"));
  EXPECT_THAT(refusal("\x89PNG\r\n"), HasSubstr("no known format"));
  EXPECT_THAT(refusal("time,x,y\n"), HasSubstr("holds no poses")) << "a header alone";
  EXPECT_THAT(refusal("1,0,0,0,1,0,0,0\n2,0,0,0,1\n"),
              HasSubstr("line 2: expected a time in nanoseconds and 7 numbers"));
  EXPECT_THAT(refusal("1,0,0,0,1,0,0,0\nx,0,0,0,1,0,0,0\n"), HasSubstr("'x' is not a time in whole nanoseconds"));
  EXPECT_THAT(refusal("1.5,0,0,0,1,0,0,0\n"), HasSubstr("'1.5' is not a time in whole nanoseconds"));
  EXPECT_THAT(refusal("1,0,nan,0,1,0,0,0\n"), HasSubstr("'nan' is not a finite number"));
  EXPECT_THAT(refusal("1,0,0,0,0,0,0,0\n"), HasSubstr("the quaternion has length 0"));
  EXPECT_THAT(refusal("2,0,0,0,1,0,0,0\n1,0,0,0,1,0,0,0\n"), HasSubstr("line 2: the time is before"));
  const std::string good = "1 0 0 0 0 1 0 0 0 0 1 0\n";
  EXPECT_EQ(read(good).trajectory.size(), 1u);
  EXPECT_THAT(refusal(good + "1 0 0 0\n"), HasSubstr("line 2: expected 12 numbers"));
  EXPECT_THAT(refusal(good + "2 0 0 0 0 2 0 0 0 0 2 0\n"), HasSubstr("line 2: the first three columns"));
  EXPECT_THAT(refusal(good + "1 0 0 0 0 1 0 0 0 0 -1 0\n"), HasSubstr("not a rotation")) << "mirrored";
  EXPECT_THAT(tests::refusal_of([] { read_trajectory("/no/such/file"); }), HasSubstr("No such file"));
}

TEST_F(TrajectoryFiles, ReadsFilesOfOtherPrograms) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "trajectories/evo");
  const TrajectoryFile truth = read_trajectory(folder / "V102_groundtruth.csv"),
                       estimate = read_trajectory(folder / "V102.txt");
  EXPECT_EQ(truth.format, TrajectoryFormat::kEuroc);
  EXPECT_EQ(estimate.format, TrajectoryFormat::kTum);
  EXPECT_NEAR(truth.trajectory.poses[0].time_s, 1403715524.907143168, 1e-6);
  EXPECT_EQ(truth.trajectory.poses[0].T_local_camera.translation, Vec3(0.515356, 1.996773, 0.971104));
  EXPECT_NEAR(std::abs(truth.trajectory.poses[0].T_local_camera.rotation.w()), 0.161996, 1e-6);
  EXPECT_GT(associate(estimate.trajectory, truth.trajectory).size(), estimate.trajectory.size() / 2);
}

}  // namespace
}  // namespace tileflight::geometry::trajectory_files_test
