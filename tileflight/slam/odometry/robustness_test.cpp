// Disturbances of real flights, applied to rendered images: exposure changes, blur, gaps, an occluded lens, rotation in
// place, slow or fast starts, and loss of tracking.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/temporary_folder.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/synthetic_flight.h"
#include "tileflight/slam/odometry/track.h"

namespace tileflight::odometry::robustness_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using imaging::RgbImage;
using test_support::relative_ate;
using test_support::Sequence;
using test_support::small_options;
using testing::HasSubstr;

/// Expects tracking to the end, at least `least_tracked` images, and an ATE below a share of the path length.
void expect_followed(const Sequence& sequence, std::size_t least_tracked, double most_ate_share = 0.01) {
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_GE(result.frames_tracked, static_cast<std::int64_t>(least_tracked));
  EXPECT_LT(relative_ate(result.trajectory, sequence.truth), most_ate_share);
}
void expect_all_followed(const Sequence& sequence) { expect_followed(sequence, sequence.images.size()); }

void scale_light(RgbImage& image, double gain, double offset) {
  for (imaging::Rgb8& pixel : image.pixels) {
    for (std::uint8_t& value : pixel) {
      value = static_cast<std::uint8_t>(std::lround(std::clamp(gain * value + offset, 0.0, 255.0)));
    }
  }
}

void blacken(RgbImage& image) { std::fill(image.pixels.begin(), image.pixels.end(), imaging::Rgb8{}); }

/// The sequence with images and their truth reordered.
Sequence picked(const Sequence& sequence, const std::vector<int>& order) {
  Sequence out;
  out.calibration = sequence.calibration;
  for (const int i : order) {
    out.images.push_back(sequence.images[i]);
    out.truth.push_back(sequence.truth[i]);
  }
  return out;
}

std::vector<int> counted(int from, int to, int step = 1) {
  std::vector<int> order;
  for (int i = from; step > 0 ? i < to : i > to; i += step) order.push_back(i);
  return order;
}

/// Rolling ground by a small wide lens; `pose` gives the camera of image i.
template <class Pose>
Sequence over_rolling_ground(int frames, const Pose& pose) {
  const auto relief = keyframes::test_support::sine_hills({.amplitude_m = 1.5, .k_x = 0.25, .k_y = 0.2}, 0.8);
  std::vector<SE3> truth;
  for (int i = 0; i < frames; ++i) truth.push_back(pose(i));
  return test_support::render_sequence(imaging::make_fisheye(320, 200, 130.0), relief, truth);
}

/// Fifty images of a level flight, which most tests disturb.
const Sequence& level_flight() {
  static const Sequence kAll = over_rolling_ground(50, [](int i) {
    const double s = i / 30.0;
    return keyframes::test_support::look_along(Vec3(4.0 * s, 5.0 * s, 20.0 + 0.5 * std::sin(s)),
                                               Vec3(0.3 * std::sin(0.7 * s), 1.0, -1.0));
  });
  return kAll;
}

TEST(Robustness, ExposureMayStepAndDrift) {
  Sequence sequence = level_flight();
  for (int i = 0; i < 50; ++i) {
    const double step = i < 22 ? 1.0 : (i < 36 ? 1.3 : 0.8);
    scale_light(sequence.images[i], step * (1.0 + 0.1 * std::sin(0.2 * i)), i < 36 ? 0.0 : 10.0);
  }
  expect_all_followed(sequence);
}

TEST(Robustness, MissingPicturesAreBridged) {
  std::vector<int> order = counted(0, 50);
  order.erase(order.begin() + 41, order.begin() + 43);
  order.erase(order.begin() + 25, order.begin() + 29);
  expect_all_followed(picked(level_flight(), order));
}

TEST(Robustness, AShortOcclusionIsPassed) {
  Sequence sequence = level_flight();
  for (int i = 28; i < 33; ++i) {
    RgbImage& image = sequence.images[i];
    for (int y = 40; y < 160; ++y) {
      for (int x = 100; x < 220; ++x) image(x, y) = {30, 30, 30};
    }
  }
  expect_followed(sequence, 45);
}

TEST(Robustness, BlurredPicturesAreFollowed) {
  const auto pose = [](double i) {
    return keyframes::test_support::look_along(Vec3(0.13 * i, 0.16 * i, 20.0),
                                               Vec3(0.3 * std::sin(0.03 * i), 1.0, -1.0));
  };
  // Some images are means over the exposure time, which is most of the frame interval.
  constexpr int kFirst = 26, kLast = 31, kParts = 4;
  Sequence sequence = over_rolling_ground(42, pose);
  for (int i = kFirst; i <= kLast; ++i) {
    const Sequence parts = over_rolling_ground(kParts, [&](int k) { return pose(i + 0.8 * (k - 1.5) / kParts); });
    RgbImage& image = sequence.images[i];
    for (std::size_t p = 0; p < image.pixels.size(); ++p) {
      int sum = 0;
      for (const RgbImage& part : parts.images) sum += part.pixels[p][0];
      const auto grey = static_cast<std::uint8_t>(sum / kParts);
      image.pixels[p] = {grey, grey, grey};
    }
  }
  expect_all_followed(sequence);
}

TEST(Robustness, ATurnOnTheSpotIsFollowed) {
  const Sequence sequence = over_rolling_ground(70, [](int i) {
    const double moved = i < 30 ? i : (i < 50 ? 30 : i - 20);               // stands still for twenty pictures
    const double turned = i < 30 ? 0.0 : (i < 50 ? 0.03 * (i - 30) : 0.6);  // and turns by 34 degrees
    return keyframes::test_support::look_along(Vec3(0.14 * moved, 0.17 * moved, 20.0),
                                               Vec3(std::sin(turned), std::cos(turned), -1.0));
  });
  expect_all_followed(sequence);
}

TEST(Robustness, ALongTurnOnTheSpotKeepsTheScale) {
  // Half a turn with a lens of 130 degrees: nothing seen at the end was in view at the beginning.
  const Sequence sequence = over_rolling_ground(110, [](int i) {
    const double moved = i < 35 ? i : (i < 75 ? 35 : i - 40);
    const double turned = i < 35 ? 0.0 : (i < 75 ? 0.04 * (i - 35) : 1.6);
    return keyframes::test_support::look_along(Vec3(0.14 * moved, 0.17 * moved, 20.0),
                                               Vec3(std::sin(turned), std::cos(turned), -1.0));
  });
  expect_followed(sequence, 105);
}

TEST(Robustness, ASlowStartIsWaitedFor) {
  const Sequence sequence = over_rolling_ground(60, [](int i) {
    const double s = i < 40 ? 0.1 * i * i / 40.0 : 4.0 + 0.2 * (i - 40);
    return keyframes::test_support::look_along(Vec3(0.6 * s, 0.8 * s, 20.0), Vec3(0.0, 1.0, -1.0));
  });
  expect_followed(sequence, 45);
}

TEST(Robustness, LevelGroundFromStraightAboveIsEnoughForAStart) {
  // A narrow lens without relief: the best rotation absorbs most of the motion, and tracks end before the remaining
  // parallax reaches the usual threshold.
  keyframes::test_support::Relief level;
  level.texel_m = 0.6;
  std::vector<SE3> truth;
  for (int i = 0; i < 60; ++i)
    truth.push_back(keyframes::test_support::look_along(Vec3(0.17 * i, 0.02 * i, 12.0), Vec3(0.01, 0.02, -1.0)));
  const test_support::Sequence sequence = test_support::render_sequence(
      imaging::Camera(imaging::PinholeRadtan{242, 242, 139.5, 99.5, {}}, 280, 200), level, truth);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), test_support::small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_GE(result.frames_tracked, 55);
  EXPECT_LT(test_support::relative_ate(result.trajectory, sequence.truth), 0.01);
}

TEST(Robustness, LargeMotionBetweenPicturesIsFollowed) {
  expect_followed(picked(level_flight(), counted(0, 50, 3)), 15, 0.02);
}

TEST(Robustness, AJumpBackAfterBlackPicturesIsFollowed) {
  // The camera is blinded (black images) and returns to where it was some keyframes ago.
  std::vector<int> order = counted(0, 46);
  for (const int i : {46, 47, 48}) order.push_back(i);
  for (const int i : counted(30, 19, -1)) order.push_back(i);
  Sequence sequence = picked(level_flight(), order);
  for (const int i : {46, 47, 48}) blacken(sequence.images[i]);
  expect_followed(sequence, order.size() - 6);
}

// An image without contrast fits every pose with a gain near zero: its small residuals are no sign of a fit.
TEST(Robustness, BlackImagesAtTheEndAreLostForTheirContrast) {
  Sequence sequence = level_flight();
  for (int i = 40; i < 50; ++i) blacken(sequence.images[i]);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  ASSERT_TRUE(result.lost);
  EXPECT_EQ(result.lost_since, 40);
  EXPECT_THAT(result.lost_detail, HasSubstr("their contrast is"));
  EXPECT_THAT(result.lost_detail, testing::Not(HasSubstr("RMSE")));
}

TEST(Robustness, BlackImagesAtTheBeginningAreNamedInTheOrderOfTheFlight) {
  const tests::TemporaryFolder folder;
  const Sequence& sequence = level_flight();
  dataset::DatasetWriter writer(folder / "data", {sequence.calibration.camera, {}, 0.0}, {});
  for (std::size_t i = 0; i < sequence.images.size(); ++i) {
    RgbImage image = sequence.images[i];
    if (i < 12) blacken(image);
    writer.add_frame(i, static_cast<double>(i) / 30.0, 0.0, image);
  }
  writer.finish();
  TrackOptions options;
  options.odometry = small_options();
  const TrackResult result = track(folder / "data", folder / "out", false, options);
  std::string all;
  for (const Warning& warning : result.warnings) all += warning.message + " (" + warning.remedy + ")\n";
  EXPECT_THAT(all, HasSubstr("12 of 50 images are nearly black: frames 000000 to 000011"));
  EXPECT_THAT(all, HasSubstr("leave them out (--from 12)"));
  EXPECT_THAT(all, testing::Not(HasSubstr("RMSE 0.0")));
  EXPECT_GE(result.odometry.frames_tracked, 36);
}

}  // namespace
}  // namespace tileflight::odometry::robustness_test
