#include "tileflight/odometry/direction_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <utility>

namespace tileflight::odometry::direction_check_test {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::size_t kImages = 80;

/// A curved path without warnings. From image `bend_at` on its lengths are `scale` times as long.
OdometryResult flight(double scale = 1.0, std::size_t bend_at = kImages / 2) {
  OdometryResult result;
  Vec3 position = Vec3::Zero();
  for (std::size_t i = 0; i < kImages; ++i) {
    const double angle = 0.02 * static_cast<double>(i);
    if (i > 0) position += (i >= bend_at ? scale : 1.0) * Vec3(std::cos(angle), std::sin(angle), 0.0);
    const SE3 pose(Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vec3::UnitZ())), position);
    result.trajectory.poses.push_back({0.1 * static_cast<double>(i), pose});
    tracking::FrameQuality quality;
    quality.frame = static_cast<std::int64_t>(i);
    quality.time_s = 0.1 * static_cast<double>(i);
    quality.tracked = true;
    quality.rmse = 3.0;
    result.quality.push_back(quality);
  }
  result.frames = result.frames_tracked = kImages;
  return result;
}

/// Stands in for tracking: the path of each direction, from its first image and from a later one.
struct Runs {
  OdometryResult other = flight(), same_later = flight(), other_later = flight();
  mutable int later_runs = 0;

  DirectionCheck check(const OdometryResult& run, bool may_use_other = true) const {
    return check_directions(run, kImages, may_use_other, [&](Direction direction, std::size_t left_out) {
      if (left_out == 0) return other;
      ++later_runs;
      OdometryResult result = direction == Direction::kSame ? same_later : other_later;
      auto& poses = result.trajectory.poses;
      const auto count = static_cast<std::ptrdiff_t>(left_out);
      if (direction == Direction::kSame)
        poses.erase(poses.begin(), poses.begin() + count);
      else
        poses.erase(poses.end() - count, poses.end());
      return result;
    });
  }
};

double length(const geometry::Trajectory& path) {
  double sum = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i)
    sum += (path.poses[i].T_local_camera.translation - path.poses[i - 1].T_local_camera.translation).norm();
  return sum;
}

const OdometryResult kRight = flight(), kWrong = flight(3.0, 20), kAlsoWrong = flight(0.2, 60);

TEST(CheckDirections, WhereBothAgreeNothingElseIsTried) {
  const Runs runs;
  const DirectionCheck check = runs.check(kRight);
  EXPECT_FALSE(check.use_other);
  EXPECT_FALSE(check.disagreement);
  EXPECT_EQ(check.counterpart.size(), kImages);
  EXPECT_EQ(runs.later_runs, 0);
}

TEST(CheckDirections, AWrongStartAgainstItIsFoundOut) {
  const Runs runs{.other = kWrong};
  const DirectionCheck check = runs.check(kRight);
  EXPECT_FALSE(check.use_other);
  ASSERT_TRUE(check.disagreement);
  EXPECT_TRUE(check.disagreement->is_answered);
  EXPECT_EQ(check.counterpart.size(), kImages - 12) << "the later run against it, not the wrong one";
}

TEST(CheckDirections, AWrongStartOfItsOwnIsFoundOut) {
  const Runs runs;
  const DirectionCheck check = runs.check(kWrong);
  EXPECT_TRUE(check.use_other);
  ASSERT_TRUE(check.disagreement);
  EXPECT_TRUE(check.disagreement->is_answered);
  EXPECT_NEAR(length(check.counterpart), kImages - 12 - 1, 1e-9) << "the later run in its own direction";
}

/// What a turn in place does to the scale is the same in each direction, wherever the run began.
TEST(CheckDirections, AgreementWithinEachDirectionAnswersNothing) {
  const Runs runs{.other = kWrong, .same_later = kAlsoWrong, .other_later = kWrong};
  const DirectionCheck check = runs.check(kAlsoWrong);
  EXPECT_FALSE(check.use_other);
  ASSERT_TRUE(check.disagreement);
  EXPECT_FALSE(check.disagreement->is_answered);
  EXPECT_NEAR(length(check.counterpart), length(kWrong.trajectory), 1e-9);
}

TEST(CheckDirections, WhatIsFoundAgainIsRatherUsedThanWhatIsNot) {
  const Runs runs{.other = kRight, .same_later = flight(5.0, 30), .other_later = kRight};
  const DirectionCheck check = runs.check(kAlsoWrong);
  EXPECT_TRUE(check.use_other);
  ASSERT_TRUE(check.disagreement);
}

TEST(CheckDirections, WhereThreeRunsDifferNothingIsAnswered) {
  const Runs runs{.other = kWrong, .same_later = flight(5.0, 30), .other_later = flight(0.1, 30)};
  const DirectionCheck check = runs.check(kAlsoWrong);
  EXPECT_FALSE(check.use_other);
  EXPECT_FALSE(check.disagreement->is_answered);
  EXPECT_EQ(runs.later_runs, 2);
}

/// A run that begins from given poses is not replaced, and not compared with itself.
TEST(CheckDirections, ARunThatMustBeUsedIsComparedOnly) {
  const Runs runs;
  const DirectionCheck check = runs.check(kWrong, false);
  EXPECT_FALSE(check.use_other);
  ASSERT_TRUE(check.disagreement);
  EXPECT_FALSE(check.disagreement->is_answered);
  EXPECT_NEAR(length(check.counterpart), kImages - 1, 1e-9);
  EXPECT_EQ(runs.later_runs, 0);
}

TEST(CheckDirections, TheDoubtIsOnlyPossibleOnceItIsAnswered) {
  const auto how_sure = [](const OdometryResult& run, const Runs& runs) {
    const DirectionCheck check = runs.check(run);
    const Doubts doubts = find_doubts(
        run, kImages, [](std::int64_t) { return std::string("x"); }, check.disagreement);
    return doubts.size() == 1 ? doubts[0].how_sure : "not one doubt";
  };
  EXPECT_EQ(how_sure(kRight, {.other = kWrong}), "possible");
  EXPECT_EQ(how_sure(kRight, {.other = kWrong, .same_later = kAlsoWrong, .other_later = kAlsoWrong}), "likely");
}

}  // namespace
}  // namespace tileflight::odometry::direction_check_test
