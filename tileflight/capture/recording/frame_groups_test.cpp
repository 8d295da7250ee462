#include "tileflight/capture/recording/frame_groups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace tileflight::recording::frame_groups_test {
namespace {

using geometry::Vec3;
using testing::ElementsAre;

std::vector<Vec3> along_x(double from_m, double to_m, double step_m, double y_m = 0.0) {
  std::vector<Vec3> positions;
  const double sign = to_m > from_m ? 1.0 : -1.0;
  for (double x = from_m; sign * (to_m - x) >= 0.0; x += sign * step_m) positions.emplace_back(x, y_m, 50.0);
  return positions;
}

TEST(FrameGroups, AFlightOfAFewHundredMetresIsOneAroundItsMiddleFrame) {
  const std::vector<Vec3> positions = along_x(-200.0, kSingleGroupSpan_m - 200.0, 8.0);
  const FrameGroups groups = group_frames(positions);
  ASSERT_EQ(groups.count(), 1U);
  EXPECT_EQ(groups.frames[0].size(), positions.size());
  EXPECT_EQ(groups.anchors[0], positions[positions.size() / 2]);
  EXPECT_GT(group_frames(along_x(-200.0, kSingleGroupSpan_m - 199.0, 1.0)).count(), 1U);
}

TEST(FrameGroups, HoldEachFrameOnceAndNearTheirCentre) {
  std::vector<Vec3> positions;
  for (int i = 0; i < 4000; ++i)
    positions.emplace_back(900.0 * std::sin(0.011 * i), 700.0 * std::cos(0.007 * i), 60.0 + 0.1 * i);
  const FrameGroups groups = group_frames(positions);
  ASSERT_EQ(groups.group_of_frame.size(), positions.size());
  std::set<std::size_t> seen;
  std::size_t next_first = 0;
  for (std::size_t g = 0; g < groups.count(); ++g) {
    EXPECT_TRUE(std::ranges::is_sorted(groups.frames[g]));
    EXPECT_GE(groups.frames[g].front(), next_first);
    next_first = groups.frames[g].front();
    for (const std::size_t frame : groups.frames[g]) {
      EXPECT_TRUE(seen.insert(frame).second);
      EXPECT_EQ(groups.group_of_frame[frame], g);
      EXPECT_LE((positions[frame] - groups.anchors[g]).cwiseAbs().maxCoeff(), kGroupEdge_m / 2 + kGroupMargin_m);
    }
  }
  EXPECT_EQ(seen.size(), positions.size());
}

TEST(FrameGroups, APathAlongAFaceStaysInACubeAndOneThatReturnsFindsItsGroupAgain) {
  std::vector<Vec3> positions = along_x(10.0, 1000.0, 10.0);
  for (std::size_t i = 0; i < positions.size(); ++i) positions[i].y() = i % 2 == 0 ? 5.0 : -5.0;
  EXPECT_EQ(group_frames(positions).count(), 4U) << "four cubes along x; y alternates around 0";

  const std::vector<Vec3> there{{10, 10, 50}, {300, 10, 50}, {1000, 10, 50}, {300, 10, 50}, {20, 10, 50}};
  EXPECT_THAT(group_frames(there).group_of_frame, ElementsAre(0, 1, 2, 1, 0));
}

}  // namespace
}  // namespace tileflight::recording::frame_groups_test
