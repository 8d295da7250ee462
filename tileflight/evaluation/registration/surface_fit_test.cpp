#include "tileflight/evaluation/registration/surface_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <random>

#include "tileflight/core/alignment/plane_system.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/registration/test_flights.h"

namespace tileflight::registration::surface_fit_test {
namespace {

using namespace test_flights;
using geometry::Vec7;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Sim3 off(double metres, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Vec7 motion;
  for (int k = 0; k < 7; ++k) motion[k] = normal(random) * metres / (k < 3 ? 1.7 : 40.0);
  return apply_motion(T_local_map(), motion, Vec3(0.0, 0.0, 5.0));
}

TEST(SurfaceFit, FindsTheTransformFromMetresOff) {
  const Flight flight = simulate_map(curved_path());
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const SurfaceFit fit = fit_to_surface(flight.points, the_place().index, the_place().mesh, off(1.5, seed));
    EXPECT_TRUE(fit.converged);
    EXPECT_LT(rms_distance_m(flight.points, fit.T_target_source, T_local_map()), 0.03) << seed;
    EXPECT_NEAR(fit.noise_factor, 1.0, 0.35) << seed;
    EXPECT_GT(fit.inlier_share, 0.9) << seed;
  }
}

TEST(SurfaceFit, UncertainAndWildPointsDoNotPull) {
  Flight flight = simulate_map(curved_path(), 150, 0.003);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < flight.points.size();
       i += 3) {  // a third is far off along its ray, with an accordingly large sigma
    const double sigma = 0.1;
    const Vec3 ray = flight.points.positions[i] - flight.points.viewpoints[i];
    flight.points.positions[i] += std::abs(sigma * normal(random)) * ray;
    flight.points.distance_sigma[i] = sigma;
  }
  for (std::size_t i = 1; i < flight.points.size(); i += 15) flight.points.positions[i] += Vec3(0.2, 0.1, 0.3);  // far
  const SurfaceFit fit = fit_to_surface(flight.points, the_place().index, the_place().mesh, off(0.5, 1));
  EXPECT_LT(rms_distance_m(flight.points, fit.T_target_source, T_local_map()), 0.05);
}

/// Over level ground the surface does not constrain position and heading: the prior does.
TEST(SurfaceFit, WhatTheSurfaceLeavesOpenIsHeldByWhatIsKnown) {
  geometry::TriangleMesh plain;
  plain.vertices = {{-200, -200, 0}, {200, -200, 0}, {200, 200, 0}, {-200, 200, 0}};
  plain.triangles = {{0, 1, 2}, {0, 2, 3}};
  const geometry::TriangleIndex index(plain);
  ObservedPoints points;
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> unit(-30.0, 30.0);
  for (int k = 0; k < 3000; ++k)
    points.positions.push_back(T_local_map().inverse() * Vec3(unit(random), unit(random), 0.0));
  Vec7 motion = Vec7::Zero();
  motion << 0.8, -0.6, 0.5, 0.01, -0.01, 0.02, 0.01;
  SurfaceFitOptions options;
  options.prior = SimilarityEstimate{T_local_map(), Vec3::Zero(), 100.0 * Mat7::Identity()};
  const Sim3 start = apply_motion(T_local_map(), motion, Vec3::Zero());
  const SurfaceFit held = fit_to_surface(points, index, plain, start, options);
  EXPECT_LT(rms_distance_m(points, held.T_target_source, T_local_map()), 0.02);
  EXPECT_FALSE(held.constraint.well_constrained);
  const SurfaceFit open = fit_to_surface(points, index, plain, start);
  EXPECT_GT(rms_distance_m(points, open.T_target_source, T_local_map()), 0.5);
  // The estimate reflects this: the shape has no information on horizontal position, heading and scale, only on height
  // and tilt.
  EXPECT_LT(open.shape_estimate.information(0, 0), 1e-3 * open.shape_estimate.information(2, 2));
  EXPECT_LT(open.shape_estimate.information(5, 5), 1e-3 * open.shape_estimate.information(3, 3));
}

TEST(SurfaceFit, SameBitsForAnyNumberOfCalls) {
  const Flight flight = simulate_map(curved_path(), 40);
  const SurfaceFit a = fit_to_surface(flight.points, the_place().index, the_place().mesh, off(1.0, 3));
  const SurfaceFit b = fit_to_surface(flight.points, the_place().index, the_place().mesh, off(1.0, 3));
  EXPECT_EQ(a.T_target_source.matrix(), b.T_target_source.matrix());
}

TEST(SurfaceFit, NothingToAlignIsSaid) {
  EXPECT_THAT([&] { fit_to_surface({}, the_place().index, the_place().mesh, Sim3()); },
              ThrowsMessage<InputError>(HasSubstr("map: has no points")));
  ObservedPoints broken;
  broken.positions = {Vec3(0, 0, std::nan(""))};
  EXPECT_THAT([&] { fit_to_surface(broken, the_place().index, the_place().mesh, Sim3()); },
              ThrowsMessage<InputError>(HasSubstr("map: point 0 is not finite")));
  SurfaceFitOptions elsewhere;
  elsewhere.regions = {geometry::Box3(Vec3(1e6, 1e6, 0), Vec3(1e6 + 1, 1e6 + 1, 1))};
  const SurfaceFit fit = fit_to_surface(simulate_map(curved_path(), 10).points, the_place().index, the_place().mesh,
                                        T_local_map(), elsewhere);
  EXPECT_EQ(fit.points, 0U);
  EXPECT_FALSE(fit.converged);
}

}  // namespace
}  // namespace tileflight::registration::surface_fit_test

namespace tileflight::registration::surface_information_test {
namespace {

using geometry::Vec3;
using geometry::Vec7;

constexpr double kLength_m = 20.0;  // cubes of 4 m

SurfaceMatches random_matches(std::size_t count) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> across(-kLength_m, kLength_m);
  SurfaceMatches matches;
  for (std::size_t i = 0; i < count; ++i) {
    matches.residuals.push_back({{across(random), across(random), across(random)},
                                 Vec3(normal(random), normal(random), normal(random)).normalized(),
                                 0.2 * normal(random),
                                 0.2});
  }
  return matches;
}

Vec7 gradient(const SurfaceResidual& r) {
  return kernel_weight(r.residual_m * r.residual_m / (r.sigma_m * r.sigma_m)) / (r.sigma_m * r.sigma_m) * r.residual_m *
         alignment::plane_jacobian(r.y, r.normal, kLength_m);
}

double relative_difference(const Mat7& a, const Mat7& b) { return (a - b).norm() / b.norm(); }

TEST(SurfaceInformation, WeightIsTheDerivativeOfTheCost) {
  for (double z = 0.1; z < 20.0; z += 0.1) {
    const double step = 1e-5;
    const double slope = (kernel_cost((z + step) * (z + step)) - kernel_cost((z - step) * (z - step))) / (2.0 * step);
    EXPECT_NEAR(kernel_weight(z * z), slope / (2.0 * z), 1e-8) << z;
  }
  EXPECT_DOUBLE_EQ(kernel_weight(kSurfaceKernel * kSurfaceKernel), 0.25);
}

// One point a cube: the scatter is the sum of the gradients' outer products, with the correction n / (n - 1).
TEST(SurfaceInformation, PointsFarApartCountEachForItself) {
  SurfaceMatches matches = random_matches(40);
  for (std::size_t i = 0; i < matches.residuals.size(); ++i)
    matches.residuals[i].y = Vec3(4.0 * static_cast<double>(i) + 2.0, 0.5, -0.5);
  Mat7 expected = Mat7::Zero();
  for (const SurfaceResidual& r : matches.residuals) expected += gradient(r) * gradient(r).transpose();
  expected *= 40.0 / 39.0;
  EXPECT_LT(relative_difference(shape_information(matches, kLength_m).gradient_scatter, expected), 1e-12);
}

// The same points once more at the same places and with the same errors add no information.
TEST(SurfaceInformation, RepeatedPointsAddNothing) {
  SurfaceMatches once = random_matches(400), twice = once;
  twice.residuals.insert(twice.residuals.end(), once.residuals.begin(), once.residuals.end());
  const Mat7 a = sandwich_information(shape_information(once, kLength_m), kLength_m);
  const ShapeInformation repeated = shape_information(twice, kLength_m);
  // The points' own noise is half as large a part of it.
  ShapeInformation halved = repeated;
  halved.hessian /= 2.0;
  halved.gradient_scatter /= 4.0;
  EXPECT_LT(relative_difference(sandwich_information(halved, kLength_m), a), 1e-9);
  SurfaceMatches four_times = twice;
  four_times.residuals.insert(four_times.residuals.end(), twice.residuals.begin(), twice.residuals.end());
  const double discount = information_discount(repeated);
  EXPECT_GT(discount, 1.0);
  EXPECT_NEAR(information_discount(shape_information(four_times, kLength_m)), 2.0 * discount, 1e-9);
}

// Keyframes and cubes cross each other: each point alone in its cube, so that cubes and pairs of cube and keyframe
// are the same clusters, and the scatter is that over keyframes.
TEST(SurfaceInformation, PointsOfAKeyframeAreOneCluster) {
  SurfaceMatches matches = random_matches(60);
  std::array<Vec7, 5> sums;
  sums.fill(Vec7::Zero());
  for (std::size_t i = 0; i < matches.residuals.size(); ++i) {
    matches.residuals[i].y = Vec3(4.0 * static_cast<double>(i) + 2.0, 0.5, -0.5);
    matches.keyframes.push_back(i % sums.size());
    sums[i % sums.size()] += gradient(matches.residuals[i]);
  }
  Mat7 expected = Mat7::Zero();
  for (const Vec7& sum : sums) expected += sum * sum.transpose();
  expected *= 5.0 / 4.0;
  EXPECT_LT(relative_difference(shape_information(matches, kLength_m).gradient_scatter, expected), 1e-9);
}

TEST(SurfaceInformation, IsTheInverseOfTheSandwichWithThePointsOwnNoise) {
  const ShapeInformation shape = shape_information(random_matches(500), kLength_m);
  const Mat7 own = shape.hessian.inverse();
  Vec7 units;
  units << 1, 1, 1, 1 / kLength_m, 1 / kLength_m, 1 / kLength_m, 1 / kLength_m;
  const Mat7 covariance = units.asDiagonal() * (own * shape.gradient_scatter * own + own) * units.asDiagonal();
  EXPECT_LT(relative_difference(sandwich_information(shape, kLength_m), covariance.inverse()), 1e-6);
}

TEST(SurfaceInformation, APlaneSaysNothingOfMotionsAlongIt) {
  SurfaceMatches matches = random_matches(300);
  for (SurfaceResidual& r : matches.residuals) {
    r.y.z() = 0.0;
    r.normal = Vec3::UnitZ();
  }
  const Mat7 information = sandwich_information(shape_information(matches, kLength_m), kLength_m);
  for (const int open : {0, 1, 5, 6}) EXPECT_NEAR(information(open, open), 0.0, 1e-6) << open;
  for (const int held : {2, 3, 4}) EXPECT_GT(information(held, held), 100.0) << held;
}

}  // namespace
}  // namespace tileflight::registration::surface_information_test
