#include "tileflight/evaluation/localization/picture_localizer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/localization/test_places.h"

namespace tileflight::localization::picture_localizer_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

struct Place {
  scene::Scene scene;
  explicit Place(int seed)
      : scene({render::test_scenes::hills(Vec3(0, 0, 10), 100.0, 60, test_places::blotches(seed))}) {}
};

const Place& the_place() {
  static const Place place(1);
  return place;
}

imaging::Camera camera() { return imaging::make_pinhole(320, 240, 80.0); }

SE3 true_pose() {
  SE3 pose = render::test_scenes::looking_down(Vec3(4.0, -7.0, 40.0));
  pose.rotation = pose.rotation * geometry::so3_exp({0.25, -0.1, 0.4});
  return pose;
}

imaging::RgbImage picture_at(const Place& place, const SE3& pose) {
  return render::CameraRenderer(place.scene, camera(), {}).render(pose).rgb;
}

SE3 off(const SE3& pose, const Vec3& metres, const Vec3& radians) {
  return {pose.rotation * geometry::so3_exp(radians), pose.translation + metres};
}

TEST(PictureLocalizer, FindsTheCameraFromAMetreAndTwoDegreesOff) {
  const PictureLocalizer localizer(the_place().scene, camera());
  const imaging::RgbImage picture = picture_at(the_place(), true_pose());
  for (const Vec3& metres : {Vec3(1.0, 0.0, 0.0), Vec3(-0.6, 0.8, 0.3), Vec3(0.2, -0.3, -0.9)}) {
    const auto found = localizer.locate(picture, off(true_pose(), metres, Vec3(0.02, -0.025, 0.03)));
    ASSERT_TRUE(found);
    EXPECT_LT((found->T_local_camera.translation - true_pose().translation).norm(), 0.02);
    EXPECT_LT(found->T_local_camera.rotation.angularDistance(true_pose().rotation), 6e-4);
    EXPECT_GT(found->correlation, 0.95);
    // The smallest information is along the motion that changes the image least: along the optical axis.
    const double along = found->information(2, 2), across = found->information(0, 0);
    EXPECT_LT(along, across);
  }
}

TEST(PictureLocalizer, OtherLightDoesNotMatter) {
  imaging::RgbImage picture = picture_at(the_place(), true_pose());
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {  // darker, and fading to a corner
      const double share = 0.7 - 0.4 * (double(x) / picture.width) * (double(y) / picture.height);
      for (auto& channel : picture(x, y)) channel = static_cast<std::uint8_t>(share * channel);
    }
  }
  const PictureLocalizer localizer(the_place().scene, camera());
  const auto found = localizer.locate(picture, off(true_pose(), Vec3(0.5, 0.4, -0.3), Vec3(0.01, 0.01, 0.01)));
  ASSERT_TRUE(found);
  EXPECT_LT((found->T_local_camera.translation - true_pose().translation).norm(), 0.05);
}

TEST(PictureLocalizer, AnotherPlaceIsNotTaken) {
  const PictureLocalizer localizer(the_place().scene, camera());
  EXPECT_FALSE(localizer.locate(picture_at(Place(2), true_pose()), true_pose()));
  // Neither an image far from the guess, nor the sky.
  EXPECT_FALSE(
      localizer.locate(picture_at(the_place(), true_pose()), off(true_pose(), Vec3(25.0, 0, 0), Vec3::Zero())));
  EXPECT_FALSE(
      localizer.locate(picture_at(the_place(), true_pose()), off(true_pose(), Vec3::Zero(), Vec3(M_PI, 0, 0))));
}

TEST(PictureLocalizer, APictureOfAnotherSizeIsAnError) {
  const PictureLocalizer localizer(the_place().scene, camera());
  EXPECT_THAT([&] { localizer.locate(imaging::RgbImage(100, 100), true_pose()); },
              ThrowsMessage<InputError>(HasSubstr("is 100x100, the calibration is for 320x240")));
}

}  // namespace
}  // namespace tileflight::localization::picture_localizer_test

namespace tileflight::localization::local_contrast_test {
namespace {

imaging::FloatImage pattern(double gain, double offset, double slope) {
  imaging::FloatImage image(64, 48);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x)
      image(x, y) =
          static_cast<float>(gain * 30.0 * std::sin(0.9 * x + 0.4 * y) * std::cos(1.1 * y) + offset + slope * x);
  return image;
}

TEST(LocalContrast, IsTheDefinitionByBruteForce) {
  const imaging::FloatImage image = pattern(1.0, 100.0, 0.5);
  const imaging::FloatImage even = normalize_local_contrast(image, 5, 4.0F);
  for (const auto& [x, y] : {std::pair{0, 0}, {63, 47}, {20, 30}, {3, 25}}) {
    double sum = 0.0, squares = 0.0, n = 0.0;
    for (int v = std::max(0, y - 5); v <= std::min(47, y + 5); ++v) {
      for (int u = std::max(0, x - 5); u <= std::min(63, x + 5); ++u) {
        sum += image(u, v);
        squares += image(u, v) * image(u, v);
        n += 1.0;
      }
    }
    const double mean = sum / n, deviation = std::sqrt(squares / n - mean * mean);
    EXPECT_NEAR(even(x, y), 128.0 + 40.0 * (image(x, y) - mean) / (deviation + 4.0), 1e-2);
  }
}

TEST(LocalContrast, LightThatChangesSlowlyFallsAway) {
  const imaging::FloatImage a = normalize_local_contrast(pattern(1.0, 100.0, 0.0), 8, 0.5F);
  const imaging::FloatImage b = normalize_local_contrast(pattern(1.6, 40.0, 0.6), 8, 0.5F);
  double squares = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) squares += std::pow(a.pixels[i] - b.pixels[i], 2);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(a.pixels.size())), 8.0);  // of a deviation of 40
}

TEST(LocalContrast, AnEvenPictureStaysEven) {
  const imaging::FloatImage even = normalize_local_contrast(imaging::FloatImage(20, 10, 77.0F), 3);
  ASSERT_EQ(even.pixels.size(), 200U);
  for (const float value : even.pixels) EXPECT_NEAR(value, 128.0F, 1e-3F);
}

}  // namespace
}  // namespace tileflight::localization::local_contrast_test
