#include "tileflight/slam/mapping/static_stereo.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/slam/keyframes/pixel_selector.h"
#include "tileflight/slam/keyframes/synthetic_scene.h"
#include "tileflight/slam/mapping/mapper.h"
#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping::static_stereo_test {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using keyframes::test_support::look_along;
using keyframes::test_support::Relief;
using keyframes::test_support::ReliefCamera;

constexpr int kLevels = 4;

/// A level plane below two cameras of one instant.
struct Rig {
  Rig(const imaging::Camera& own, const imaging::Camera& other, const SE3& T_other_own, double height_m)
      : lens(keyframes::build_lens_pyramid(own, kLevels)), T_own(look_along({0, 0, height_m}, {0.1, 1.0, -1.2})) {
    relief.texel_m = 0.035 * height_m;
    cameras.push_back({keyframes::Lens(other), T_other_own});
    picture = pyramid(own, T_own);
    other_picture = pyramid(other, T_own * T_other_own.inverse());
  }

  std::shared_ptr<const keyframes::Pyramid> pyramid(const imaging::Camera& camera, const SE3& T_local_camera) const {
    const imaging::RgbImage image = ReliefCamera(camera, relief).render(T_local_camera);
    return std::make_shared<const keyframes::Pyramid>(
        keyframes::build_pyramid(keyframes::luminance(image, nullptr), kLevels));
  }
  double true_rho(const Eigen::Vector3f& ray) const {
    const double distance =
        keyframes::test_support::hit_distance(relief, T_own.translation, T_own.rotation * ray.cast<double>());
    return distance > 0.0 ? 1.0 / distance : 0.0;
  }
  keyframes::Window window() const {
    keyframes::Window window;
    window.stereo_cameras = cameras;
    return window;
  }
  keyframes::Keyframe keyframe() const {
    keyframes::Keyframe keyframe;
    keyframe.pyramid = picture;
    keyframe.brightness_information = {1e14, 1e8};
    keyframe.stereo.resize(1);
    keyframe.stereo[0].pyramid = other_picture;
    keyframe.stereo[0].brightness_information = {1e3, 1.0};
    for (const keyframes::SelectedPixel& p : keyframes::select_pixels(*picture, lens.rays[0], 600, options.selection)) {
      const auto patch = keyframes::make_patch(picture->levels[0], lens.lenses[0], Eigen::Vector2f(p.x, p.y),
                                               options.window.gradient_weight);
      if (!patch || true_rho(patch->ray) <= 0.0) continue;
      keyframe.immature.emplace_back();
      keyframe.immature.back().patch = *patch;
    }
    return keyframe;
  }

  keyframes::OdometryOptions options;
  Relief relief;
  keyframes::LensPyramid lens;
  SE3 T_own;
  std::vector<keyframes::StereoCamera> cameras;
  std::shared_ptr<const keyframes::Pyramid> picture, other_picture;
};

SE3 beside(double baseline_m, const Vec3& turned_rad = Vec3::Zero()) {
  return SE3(geometry::so3_exp(turned_rad), Vec3(-baseline_m, 0, 0));
}

double median_relative_error(const Rig& rig, const keyframes::Keyframe& keyframe) {
  std::vector<double> errors;
  for (const keyframes::ImmaturePoint& point : keyframe.immature) {
    if (point.has_depth()) errors.push_back(std::abs(point.rho() / rig.true_rho(point.patch.ray) - 1.0));
  }
  return errors.empty() ? 1.0 : base::median(errors);
}

struct StereoCase {
  const char* name;
  imaging::Camera own, other;
  SE3 T_other_own;
  double height_m;
  double error;  ///< largest median error of the inverse distance, a share of it
  double found;  ///< smallest share of the searched points
};

std::vector<StereoCase> cases() {
  const imaging::Camera pinhole = imaging::make_pinhole(400, 300, 80.0),
                        fisheye = imaging::make_fisheye(400, 300, 155.0);
  return {{"a pinhole pair", pinhole, pinhole, beside(0.2), 5.0, 0.01, 0.6},
          {"weak parallax", pinhole, pinhole, beside(0.2), 30.0, 0.06, 0.6},
          {"a fisheye pair", fisheye, fisheye, beside(0.4), 5.0, 0.02, 0.6},
          {"one above the other", pinhole, pinhole, SE3(Eigen::Quaterniond::Identity(), {0, 0.25, 0}), 5.0, 0.01, 0.6},
          {"other lenses, turned", pinhole, fisheye, beside(0.4, {0.25, -0.3, 0.1}), 5.0, 0.03, 0.3}};
}

TEST(StaticStereo, FindsTheDistancesOfAPlaneThroughAnyLens) {
  for (const StereoCase& one : cases()) {
    SCOPED_TRACE(one.name);
    const Rig rig(one.own, one.other, one.T_other_own, one.height_m);
    keyframes::Keyframe keyframe = rig.keyframe();
    const StereoMatches matches = trace_stereo(rig.window(), rig.lens.lenses[0], rig.options, keyframe)[0];
    EXPECT_GT(matches.searched, 200);
    EXPECT_GT(matches.found, one.found * matches.searched);
    EXPECT_LT(median_relative_error(rig, keyframe), one.error);
    ASSERT_NE(keyframe.stereo[0].pyramid, nullptr);
  }
}

TEST(StaticStereo, LeavesPointsAloneThatTheOtherCameraDoesNotSee) {
  const imaging::Camera camera = imaging::make_pinhole(400, 300, 80.0);
  const Rig rig(camera, camera, beside(0.2, {0.0, -0.9, 0.0}), 5.0);  // half a field of view further to the side
  keyframes::Keyframe keyframe = rig.keyframe();
  trace_stereo(rig.window(), rig.lens.lenses[0], rig.options, keyframe);
  int inside = 0, outside = 0;
  for (const keyframes::ImmaturePoint& point : keyframe.immature) {
    const Eigen::Vector3f far =
        rig.cameras[0].T_stereo_reference.rotation.toRotationMatrix().cast<float>() * point.patch.ray;
    Eigen::Vector2f pixel;
    const bool seen = rig.cameras[0].lens.project<float>(far, pixel) && pixel.x() > 0 && pixel.x() < 399;
    (seen ? inside : outside) += 1;
    if (!seen) {
      EXPECT_EQ(point.status, keyframes::ImmaturePoint::Status::kUntraced);
    }
  }
  EXPECT_GT(inside, 50);
  EXPECT_GT(outside, 50);
}

TEST(StaticStereo, FindsTheBrightnessOfTheOtherPicture) {
  const imaging::Camera camera = imaging::make_pinhole(400, 300, 80.0);
  Rig rig(camera, camera, beside(0.2), 5.0);
  keyframes::Pyramid darker = *rig.other_picture;
  for (keyframes::PyramidLevel& level : darker.levels) {
    for (float& grey : level.grey) grey = 0.6F * grey + 3.0F;
  }
  rig.other_picture = std::make_shared<const keyframes::Pyramid>(std::move(darker));
  keyframes::Window window = rig.window();
  keyframes::Keyframe keyframe = rig.keyframe();
  const StereoMatches matches = trace_stereo(window, rig.lens.lenses[0], rig.options, keyframe)[0];
  EXPECT_GT(matches.found, 0.6 * matches.searched);
  EXPECT_LT(median_relative_error(rig, keyframe), 0.02);
  add_keyframe(window, std::move(keyframe));
  EXPECT_GT(start_from_stereo(window, rig.lens.lenses[0], rig.options), 100);
  EXPECT_NEAR(window.keyframes[0].stereo_brightness(0).a, std::log(0.6), 0.01);
  EXPECT_NEAR(window.keyframes[0].stereo_brightness(0).b, 3.0, 1.0);
}

TEST(StaticStereo, StartsAMetricMapFromOneInstant) {
  const imaging::Camera camera = imaging::make_pinhole(400, 300, 80.0);
  const Rig rig(camera, camera, beside(0.2), 5.0);
  const auto map_with = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    keyframes::Window window = rig.window();
    keyframes::Keyframe keyframe = rig.keyframe();
    trace_stereo(window, rig.lens.lenses[0], rig.options, keyframe);
    add_keyframe(window, std::move(keyframe));
    EXPECT_GT(start_from_stereo(window, rig.lens.lenses[0], rig.options), 100);
    return window;
  };
  const keyframes::Window one = map_with(1), two = map_with(2);
  std::vector<double> ratios;
  ASSERT_EQ(one.keyframes[0].points.size(), two.keyframes[0].points.size());
  for (std::size_t i = 0; i < one.keyframes[0].points.size(); ++i) {
    const keyframes::ActivePoint& point = one.keyframes[0].points[i];
    EXPECT_EQ(point.rho, two.keyframes[0].points[i].rho);
    ratios.push_back(point.rho / rig.true_rho(point.patch.ray));
  }
  EXPECT_NEAR(base::median(ratios), 1.0, 0.003);
}

TEST(StaticStereo, DoesNotStartFromExchangedCamerasNorFromAnotherPlace) {
  const imaging::Camera camera = imaging::make_pinhole(400, 300, 80.0);
  const Rig right(camera, camera, beside(0.2), 5.0);
  Rig exchanged = right, elsewhere = right;
  exchanged.cameras[0].T_stereo_reference = beside(-0.2);
  elsewhere.other_picture = elsewhere.pyramid(camera, look_along({40, 7, 5}, {0.1, 1.0, -1.2}));
  for (const Rig* rig : {&exchanged, &elsewhere}) {
    keyframes::Window window = rig->window();
    keyframes::Keyframe keyframe = rig->keyframe();
    const StereoMatches matches = trace_stereo(window, rig->lens.lenses[0], rig->options, keyframe)[0];
    EXPECT_LT(matches.found, 0.12 * matches.searched);
    EXPECT_EQ(keyframe.stereo[0].pyramid, nullptr);
    add_keyframe(window, std::move(keyframe));
    EXPECT_EQ(start_from_stereo(window, rig->lens.lenses[0], rig->options), 0);
    EXPECT_TRUE(window.keyframes[0].points.empty());
  }
}

/// The residual in a stereo picture depends on the inverse distance only; through another lens than the host's.
TEST(StaticStereo, ThePixelsDerivativeByTheInverseDistanceIsTheNumericOne) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (const StereoCase& one : cases()) {
    const keyframes::Lens other(one.other);
    for (int i = 0; i < 200; ++i) {
      const auto ray = one.own.unproject(Vec2((0.5 + 0.4 * unit(random)) * 400, (0.5 + 0.4 * unit(random)) * 300));
      const double rho = 0.3 + 0.25 * unit(random);
      const SE3& T = one.T_other_own;
      const Vec3 X = T.rotation * *ray + rho * T.translation;
      Vec2 pixel, by_rho, before, after;
      Eigen::Matrix<double, 2, 3> by_X;
      Eigen::Matrix<double, 2, 6> by_pose;
      if (!other.project<double>(X, pixel, by_X)) continue;
      keyframes::pixel_derivatives<double>(by_X, X, T.translation, rho, by_pose, by_rho);
      constexpr double kStep = 1e-5;
      ASSERT_TRUE(other.project<double>(X + kStep * T.translation, after));
      ASSERT_TRUE(other.project<double>(X - kStep * T.translation, before));
      EXPECT_LT(((after - before) / (2 * kStep) - by_rho).norm(), 1e-6 * (1.0 + by_rho.norm()));
    }
  }
}

/// Derivatives of the energy by the inverse distance and by (a, b) of the stereo picture, over a picture whose grey
/// values are linear, so that they are exact.
TEST(StaticStereo, TheEnergysDerivativesAreTheNumericOnes) {
  const imaging::Camera camera = imaging::make_pinhole(400, 300, 80.0);
  Rig rig(camera, camera, beside(0.2), 5.0);
  keyframes::Pyramid ramp = *rig.other_picture;
  keyframes::PyramidLevel& level = ramp.levels[0];
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) level.row(y)[x] = 0.4F * x + 0.1F * y;
  }
  keyframes::Window window = rig.window();
  keyframes::Keyframe keyframe = rig.keyframe();
  keyframe.stereo[0].brightness_linear = {0.1, 2.0};
  add_keyframe(window, keyframe);
  constexpr float kNoHuber = 1e6F;
  const auto energy = [&](const keyframes::Patch& patch, double rho, double a, double b) {
    window.keyframes[0].stereo_delta[0] = a;
    window.keyframes[0].stereo_delta[1] = b;
    return static_cast<double>(keyframes::evaluate_residual(rig.cameras[0].lens, level, patch, static_cast<float>(rho),
                                                            make_stereo_pairs(window)[0], kNoHuber, nullptr)
                                   .energy);
  };
  int checked = 0;
  for (const keyframes::ImmaturePoint& point : keyframe.immature) {
    const double rho = rig.true_rho(point.patch.ray);
    window.keyframes[0].stereo_delta.setZero();
    keyframes::Linearization lin;
    const auto value = keyframes::evaluate_residual(rig.cameras[0].lens, level, point.patch, static_cast<float>(rho),
                                                    make_stereo_pairs(window)[0], kNoHuber, &lin);
    if (value.state != keyframes::ResidualState::kGood) continue;
    const Eigen::Vector3d half(lin.d_pixel_d_rho.dot(lin.sums.gr), lin.sums.Ar[0], lin.sums.Ar[1]);
    // What each derivative would be if all residuals of the pattern were of one sign (Cauchy and Schwarz): the Jacobian
    // by rho is that of the pattern's middle (DSO, section 2.3), so it may err by a small part of this.
    const Eigen::Vector3d largest = 2.0 * std::sqrt(value.energy) *
                                    Eigen::Vector3d(std::sqrt(lin.d_pixel_d_rho.dot(lin.sums.gg * lin.d_pixel_d_rho)),
                                                    std::sqrt(lin.sums.AA(0, 0)), std::sqrt(lin.sums.AA(1, 1)));
    const Eigen::Vector3d steps(0.01 * rho, 0.02, 0.5);
    for (int d = 0; d < 3; ++d) {
      const auto difference = [&](double times) {
        const Eigen::Vector3d s = times * steps[d] * Eigen::Vector3d::Unit(d);
        return energy(point.patch, rho + s[0], s[1], s[2]) - energy(point.patch, rho - s[0], -s[1], -s[2]);
      };
      const double numeric = (8.0 * difference(1.0) - difference(2.0)) / (12.0 * steps[d]);  // of fourth order
      EXPECT_NEAR(numeric, 2.0 * half[d], 5e-3 * largest[d]) << d;
    }
    ++checked;
  }
  EXPECT_GT(checked, 100);
}

}  // namespace
}  // namespace tileflight::mapping::static_stereo_test
