#include "tileflight/slam/keyframes/valid_region.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::valid_region_test {
namespace {

using imaging::GrayImage;
using imaging::RgbImage;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr int kReach_px = 5;

TEST(ValidRegion, IsWhatIsFarEnoughFromBlackCornersAndMask) {
  RgbImage picture(60, 40, {100, 120, 90});
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 10; ++x) picture(x, y) = {3, 2, 4};  // a black strip at the left edge, not quite black
  picture(30, 20) = {0, 0, 0};                               // black that is not connected to a corner belongs to the
                                                             // scene
  GrayImage mask(60, 40, 255);
  for (int x = 40; x < 60; ++x) mask(x, 39) = 0;
  const GrayImage region = keyframes::find_valid_region(picture, mask);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 60; ++x) {
      const bool near_strip = x < 10 + kReach_px, near_mask = x >= 40 - kReach_px && y >= 39 - kReach_px;
      ASSERT_EQ(region(x, y), near_strip || near_mask ? 0 : 255) << x << " " << y;
    }
}

TEST(ValidRegion, ADarkPictureSaysNothing) {
  EXPECT_TRUE(keyframes::is_dark(RgbImage(50, 40)));
  EXPECT_FALSE(keyframes::is_dark(RgbImage(50, 40, {100, 100, 100})));
  const GrayImage region = keyframes::find_valid_region(RgbImage(50, 40), {});
  ASSERT_EQ(region.pixels.size(), 2000U);
  for (const std::uint8_t value : region.pixels) EXPECT_EQ(value, 255);
}

TEST(ValidRegion, MaskOfAnotherSizeIsRefused) {
  EXPECT_THAT([&] { keyframes::find_valid_region(RgbImage(50, 40), GrayImage(40, 50)); },
              ThrowsMessage<InputError>(HasSubstr("mask: is 40x50, the images are 50x40")));
}

TEST(ValidRegion, TakesRaysAtEveryLevel) {
  keyframes::LensPyramid lens = keyframes::build_lens_pyramid(imaging::make_pinhole(64, 48, 80.0), 3);
  GrayImage region(64, 48, 255);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 21; ++x) region(x, y) = 0;
  keyframes::mask_rays(lens, region);
  const std::array<int, 3> first_kept{21, 12, 7};  // one more pixel goes at each coarser level, for its gradients
  for (int l = 0; l < 3; ++l) {
    EXPECT_TRUE(lens.rays[l].at(first_kept[l] - 1, 5).isZero(0)) << l;
    EXPECT_FALSE(lens.rays[l].at(first_kept[l], 5).isZero(0)) << l;
  }
}

/// Pixels of a result's points in the images of their hosts.
std::vector<geometry::Vec2> host_pixels(const imaging::Camera& camera, const OdometryResult& result) {
  std::vector<geometry::Vec2> pixels;
  for (std::size_t i = 0; i < result.map.size(); ++i) {
    const auto& host = result.keyframes.poses[result.map_point_keyframes[i].front()].T_local_camera;
    const auto pixel = camera.project(host.inverse() * result.map.positions[i]);
    if (pixel) pixels.push_back(*pixel);
  }
  return pixels;
}

/// Paints an object that moves with the camera: stripes over the lower fifth.
void paint_body(RgbImage& image) {
  for (int y = image.height * 4 / 5; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      image(x, y) = (x / 7 + y / 5) % 2 == 0 ? imaging::Rgb8{40, 40, 45} : imaging::Rgb8{210, 200, 190};
}

TEST(Masks, OwnBodyLeavesNoPointsAndDoesNoHarm) {
  test_support::Sequence sequence = test_support::render_hill_flight(imaging::make_fisheye(320, 200, 130.0), 36);
  for (RgbImage& image : sequence.images) paint_body(image);
  OdometryInput input = sequence.calibration;
  input.mask = GrayImage(320, 200, 255);
  for (int y = 160; y < 200; ++y) std::fill(input.mask.row(y), input.mask.row(y) + 320, std::uint8_t{0});
  const OdometryResult result = run_odometry(input, sequence.source(), test_support::small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_GE(result.frames_tracked, 34);
  EXPECT_LT(test_support::relative_ate(result.trajectory, sequence.truth), 0.005);
  ASSERT_GT(result.map.size(), 300U);
  const std::vector<geometry::Vec2> pixels = host_pixels(sequence.calibration.camera, result);
  ASSERT_FALSE(pixels.empty());
  for (const geometry::Vec2& pixel : pixels) EXPECT_LT(pixel.y(), 155.5);
}

TEST(Masks, TheBlackSurroundOfALensIsFound) {
  test_support::Sequence sequence = test_support::render_hill_flight(imaging::make_fisheye(300, 240, 150.0), 36);
  const auto outside = [](double x, double y) { return std::hypot(x - 149.5, y - 119.5) > 125.0; };
  for (RgbImage& image : sequence.images)
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        if (outside(x, y)) image(x, y) = {2, 1, 3};
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), test_support::small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_GE(result.frames_tracked, 34);
  EXPECT_LT(test_support::relative_ate(result.trajectory, sequence.truth), 0.005);
  ASSERT_GT(result.map.size(), 300U);
  const std::vector<geometry::Vec2> pixels = host_pixels(sequence.calibration.camera, result);
  ASSERT_FALSE(pixels.empty());
  for (const geometry::Vec2& pixel : pixels) EXPECT_LT(std::hypot(pixel.x() - 149.5, pixel.y() - 119.5), 121.0);
}

TEST(Masks, CloudsAreNotInTheMap) {
  keyframes::test_support::Relief relief = test_support::hilly_ground();
  relief.clouds = 90.0;
  std::vector<geometry::SE3> truth = test_support::path_over_ground(36);
  for (geometry::SE3& pose : truth) pose = keyframes::test_support::look_along(pose.translation, {0.1, 1.0, -0.35});
  const test_support::Sequence sequence =
      test_support::render_sequence(imaging::make_fisheye(320, 220, 130.0), relief, truth);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), test_support::small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_LT(test_support::relative_ate(result.trajectory, sequence.truth), 0.005);
  ASSERT_GT(result.map.size(), 300U);
  const std::vector<double> heights = test_support::height_errors_m(relief, result, sequence.truth);
  const auto off = std::count_if(heights.begin(), heights.end(), [](double h) { return h > 3.0; });
  EXPECT_LT(static_cast<double>(off), 0.01 * static_cast<double>(heights.size()));
}

}  // namespace
}  // namespace tileflight::odometry::valid_region_test
