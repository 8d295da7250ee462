#include "tileflight/slam/self_calibration/self_calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image_files.h"
#include "tileflight/slam/keyframes/synthetic_scene.h"

namespace tileflight::self_calibration {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using PoseAt = std::function<SE3(double time_s)>;  ///< T_local_camera

constexpr int kWidth = 640, kHeight = 400;

/// States how corners are seen: the oracle, in which everything is known.
struct Oracle {
  imaging::Camera camera;
  double readout_s = 0.0;
  double noise_px = 0.3;
  double relief_m = 6.0;
  std::size_t segments = 4, keyframes = 8, points = 280;
};

/// Returns where the rows of a rolling shutter see a point; nullopt outside the image.
std::optional<Vec2> seen_at(const Oracle& oracle, const PoseAt& pose, double time_s, const Vec3& point) {
  double row = 0.5 * (kHeight - 1);
  std::optional<Vec2> pixel;
  const int rounds = oracle.readout_s == 0.0 ? 1 : 8;
  for (int i = 0; i < rounds; ++i) {
    const double share = (row - 0.5 * (kHeight - 1)) / kHeight;
    pixel = oracle.camera.project(pose(time_s + share * oracle.readout_s).inverse() * point);
    if (!pixel || !oracle.camera.contains(*pixel)) return std::nullopt;
    row = pixel->y();
  }
  return pixel;
}

/// Corners of hilly ground, by the poses of each segment.
FollowedFlight observe(const Oracle& oracle, const std::function<PoseAt(std::size_t segment)>& path,
                       std::uint32_t seed) {
  FollowedFlight flight{.full_width = kWidth, .full_height = kHeight, .width = kWidth, .height = kHeight};
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, oracle.noise_px);
  std::uniform_real_distribution<double> wide(-45.0, 45.0), height(-0.5 * oracle.relief_m, 0.5 * oracle.relief_m);
  constexpr double kInterval_s = 0.4, kFrame_s = 1.0 / 30.0;
  for (std::size_t s = 0; s < oracle.segments; ++s) {
    const PoseAt pose = path(s);
    Segment segment;
    for (std::size_t k = 0; k < oracle.keyframes; ++k) {
      const double time_s = kInterval_s * static_cast<double>(k);
      segment.keyframes.push_back({time_s, time_s - kFrame_s, time_s + kFrame_s});
    }
    const Vec3 middle = pose(0.5 * kInterval_s * static_cast<double>(oracle.keyframes)).translation;
    for (std::size_t i = 0; i < oracle.points; ++i) {
      const Vec3 point(middle.x() + wide(random), middle.y() + wide(random), height(random));
      SegmentTrack track;
      std::ptrdiff_t views = 0;
      for (const SegmentKeyframe& keyframe : segment.keyframes) {
        const auto noisy = [&](double time_s) {
          const auto pixel = seen_at(oracle, pose, time_s, point);
          const Vec2 error(noise(random), noise(random));
          return pixel ? std::optional<Vec2>(*pixel + error) : std::nullopt;
        };
        const auto pixel = noisy(keyframe.time_s), before = noisy(keyframe.before_s), after = noisy(keyframe.after_s);
        track.points.push_back(pixel ? std::optional<TrackPoint>({*pixel, before, after}) : std::nullopt);
        views += pixel.has_value();
      }
      if (views >= 3) segment.tracks.push_back(std::move(track));
    }
    flight.segments.push_back(std::move(segment));
  }
  return flight;
}

/// Obliquely over the ground, in curves, with the nose nodding: a motion that shows the lens.
PoseAt curves(std::size_t segment) {
  const double start = 0.9 * static_cast<double>(segment);
  return [start](double time_s) {
    const double heading = start + 0.25 * time_s;
    const Vec3 position(3.0 * time_s, 2.0 * std::sin(0.8 * time_s + start), 20.0 + 1.5 * std::sin(time_s + start));
    const Vec3 forward(std::sin(heading), std::cos(heading), -1.3 + 0.3 * std::sin(0.9 * time_s));
    const Vec3 roll(0.0, 0.0, 0.15 * std::sin(1.3 * time_s + start));
    return keyframes::test_support::look_along(position, forward) * SE3(geometry::so3_exp(roll), Vec3::Zero());
  };
}

/// Low over hills, in a curve.
SE3 low_curve(double time_s) {
  const double heading = 0.25 * time_s;
  const Vec3 position(1.5 * time_s, 1.2 * std::sin(time_s), 12.0 + 0.8 * std::sin(1.4 * time_s));
  return keyframes::test_support::look_along(
      position, Vec3(std::sin(heading), std::cos(heading), -1.2 + 0.25 * std::sin(0.9 * time_s)));
}

/// Straight on, looking down without turning: no image shows the focal length over level ground.
PoseAt straight_down(std::size_t segment) {
  const double height_m = 20.0 + 0.1 * static_cast<double>(segment);
  return [height_m](double time_s) {
    geometry::Mat3 R;
    R << 1, 0, 0, 0, -1, 0, 0, 0, -1;
    return SE3(R, Vec3(0.0, 4.0 * time_s, height_m));
  };
}

imaging::Camera bent_pinhole() {
  return {imaging::PinholeRadtan{417.0, 417.0, 326.0, 195.0, {-0.1, 0.02, 0.0, 0.0}}, kWidth, kHeight};  // 75 degrees
}
imaging::Camera wide_fisheye() {
  return {imaging::KannalaBrandt{240.0, 240.0, 316.0, 203.0, {-0.02, 0.004, 0.0, 0.0}}, kWidth, kHeight};
}

LensParameters parameters_of(const imaging::Camera& camera) {
  imaging::Calibration calibration;
  calibration.camera = camera;
  return lens_of(calibration, model_of(camera), kWidth, kHeight);
}

double value(const LensEstimate& estimate, const std::string& name) {
  for (const ParameterEstimate& p : estimate.parameters)
    if (p.name == name) return p.value;
  return NAN;
}

double focal_error(const LensEstimate& estimate, double truth_px) { return value(estimate, "fx") / truth_px - 1.0; }

/// Largest distance between where two lenses see the rays of the first, over its image.
double largest_difference_px(const imaging::Camera& truth, const imaging::Camera& other) {
  double largest = 0.0;
  for (int y = 20; y < kHeight; y += 60) {
    for (int x = 20; x < kWidth; x += 60) {
      const auto pixel = other.project(truth.unproject({x, y}).value());
      largest = std::max(largest, pixel ? (*pixel - Vec2(x, y)).norm() : 1e9);
    }
  }
  return largest;
}

TEST(SelfCalibration, FindsAPinholeWithDistortionFromAWrongFieldOfView) {
  const FollowedFlight flight = observe({.camera = bent_pinhole()}, curves, 1);
  for (const double fov_deg : {62.0, 88.0}) {
    const LensEstimate estimate =
        estimate_lens(flight, {.horizontal_fov_deg = fov_deg, .model = LensModel::kPinhole}, false);
    EXPECT_TRUE(estimate.is_estimated);
    EXPECT_LT(std::abs(focal_error(estimate, 417.0)), std::min(0.02, 4.0 * estimate.focal_sigma));
    EXPECT_LT(estimate.focal_sigma, 0.006);
    EXPECT_NEAR(value(estimate, "k1"), -0.1, 0.02);
    // A corner's pixels have two errors each, and its position takes three of them up.
    EXPECT_NEAR(estimate.rms_px, 0.3 * std::sqrt(2.0), 0.1);
  }
}

TEST(SelfCalibration, FindsAFisheyeWithoutAnyGuess) {
  const FollowedFlight flight = observe({.camera = wide_fisheye(), .points = 160}, curves, 2);
  const LensEstimate estimate = estimate_lens(flight, {}, false);
  EXPECT_TRUE(estimate.is_estimated);
  EXPECT_EQ(estimate.model, LensModel::kFisheye);
  EXPECT_LT(std::abs(focal_error(estimate, 240.0)), std::min(0.02, 4.0 * estimate.focal_sigma));
  EXPECT_LT(largest_difference_px(wide_fisheye(), estimate.calibration.camera), 2.5);
  EXPECT_GT(estimate.other_model_rms_px, 1.2 * estimate.rms_px);
}

// Errors over their standard deviations have a mean square of 1.
TEST(SelfCalibration, StandardDeviationsAreThoseOfTheErrors) {
  for (const imaging::Camera& camera : {bent_pinhole(), wide_fisheye()}) {
    const LensParameters truth = parameters_of(camera);
    const std::vector<double> values{std::exp(truth.values[kLogFocal]), truth.values[kCenterX], truth.values[kCenterY],
                                     truth.values[kFirstDistortion]};
    double sum = 0.0;
    constexpr int kFlights = 3;
    for (int i = 0; i < kFlights; ++i) {
      const FollowedFlight flight =
          observe({.camera = camera, .points = model_of(camera) == LensModel::kPinhole ? 280U : 110U}, curves, 10 + i);
      imaging::Calibration guess;
      guess.camera = camera;
      const LensEstimate estimate = estimate_lens(flight, {.calibration = guess, .focal_sigma = 0.08}, false);
      for (const auto& [name, known] :
           {std::pair{"fx", values[0]}, {"cx", values[1]}, {"cy", values[2]}, {"k1", values[3]}}) {
        for (const ParameterEstimate& p : estimate.parameters)
          if (p.name == name) sum += std::pow((p.value - known) / p.sigma, 2);
      }
    }
    const double mean_square = sum / (4.0 * kFlights);
    EXPECT_GT(mean_square, 0.2);
    EXPECT_LT(mean_square, 2.0);
  }
}

TEST(SelfCalibration, FindsTheRollingShutter) {
  constexpr double kReadout_s = 0.02;
  const FollowedFlight flight =
      observe({.camera = bent_pinhole(), .readout_s = kReadout_s, .noise_px = 0.1}, curves, 3);
  const LensEstimate estimate =
      estimate_lens(flight, {.horizontal_fov_deg = 75.0, .model = LensModel::kPinhole, .focal_sigma = 0.1});
  EXPECT_NEAR(estimate.calibration.line_delay_s * kHeight, kReadout_s, 0.1 * kReadout_s);
  EXPECT_LT(std::abs(focal_error(estimate, 417.0)), 0.006);
}

TEST(SelfCalibration, KeepsTheGuessWhereTheMotionDoesNotShowTheLens) {
  const FollowedFlight flight = observe({.camera = bent_pinhole(), .relief_m = 0.0}, straight_down, 4);
  const LensEstimate estimate =
      estimate_lens(flight, {.horizontal_fov_deg = 60.0, .model = LensModel::kPinhole}, false);
  EXPECT_FALSE(estimate.is_estimated);
  EXPECT_NEAR(estimate.calibration.camera.horizontal_fov_deg(), 60.0, 1e-6);
  ASSERT_FALSE(estimate.warnings.empty());
  EXPECT_NE(estimate.warnings.front().message.find("the lens is the guess"), std::string::npos);
}

TEST(SelfCalibration, KeepsTheGuessWhereNothingMoves) {
  const FollowedFlight flight = observe(
      {.camera = bent_pinhole(), .noise_px = 0.05},
      [](std::size_t) -> PoseAt { return [](double) { return curves(0)(0.0); }; }, 5);
  const LensEstimate estimate = estimate_lens(flight, {.horizontal_fov_deg = 60.0}, false);
  EXPECT_FALSE(estimate.is_estimated);
  EXPECT_FALSE(estimate.warnings.empty());
}

// Pictures of hills through a fisheye of 120 degrees, from a guess that is a sixth too narrow.
TEST(SelfCalibration, FindsTheLensOfRenderedImages) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(testing::TempDir()) / "self_calibration_images";
  fs::remove_all(folder);
  fs::create_directories(folder);
  const imaging::Camera camera = imaging::make_fisheye(320, 240, 120.0);
  const keyframes::test_support::ReliefCamera scene(
      camera, keyframes::test_support::sine_hills({.amplitude_m = 1.5, .k_x = 0.35, .k_y = 0.28, .phase_y = 0.5}, 0.6));
  constexpr int kImages = 50;
  for (int i = 0; i < kImages; ++i) {
    const std::string name = std::to_string(1000 + i) + ".png";
    imaging::write_rgb(folder / name, scene.render(low_curve(0.12 * i)));
  }
  LensEstimateOptions options;
  options.segments.corners = 250;
  options.segments.keyframes = 12;
  const LensEstimate estimate =
      estimate_lens(folder, {.horizontal_fov_deg = 100.0, .model = LensModel::kFisheye}, options);
  EXPECT_TRUE(estimate.is_estimated);
  const double truth_px = 160.0 / (60.0 * geometry::kRadiansPerDegree);
  EXPECT_LT(std::abs(focal_error(estimate, truth_px)), std::min(0.015, 4.0 * estimate.focal_sigma));
  EXPECT_EQ(estimate.calibration.line_delay_s, 0.0);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace tileflight::self_calibration
