#include "tileflight/core/geometry/trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::geometry::trajectory_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Trajectory spiral(int poses, double first_s = 0.0, double step_s = 0.1) {
  Trajectory trajectory;
  for (int i = 0; i < poses; ++i) {
    const double angle = 0.2 * i;
    trajectory.poses.push_back(
        {first_s + step_s * i, SE3(so3_exp(Vec3(0.1, angle, 0)), Vec3(std::cos(angle), std::sin(angle), 0.05 * i))});
  }
  return trajectory;
}

Trajectory read_lines(const std::string& text) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "t.txt", text);
  return read_tum(folder / "t.txt");
}

TEST(Tum, RoundTripIsExact) {
  const tests::TemporaryFolder folder;
  const Trajectory written = spiral(50, 1305031102.175304, 1.0 / 30.0);
  write_tum(folder / "t.txt", written);
  const Trajectory read = read_tum(folder / "t.txt");
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read.poses[i].time_s, written.poses[i].time_s);
    EXPECT_EQ(read.poses[i].T_local_camera.translation, written.poses[i].T_local_camera.translation);
    EXPECT_LT(read.poses[i].T_local_camera.rotation.angularDistance(written.poses[i].T_local_camera.rotation), 1e-15);
  }
}

TEST(Tum, AcceptsCommentsBlankLinesTabsAndWindowsEnds) {
  const Trajectory read = read_lines("# c\r\n\r\n1 1 2 3 0 0 0 1\r\n  # d\n2\t1 2 3\t0 0 0 -1.004");
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read.poses[0].T_local_camera.translation, Vec3(1, 2, 3));
  EXPECT_DOUBLE_EQ(read.poses[1].T_local_camera.rotation.norm(), 1.0);
}

TEST(Tum, BadInputIsNamedWithItsLine) {
  const auto expect = [](const std::string& text, const std::string& message) {
    EXPECT_THAT([&] { read_lines(text); }, ThrowsMessage<InputError>(HasSubstr(message))) << text;
  };
  expect("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n", "line 2: expected 8 numbers");
  expect("1 0 0 0 0 0 0 1 9\n", "line 1: expected 8 numbers");
  expect("1 0 nan 0 0 0 0 1\n", "line 1: 'nan' is not a finite number");
  expect("1 0 inf 0 0 0 0 1\n", "'inf' is not a finite number");
  expect("1 0 0x 0 0 0 0 1\n", "'0x' is not a finite number");
  expect("1 0 0 0 0 0 0 0\n", "the quaternion has length 0");
  expect("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "line 2: the time is before the previous one");
  EXPECT_THAT([] { read_tum("/no/such/file"); }, ThrowsMessage<InputError>(HasSubstr("No such file")));
}

TEST(Tum, KeepsTheFirstOfPosesWithOneTime) {
  const Trajectory read = read_lines("1 1 0 0 0 0 0 1\n1 2 0 0 0 0 0 1\n2 3 0 0 0 0 0 1\n");
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read.poses[0].T_local_camera.translation.x(), 1.0);
}

TEST(PathLength, OfASquare) {
  Trajectory square;
  const Vec3 corners[] = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 0}};
  for (const Vec3& c : corners) square.poses.push_back({static_cast<double>(square.size()), SE3(Mat3::Identity(), c)});
  EXPECT_DOUBLE_EQ(path_length_m(square), 8.0);
  EXPECT_EQ(path_length_m({}), 0.0);
}

TEST(Interpolate, HitsThePosesAndHalvesBetween) {
  const Trajectory t = spiral(5);
  for (const StampedPose& pose : t.poses) {
    EXPECT_EQ(interpolate(t, pose.time_s)->translation, pose.T_local_camera.translation);
  }
  const SE3 half = *interpolate(t, 0.5 * (t.poses[1].time_s + t.poses[2].time_s));
  const SE3& a = t.poses[1].T_local_camera;
  const SE3& b = t.poses[2].T_local_camera;
  EXPECT_LT((half.translation - 0.5 * (a.translation + b.translation)).norm(), 1e-12);
  EXPECT_NEAR(half.rotation.angularDistance(a.rotation), half.rotation.angularDistance(b.rotation), 1e-9);
}

TEST(Interpolate, NothingOutside) {
  const Trajectory t = spiral(3, 10.0);
  EXPECT_FALSE(interpolate(t, 9.999));
  EXPECT_FALSE(interpolate(t, 10.201));
  EXPECT_FALSE(interpolate({}, 0.0));
  EXPECT_FALSE(interpolate(t, std::nan("")));
}

TEST(Associate, FindsTheNearestWithinTheLimitOnceEach) {
  const Trajectory a = spiral(10, 0.0, 0.1);
  const Trajectory b = spiral(100, 0.004, 0.01);
  const auto pairs = associate(a, b, 0.01);
  ASSERT_EQ(pairs.size(), 10U);
  for (const auto& [i, j] : pairs) EXPECT_LE(std::abs(a.poses[i].time_s - b.poses[j].time_s), 0.0061);
  EXPECT_TRUE(associate(a, spiral(10, 0.05, 0.1), 0.01).empty());
  EXPECT_TRUE(associate(a, {}, 1.0).empty());
  EXPECT_TRUE(associate({}, a, 1.0).empty());
}

TEST(Associate, EqualsBruteForceOverAllPairs) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> step(0.01, 0.1);
  const auto random_times = [&](int n) {
    Trajectory t = spiral(n);
    double time = 0.0;
    for (StampedPose& pose : t.poses) pose.time_s = time += step(random);
    return t;
  };
  const Trajectory a = random_times(60), b = random_times(80);
  std::vector<std::pair<std::size_t, std::size_t>> expected;
  const auto gap = [&](std::size_t i, std::size_t j) { return std::abs(a.poses[i].time_s - b.poses[j].time_s); };
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      bool best = gap(i, j) <= 0.03;
      for (std::size_t k = 0; k < b.size(); ++k) best = best && (k == j || gap(i, j) < gap(i, k));
      for (std::size_t k = 0; k < a.size(); ++k) best = best && (k == i || gap(i, j) < gap(k, j));
      if (best) expected.emplace_back(i, j);
    }
  }
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(associate(a, b, 0.03), expected);
}

TEST(Transformed, ByASimilarityAndBack) {
  const Sim3 S(2.0, so3_exp(Vec3(1, 0, 2)), Vec3(5, 6, 7));
  const Trajectory t = spiral(20);
  const Trajectory moved = transformed(S, t);
  EXPECT_NEAR(path_length_m(moved), 2.0 * path_length_m(t), 1e-12);
  const Trajectory back = transformed(S.inverse(), moved);
  for (std::size_t i = 0; i < t.size(); ++i) {
    EXPECT_LT((back.poses[i].T_local_camera.matrix() - t.poses[i].T_local_camera.matrix()).norm(), 1e-12);
  }
}

TEST(Tum, ReadsFilesOfOtherPrograms) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "trajectories/evo");
  // Numbers of lines that are not comments.
  EXPECT_EQ(read_tum(folder / "freiburg1_xyz-groundtruth.txt").size(), 3000U);
  EXPECT_EQ(read_tum(folder / "freiburg1_xyz-rgbdslam.txt").size(), 788U);
  const Trajectory truth = read_tum(folder / "fr2_desk_groundtruth.txt");
  EXPECT_EQ(truth.size(), 20957U - 1U);  // one time comes twice
  const Trajectory orb = read_tum(folder / "fr2_desk_ORB.txt");
  EXPECT_EQ(associate(orb, truth, 0.01).size(), 2174U);  // the truth has gaps: counted by brute force
}

}  // namespace
}  // namespace tileflight::geometry::trajectory_test

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

TEST_F(TrajectoryFiles, AHeadingNamesTheColumnsWhereverTheyStand) {
  const Vec3& t = kPose.translation;
  const Eigen::Quaterniond& q = kPose.rotation;
  const std::string w_first = row({t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()}, ' ');
  const std::string w_last = row({t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}, ',');
  for (const std::string& text :
       {"# trajectory of my system\n# timestamp tx ty tz qw qx qy qz\n12.5 " + w_first + "\n",
        "timestamp tx ty tz qw qx qy qz\n12.5 " + w_first + "\n",
        "id time_ns x y z q_w q_x q_y q_z\n7 12500000000 " + w_first + "\n",
        "num,time_s,x,y,z,qx,qy,qz,qw\n0,12.5," + w_last + "\n",
        "#timestamp [s],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_x [],q_RS_y [],q_RS_z [],q_RS_w [],v_x\n12.5," +
            w_last + ",9\n"}) {
    const TrajectoryFile read_back = read(text);
    ASSERT_EQ(read_back.trajectory.size(), 1u) << text;
    EXPECT_DOUBLE_EQ(read_back.trajectory.poses[0].time_s, 12.5) << text;
    expect_pose(read_back.trajectory.poses[0].T_local_camera);
  }
  EXPECT_THAT(refusal("# time tx ty tz qw qx qy qz\n1 0 0 0 1\n"),
              HasSubstr("line 2: expected 8 fields as in its heading"));
}

TEST_F(TrajectoryFiles, NamesWhatIsNoTrajectoryOfKnownColumns) {
  const Vec3& t = kPose.translation;
  const Eigen::Quaterniond& q = kPose.rotation;
  const std::string w_last = row({t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}, ',');
  const TrajectoryFile ros = read(
      "%time,field.position.x,field.position.y,field.position.z,field.orientation.x,field.orientation.y,"
      "field.orientation.z,field.orientation.w\n12500000000," +
      w_last + "\n");
  EXPECT_DOUBLE_EQ(ros.trajectory.poses.at(0).time_s, 12.5);
  expect_pose(ros.trajectory.poses[0].T_local_camera);
  EXPECT_THAT(refusal("day,x,y,z,qx,qy,qz,qw\n12," + w_last + "\n"),
              HasSubstr("its heading 'day,x,y,z,qx,qy,qz,qw' must name one column each for time"));
  EXPECT_THAT(refusal("1 0 0 0 10 20 30 1\n"), HasSubstr("has length 37.4"));
  std::string rounded;
  for (int i = 0; i < 20; ++i) rounded += "1.403636579e+09 " + std::to_string(i) + " 0 0 0 0 0 1\n";
  EXPECT_THAT(refusal(rounded), HasSubstr("19 of 20 poses have the time of the one before"));
}

TEST_F(TrajectoryFiles, ReadsTimesInTwoColumnsAndInEveryUnit) {
  const Vec3& t = kPose.translation;
  const Eigen::Quaterniond& q = kPose.rotation;
  const auto pose = [&](char separator) { return row({t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}, separator); };
  const std::string names = ",x,y,z,qx,qy,qz,qw\n";
  for (const std::string& text :
       {"timestamp_nsec" + names + "12500000000," + pose(','), "sec,nsec" + names + "12,500000000," + pose(','),
        "header.stamp.secs,header.stamp.nsecs" + names + "12,500000000," + pose(','),
        "stamp_sec,stamp_nanosec" + names + "12,500000000," + pose(','), "timestamp_ms" + names + "12500," + pose(','),
        "time [us]" + names + "12500000," + pose(','), "# timestamp [us] x y z qx qy qz qw\n12500000 " + pose(' '),
        "t_us x y z qx qy qz qw\n12500000 " + pose(' ')}) {
    const TrajectoryFile read_back = read(text + "\n");
    ASSERT_EQ(read_back.trajectory.size(), 1u) << text;
    EXPECT_DOUBLE_EQ(read_back.trajectory.poses[0].time_s, 12.5) << text;
    expect_pose(read_back.trajectory.poses[0].T_local_camera);
  }
}

TEST_F(TrajectoryFiles, ReadsSemicolonsAndDecimalCommas) {
  const TrajectoryFile semicolons = read("time;x;y;z;qx;qy;qz;qw\n12,5;1,25;-2;3,5;0;0;0;1\n13;1;2;3;0;0;0;1,0\n");
  ASSERT_EQ(semicolons.trajectory.size(), 2u);
  EXPECT_EQ(semicolons.trajectory.poses[0].time_s, 12.5);
  EXPECT_EQ(semicolons.trajectory.poses[0].T_local_camera.translation, Vec3(1.25, -2, 3.5));
  EXPECT_EQ(read("time;x;y;z;qx;qy;qz;qw\n12.5;1;2;3;0;0;0;1\n").trajectory.poses.at(0).time_s, 12.5);
  const TrajectoryFile tum = read("# timestamp tx ty tz qx qy qz qw\n12,5 1,25 -2 3,5 0 0 0 1\n");
  EXPECT_EQ(tum.format, TrajectoryFormat::kTum);
  EXPECT_EQ(tum.trajectory.poses.at(0).T_local_camera.translation, Vec3(1.25, -2, 3.5));
}

TEST_F(TrajectoryFiles, TellsNanosecondsFromSeconds) {
  const TrajectoryFile orb = read("1403636579763555584 0 0 0 0 0 0 1\n1403636579813555456 1 0 0 0 0 0 1\n");
  ASSERT_EQ(orb.trajectory.size(), 2u);
  EXPECT_NEAR(orb.trajectory.poses[0].time_s, 1403636579.763555584, 1e-6);
  EXPECT_NEAR(orb.trajectory.poses[1].time_s, 1403636579.813555456, 1e-6);
  EXPECT_NEAR(read("1403636579763.5 0 0 0 0 0 0 1\n").trajectory.poses.at(0).time_s, 1403636579.7635, 1e-6);
}

TEST_F(TrajectoryFiles, LeavesOutRowsThatSayThatThereIsNoPose) {
  const TrajectoryFile truth = read("1 0 0 0 0 0 0 1\n2 NaN NaN NaN NaN NaN NaN NaN\n3 1 0 0 0 0 0 1\n");
  ASSERT_EQ(truth.trajectory.size(), 2u);
  EXPECT_EQ(truth.trajectory.poses[1].time_s, 3.0);
  EXPECT_THAT(refusal("1 nan nan nan 0 0 0 1\n"), HasSubstr("'nan' is not a finite number"));
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
