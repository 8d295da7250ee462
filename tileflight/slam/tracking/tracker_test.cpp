#include "tileflight/slam/tracking/tracker.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::tracking::tracker_test {
namespace {

using geometry::SE3;
using geometry::Vec3;

const SE3 kTurn(geometry::so3_exp(Vec3(0.02, -0.03, 0.05)), Vec3::Zero());

/// Pixels all over the image, at the distances that `distance_m` gives for their unit rays.
template <class Distance>
TrackingReference reference_of(const imaging::Camera& camera, int count, const Distance& distance_m) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  ReferenceLevel level;
  for (int i = 0; i < count; ++i) {
    const geometry::Vec2 pixel(camera.width() * unit(random), camera.height() * unit(random));
    const auto ray = camera.unproject(pixel);
    if (ray) level.add(pixel.cast<float>(), ray->cast<float>(), static_cast<float>(1.0 / distance_m(*ray)), 100.0F);
  }
  return {{level}};
}

/// Root mean square over all pixels, by the camera's own projection.
OpticalFlow flow_by_brute_force(const imaging::Camera& camera, const TrackingReference& reference, const SE3& T) {
  const ReferenceLevel& level = reference.levels[0];
  double translation = 0.0, full = 0.0;
  for (std::size_t i = 0; i < level.size(); ++i) {
    const Vec3 point = level.ray_of(i).cast<double>() / level.rho[i];
    const geometry::Vec2 pixel = level.pixels[i].cast<double>();
    translation += (*camera.project(point + T.translation) - pixel).squaredNorm();
    full += (*camera.project(T * point) - pixel).squaredNorm();
  }
  const auto count = static_cast<double>(level.size());
  return {std::sqrt(translation / count), std::sqrt(full / count)};
}

TEST(OpticalFlow, OfAPlaneBesideAPinholeIsFocalLengthTimesShiftOverDistance) {
  const imaging::Camera camera = imaging::make_pinhole(320, 240, 90.0);  // focal length 160 px
  const TrackingReference plane = reference_of(camera, 300, [](const Vec3& ray) { return 8.0 / ray.z(); });
  const keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, 1);
  const OpticalFlow flow = optical_flow(lens, plane, SE3(Eigen::Quaterniond::Identity(), Vec3(0.3, -0.4, 0.0)));
  EXPECT_NEAR(flow.translation_px, 160.0 * 0.5 / 8.0, 1e-3);
  EXPECT_NEAR(flow.full_px, 160.0 * 0.5 / 8.0, 1e-3);
}

TEST(OpticalFlow, OfARotationIsNoneByTranslation) {
  const imaging::Camera camera = imaging::make_fisheye(320, 240, 140.0);
  const keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, 1);
  const TrackingReference sphere = reference_of(camera, 4000, [](const Vec3&) { return 5.0; });
  const OpticalFlow flow = optical_flow(lens, sphere, kTurn);
  EXPECT_LT(flow.translation_px, 1e-3);
  const OpticalFlow truth = flow_by_brute_force(camera, sphere, kTurn);
  EXPECT_GT(truth.full_px, 4.0);
  EXPECT_NEAR(flow.full_px, truth.full_px, 0.03 * truth.full_px) << "of a sample of the pixels";
}

TEST(OpticalFlow, IsTheRootMeanSquareOverAllPixels) {
  const imaging::Camera camera = imaging::make_fisheye(320, 240, 140.0);
  const keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, 1);
  const TrackingReference reference =
      reference_of(camera, 4000, [](const Vec3& ray) { return 6.0 + 3.0 * std::sin(9.0 * ray.x()); });
  const SE3 T(kTurn.rotation * kTurn.rotation, Vec3(0.5, -0.2, 0.3));
  const OpticalFlow flow = optical_flow(lens, reference, T), truth = flow_by_brute_force(camera, reference, T);
  EXPECT_NEAR(flow.translation_px, truth.translation_px, 0.03 * truth.translation_px);
  EXPECT_NEAR(flow.full_px, truth.full_px, 0.03 * truth.full_px);
  EXPECT_GT(std::abs(truth.full_px - truth.translation_px), 0.2 * truth.full_px) << "the two are told apart";
}

TEST(OpticalFlow, OfNoPointsAndOfPointsBehindTheCameraIsZero) {
  const imaging::Camera camera = imaging::make_pinhole(320, 240, 90.0);
  const keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, 1);
  const OpticalFlow none = optical_flow(lens, {{ReferenceLevel()}}, kTurn);
  EXPECT_EQ(none.translation_px, 0.0);
  EXPECT_EQ(none.full_px, 0.0);
  const TrackingReference plane = reference_of(camera, 300, [](const Vec3& ray) { return 8.0 / ray.z(); });
  const OpticalFlow behind = optical_flow(lens, plane, SE3(Eigen::Quaterniond::Identity(), Vec3(0, 0, -20.0)));
  EXPECT_EQ(behind.translation_px, 0.0);
  EXPECT_EQ(behind.full_px, 0.0);
}

}  // namespace
}  // namespace tileflight::tracking::tracker_test
