// Response, vignetting and exposure: corrected if calibrated, tolerated if not.

#include <gtest/gtest.h>

#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::light_test {
namespace {

using imaging::PhotometricCalibration;
using imaging::RgbImage;

/// A response with gamma 1 / 1.6 and a vignette that leaves 60 % in the corners.
PhotometricCalibration made_up_calibration(int width, int height) {
  PhotometricCalibration calibration;
  for (int i = 0; i < 256; ++i) calibration.inverse_response[i] = static_cast<float>(255.0 * std::pow(i / 255.0, 1.6));
  calibration.vignette = imaging::FloatImage(width, height);
  const double corner2 = 0.25 * (width * width + height * height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double r2 = (x - 0.5 * width) * (x - 0.5 * width) + (y - 0.5 * height) * (y - 0.5 * height);
      calibration.vignette(x, y) = static_cast<float>(1.0 - 0.4 * r2 / corner2);
    }
  return calibration;
}

/// I = G(t V B), with the response that the calibration inverts: eq. 1 of Engel, Usenko, Cremers 2016.
RgbImage taken(const RgbImage& irradiance, const PhotometricCalibration& calibration, double exposure) {
  RgbImage image(irradiance.width, irradiance.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const double light = exposure * calibration.vignette.pixels[i] * irradiance.pixels[i][0];
    const auto value =
        static_cast<std::uint8_t>(std::lround(255.0 * std::pow(std::min(light, 255.0) / 255.0, 1.0 / 1.6)));
    image.pixels[i] = {value, value, value};
  }
  return image;
}

const test_support::Sequence& clean_flight() {
  static const test_support::Sequence kFlight =
      test_support::render_hill_flight(imaging::make_fisheye(320, 200, 130.0), 32);
  return kFlight;
}

/// Exposures that oscillate between 70 and 100 %, with a step in the middle.
double exposure_of(std::size_t frame) {
  return (frame < 18 ? 1.0 : 0.8) * (0.94 + 0.06 * std::cos(0.8 * static_cast<double>(frame)));
}

test_support::Sequence filmed(const PhotometricCalibration& calibration) {
  test_support::Sequence flight = clean_flight();
  for (std::size_t i = 0; i < flight.images.size(); ++i)
    flight.images[i] = taken(flight.images[i], calibration, exposure_of(i));
  return flight;
}

FrameSource with_exposures(const test_support::Sequence& sequence) {
  return [source = sequence.source()]() -> std::optional<InputFrame> {
    std::optional<InputFrame> frame = source();
    if (frame) frame->exposure_ms = 10.0 * exposure_of(static_cast<std::size_t>(frame->index));
    return frame;
  };
}

TEST(Light, LuminanceUndoesResponseAndVignette) {
  const RgbImage& clean = clean_flight().images.front();
  const PhotometricCalibration calibration = made_up_calibration(clean.width, clean.height);
  const imaging::FloatImage undone = keyframes::luminance(taken(clean, calibration, 1.0), &calibration);
  for (std::size_t i = 0; i < undone.pixels.size(); ++i) {
    // Half a grey level of the 8-bit image, through the slope of the inverse response, over the vignette.
    EXPECT_NEAR(undone.pixels[i], clean.pixels[i][0], 0.5 * 1.6 / 0.6 + 0.05);
  }
}

TEST(Light, AKnownCalibrationUndoneGivesTheCleanResult) {
  const test_support::Sequence& clean = clean_flight();
  const PhotometricCalibration calibration = made_up_calibration(320, 200);
  const test_support::Sequence dim = filmed(calibration);
  const keyframes::OdometryOptions options = test_support::small_options();
  const OdometryResult expected = run_odometry(clean.calibration, clean.source(), options);
  OdometryInput input = dim.calibration;
  input.photometric = calibration;
  const OdometryResult undone = run_odometry(input, with_exposures(dim), options);
  ASSERT_FALSE(undone.lost) << undone.lost_reason;
  EXPECT_EQ(undone.frames_tracked, expected.frames_tracked);
  EXPECT_LT(test_support::relative_ate(expected.trajectory, clean.truth), 0.004);
  EXPECT_LT(test_support::relative_ate(undone.trajectory, clean.truth), 0.004);
  EXPECT_NEAR(static_cast<double>(undone.map.size()), static_cast<double>(expected.map.size()),
              0.25 * static_cast<double>(expected.map.size()));
}

TEST(Light, WithoutACalibrationAffineLightFollowsTheExposure) {
  const test_support::Sequence dim = filmed(made_up_calibration(320, 200));
  const OdometryResult result = run_odometry(dim.calibration, dim.source(), test_support::small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_GE(result.frames_tracked, 30);
  EXPECT_LT(test_support::relative_ate(result.trajectory, dim.truth), 0.01);
}

}  // namespace
}  // namespace tileflight::odometry::light_test
