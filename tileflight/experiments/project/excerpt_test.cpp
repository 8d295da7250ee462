#include "tileflight/experiments/project/excerpt.h"

#include <gmock/gmock.h>

#include <algorithm>

namespace tileflight::project {
namespace {

using ::testing::HasSubstr;

/// A flight by its heights, one a second: `on_ground_s` on the ground, then up to `height_m` at 2 m/s, `cruise_s`
/// there, and down again.
std::vector<TrackSample> flight(int on_ground_s, double height_m, int cruise_s) {
  const int climb_s = static_cast<int>(height_m / 2);
  std::vector<TrackSample> track;
  const int all_s = 2 * (on_ground_s + climb_s) + cruise_s;
  for (int t = 0; t <= all_s; ++t) {
    const double up_m = 2.0 * (t - on_ground_s), down_m = 2.0 * (all_s - on_ground_s - t);
    track.push_back({static_cast<double>(t), std::clamp(std::min(up_m, down_m), 0.0, height_m), true});
  }
  return track;
}

TEST(Excerpt, LeavesOutTakeOffAndLanding) {
  const std::vector<TrackSample> track = flight(10, 40.0, 60);  // up at 10 s to 30 s, down at 90 s to 110 s
  const Excerpt excerpt = choose_excerpt(track, true, 120.0);
  EXPECT_DOUBLE_EQ(excerpt.from_s, 24.0);  // 28 m are reached there
  EXPECT_DOUBLE_EQ(excerpt.to_s.value(), 96.0);
  EXPECT_THAT(excerpt.choices.at(0).reason, HasSubstr("it flies 40 m above the ground"));
}

TEST(Excerpt, KeepsAllOfAFlightThatNeitherTakesOffNorLands) {
  std::vector<TrackSample> track;
  for (int t = 0; t <= 30; ++t) track.push_back({static_cast<double>(t), 50.0 + (t % 7), true});
  const Excerpt excerpt = choose_excerpt(track, true, 30.0);
  EXPECT_EQ(excerpt.from_s, 0.0);
  EXPECT_FALSE(excerpt.to_s.has_value());
  EXPECT_EQ(excerpt.choices.at(0).value, "");
}

TEST(Excerpt, IgnoresWhatIsOutsideTheVideoOrThePlace) {
  std::vector<TrackSample> track;
  for (int t = -20; t <= 100; ++t) track.push_back({static_cast<double>(t), 30.0, t <= 15 || (t > 20 && t < 70)});
  const Excerpt excerpt = choose_excerpt(track, true, 90.0);
  EXPECT_DOUBLE_EQ(excerpt.from_s, 21.0);
  EXPECT_DOUBLE_EQ(excerpt.to_s.value(), 69.0);
  EXPECT_THAT(excerpt.choices.at(0).reason, HasSubstr("not over the place"));
}

TEST(Excerpt, EndsThatAreGivenReplaceTheChosenOnes) {
  const Excerpt chosen = choose_excerpt(flight(10, 40.0, 60), true, 120.0);  // 24 s to 96 s
  const Excerpt both = with_given_ends(chosen, 30.25, 50.0);
  EXPECT_EQ(both.from_s, 30.25);
  EXPECT_EQ(both.to_s, 50.0);
  ASSERT_EQ(both.choices.size(), 2U);
  EXPECT_EQ(both.choices[0].value, "30.25");
  EXPECT_EQ(both.choices[1].key, "to");
  EXPECT_EQ(both.choices[1].certainty, Certainty::kCertain);
  const Excerpt later = with_given_ends(chosen, 40.0, std::nullopt);
  EXPECT_EQ(later.from_s, 40.0);
  EXPECT_EQ(later.to_s, 96.0) << "the other end stays as it was chosen";
  EXPECT_EQ(with_given_ends(chosen, 100.0, std::nullopt).to_s, std::nullopt) << "nothing would be left";
  EXPECT_EQ(with_given_ends(chosen, std::nullopt, 20.0).from_s, 0.0);
  const Excerpt whole = with_given_ends(choose_excerpt({}, true, 10.0), std::nullopt, 5.0);
  ASSERT_EQ(whole.choices.size(), 1U);
  EXPECT_EQ(whole.choices[0].key, "to");
}

TEST(Excerpt, SaysThatNothingIsThere) {
  const std::vector<TrackSample> outside{{0.0, 20.0, false}, {1.0, 20.0, false}};
  const Excerpt excerpt = choose_excerpt(outside, true, 10.0);
  EXPECT_EQ(excerpt.choices.at(0).certainty, Certainty::kGuess);
  EXPECT_THAT(excerpt.choices.at(0).reason, HasSubstr("no position"));
}

TEST(Excerpt, LeavesOutStillImagesWithoutPositions) {
  std::vector<MotionSample> motion;
  for (int i = 0; i <= 20; ++i) motion.push_back({1.0 * i, i < 4 || i > 17 ? 0.0001 : 0.2});
  const Excerpt excerpt = choose_excerpt_by_motion(motion, 20.5);
  EXPECT_DOUBLE_EQ(excerpt.from_s, 4.0);
  EXPECT_DOUBLE_EQ(excerpt.to_s.value(), 17.0);
  for (MotionSample& sample : motion) sample.share_per_s.reset();  // not known: nothing is left out
  EXPECT_EQ(choose_excerpt_by_motion(motion, 20.5).from_s, 0.0);
}

TEST(Excerpt, IsTheLongestPartWithoutABreak) {
  const std::vector<Break> breaks{{4.0, 4.04, "the video is cut at 4.04 s"}, {19.0, 25.0, "no image was recorded"}};
  const Excerpt excerpt = leave_out_breaks({}, breaks, 30.0);
  EXPECT_GT(excerpt.from_s, 4.0);
  EXPECT_LT(excerpt.from_s, 4.04);
  EXPECT_GT(excerpt.to_s.value(), 19.0);
  EXPECT_LT(excerpt.to_s.value(), 19.01);
  ASSERT_EQ(excerpt.choices.size(), 2U);
  EXPECT_THAT(excerpt.choices.at(0).reason, HasSubstr("is cut at 4.04 s"));
  EXPECT_THAT(excerpt.choices.at(1).reason, HasSubstr("no image was recorded"));
}

TEST(Excerpt, BreaksOutsideOfItDoNotCount) {
  Excerpt flight = choose_excerpt(tileflight::project::flight(10, 40.0, 60), true, 120.0);  // 24 s to 96 s
  const Excerpt same = leave_out_breaks(flight, {{5.0, 5.1, "a"}, {100.0, 101.0, "b"}}, 120.0);
  EXPECT_DOUBLE_EQ(same.from_s, 24.0);
  EXPECT_DOUBLE_EQ(same.to_s.value(), 96.0);
  const Excerpt cut = leave_out_breaks(flight, {{50.0, 50.1, "the video is cut"}}, 120.0);
  EXPECT_NEAR(cut.from_s, 50.1, 0.01);
  EXPECT_DOUBLE_EQ(cut.to_s.value(), 96.0);
  EXPECT_EQ(cut.choices.size(), 2U);
  EXPECT_THAT(cut.choices.at(1).reason, HasSubstr("the video is cut"));
}

TEST(Excerpt, EndsWhereTheRestCannotBeRead) {
  const Excerpt excerpt = leave_out_breaks({}, {{8.0, std::nullopt, "images cannot be read after 8.00 s"}}, 30.0);
  EXPECT_EQ(excerpt.from_s, 0.0);
  EXPECT_NEAR(excerpt.to_s.value(), 8.0, 0.01);
  // Parts of less than two seconds are no flight.
  EXPECT_FALSE(leave_out_breaks({}, {{1.0, std::nullopt, "a"}}, 30.0).to_s.has_value());
}

TEST(FrameStep, TakesImagesThatAreStoredTwiceOnce) {
  std::vector<MotionSample> motion(10, {0.0, 0.2});
  EXPECT_EQ(choose_frame_step(motion, 60.0, 1).value().every, 3);
  EXPECT_EQ(choose_frame_step(motion, 60.0, 2).value().every, 2);
  motion.assign(10, {0.0, 1.5});
  EXPECT_EQ(choose_frame_step(motion, 60.0, 2).value().every, 2);
}

TEST(FrameStep, KeepsTheMotionBelowOnePercent) {
  std::vector<MotionSample> motion(10, {0.0, 0.15});
  EXPECT_EQ(choose_frame_step(motion, 30.0).value().every, 2);   // 0.5 % a frame
  EXPECT_EQ(choose_frame_step(motion, 120.0).value().every, 8);  // 0.125 % a frame
  EXPECT_DOUBLE_EQ(choose_frame_step(motion, 30.0).value().share, 0.01);
  motion.assign(10, {0.0, 1.5});
  EXPECT_EQ(choose_frame_step(motion, 30.0).value().every, 1);  // 5 % a frame: too fast even so
  motion.assign(10, {0.0, 0.001});
  EXPECT_EQ(choose_frame_step(motion, 30.0).value().every, 3);  // ten a second are left
  motion.assign(10, {0.0, std::nullopt});
  EXPECT_FALSE(choose_frame_step(motion, 30.0).has_value());
}

}  // namespace
}  // namespace tileflight::project
