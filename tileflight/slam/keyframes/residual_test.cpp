#include "tileflight/slam/keyframes/residual.h"

#include <gtest/gtest.h>

#include <random>

#include "tileflight/slam/keyframes/keyframe.h"

namespace tileflight::keyframes::residual_test {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using Vec6 = geometry::Vec6;

std::optional<Vec2> pixel_of(const Lens& lens, const SE3& T, const Vec3& ray, double rho) {
  Vec2 pixel;
  if (!lens.project<double>(T.rotation * ray + rho * T.translation, pixel)) return std::nullopt;
  return pixel;
}

TEST(PixelDerivatives, AreTheNumericOnes) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (const imaging::Camera& camera :
       {imaging::make_fisheye(1008, 566, 155.0, {-0.04, 0.0005, 0, 0}), imaging::make_fisheye(600, 600, 210.0),
        imaging::make_pinhole(640, 480, 70.0)}) {
    const Lens lens(camera);
    for (int i = 0; i < 200; ++i) {
      const auto ray = camera.unproject(
          Vec2((0.5 + 0.3 * unit(random)) * camera.width(), (0.5 + 0.3 * unit(random)) * camera.height()));
      const SE3 T =
          SE3::exp(0.2 * Vec6(unit(random), unit(random), unit(random), unit(random), unit(random), unit(random)));
      const double rho = 0.6 + 0.5 * unit(random);
      const Vec3 X = T.rotation * *ray + rho * T.translation;
      Vec2 pixel, by_rho;
      Eigen::Matrix<double, 2, 3> by_X;
      Eigen::Matrix<double, 2, 6> by_pose;
      ASSERT_TRUE(lens.project<double>(X, pixel, by_X));
      pixel_derivatives<double>(by_X, X, T.translation, rho, by_pose, by_rho);
      constexpr double kStep = 1e-5;
      for (int d = 0; d < 6; ++d) {
        const Vec6 step = kStep * Vec6::Unit(d);
        const Vec2 numeric =
            (*pixel_of(lens, SE3::exp(step) * T, *ray, rho) - *pixel_of(lens, SE3::exp(-step) * T, *ray, rho)) /
            (2 * kStep);
        EXPECT_LT((numeric - by_pose.col(d)).norm(), 1e-6 * (1.0 + by_pose.col(d).norm()));
      }
      const Vec2 numeric =
          (*pixel_of(lens, T, *ray, rho + kStep) - *pixel_of(lens, T, *ray, rho - kStep)) / (2 * kStep);
      EXPECT_LT((numeric - by_rho).norm(), 1e-6 * (1.0 + by_rho.norm()));
    }
  }
}

/// Pixel in the target of a host pixel.
Vec2 target_pixel(const Lens& lens, const SE3& T, const Vec2& host, double rho) {
  return pixel_of(lens, T, *lens.unproject(host), rho).value();
}

TEST(PixelDerivatives, ByTheLensAreTheNumericOnes) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const IntrinsicsDelta at(0.012, -0.008, 0.004, 0.006);
  for (const imaging::Camera& camera :
       {imaging::make_fisheye(1008, 566, 155.0, {-0.04, 0.0005, 0, 0}), imaging::make_fisheye(600, 600, 210.0),
        imaging::make_pinhole(640, 480, 70.0),
        imaging::Camera(imaging::PinholeRadtan{180, 181, 141, 98, {-0.2, 0.05, 1e-3, -1e-3}}, 280, 200),
        imaging::Camera(imaging::UnifiedModel{230, 231, 141, 98, 1.1, {-0.05, 0.01, 2e-3, -1e-3}}, 280, 200),
        imaging::Camera(imaging::ExtendedUnifiedModel{120, 120, 139.5, 99.5, 0.6, 1.1}, 280, 200),
        imaging::Camera(
            imaging::PinholeRational{180, 181, 141, 98, {0.3, 0.1, 1e-3, -1e-3, 0.02, 0.5, 0.1, 0.01, 1e-3}}, 280, 200),
        imaging::make_panorama(400, 200),
        imaging::Camera(imaging::DoubleSphere{80, 80, 139.5, 79.5, 0.4, 0.62}, 280, 160)}) {
    const Lens own(camera), lens = own.apply_delta(at);
    for (int i = 0; i < 100; ++i) {
      const Vec2 host((0.5 + 0.3 * unit(random)) * camera.width(), (0.5 + 0.3 * unit(random)) * camera.height());
      const SE3 T =
          SE3::exp(0.2 * Vec6(unit(random), unit(random), unit(random), unit(random), unit(random), unit(random)));
      const double rho = 0.6 + 0.5 * unit(random);
      const Vec2 target = target_pixel(lens, T, host, rho);
      constexpr double kPixel = 1e-3, kStep = 1e-6;
      Eigen::Matrix2d by_host;
      for (int d = 0; d < 2; ++d) {
        const Vec2 step = kPixel * Vec2::Unit(d);
        by_host.col(d) =
            (target_pixel(lens, T, host + step, rho) - target_pixel(lens, T, host - step, rho)) / (2 * kPixel);
      }
      const Eigen::Matrix<double, 2, 4> derivative = intrinsics_jacobian<double>(lens, target, host, by_host);
      for (int d = 0; d < 4; ++d) {
        const IntrinsicsDelta step = kStep * IntrinsicsDelta::Unit(d);
        const Vec2 numeric = (target_pixel(own.apply_delta(at + step), T, host, rho) -
                              target_pixel(own.apply_delta(at - step), T, host, rho)) /
                             (2 * kStep);
        EXPECT_LT((numeric - derivative.col(d)).norm(), 1e-6 * (1.0 + lens.focal_px()));
      }
    }
  }
}

/// An image with grey values linear in the pixel, so that sampled gradients are exact.
PyramidLevel ramp(int width, int height, float gx, float gy) {
  imaging::FloatImage image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image(x, y) = 20.0F + gx * static_cast<float>(x) + gy * static_cast<float>(y);
  }
  return build_pyramid(image, 1).levels[0];
}

/// Energy of the residual at a state, by the definition that the sums approximate.
float energy_at(const Lens& lens, const PyramidLevel& target, const Patch& patch, const SE3& T, double a, double b,
                double rho) {
  HostTargetPrecalc frame;
  frame.current = pair_transform(T, {}, {a, b});
  return evaluate_residual(lens, target, patch, static_cast<float>(rho), frame, 1e6F, nullptr).energy;
}

TEST(Residual, SumsGiveTheGradientOfTheEnergy) {
  const Lens lens(imaging::make_fisheye(400, 300, 120.0));
  const PyramidLevel host = ramp(400, 300, 0.30F, -0.2F), target = ramp(400, 300, 0.28F, -0.15F);
  const auto patch = make_patch(host, lens, {180, 170}, 50.0F);
  ASSERT_TRUE(patch);
  const SE3 T = SE3::exp((Vec6() << 0.05, -0.03, 0.02, 0.01, -0.02, 0.03).finished());
  const double rho = 0.8, a = 0.1, b = 3.0;
  HostTargetPrecalc frame;
  frame.current = pair_transform(T, {}, {a, b});
  frame.R_linear = frame.current.R;
  frame.t_linear = frame.current.t;
  frame.gain_linear = frame.current.gain;
  Linearization lin;
  ASSERT_EQ(evaluate_residual(lens, target, *patch, static_cast<float>(rho), frame, 1e6F, &lin).state,
            ResidualState::kGood);
  // dE/dx = 2 J^T w r; on ramps the gradients are constant, so using the centre's geometry is the only approximation.
  const Vec6 by_pose = 2.0 * (lin.d_pixel_d_pose.transpose() * lin.sums.gr).cast<double>();
  const double by_rho = 2.0 * lin.d_pixel_d_rho.dot(lin.sums.gr);
  constexpr double kStep = 2e-3;
  for (int d = 0; d < 6; ++d) {
    const Vec6 step = kStep * Vec6::Unit(d);
    const double numeric = (energy_at(lens, target, *patch, SE3::exp(step) * T, a, b, rho) -
                            energy_at(lens, target, *patch, SE3::exp(-step) * T, a, b, rho)) /
                           (2 * kStep);
    EXPECT_NEAR(by_pose[d], numeric, 0.02 * by_pose.norm());
  }
  const double numeric_rho =
      (energy_at(lens, target, *patch, T, a, b, rho + kStep) - energy_at(lens, target, *patch, T, a, b, rho - kStep)) /
      (2 * kStep);
  EXPECT_NEAR(by_rho, numeric_rho, 0.02 * std::abs(numeric_rho));
  const double numeric_a =
      (energy_at(lens, target, *patch, T, a + kStep, b, rho) - energy_at(lens, target, *patch, T, a - kStep, b, rho)) /
      (2 * kStep);
  EXPECT_NEAR(2.0 * lin.sums.Ar[0], numeric_a, 0.01 * std::abs(numeric_a));
  const double numeric_b =
      (energy_at(lens, target, *patch, T, a, b + kStep, rho) - energy_at(lens, target, *patch, T, a, b - kStep, rho)) /
      (2 * kStep);
  EXPECT_NEAR(2.0 * lin.sums.Ar[1], numeric_b, 0.01 * std::abs(numeric_b));
}

TEST(Residual, LeavingThePictureIsOutside) {
  const Lens lens(imaging::make_pinhole(200, 160, 80.0));
  const PyramidLevel picture = ramp(200, 160, 1.0F, 0.0F);
  const auto patch = make_patch(picture, lens, {100, 80}, 50.0F);
  ASSERT_TRUE(patch);
  HostTargetPrecalc frame;
  frame.current = pair_transform(SE3(geometry::so3_exp(Vec3(0, 1.2, 0)), Vec3::Zero()), {}, {});
  EXPECT_EQ(evaluate_residual(lens, picture, *patch, 1.0F, frame, 9.0F, nullptr).state, ResidualState::kOutside);
}

TEST(Patch, RayDerivativeIsTheInverseOfTheProjection) {
  const Lens lens(imaging::make_fisheye(400, 300, 170.0));
  const PyramidLevel picture = ramp(400, 300, 1.0F, 0.5F);
  for (const Eigen::Vector2f& pixel : {Eigen::Vector2f(30, 40), Eigen::Vector2f(200, 150), Eigen::Vector2f(380, 280)}) {
    const auto patch = make_patch(picture, lens, pixel, 50.0F);
    ASSERT_TRUE(patch);
    const Eigen::Vector2f offset(0.1F, -0.05F);
    const auto moved = lens.unproject((pixel + offset).cast<double>());
    EXPECT_LT((patch->ray + patch->d_ray_d_pixel * offset - moved->cast<float>()).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace tileflight::keyframes::residual_test
