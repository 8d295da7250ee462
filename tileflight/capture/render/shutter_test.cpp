// Pictures of a camera that moves while it is exposed, against those of one that stands still at each row's moment.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <ostream>
#include <span>
#include <vector>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::shutter_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using scene::Scene;
using namespace test_scenes;

constexpr int kWidth = 67, kHeight = 45;

/// Hills, and things above them.
Scene place() {
  const auto image = texture(256, 256, [](int x, int y) { return grey(noise(x / 16, y / 16)); });
  return Scene(
      {hills(Vec3::Zero(), 100.0, 60, image), ground(Vec3(2, 1, 9), 4.0, image), ground(Vec3(-6, -3, 12), 3.0, image)});
}

SE3 pose_at(double time_s) {
  SE3 T = looking_along(Vec3(0, -9, 25) + time_s * Vec3(7, 4, 1), Vec3(0.1, 0.8, -1.7));
  T.rotation = geometry::so3_exp(time_s * Vec3(0.4, -0.3, 0.5)) * T.rotation;
  return T;
}

/// The mean over the moments of pictures from each row's pose, of which only that row is kept.
LightFrame row_by_row(const CameraRenderer& renderer, const ShutterPoses& poses) {
  LightFrame sum{LinearImage(kWidth, kHeight), imaging::FloatImage(kWidth, kHeight), {}};
  for (int k = 0; k < poses.moments; ++k) {
    for (int y = 0; y < kHeight; ++y) {
      const SE3& T = poses.T_local_camera[static_cast<std::size_t>(k * poses.rows + (poses.rows == 1 ? 0 : y))];
      const LightFrame still = renderer.render_light({1, 1, {T}});
      for (int x = 0; x < kWidth; ++x) {
        for (std::size_t c = 0; c < 3; ++c)
          sum.light(x, y)[c] += still.light(x, y)[c] / static_cast<float>(poses.moments);
        if (k == poses.moments / 2) sum.depth_m(x, y) = still.depth_m(x, y);
      }
    }
  }
  return sum;
}

struct Shutter {
  const char* name;
  double exposure_s;
  int exposure_samples;
  double line_delay_s;
  int samples;  ///< a pixel
};

/// Names of tests do not show bytes.
void PrintTo(const Shutter& of, std::ostream* to) { *to << of.name; }

class ShutterKinds : public testing::TestWithParam<Shutter> {};

TEST_P(ShutterKinds, RowsAndMomentsAreThoseOfCamerasThatStandStill) {
  const Shutter& of = GetParam();
  const Scene scene = place();
  const CameraRenderer renderer(scene, imaging::make_fisheye(kWidth, kHeight, 100.0),
                                {.samples_per_pixel = of.samples});
  const ImageFormation formation{
      .exposure_time_s = of.exposure_s, .exposure_samples = of.exposure_samples, .line_delay_s = of.line_delay_s};
  const ShutterPoses poses = shutter_poses(formation, pose_at, 0.3, kHeight);
  const LightFrame frame = renderer.render_light(poses), expected = row_by_row(renderer, poses);
  int pixels = 0, other_depth = 0, other_light = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (std::isnan(expected.depth_m(x, y))) continue;
      ++pixels;
      const float depth_m = frame.depth_m(x, y), expected_m = expected.depth_m(x, y);
      other_depth += depth_m == expected_m || std::abs(depth_m - expected_m) < 1e-3F ? 0 : 1;
      // A little of the footprint of a row's pixels is the motion from row to row.
      other_light += std::abs(frame.light(x, y)[0] - expected.light(x, y)[0]) < 0.02F ? 0 : 1;
    }
  }
  EXPECT_GT(pixels, 2000);
  EXPECT_LE(other_depth, 3) << "at edges";
  EXPECT_LE(other_light, pixels / 50);
}

TEST_P(ShutterKinds, SameBytesForAnyNumberOfThreads) {
  const Shutter& of = GetParam();
  const ImageFormation formation{
      .exposure_time_s = of.exposure_s, .exposure_samples = of.exposure_samples, .line_delay_s = of.line_delay_s};
  const auto made = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Scene scene = place();
    const CameraRenderer renderer(scene, imaging::make_fisheye(kWidth, kHeight, 100.0),
                                  {.samples_per_pixel = of.samples});
    return renderer.render_light(shutter_poses(formation, pose_at, 0.3, kHeight));
  };
  const LightFrame one = made(1), two = made(2);
  EXPECT_EQ(one.light.pixels, two.light.pixels);
  EXPECT_EQ(std::memcmp(one.depth_m.pixels.data(), two.depth_m.pixels.data(), 4 * one.depth_m.pixels.size()), 0);
  EXPECT_EQ(one.view.surfaces, two.view.surfaces);
  EXPECT_EQ(one.view.nearest_m, two.view.nearest_m);
}

TEST_P(ShutterKinds, ChecksOfTheViewAreThoseOfTheMiddleMoment) {
  const Shutter& of = GetParam();
  const Scene scene = place();
  const CameraRenderer renderer(scene, imaging::make_fisheye(kWidth, kHeight, 100.0),
                                {.samples_per_pixel = of.samples});
  const ImageFormation formation{
      .exposure_time_s = of.exposure_s, .exposure_samples = of.exposure_samples, .line_delay_s = of.line_delay_s};
  const ViewStatistics view = renderer.render_light(shutter_poses(formation, pose_at, 0.3, kHeight)).view;
  const ViewStatistics middle =
      renderer.render_light(shutter_poses({.line_delay_s = of.line_delay_s}, pose_at, 0.3, kHeight)).view;
  EXPECT_EQ(view.rays, middle.rays);
  EXPECT_NEAR(static_cast<double>(view.surfaces), static_cast<double>(middle.surfaces), 1.0);
  EXPECT_NEAR(view.nearest_m, middle.nearest_m, 1e-4);
}

/// The data that visitors get: mesh, triangle and distance of each pixel; without a value there is no ray.
using Seen = imaging::Image<std::array<float, 3>>;

SurfaceVisitor writer_to(Seen& seen) {
  seen = Seen(kWidth, kHeight, {-1.0F, -1.0F, -1.0F});
  return [&seen](const SurfacePoint& at) {
    seen(at.x, at.y) = {at.hit ? static_cast<float>(at.mesh) : -0.5F, static_cast<float>(at.triangle), at.distance_m};
  };
}

TEST(OnePass, PictureAndVisitorGetWhatTheyGetAlone) {
  const Scene scene = place();
  const SE3 T = pose_at(0.3);
  for (const int samples : {1, 4}) {
    const CameraRenderer renderer(scene, imaging::make_fisheye(kWidth, kHeight, 100.0), {.samples_per_pixel = samples});
    Seen together, alone;
    const RenderedFrame frame = renderer.render(T, writer_to(together));
    const RenderedFrame picture = renderer.render(T);
    renderer.visit_surface(std::span(&T, 1), writer_to(alone));
    EXPECT_EQ(together.pixels, alone.pixels);
    EXPECT_EQ(frame.rgb.pixels, picture.rgb.pixels);
    EXPECT_EQ(frame.view.surfaces, picture.view.surfaces);
    EXPECT_EQ(std::memcmp(frame.depth_m.pixels.data(), picture.depth_m.pixels.data(), 4 * frame.depth_m.pixels.size()),
              0);
  }
}

TEST(OnePass, VisitorSeesTheMiddleMomentOfAnExposure) {
  const Scene scene = place();
  const CameraRenderer renderer(scene, imaging::make_fisheye(kWidth, kHeight, 100.0), {});
  const ShutterPoses shutter = shutter_poses({.exposure_time_s = 0.02}, pose_at, 0.3, kHeight);
  const SE3 middle = pose_at(0.3);
  Seen together, alone;
  renderer.render_light(shutter, writer_to(together));
  renderer.visit_surface(std::span(&middle, 1), writer_to(alone));
  EXPECT_EQ(together.pixels, alone.pixels);
}

/// Each with a texture of its own brightness and size.
Scene place_of_many_textures() {
  const auto of = [](int size, int darkest) {
    return texture(size, size, [=](int x, int y) { return grey(darkest + noise(x / 8, y / 8) / 4); });
  };
  return Scene({hills(Vec3::Zero(), 100.0, 60, of(256, 0)), ground(Vec3(2, 1, 9), 4.0, of(64, 80)),
                ground(Vec3(-6, -3, 12), 3.0, of(512, 160))});
}

// Moments that are cast together share what is known of the triangles that they meet; here many meet others.
TEST(Moments, AreTogetherWhatEachIsAlone) {
  const Scene scene = place_of_many_textures();
  const CameraRenderer renderer(scene, imaging::make_fisheye(kWidth, kHeight, 100.0), {});
  const ShutterPoses shutter =
      shutter_poses({.exposure_time_s = 0.2, .exposure_samples = 3, .line_delay_s = 2e-4}, pose_at, 0.3, kHeight);
  const LightFrame together = renderer.render_light(shutter);
  std::vector<double> sum(together.light.pixels.size()), changes(sum.size());
  for (int k = 0; k < 3; ++k) {
    const auto first = shutter.T_local_camera.begin() + k * kHeight;
    const LightFrame alone = renderer.render_light({1, kHeight, {first, first + kHeight}});
    for (std::size_t i = 0; i < sum.size(); ++i) {
      if (k > 0) changes[i] = std::max(changes[i], std::abs(alone.light.pixels[i][0] - sum[i] / k));
      sum[i] += alone.light.pixels[i][0];
    }
  }
  std::size_t other = 0, changing = 0;
  for (std::size_t i = 0; i < sum.size(); ++i) {
    other += std::abs(together.light.pixels[i][0] - sum[i] / 3.0) < 1e-4 ? 0 : 1;
    changing += changes[i] > 0.05 ? 1 : 0;
  }
  EXPECT_LE(other, 3U) << "at edges";
  EXPECT_GT(changing, 100U);
}

INSTANTIATE_TEST_SUITE_P(Of, ShutterKinds,
                         testing::Values(Shutter{"rolling", 0.0, 1, 2e-4, 1}, Shutter{"blurred", 0.01, 3, 0.0, 1},
                                         Shutter{"blurred_and_rolling", 0.01, 3, 2e-4, 1},
                                         Shutter{"many_moments", 0.01, 7, 2e-4, 1},
                                         Shutter{"several_samples", 0.01, 3, 2e-4, 9}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace tileflight::render::shutter_test
