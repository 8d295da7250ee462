#include "tileflight/slam/mapping/keyframe_policy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tileflight/slam/mapping/test_random_window.h"

namespace tileflight::mapping::keyframe_policy_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using keyframes::ResidualState;

const keyframes::Lens& lens() {
  static const keyframes::Lens kLens(imaging::make_pinhole(320, 240, 90.0));
  return kLens;
}

/// A point at a pixel of its host, so far away that a keyframe that looks the same way sees it at the same pixel.
keyframes::ActivePoint distant_point(double x, double y) {
  keyframes::ActivePoint point;
  point.patch.pixel = Eigen::Vector2d(x, y).cast<float>();
  point.patch.ray = lens().unproject({x, y})->cast<float>();
  point.rho = 1e-6F;
  point.observations.emplace_back();
  return point;
}

/// Keyframes at these places that look the same way; each has activated one point, which all others see.
keyframes::Window window_at(const std::vector<Vec3>& places) {
  const auto pyramid =
      std::make_shared<const keyframes::Pyramid>(keyframes::build_pyramid(imaging::FloatImage(320, 240, 100.0F), 1));
  keyframes::Window window;
  for (const Vec3& place : places) {
    keyframes::Keyframe keyframe;
    keyframe.id = window.size();
    keyframe.pyramid = pyramid;
    keyframe.T_camera_map_linear = SE3(Eigen::Quaterniond::Identity(), -place);
    keyframe.points = {distant_point(160, 120)};
    keyframe.activated_points = 1;
    add_keyframe(window, std::move(keyframe));
  }
  return window;
}

std::vector<Vec3> row_of(int count) {
  std::vector<Vec3> places;
  for (int i = 0; i < count; ++i) places.emplace_back(i, 0, 0);
  return places;
}

std::vector<int> flagged(keyframes::Window window, const keyframes::WindowOptions& options = {}) {
  flag_for_marginalization(window, lens(), options);
  std::vector<int> slots;
  for (int i = 0; i < window.size(); ++i) {
    if (window.keyframes[i].to_marginalize) slots.push_back(i);
  }
  return slots;
}

TEST(NeedsKeyframe, WhenTheWeightedSumOfFlowAndBrightnessExceedsOne) {
  const keyframes::WindowOptions options{.keyframe_flow_share = 0.025, .keyframe_log_brightness = 0.5};
  // 0.025 (640 + 360) = 25 px.
  const auto needed = [&](double translation_px, double full_px, double log_brightness) {
    return needs_keyframe({{translation_px, full_px}, log_brightness, 1.0, 1.0}, 640, 360, options);
  };
  EXPECT_FALSE(needed(0, 0, 0));
  EXPECT_FALSE(needed(24.9, 0, 0));
  EXPECT_TRUE(needed(25.1, 0, 0));
  EXPECT_FALSE(needed(0, 49.9, 0)) << "the full flow counts half";
  EXPECT_TRUE(needed(0, 50.1, 0));
  for (const double sign : {-1.0, 1.0}) {
    EXPECT_FALSE(needed(0, 0, sign * 0.499));
    EXPECT_TRUE(needed(0, 0, sign * 0.501));
    EXPECT_FALSE(needed(10, 10, sign * 0.199));  // 0.4 + 0.2 + 0.4
    EXPECT_TRUE(needed(10, 10, sign * 0.201));
  }
}

TEST(NeedsKeyframe, WhenTheErrorHasDoubled) {
  EXPECT_FALSE(needs_keyframe({{}, 0.0, 5.99, 3.0}, 640, 360, {}));
  EXPECT_TRUE(needs_keyframe({{}, 0.0, 6.01, 3.0}, 640, 360, {}));
}

TEST(FlagForMarginalization, KeepsAWindowThatIsNotFull) { EXPECT_TRUE(flagged(window_at(row_of(7))).empty()); }

/// DSO, eq. 20, where I_1 is the newest: the largest sqrt(d(i, 1)) sum_{j in [3, n], j != i} 1 / (d(i, j) + epsilon).
int largest_distance_score(const std::vector<Vec3>& places) {
  const int newest = static_cast<int>(places.size()) - 1;
  int best = -1;
  double largest = 0.0;
  for (int i = 0; i <= newest - 2; ++i) {
    double sum = 0.0;
    for (int j = 0; j <= newest - 2; ++j) sum += j == i ? 0.0 : 1.0 / ((places[i] - places[j]).norm() + 1e-5);
    const double score = std::sqrt((places[i] - places[newest]).norm()) * sum;
    if (score > largest) best = i, largest = score;
  }
  return best;
}

TEST(FlagForMarginalization, OfAFullWindowTheOneOfTheLargestDistanceScore) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Vec3> places;
    for (int i = 0; i < 8; ++i) places.emplace_back(5 * unit(random), 5 * unit(random), unit(random));
    EXPECT_EQ(flagged(window_at(places)), std::vector{largest_distance_score(places)}) << trial;
  }
}

TEST(FlagForMarginalization, KeyframesWithLessThanATwentiethOfTheirPointsInView) {
  keyframes::Window window = window_at(row_of(7));
  for (const int slot : {1, 3, 6}) {
    keyframes::Keyframe& keyframe = window.keyframes[slot];
    keyframe.activated_points = 100;
    keyframe.points.assign(slot == 3 ? 6 : 4, distant_point(160, 120));
    // Seen by none: their rays point backwards.
    for (int i = 0; i < 40; ++i) {
      keyframe.points.push_back(distant_point(160, 120));
      keyframe.points.back().patch.ray *= -1.0F;
    }
  }
  EXPECT_EQ(flagged(window), std::vector{1}) << "4 of 100, but neither 6 of 100 nor the newest";
  // Immature points count as points, and as visible where their depth is known.
  keyframes::ImmaturePoint point;
  point.patch = distant_point(160, 120).patch;
  point.rho_max = 2e-6F;
  window.keyframes[1].immature.assign(3, point);
  EXPECT_TRUE(flagged(window).empty());
  point.rho_max = std::numeric_limits<float>::quiet_NaN();
  window.keyframes[1].immature.assign(3, point);
  EXPECT_EQ(flagged(window), std::vector{1});
}

TEST(FlagForMarginalization, PointsAtTheEdgeOfTheNewestImageAreNotInView) {
  keyframes::Window window = window_at(row_of(7));
  window.keyframes[0].points = {distant_point(2, 120)};
  window.keyframes[1].points = {distant_point(8, 120)};
  EXPECT_EQ(flagged(window), std::vector{0});
}

TEST(FlagForMarginalization, KeyframesOfAnotherBrightness) {
  keyframes::Window window = window_at(row_of(7));
  window.keyframes[0].brightness_linear.a = 0.71;
  window.keyframes[1].brightness_linear.a = -0.71;
  window.keyframes[2].brightness_linear.a = 0.69;
  window.keyframes[3].brightness_linear.b = 30.0;
  EXPECT_EQ(flagged(window), (std::vector{0, 1}));
  EXPECT_EQ(flagged(window, {.min_keyframes = 6}), std::vector{0}) << "six keyframes stay";
  EXPECT_TRUE(flagged(window, {.min_keyframes = 7}).empty());
}

/// Outcome for one point of a random window of well observed points, after `change` of it or its host.
struct Fate {
  bool leaves = false;
  bool enters_prior = false;
};
template <class Change>
Fate fate_of(const Change& change) {
  keyframes::Window window = test_support::random_window(4, 1, 5);
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    keyframe.points[0].good_observations = 4;
    keyframe.points[0].information = 51.0F;
  }
  const Eigen::MatrixXd before = window.H_prior;
  change(window.keyframes[1], window.keyframes[1].points[0]);
  const int host = 1;
  std::vector<RetiredPoint> left;
  retire_points(window, {}, left);
  for (int i = 0; i < window.size(); ++i)
    EXPECT_EQ(window.keyframes[i].points.size(), i == host && !left.empty() ? 0U : 1U);
  EXPECT_LE(left.size(), 1U);
  for (const RetiredPoint& point : left) EXPECT_EQ(point.host, host);
  return {!left.empty(), window.H_prior != before};
}

TEST(RetirePoints, KeepsThoseThatTheNewestImageSees) {
  using keyframes::ActivePoint;
  using keyframes::Keyframe;
  EXPECT_FALSE(fate_of([](Keyframe&, ActivePoint&) {}).leaves);
  EXPECT_FALSE(fate_of([](Keyframe&, ActivePoint& p) {
                 p.recent_states = {ResidualState::kOutlier, ResidualState::kGood};
               }).leaves);
  EXPECT_FALSE(fate_of([](Keyframe&, ActivePoint& p) {
                 p.recent_states = {ResidualState::kGood, ResidualState::kOutside};
               }).leaves);
}

TEST(RetirePoints, TakesWellObservedOnesIntoThePriorAndDropsTheOthers) {
  using keyframes::ActivePoint;
  using keyframes::Keyframe;
  const std::vector<std::function<void(Keyframe&, ActivePoint&)>> causes{
      [](Keyframe&, ActivePoint& p) {
        p.recent_states = {ResidualState::kOutside, ResidualState::kGood};
      },
      [](Keyframe&, ActivePoint& p) {
        p.recent_states = {ResidualState::kOutlier, ResidualState::kOutlier};
      },
      [](Keyframe& k, ActivePoint&) { k.to_marginalize = true; }};
  for (std::size_t i = 0; i < causes.size(); ++i) {
    const auto fate_with = [&](const std::function<void(ActivePoint&)>& change) {
      return fate_of([&](Keyframe& k, ActivePoint& p) {
        causes[i](k, p);
        change(p);
      });
    };
    const Fate observed = fate_with([](ActivePoint&) {});
    EXPECT_TRUE(observed.leaves && observed.enters_prior) << i;
    for (const std::function<void(ActivePoint&)>& worse : std::vector<std::function<void(ActivePoint&)>>{
             [](ActivePoint& p) { p.good_observations = 3; }, [](ActivePoint& p) { p.information = 50.0F; },
             [](ActivePoint& p) { p.observations.resize(2); }, [](ActivePoint& p) { p.rho = -0.1F; }}) {
      const Fate dropped = fate_with(worse);
      EXPECT_TRUE(dropped.leaves && !dropped.enters_prior) << i;
    }
  }
  const Fate unobserved = fate_of([](Keyframe&, ActivePoint& p) { p.observations.clear(); });
  EXPECT_TRUE(unobserved.leaves && !unobserved.enters_prior);
}

}  // namespace
}  // namespace tileflight::mapping::keyframe_policy_test
