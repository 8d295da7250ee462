#include "tileflight/slam/mapping/inertial_window.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/inertial/test_smooth_motion.h"
#include "tileflight/slam/mapping/test_random_window.h"
#include "tileflight/slam/mapping/window_optimizer.h"

namespace tileflight::mapping::inertial_window_test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using geometry::SE3;
using geometry::Vec3;
using inertial::test_support::lively_motion;

const geometry::ImuBias kBias{{0.01, -0.02, 0.01}, {0.1, -0.05, 0.08}};
const SE3 kT_imu_camera(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Vec3(0.1, 0.03, -0.05));
constexpr double kScale = 3.0;  // metres per map unit
const Eigen::Quaterniond kR_world_map(Eigen::AngleAxisd(0.7, Vec3(1, -2, 0.5).normalized()));
constexpr double kInterval_s = 0.8;

/// A window along a flight whose first keyframes have points and whose later ones only readings.
struct CoupledFlight {
  keyframes::Window window;
  std::optional<InertialWindow> inertial;
};

SE3 T_camera_map(double time_s) {
  const SE3 T_world_camera = lively_motion().pose(time_s) * kT_imu_camera;
  return SE3(kR_world_map.conjugate() * T_world_camera.rotation,
             (1.0 / kScale) * (kR_world_map.conjugate() * T_world_camera.translation))
      .inverse();
}

inertial::Mat12 some_covariance() {
  Eigen::Matrix<double, 12, 1> sigma;
  sigma << 0.01, 0.02, 0.005, 0.03, 0.02, 0.04, 0.001, 0.002, 0.001, 0.03, 0.02, 0.05;
  inertial::Mat12 correlation = 0.7 * inertial::Mat12::Identity() + 0.3 * inertial::Mat12::Ones();
  return sigma.asDiagonal() * correlation * sigma.asDiagonal();
}

/// `off`: the readings' bias is taken that far from the true one, so that the residuals are not zero.
CoupledFlight fly(double off, std::uint32_t seed = 1) {
  CoupledFlight flight{test_support::random_window(4, 20, seed), std::nullopt};
  for (int k = 0; k < 4; ++k) flight.window.keyframes[k].T_camera_map_linear = T_camera_map(kInterval_s * k);
  flight.window.H_prior.diagonal().array() += 1.0;
  const inertial::ImuState at = lively_motion().state(3 * kInterval_s, kBias);
  geometry::ImuBias bias = kBias;
  bias.gyroscope_rad_s += off * Vec3(0.01, 0.02, -0.02);
  bias.accelerometer_m_s2 += off * Vec3(0.2, -0.1, 0.3);
  flight.inertial.emplace(flight.window,
                          InertialStart{kR_world_map, std::log(kScale), at.velocity_m_s, bias, some_covariance()},
                          InertialCalibration{kT_imu_camera, {}, inertial::test_support::kGravity_m_s2}, 1e-3);
  const auto samples = lively_motion().readings(0.0, 8.0, 400.0, kBias);
  for (int k = 4; k < 7; ++k) {
    keyframes::Keyframe keyframe;
    keyframe.id = k;
    keyframe.T_camera_map_linear = T_camera_map(kInterval_s * k);
    keyframe.brightness_information = {1.0, 0.5};
    add_keyframe(flight.window, std::move(keyframe));
    flight.inertial->add_keyframe(flight.window,
                                  *inertial::preintegrate(samples, kInterval_s * (k - 1), kInterval_s * k, kBias, {}));
  }
  return flight;
}

/// Moves every unknown from its linearisation point.
void move(const VectorXd& by, CoupledFlight& flight) {
  const int n = flight.window.unknowns();
  for (int k = 0; k < flight.window.size(); ++k) flight.window.keyframes[k].delta = by.segment<8>(8 * k);
  flight.inertial->apply_step(by.tail(by.size() - n));
}

TEST(InertialWindow, StatesOfTheTrueFlightFitTheReadings) {
  const CoupledFlight flight = fly(0.0);
  EXPECT_LT(flight.inertial->newest_residual(flight.window), 1e-3);
  const inertial::ImuState newest = flight.inertial->newest_state(flight.window);
  EXPECT_LT((newest.velocity_m_s - lively_motion().velocity(6 * kInterval_s)).norm(), 1e-3);
  EXPECT_LT((newest.T_world_imu.translation - lively_motion().pose(6 * kInterval_s).translation).norm(), 1e-6);
  const SE3 again = flight.inertial->T_camera_map(newest) * flight.window.keyframes.back().T_camera_map().inverse();
  EXPECT_LT(again.log().norm(), 1e-9);
}

TEST(InertialWindow, GradientIsThatOfTheEnergy) {
  CoupledFlight flight = fly(1.0);
  const NormalEquations at = flight.inertial->equations(flight.window);
  const auto n = static_cast<int>(at.b.size());
  VectorXd numeric(n);
  for (int i = 0; i < n; ++i) {
    const auto energy = [&](double h) {
      move(h * VectorXd::Unit(n, i), flight);
      return flight.inertial->energy(flight.window);
    };
    constexpr double h = 1e-4;
    numeric[i] = (8.0 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12.0 * h);
  }
  const VectorXd scale = at.H.diagonal().cwiseSqrt().cwiseMax(1e-3);
  const VectorXd difference = (0.5 * numeric - at.b).cwiseQuotient(scale);
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-6 * at.b.cwiseQuotient(scale).cwiseAbs().maxCoeff());
}

// Where the residuals are zero, the second derivatives of the energy are twice the Gauss-Newton matrix.
TEST(InertialWindow, MatrixIsTheEnergysCurvatureAtTheTrueFlight) {
  CoupledFlight flight = fly(0.0);
  const NormalEquations at = flight.inertial->equations(flight.window);
  const auto n = static_cast<int>(at.b.size());
  const auto gradient = [&](const VectorXd& x) {
    move(x, flight);
    return flight.inertial->energy(flight.window);
  };
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  const VectorXd scale = at.H.diagonal().cwiseSqrt().cwiseMax(1.0).cwiseInverse();
  for (int draw = 0; draw < 20; ++draw) {
    VectorXd direction(n);
    for (int i = 0; i < n; ++i) direction[i] = scale[i] * normal(random);
    constexpr double h = 1e-2;
    const double curvature =
        (gradient(h * direction) - 2.0 * gradient(VectorXd::Zero(n)) + gradient(-h * direction)) / (h * h);
    EXPECT_NEAR(0.5 * curvature / direction.dot(at.H * direction), 1.0, 1e-4);
  }
}

/// Number of directions without information, in unknowns scaled to a unit diagonal.
int rank_deficiency(const MatrixXd& H) {
  const VectorXd scale = H.diagonal().cwiseSqrt().cwiseMax(1e-9).cwiseInverse();
  const VectorXd values = geometry::symmetric_eigenvalues(scale.asDiagonal() * H * scale.asDiagonal());
  return static_cast<int>((values.array() < 1e-11 * values.maxCoeff()).count());
}

TEST(InertialWindow, OnlyPositionAndHeadingAreUnobservable) {
  keyframes::Window window = test_support::random_window(4, 40, 7);
  for (int k = 0; k < 4; ++k) window.keyframes[k].T_camera_map_linear = T_camera_map(kInterval_s * k);
  const inertial::ImuState at = lively_motion().state(3 * kInterval_s, kBias);
  InertialWindow inertial(window, {kR_world_map, std::log(kScale), at.velocity_m_s, kBias, some_covariance()},
                          {kT_imu_camera, {}, inertial::test_support::kGravity_m_s2}, 1.0);
  const auto samples = lively_motion().readings(0.0, 8.0, 400.0, kBias);
  for (int k = 4; k < 6; ++k) {
    keyframes::Keyframe keyframe;
    keyframe.id = k;
    keyframe.T_camera_map_linear = T_camera_map(kInterval_s * k);
    keyframe.brightness_information = {1.0, 0.5};
    add_keyframe(window, std::move(keyframe));
    inertial.add_keyframe(window, *inertial::preintegrate(samples, kInterval_s * (k - 1), kInterval_s * k, kBias, {}));
  }
  const int n = window.unknowns();
  MatrixXd H = inertial.equations(window).H;
  // The readings alone change nothing along the directions of the map's frame and scale.
  const MatrixXd N = inertial.nullspace(window);
  const VectorXd scale = H.diagonal().cwiseSqrt().cwiseMax(1e-9);
  const MatrixXd scaled_N = (scale.asDiagonal() * N).colwise().normalized();
  EXPECT_LT((scale.cwiseInverse().asDiagonal() * H * scale.cwiseInverse().asDiagonal() * scaled_N).norm(), 1e-7);
  // With the images: the map's frame (6) is counted twice with the world's tilt (2), which leaves four. The random
  // residuals have a scale of their own, as a stereo camera's have.
  H.topLeftCorner(n, n) += test_support::dense_reduced(window);
  EXPECT_EQ(rank_deficiency(H), 6);
  std::vector<int> without_tilt;
  for (int i = 0; i < static_cast<int>(H.rows()); ++i)
    if (i != n && i != n + 1) without_tilt.push_back(i);
  EXPECT_EQ(rank_deficiency(H(without_tilt, without_tilt)), 4);
}

TEST(InertialWindow, MarginalizationLeavesTheSolutionOfTheFullProblem) {
  CoupledFlight flight = fly(1.0, 5);
  keyframes::Window& window = flight.window;
  InertialWindow& inertial = *flight.inertial;
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  VectorXd moved(inertial.unknowns(window));
  for (double& value : moved) value = 1e-3 * normal(random);
  move(moved, flight);
  const auto pairs = make_host_target_pairs(window);
  const auto points = all_points(window);
  const int n = window.unknowns(), all = inertial.unknowns(window);
  NormalEquations full = inertial.equations(window);
  const NormalEquations images = build_normal_equations(window, pairs, points, 0.0);
  full.H.topLeftCorner(n, n) += images.H;
  full.b.head(n) += images.b;
  const VectorXd x_full = -geometry::solve_symmetric(full.H, full.b);

  const MatrixXd H_before = window.H_prior;
  const VectorXd b_before = window.b_prior;
  marginalize_points(window, pairs, points, 1.0);
  inertial.add_to_prior(window.H_prior - H_before, window.b_prior - b_before);
  for (keyframes::Keyframe& keyframe : window.keyframes) keyframe.points.clear();
  for (const int slot : {4, 3, 0}) {  // one between readings, the first of the unit's, one before it
    inertial.remove_keyframe(window, slot);
    remove_keyframe(window, slot);
  }
  const NormalEquations left = inertial.equations(window);
  const VectorXd x = -geometry::solve_symmetric(left.H, left.b);
  std::vector<int> kept;  // keyframes 1, 2, 5, 6, the world, the unit's states at 5 and 6
  for (const int slot : {1, 2, 5, 6})
    for (int i = 0; i < 8; ++i) kept.push_back(8 * slot + i);
  for (int i = n; i < n + InertialWindow::kWorldSize; ++i) kept.push_back(i);
  for (int i = all - 2 * InertialWindow::kKeyframeSize; i < all; ++i) kept.push_back(i);
  ASSERT_EQ(x.size(), static_cast<Eigen::Index>(kept.size()));
  const VectorXd scale = full.H.diagonal().cwiseSqrt();
  const VectorXd expected = VectorXd(scale.cwiseProduct(x_full))(kept);
  EXPECT_LT((VectorXd(scale(kept)).cwiseProduct(x) - expected).norm(), 1e-4 * expected.norm());
}

TEST(InertialWindow, LinearizingTheNewestKeyframeAnewChangesNoEquation) {
  CoupledFlight flight = fly(1.0);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  VectorXd moved(flight.inertial->unknowns(flight.window));
  for (double& value : moved) value = 1e-3 * normal(random);
  move(moved, flight);
  // Makes the prior depend on the newest keyframe's neighbour.
  const VectorXd b_before = flight.inertial->equations(flight.window).b;
  const double before = flight.inertial->newest_residual(flight.window);
  const VectorXd delta = stacked_delta(flight.window);
  relinearize(flight.window, flight.window.size() - 1);
  flight.inertial->relinearize_newest(delta - stacked_delta(flight.window));
  EXPECT_NEAR(flight.inertial->newest_residual(flight.window), before, 1e-6 * before);
  EXPECT_LT((flight.inertial->equations(flight.window).b - b_before).norm(), 1e-2 * b_before.norm());
}

}  // namespace
}  // namespace tileflight::mapping::inertial_window_test
