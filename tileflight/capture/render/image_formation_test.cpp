#include "tileflight/capture/render/image_formation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <span>

#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"

namespace tileflight::render::image_formation_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

LinearImage even_light(int width, int height, float value) { return {width, height, LinearRgb{value, value, value}}; }

/// `light` through the formation, without vignette image or gain.
imaging::RgbImage developed(const LinearImage& light, const ImageFormation& formation, double gain = 1.0) {
  return develop(light, make_vignette(formation, light.width, light.height), formation, gain, 0);
}

TEST(ImageFormation, IdealCameraGivesTheTexturesColours) {
  EXPECT_TRUE(is_ideal(ImageFormation{}));
  LinearImage light(256, 1);
  for (int x = 0; x < 256; ++x) light(x, 0).fill(static_cast<float>(srgb_decode(x)));
  const imaging::RgbImage image = developed(light, {});
  for (int x = 0; x < 256; ++x) EXPECT_EQ(image(x, 0)[1], x);
}

TEST(ImageFormation, VignettingFallsWithTheSquareOfTheRadius) {
  const ImageFormation formation{.vignetting = 0.4};
  const imaging::FloatImage v = make_vignette(formation, 101, 51);
  EXPECT_FLOAT_EQ(v(50, 25), 1.0F);
  EXPECT_NEAR(v(0, 0), 0.6, 1e-6);
  EXPECT_NEAR(v(100, 50), 0.6, 1e-6);
  EXPECT_NEAR(v(50, 0), 1.0 - 0.4 * 625.0 / 3125.0, 1e-6);
  const imaging::RgbImage image = developed(even_light(101, 51, 0.5F), formation);
  EXPECT_NEAR(image(0, 0)[0], srgb_encode(0.3), 0.51);
}

TEST(ImageFormation, ExposureScalesLightBeforeTheResponse) {
  EXPECT_NEAR(developed(even_light(1, 1, 0.2F), {}, 1.7)(0, 0)[2], srgb_encode(0.34), 0.51);
  EXPECT_EQ(developed(even_light(1, 1, 0.8F), {}, 1.7)(0, 0)[2], 255);  // full well
}

TEST(ImageFormation, GainDriftsAndSteps) {
  const ImageFormation formation{
      .exposure_drift = 0.16, .exposure_drift_period_s = 4.0, .exposure_steps = {{2.0, 1.25}, {6.0, 0.8}}};
  EXPECT_NEAR(exposure_gain(formation, 0.0), 1.0, 1e-12);
  EXPECT_NEAR(exposure_gain(formation, 1.0), 1.16, 1e-12);
  EXPECT_NEAR(exposure_gain(formation, 2.0), 1.25, 1e-9);
  EXPECT_NEAR(exposure_gain(formation, 3.0), 1.25 * 0.84, 1e-9);
  EXPECT_NEAR(exposure_gain(formation, 7.0), 0.8 * 0.84, 1e-9);
}

TEST(ImageFormation, NoiseHasTheVarianceOfPhotonsAndReading) {
  const double white = 2000.0;
  const double read = 12.0;
  for (const double light : {0.02, 0.1, 0.5}) {
    // A response of power 1: values are proportional to electrons.
    const ImageFormation formation{.seed = 3, .white_electrons = white, .read_noise_electrons = read, .gamma = 1.0};
    const imaging::RgbImage image = developed(even_light(200, 150, static_cast<float>(light)), formation);
    double sum = 0.0;
    double squares = 0.0;
    for (const imaging::Rgb8& pixel : image.pixels) {
      sum += pixel[0];
      squares += pixel[0] * pixel[0];
    }
    const auto n = static_cast<double>(image.pixels.size());
    const double mean = sum / n;
    const double rounding = 1.0 / 12.0;
    const double grey_an_electron = 255.0 / white;
    const double expected = (light * white + read * read) * grey_an_electron * grey_an_electron + rounding;
    EXPECT_NEAR(mean, 255.0 * light, 0.1);
    EXPECT_NEAR(squares / n - mean * mean, expected, 0.04 * expected);
  }
}

TEST(ImageFormation, NoiseDiffersByFrameChannelAndSeedAndNotByThreads) {
  ImageFormation formation{.seed = 3, .white_electrons = 500.0};
  const LinearImage light = even_light(64, 48, 0.3F);
  const auto make = [&](std::uint64_t frame, std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return develop(light, {}, formation, 1.0, frame).pixels;
  };
  const auto reference = make(0, 1);
  EXPECT_EQ(make(0, 2), reference);
  EXPECT_NE(make(1, 2), reference);
  EXPECT_NE(reference[0][0] - reference[1][0], reference[0][1] - reference[1][1]);
  formation.seed = 4;
  EXPECT_NE(make(0, 1), reference);
}

TEST(ImageFormation, PhotometricCalibrationUndoesResponseAndVignette) {
  for (const double gamma : {0.0, 2.2}) {
    const ImageFormation formation{.vignetting = 0.5, .gamma = gamma};
    const imaging::PhotometricCalibration calibration = photometric_calibration(formation, 40, 30);
    const LinearImage light = even_light(40, 30, 0.4F);
    const imaging::RgbImage image = developed(light, formation);
    for (const auto& [x, y] : {std::pair{0, 0}, {20, 15}, {39, 7}}) {
      const float irradiance = calibration.inverse_response[image(x, y)[0]] / calibration.vignette(x, y);
      EXPECT_NEAR(irradiance, 255.0 * 0.4, 1.5) << gamma;
    }
    for (std::size_t i = 1; i < 256; ++i) {
      EXPECT_GT(calibration.inverse_response[i], calibration.inverse_response[i - 1]);
    }
  }
}

TEST(ImageFormation, ShutterAsksForEachRowAndMoment) {
  const ImageFormation formation{.exposure_time_s = 0.02, .exposure_samples = 5, .line_delay_s = 1e-4};
  const auto pose_at = [](double t) { return SE3(Eigen::Quaterniond::Identity(), Vec3(t, 0, 0)); };
  const ShutterPoses poses = shutter_poses(formation, pose_at, 7.0, 101);
  ASSERT_EQ(poses.moments, 5);
  ASSERT_EQ(poses.rows, 101);
  ASSERT_EQ(poses.T_local_camera.size(), 505U);
  const auto time_of = [&](int k, int y) {
    return poses.T_local_camera[static_cast<std::size_t>(k * 101 + y)].translation.x();
  };
  EXPECT_NEAR(time_of(2, 50), 7.0, 1e-12);         // the middle of the frame at its time
  EXPECT_NEAR(time_of(2, 0), 7.0 - 0.005, 1e-12);  // the first row is taken first
  EXPECT_NEAR(time_of(0, 50), 7.0 - 0.008, 1e-12);
  EXPECT_NEAR(time_of(4, 100), 7.0 + 0.008 + 0.005, 1e-12);
  const ShutterPoses instant = shutter_poses({}, pose_at, 7.0, 101);
  EXPECT_EQ(instant.T_local_camera.size(), 1U);
}

TEST(ImageFormation, MotionBlurIsTheShareOfTimeOverEachSide) {
  // A white-to-black edge moves 8 pixels during the exposure: the ramp between them is linear in light.
  const auto white = test_scenes::texture(2, 2, [](int, int) { return test_scenes::grey(255); });
  const scene::Scene scene({test_scenes::ground(Vec3(-500, 0, 0), 1000.0, white)});
  const imaging::Camera camera(imaging::PinholeRadtan{100, 100, 20, 10, {}}, 41, 21);
  const CameraRenderer renderer(scene, camera, {.background = {0, 0, 0}});
  const ImageFormation formation{.exposure_time_s = 0.1, .exposure_samples = 49};
  const auto pose_at = [](double t) { return test_scenes::looking_down({40.0 * t, 0, 50}); };  // 80 pixels a second
  const LightFrame frame = renderer.render_light(shutter_poses(formation, pose_at, 0.0, 21));
  for (int x = 0; x < 41; ++x) {
    const double covered = std::clamp(0.5 - (x - 20) / 8.0, 0.0, 1.0);
    EXPECT_NEAR(frame.light(x, 10)[0], covered, 0.03) << x;
  }
}

TEST(ImageFormation, RollingShutterShearsAMovingEdge) {
  const auto white = test_scenes::texture(2, 2, [](int, int) { return test_scenes::grey(255); });
  const scene::Scene scene({test_scenes::ground(Vec3(-500, 0, 0), 1000.0, white)});
  const imaging::Camera camera(imaging::PinholeRadtan{100, 100, 40, 20, {}}, 81, 41);
  const CameraRenderer renderer(scene, camera, {.background = {0, 0, 0}});
  const ImageFormation formation{.line_delay_s = 0.01};
  const auto pose_at = [](double t) { return test_scenes::looking_down({50.0 * t, 0, 50}); };  // a pixel a row
  const LightFrame frame = renderer.render_light(shutter_poses(formation, pose_at, 0.0, 41));
  for (int y = 1; y < 40; ++y) {
    const int edge = 40 - (y - 20);  // the camera moves right, so the edge moves left
    EXPECT_EQ(frame.light(edge - 2, y)[0], 1.0F) << y;
    EXPECT_EQ(frame.light(edge + 2, y)[0], 0.0F) << y;
  }
}

/// Position in pixels, along the middle row right of the centre, at which a channel falls below half of white.
double edge_px(const imaging::RgbImage& image, std::size_t channel) {
  const int y = image.height / 2;
  for (int x = image.width / 2; x + 1 < image.width; ++x) {
    const double here = srgb_decode(image(x, y)[channel]), next = srgb_decode(image(x + 1, y)[channel]);
    if (here >= 0.5 && next < 0.5) return x + (here - 0.5) / (here - next);
  }
  return -1.0;
}

TEST(ImageFormation, ChromaticAberrationMagnifiesRedAndBlueAboutThePrincipalPoint) {
  // A white square of 60 m seen from 100 m: its eastern rim is 120 pixels right of the principal point.
  const auto white = test_scenes::texture(2, 2, [](int, int) { return test_scenes::grey(255); });
  const scene::Scene scene({test_scenes::ground(Vec3(0, 0, 0), 60.0, white)});
  const imaging::Camera camera(imaging::PinholeRadtan{400, 400, 150, 40, {}}, 301, 81);
  FlightRenderOptions options;
  options.render = {.samples_per_pixel = 16, .background = {0, 0, 0}};
  options.formation.chromatic_red = 0.02;
  options.formation.chromatic_blue = -0.01;
  geometry::Trajectory frames;
  frames.poses = {{0.0, test_scenes::looking_down({0, 0, 100})}};
  imaging::RgbImage image;
  render_flight(scene, camera, frames, {}, options, [&](const FlightFrame& frame) { image = frame.rgb; });
  EXPECT_NEAR(edge_px(image, 1), 270.0, 0.15);
  EXPECT_NEAR(edge_px(image, 0), 150 + 120 * 1.02, 0.15);
  EXPECT_NEAR(edge_px(image, 2), 150 + 120 * 0.99, 0.15);
}

TEST(ImageFormation, HazeFollowsKoschmieder) {
  const auto dark = test_scenes::texture(2, 2, [](int, int) { return test_scenes::grey(40); });
  const scene::Scene scene({test_scenes::ground(Vec3(0, 0, 0), 4000.0, dark)});
  const imaging::Camera camera = imaging::make_pinhole(33, 21, 60.0);
  const imaging::Rgb8 sky{200, 210, 220};
  for (const double distance_m : {20.0, 200.0, 500.0, 2000.0}) {
    const ImageFormation formation{.haze_visibility_m = 500.0};
    const CameraRenderer renderer(scene, camera, {.background = sky, .haze_per_m = haze_per_m(formation)});
    const RenderedFrame frame = renderer.render(test_scenes::looking_down({0, 0, distance_m}));
    const double clear = std::pow(0.02, distance_m / 500.0);  // 2 % of the contrast are left at 500 m
    for (std::size_t c = 0; c < 3; ++c) {
      const double light = clear * srgb_decode(40) + (1 - clear) * srgb_decode(sky[c]);
      EXPECT_NEAR(frame.rgb(16, 10)[c], srgb_encode(light), 0.6) << distance_m;
    }
  }
  EXPECT_EQ(haze_per_m({}), 0.0);
}

/// A step of two greys, the second from column 20 on.
LinearImage step_of_light(double left_grey, double right_grey) {
  LinearImage light(40, 9);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 40; ++x) light(x, y).fill(static_cast<float>(srgb_decode(x < 20 ? left_grey : right_grey)));
  }
  return light;
}

TEST(ImageFormation, SharpeningOvershootsAtEdgesAndLeavesPlainsAlone) {
  const ImageFormation formation{.sharpening = 1.5, .sharpening_radius_px = 1.2};
  const imaging::RgbImage image = developed(step_of_light(80, 160), formation);
  // v + amount (v - v * g): beside a step of height h, the Gaussian's share of the other side is its tail. Pixels are
  // discrete, so the tails are sums of the sampled weights.
  double total = 0.0;
  for (int i = -4; i <= 4; ++i) total += std::exp(-0.5 * i * i / 1.44);
  const auto tail = [&](int from) {
    double sum = 0.0;
    for (int i = from; i <= 4; ++i) sum += std::exp(-0.5 * i * i / 1.44);
    return sum / total;
  };
  for (int away = 0; away < 20; ++away) {
    const double halo = 1.5 * 80.0 * tail(away + 1);
    EXPECT_NEAR(image(20 + away, 4)[1], std::min(255.0, 160.0 + halo), 0.51) << away;
    EXPECT_NEAR(image(19 - away, 4)[1], std::max(0.0, 80.0 - halo), 0.51) << away;
  }
  EXPECT_EQ(developed(even_light(16, 9, 0.3F), formation).pixels, developed(even_light(16, 9, 0.3F), {}).pixels);
}

TEST(ImageFormation, SharpeningKeepsColoursApart) {
  // Only the luma is sharpened: differences between the channels are unchanged where nothing is clipped.
  LinearImage light = step_of_light(110, 150);
  for (LinearRgb& pixel : light.pixels) pixel[0] = static_cast<float>(srgb_decode(srgb_encode(pixel[1]) - 30.0));
  const imaging::RgbImage image = developed(light, {.sharpening = 1.0});
  ASSERT_EQ(image.pixels.size(), light.pixels.size());
  for (const imaging::Rgb8& pixel : image.pixels) EXPECT_NEAR(pixel[1] - pixel[0], 30, 1);
  EXPECT_GT(image(20, 4)[1], 152);
}

TEST(ImageFormation, RefusesValuesOutOfRange) {
  EXPECT_NO_THROW(validate_image_formation({}));
  EXPECT_THAT([&] { validate_image_formation({.exposure_time_s = -1.0}); },
              ThrowsMessage<InputError>(HasSubstr("exposure time: must lie between 0 and 10 s")));
  EXPECT_THAT([&] { validate_image_formation({.exposure_time_s = std::numeric_limits<double>::quiet_NaN()}); },
              ThrowsMessage<InputError>(HasSubstr("exposure time: must lie between 0 and 10 s")));
  EXPECT_THAT([&] { validate_image_formation({.exposure_samples = 8}); },
              ThrowsMessage<InputError>(HasSubstr("exposure samples: must be an odd number")));
  EXPECT_THAT([&] { validate_image_formation({.vignetting = 1.0}); },
              ThrowsMessage<InputError>(HasSubstr("vignetting: must lie between 0 and 1")));
  EXPECT_THAT([&] { validate_image_formation({.exposure_drift = 1.5}); },
              ThrowsMessage<InputError>(HasSubstr("exposure drift: must lie between 0 and 1")));
  EXPECT_THAT(
      [&] {
        validate_image_formation({.exposure_steps = {{1.0, 0.0}}});
      },
      ThrowsMessage<InputError>(HasSubstr("exposure step: its gain must be positive")));
  EXPECT_THAT(
      [&] {
        validate_image_formation({.exposure_steps = {{1.0, 1.0}, {1.0, 2.0}}});
      },
      ThrowsMessage<InputError>(HasSubstr("exposure step: times must increase")));
  EXPECT_THAT([&] { validate_image_formation({.read_noise_electrons = 3.0}); },
              ThrowsMessage<InputError>(HasSubstr("read noise: needs white electrons above 0")));
  EXPECT_THAT([&] { validate_image_formation({.gamma = -2.2}); },
              ThrowsMessage<InputError>(HasSubstr("gamma: must lie between 0.1 and 10")));
  EXPECT_THAT([&] { validate_image_formation({.haze_visibility_m = -1.0}); },
              ThrowsMessage<InputError>(HasSubstr("haze visibility: must not be negative")));
  EXPECT_THAT([&] { validate_image_formation({.chromatic_red = 0.2}); },
              ThrowsMessage<InputError>(HasSubstr("chromatic aberration: must lie between")));
  EXPECT_THAT([&] { validate_image_formation({.auto_exposure = {.target = 1.5}}); },
              ThrowsMessage<InputError>(HasSubstr("auto exposure's target: must lie between 0 and 1")));
  EXPECT_THAT([&] { validate_image_formation({.auto_exposure = {.min_gain = 2.0, .max_gain = 1.0}}); },
              ThrowsMessage<InputError>(HasSubstr("auto exposure's gains: must be positive")));
  EXPECT_THAT([&] { validate_image_formation({.sharpening = -1.0}); },
              ThrowsMessage<InputError>(HasSubstr("sharpening: must lie between 0 and 10")));
  EXPECT_THAT([&] { validate_image_formation({.sharpening_radius_px = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("sharpening radius: must lie between 0.1 and 20")));
}

/// One channel of a pixel by the formation's formulas, in the order that image_formation.h lists.
std::uint8_t developed_channel(float light, float factor, float normal, const ImageFormation& formation) {
  const auto white = static_cast<float>(formation.white_electrons);
  const auto read = static_cast<float>(formation.read_noise_electrons);
  float exposed = factor * light;
  if (white > 0.0F) {
    const float electrons = std::max(0.0F, exposed) * white;
    exposed = (electrons + std::sqrt(electrons + read * read) * normal) / white;
  }
  return static_cast<std::uint8_t>(SrgbTables::get().encode(exposed) + 0.5F);
}

/// Rows are developed in runs of many pixels at once, whose ends fall anywhere within a row.
TEST(ImageFormation, RunsOfPixelsAreThosePixelByPixelToTheByte) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> anywhere(-0.1F, 1.3F);
  for (const int width : {1, 7, 128, 129, 301}) {
    for (const double white : {0.0, 6000.0}) {
      LinearImage light(width, 5);
      for (LinearRgb& pixel : light.pixels) pixel = {anywhere(random), anywhere(random), anywhere(random)};
      ImageFormation formation{.seed = 3, .vignetting = 0.4, .white_electrons = white};
      formation.read_noise_electrons = white > 0.0 ? 12.0 : 0.0;
      const imaging::FloatImage vignette = make_vignette(formation, width, 5);
      const imaging::RgbImage image = develop(light, vignette, formation, 1.1, 9);
      const std::uint64_t key = base::stream_key(base::stream_key(3, 16), 9);  // 16: the sensor's noise
      for (std::size_t i = 0; i < light.pixels.size(); ++i) {
        std::array<base::Float8, 4> normals;
        base::normal_variates8(key, i, normals);  // whose first lane is pixel i's
        for (std::size_t c = 0; c < 3; ++c) {
          ASSERT_EQ(image.pixels[i][c],
                    developed_channel(light.pixels[i][c], vignette.pixels[i] * 1.1F, normals[c][0], formation))
              << width << " " << white << " " << i;
        }
      }
    }
  }
}

TEST(ImageFormation, AFewPixelsAtATimeAreThoseOfTheWholeImage) {
  std::mt19937 random(8);
  std::uniform_real_distribution<float> anywhere(-0.1F, 1.3F);
  const int width = 301, height = 4;
  LinearImage light(width, height);
  for (LinearRgb& pixel : light.pixels) pixel = {anywhere(random), anywhere(random), anywhere(random)};
  const ImageFormation formation{
      .seed = 3, .vignetting = 0.4, .white_electrons = 6000.0, .read_noise_electrons = 12.0, .gamma = 2.2};
  const imaging::FloatImage vignette = make_vignette(formation, width, height);
  const Developer developer = make_developer(vignette, formation, 0.9, 7);
  imaging::RgbImage image(width, height);
  for (int y = height - 1; y >= 0; --y) {
    for (int x = 0; x < width;) {
      const int count = std::min(width - x, static_cast<int>(1 + random() % 200));
      developer(x, y, std::span(light.row(y) + x, static_cast<std::size_t>(count)), image);
      x += count;
    }
  }
  EXPECT_EQ(image.pixels, develop(light, vignette, formation, 0.9, 7).pixels);
}

}  // namespace
}  // namespace tileflight::render::image_formation_test
