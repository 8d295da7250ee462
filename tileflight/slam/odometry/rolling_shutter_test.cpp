// Rolling shutter: images rendered row by row with a moving camera.

#include "tileflight/slam/keyframes/rolling_shutter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "tileflight/slam/keyframes/pixel_selector.h"
#include "tileflight/slam/odometry/synthetic_flight.h"
#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::odometry::rolling_shutter_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using geometry::Vec6;
using test_support::Sequence;
using test_support::shaken_flight;

constexpr double kFps = 30.0;

OdometryResult flown(const Sequence& sequence, double line_delay_s) {
  imaging::Calibration calibration = sequence.calibration;
  calibration.line_delay_s = line_delay_s;
  return run_odometry(calibration, sequence.source(), test_support::small_options());
}

TEST(RollingShutter, AConstantVelocityGivesItsReadout) {
  const Vec6 velocity = (Vec6() << 1.0, -2.0, 0.5, 0.1, -0.3, 0.2).finished();
  const auto pose = [&](double t) { return SE3::exp(t * velocity); };
  for (const double earlier_s : {0.0, 0.02}) {
    const keyframes::RollingShutter shutter = keyframes::make_rolling_shutter(
        0.015, {pose(1.0), 0.04, pose(1.0) * pose(1.0 - earlier_s).inverse(), earlier_s});
    EXPECT_LT((shutter.twist(pose(1.04)) - 0.015 * velocity).norm(), 1e-12);
  }
  EXPECT_TRUE(keyframes::make_rolling_shutter(0.0, {pose(1.0), 0.04, SE3(), 0.0}).is_global());
  EXPECT_TRUE(keyframes::make_rolling_shutter(0.015, {pose(1.0), 0.0, SE3(), 0.0}).is_global());
}

TEST(RollingShutter, AnAcceleratedMotionIsBroughtOnToThePicturesTime) {
  const auto pose = [](double t) { return SE3(Eigen::Quaterniond::Identity(), Vec3(2.0 * t + 15.0 * t * t, 0, 0)); };
  const keyframes::RollingShutter shutter =
      keyframes::make_rolling_shutter(0.01, {pose(0.1), 0.03, pose(0.1) * pose(0.05).inverse(), 0.05});
  EXPECT_NEAR(shutter.twist(pose(0.13))[0], 0.01 * (2.0 + 30.0 * 0.13), 1e-12);
}

/// An earlier view with known depth, and a rolling-shutter view taken while the camera moves at constant velocity.
struct RollingView {
  static constexpr double kInterval_s = 1.0 / kFps, kLineDelay_s = 0.9 / kFps / 240;
  imaging::Camera camera = imaging::make_fisheye(320, 240, 120.0);
  keyframes::test_support::ReliefCamera scene{camera, test_support::hilly_ground()};
  keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, 4);
  Vec6 velocity = (Vec6() << 2.0, 6.0, -1.0, 0.5, -0.7, 0.6).finished();              // of T_camera_local
  SE3 first = keyframes::test_support::look_along(Vec3(0, 0, 12), Vec3(0, 1, -1.1));  // T_local_camera
  keyframes::Pyramid before = keyframes::build_pyramid(keyframes::luminance(scene.render(first), nullptr), 4);

  SE3 pose(double time_s) const { return first * SE3::exp(time_s * velocity).inverse(); }
  imaging::RgbImage rolling() const {
    return scene.render_by_rows([&](int y) { return pose(kInterval_s + (y - 119.5) * kLineDelay_s); });
  }
  SE3 truth() const { return pose(kInterval_s).inverse() * first; }
  keyframes::RollingShutter shutter() const {
    return keyframes::make_rolling_shutter(240 * kLineDelay_s, {SE3(), kInterval_s, SE3(), 0.0});
  }
  float rho(const Eigen::Vector2f& pixel, const SE3& T_local_camera) const {
    const Vec3 ray = *camera.unproject(pixel.cast<double>());
    const double distance = keyframes::test_support::hit_distance(scene.relief(), T_local_camera.translation,
                                                                  T_local_camera.rotation * ray);
    return distance > 0 ? static_cast<float>(1.0 / distance) : 0.0F;
  }
  tracking::TrackingReference reference() const {
    std::vector<tracking::ReferencePoint> points;
    for (const keyframes::SelectedPixel& p : keyframes::select_pixels(before, lens.rays[0], 800, {})) {
      const Eigen::Vector2f pixel(p.x, p.y);
      if (rho(pixel, first) > 0) points.push_back({pixel, rho(pixel, first), 1.0F});
    }
    return tracking::make_tracking_reference(lens, before, points);
  }
};

double turn_between(const SE3& a, const SE3& b) {
  return geometry::so3_log(a.rotation.conjugate() * b.rotation).norm();
}

TEST(RollingShutter, TheTrackerFindsTheMiddleRowsPose) {
  const RollingView view;
  const keyframes::Pyramid target = keyframes::build_pyramid(keyframes::luminance(view.rolling(), nullptr), 4);
  const tracking::TrackingReference reference = view.reference();
  const auto found = [&](const keyframes::RollingShutter& shutter) {
    const tracking::ImageAlignment result = tracking::align_image(view.lens, reference, target, {}, {}, {}, 0, shutter);
    EXPECT_TRUE(result.converged);
    return result.state.T_target_reference;
  };
  const SE3 with = found(view.shutter()), without = found({});
  const SE3 truth = view.truth();
  EXPECT_LT((with.translation - truth.translation).norm(), 0.01);  // of 0.21 m
  EXPECT_LT(turn_between(with, truth), 4e-4);
  EXPECT_GT((without.translation - truth.translation).norm(), 4 * (with.translation - truth.translation).norm());
}

TEST(RollingShutter, ACameraThatRestsIsTrackedAsWithAGlobalShutter) {
  const RollingView view;
  const tracking::TrackingReference reference = view.reference();
  const tracking::ImageAlignmentState start{SE3(geometry::so3_exp(Vec3(0.004, -0.003, 0.002)), Vec3(0.02, 0.03, -0.01)),
                                            0.0, 0.0};
  // The previous pose equals the true one, so the velocity there is zero.
  const tracking::ImageAlignment global = tracking::align_image(view.lens, reference, view.before, start, {});
  keyframes::RollingShutter resting;
  resting.motion_share = 0.9;
  const tracking::ImageAlignment rolling =
      tracking::align_image(view.lens, reference, view.before, start, {}, {}, 0, resting);
  EXPECT_LT((rolling.state.T_target_reference.translation - global.state.T_target_reference.translation).norm(), 2e-3);
  EXPECT_LT(turn_between(rolling.state.T_target_reference, global.state.T_target_reference), 1e-4);
  // A shutter with zero readout time gives bit-identical results.
  const tracking::ImageAlignment none = tracking::align_image(view.lens, reference, view.before, start, {}, {}, 0,
                                                              keyframes::make_rolling_shutter(0.0, {}));
  EXPECT_EQ(none.state.T_target_reference.matrix(), global.state.T_target_reference.matrix());
  EXPECT_EQ(none.rmse, global.rmse);
}

double mean_difference(const imaging::FloatImage& a, const imaging::FloatImage& b) {
  double sum = 0;
  int count = 0;
  for (int y = 20; y < a.height - 20; ++y) {
    for (int x = 20; x < a.width - 20; ++x, ++count) sum += std::abs(a(x, y) - b(x, y));
  }
  return sum / count;
}

TEST(RollingShutter, TheRectifiedPictureIsAGlobalShutters) {
  const RollingView view;
  const SE3 middle = view.pose(RollingView::kInterval_s);
  std::vector<keyframes::DepthSample> samples;
  for (int y = 3; y < 240; y += 9) {
    for (int x = 3; x < 320; x += 9) {
      const Eigen::Vector2f pixel(x, y);
      if (view.rho(pixel, middle) > 0) samples.push_back({pixel, view.rho(pixel, middle)});
    }
  }
  const Vec6 twist = 240 * RollingView::kLineDelay_s * view.velocity;
  const keyframes::RowRectifier rectify(view.lens.lenses[0], 320, 240, twist, samples);
  const imaging::RgbImage raw = view.rolling();
  const imaging::FloatImage rolling = keyframes::luminance(raw, nullptr),
                            global = keyframes::luminance(view.scene.render(middle), nullptr);
  const imaging::FloatImage rectified =
      rectify(keyframes::build_pyramid(keyframes::luminance(raw, nullptr), 1).levels[0]);
  // A third of a grey value is due to rounding in both images.
  EXPECT_LT(mean_difference(rectified, global), 0.25 * mean_difference(rolling, global));
  EXPECT_LT(mean_difference(keyframes::luminance(rectify(raw), nullptr), global),
            0.3 * mean_difference(rolling, global));
}

/// Keys's kernel of a = -1/2 (Keys 1981, eq. 15) over the whole picture, the edge repeated.
double keys_interpolated(const imaging::FloatImage& image, double x, double y) {
  const auto kernel = [](double s) {
    s = std::abs(s);
    if (s <= 1) return 1.5 * s * s * s - 2.5 * s * s + 1;
    return s < 2 ? -0.5 * s * s * s + 2.5 * s * s - 4 * s + 2 : 0.0;
  };
  x = std::clamp(x, 0.0, image.width - 1.0);
  y = std::clamp(y, 0.0, image.height - 1.0);
  double sum = 0;
  for (int j = static_cast<int>(y) - 1; j <= static_cast<int>(y) + 2; ++j) {
    for (int i = static_cast<int>(x) - 1; i <= static_cast<int>(x) + 2; ++i) {
      sum +=
          kernel(x - i) * kernel(y - j) * image(std::clamp(i, 0, image.width - 1), std::clamp(j, 0, image.height - 1));
    }
  }
  return std::max(sum, 0.0);
}

TEST(RollingShutter, RectifiedPixelsAreInterpolatedAtTheirSources) {
  constexpr int kWidth = 317, kHeight = 237;
  const RollingView view;
  Vec6 twist;
  twist << 0.2, -0.1, 0.05, 0.1, 0.08, -0.12;
  const keyframes::RowRectifier rectify(view.lens.lenses[0], kWidth, kHeight, twist,
                                        {{{100, 50}, 0.4F}, {{200, 180}, 0.1F}});
  std::mt19937 random(1);
  imaging::FloatImage noise(kWidth, kHeight);
  for (float& pixel : noise.pixels) pixel = static_cast<float>(random() % 256);
  const imaging::FloatImage rectified = rectify(keyframes::build_pyramid(noise, 1).levels[0]);
  ASSERT_EQ(rectified.pixels.size(), noise.pixels.size());
  double moved_px = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Eigen::Vector2f from = rectify.source_pixel(x, y);
      ASSERT_NEAR(rectified(x, y), keys_interpolated(noise, from.x(), from.y()), 0.02) << x << " " << y;
      moved_px = std::max<double>(moved_px, (from - Eigen::Vector2f(x, y)).norm());
    }
  }
  EXPECT_GT(moved_px, 8) << "the edge has to be met";
}

TEST(RollingShutter, RectifiedColorsAreInterpolatedAtTheirSources) {
  constexpr int kWidth = 317, kHeight = 237;
  const RollingView view;
  Vec6 twist;
  twist << 0.2, -0.1, 0.05, 0.1, 0.08, -0.12;
  const keyframes::RowRectifier rectify(view.lens.lenses[0], kWidth, kHeight, twist,
                                        {{{100, 50}, 0.4F}, {{200, 180}, 0.1F}});
  std::mt19937 random(2);
  imaging::RgbImage noise(kWidth, kHeight);
  std::array<imaging::FloatImage, 3> channels;
  for (std::size_t c = 0; c < 3; ++c) {
    channels[c] = imaging::FloatImage(kWidth, kHeight);
    for (std::size_t i = 0; i < noise.pixels.size(); ++i) {
      noise.pixels[i][c] = static_cast<std::uint8_t>(random() % 256);
      channels[c].pixels[i] = noise.pixels[i][c];
    }
  }
  const imaging::RgbImage rectified = rectify(noise);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Eigen::Vector2f from = rectify.source_pixel(x, y);
      for (std::size_t c = 0; c < 3; ++c) {
        const double expected = std::min(keys_interpolated(channels[c], from.x(), from.y()), 255.0);
        ASSERT_NEAR(rectified(x, y)[c], expected, 0.52) << x << " " << y << " " << c;  // rounded
      }
    }
  }
}

TEST(RollingShutter, WithoutMotionThePictureStaysAsItIs) {
  const RollingView view;
  const keyframes::RowRectifier rectify(view.lens.lenses[0], 320, 240, Vec6::Zero(), {});
  const imaging::RgbImage raw = view.rolling();
  EXPECT_LT(mean_difference(keyframes::luminance(rectify(raw), nullptr), keyframes::luminance(raw, nullptr)), 0.01);
}

TEST(RollingShutter, TheErrorWithRowTimesIsAThirdOfThatWithout) {
  constexpr double kLineDelay_s = 0.8 / kFps / 240;  // read out over 80 % of the interval
  constexpr int kFrames = 75;
  const Sequence rolling = shaken_flight(kFrames, kLineDelay_s), global = shaken_flight(kFrames, 0.0);
  const OdometryResult with = flown(rolling, kLineDelay_s), without = flown(rolling, 0.0), never = flown(global, 0.0);
  const double with_ate = test_support::relative_ate(with.trajectory, rolling.truth);
  const double without_ate = test_support::relative_ate(without.trajectory, rolling.truth);
  const double never_ate = test_support::relative_ate(never.trajectory, global.truth);
  std::printf("ATE, %% of path: %.3f with row times, %.3f without, %.3f with a global shutter; frames %ld %ld %ld\n",
              100 * with_ate, 100 * without_ate, 100 * never_ate, with.frames_tracked, without.frames_tracked,
              never.frames_tracked);
  EXPECT_EQ(with.frames_tracked, kFrames);
  EXPECT_LT(with_ate, without_ate / 3);
}

}  // namespace
}  // namespace tileflight::odometry::rolling_shutter_test
