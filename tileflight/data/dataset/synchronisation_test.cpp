// Times of a rig's pictures, made so that what is wrong with them is known.
#include "tileflight/data/dataset/synchronisation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"

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
  // Of a rate at which they are half a period, a part of one, and whole frames.
  EXPECT_THAT(of_pair(times(40, 5.0, 0.25), times(40, 5.1, 0.25)).faults,
              ElementsAre("right is not synchronised with left: its pictures are 100 ms later (median), 0 of 40 are "
                          "within 1 ms; give the camchain a timeshift_cam_imu, or a larger tolerance"));
  EXPECT_THAT(of_pair(times(40, 5.0, 0.25), times(40, 4.9, 0.25)).faults[0],
              testing::HasSubstr("its pictures are 100 ms earlier (median)"));
  EXPECT_THAT(
      of_pair(times(40, 5.0, 0.05), times(40, 5.1, 0.05)).faults,
      ElementsAre("right begins and ends 100 ms after left with as many pictures, so its time stamps may be late; "
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
  EXPECT_THAT(found.faults, ElementsAre("right: 3 pictures are missing, the first at 5.15 s"));
  EXPECT_THAT(of_pair(without(all, {9}), all).faults, ElementsAre("left: 1 picture is missing, at 5.45 s"));
  // One that triggers when it likes has no gaps of its own.
  const std::vector<double> irregular{1.0, 1.4, 3.0, 3.1, 5.0, 5.5, 9.0};
  EXPECT_THAT(of_pair(irregular, irregular).faults, IsEmpty());
  EXPECT_THAT(of_pair(irregular, without(irregular, {4})).faults, ElementsAre("right: 1 picture is missing, at 5 s"));
}

TEST(Synchronisation, ACameraThatStopsEarlyOrStartsLateIsNamed) {
  const Synchronisation found = of_pair(times(40, 5.0, 0.05), times(20, 5.0, 0.05));
  EXPECT_THAT(found.faults, ElementsAre("right stops at 5.95 s, 1 s before the last picture of the rig"));
  EXPECT_NEAR(found.cameras[1].stops_early_s, 1.0, 1e-9);
  EXPECT_EQ(found.cameras[1].matched, 20U);
  EXPECT_EQ(found.cameras[1].missing, 0U);
  EXPECT_THAT(of_pair(times(40, 5.0, 0.05), times(36, 5.2, 0.05)).faults,
              ElementsAre("right starts at 5.2 s, 0.2 s after the first picture of the rig"));
}

TEST(Synchronisation, ASlowerCameraIsMatchedByItsOwnPictures) {
  const std::vector<double> down = times(10, 5.0, 0.2);
  EXPECT_THAT(of_pair(times(40, 5.0, 0.05), down).faults, IsEmpty());
  EXPECT_THAT(of_pair(down, times(40, 5.0, 0.05)).faults, IsEmpty());
  EXPECT_EQ(of_pair(down, times(40, 5.0, 0.05)).cameras[1].pairs, 10U);
  EXPECT_THAT(of_pair(times(40, 5.0, 0.05), without(down, {5})).faults,
              ElementsAre("right: 1 picture is missing, at 6 s"));
  EXPECT_THAT(of_pair(times(40, 5.0, 0.05), times(10, 5.02, 0.2)).faults[0], testing::HasSubstr("20 ms later"));
}

TEST(Synchronisation, CamerasThatNeverRunTogetherAreRefused) {
  EXPECT_EQ(tests::refusal_of([] { of_pair(times(10, 5.0, 0.05), times(10, 1.7e9, 0.05)); }),
            "camera right: takes no picture while left does (1700000000 s to 1700000000.45 s against 5 s to 5.45 s): "
            "check their times");
}

TEST(Synchronisation, SinglePicturesHaveNoPeriod) {
  EXPECT_THAT(of_pair({2.0}, {2.0}).faults, IsEmpty());
  EXPECT_THAT(of_pair(times(3, 2.0, 0.1), {2.1}).cameras[1].matched, 1U);
}

}  // namespace
}  // namespace tileflight::dataset::synchronisation_test
