#include "tileflight/slam/odometry/direction_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

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

OdometryResult with_warning(OdometryResult result) {
  result.systematic_displacement = mapping::SystematicDisplacement{.rms_px = 0.3, .sigmas = 10.0};
  return result;
}

double length(const geometry::Trajectory& path) {
  double sum = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i)
    sum += (path.poses[i].T_local_camera.translation - path.poses[i - 1].T_local_camera.translation).norm();
  return sum;
}

const OdometryResult kRight = flight(), kWrong = with_warning(flight(3.0, 20)),
                     kAlsoWrong = with_warning(flight(0.2, 60));

/// Stands in for tracking: the runs in each direction, by their start; the last one is repeated.
struct Runs {
  std::vector<OdometryResult> same{kRight}, against{kRight};
  mutable int count = 0;

  DirectionCheck check(bool may_use_other = true) const {
    std::vector<std::size_t> seen[2];
    return check_directions(same[0], kImages, may_use_other, [&](const RunStart& start) {
      ++count;
      auto& images = seen[start.against ? 1 : 0];
      images.push_back(start.image);
      const auto& runs = start.against ? against : same;
      const std::size_t at = images.size() - (start.against ? 1 : 0);
      return runs[std::min(at, runs.size() - 1)];
    });
  }
};

TEST(CheckDirections, WhereBothAgreeNothingElseIsTried) {
  const Runs runs;
  const DirectionCheck check = runs.check();
  EXPECT_FALSE(check.use.against);
  EXPECT_FALSE(check.disagreement);
  EXPECT_EQ(runs.count, 1);
}

TEST(CheckDirections, APathThatIsFoundAgainWithoutWarningsIsUsed) {
  const Runs kept{.same = {kRight}, .against = {kWrong, kAlsoWrong}};
  const DirectionCheck same = kept.check();
  EXPECT_FALSE(same.use.against);
  EXPECT_EQ(same.use.image, 0U);
  ASSERT_TRUE(same.disagreement);
  EXPECT_EQ(kept.count, 3) << "one later run in each direction";
  EXPECT_NEAR(length(same.counterpart), length(kRight.trajectory), 1e-9) << "not the wrong one";

  const Runs exchanged{.same = {kWrong, kAlsoWrong}, .against = {kRight}};
  const DirectionCheck other = exchanged.check();
  EXPECT_TRUE(other.use.against);
  EXPECT_EQ(other.use.image, 0U);
  EXPECT_NEAR(length(other.counterpart), length(kRight.trajectory), 1e-9);
}

/// Both begin wrongly; the second and third run in one direction are right.
TEST(CheckDirections, ALaterStartMayBeTheFirstRightOne) {
  const Runs runs{.same = {kWrong, kAlsoWrong, kWrong, kAlsoWrong}, .against = {kAlsoWrong, kRight, kRight}};
  const DirectionCheck check = runs.check();
  EXPECT_TRUE(check.use.against);
  EXPECT_EQ(check.use.image, 12U);
  EXPECT_TRUE(check.disagreement);
  EXPECT_EQ(runs.count, 1 + 4);
}

TEST(CheckDirections, OfTwoThatAgreeTheOneWithoutWarningsIsUsed) {
  const Runs runs{.same = {kWrong, kAlsoWrong, kWrong}, .against = {kAlsoWrong, with_warning(kRight), kRight}};
  const DirectionCheck check = runs.check();
  EXPECT_TRUE(check.use.against);
  EXPECT_EQ(check.use.image, 24U);
}

TEST(CheckDirections, WhereBothFindTheSamePathTheEarliestRunIsUsed) {
  const Runs runs{.same = {kWrong, kRight, kRight}, .against = {kRight, kWrong, kRight}};
  const DirectionCheck check = runs.check();
  EXPECT_TRUE(check.use.against);
  EXPECT_EQ(check.use.image, 0U);
}

/// What a turn in place does to the scale is the same in each direction, wherever the run began.
TEST(CheckDirections, AScaleThatChangedOnTheWayIsLeftOpen) {
  const Runs runs{.same = {flight(0.9)}, .against = {flight(1.1)}};
  const DirectionCheck check = runs.check();
  EXPECT_FALSE(check.use.against);
  EXPECT_EQ(check.use.image, 0U);
  ASSERT_TRUE(check.disagreement);
  EXPECT_EQ(runs.count, 3);
  EXPECT_NEAR(length(check.counterpart), length(flight(1.1).trajectory), 1e-9);
}

TEST(CheckDirections, WhereNothingIsFoundAgainTheFirstIsKept) {
  const Runs runs{.same = {kWrong, kAlsoWrong}, .against = {kAlsoWrong, kWrong}};
  const DirectionCheck check = runs.check();
  EXPECT_FALSE(check.use.against);
  EXPECT_TRUE(check.disagreement);
  EXPECT_EQ(runs.count, 1 + 6);
}

/// A run that begins from given poses is not replaced, and not compared with itself.
TEST(CheckDirections, ARunThatMustBeUsedIsComparedOnly) {
  const Runs runs{.same = {kWrong}, .against = {kRight}};
  const DirectionCheck check = runs.check(false);
  EXPECT_FALSE(check.use.against);
  EXPECT_EQ(runs.count, 1);
  EXPECT_NEAR(length(check.counterpart), length(kRight.trajectory), 1e-9);
}

}  // namespace
}  // namespace tileflight::odometry::direction_check_test
