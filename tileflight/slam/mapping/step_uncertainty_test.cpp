#include "tileflight/slam/mapping/step_uncertainty.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "tileflight/slam/mapping/test_random_window.h"

namespace tileflight::mapping::step_uncertainty_test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kVariance = 4.0;

/// Brute-force oracle: all points are kept as unknowns, and the fixed directions are removed by a basis of the other
/// ones.
struct BruteForce {
  keyframes::Window window;
  std::vector<PointRef> points;
  MatrixXd information;  ///< keyframes first, then points
  int unknowns = 0;

  explicit BruteForce(const keyframes::Window& w) : window(w), points(all_points(w)), unknowns(w.unknowns()) {
    information = test_support::dense_equations(window, make_host_target_pairs(window), points).H;
    information.topLeftCorner(unknowns, unknowns) += window.H_prior;
    information /= kVariance;
  }

  const keyframes::ActivePoint& point(std::size_t p) const {
    return window.keyframes[points[p].host].points[points[p].index];
  }
  bool sees(int slot, std::size_t p) const {
    if (points[p].host == slot) return true;
    return std::ranges::any_of(point(p).observations,
                               [slot](const keyframes::Observation& o) { return o.target == slot; });
  }
  double weight(int slot, std::size_t p) const {
    const auto i = static_cast<Eigen::Index>(unknowns + p);
    return sees(slot, p) ? information(i, i) * point(p).rho * point(p).rho : 0.0;
  }
  double total_weight(int slot) const {
    double sum = 0;
    for (std::size_t p = 0; p < points.size(); ++p) sum += weight(slot, p);
    return sum;
  }
  /// Derivative of the weighted mean of log rho, with each rho optimal for the keyframes' unknowns.
  VectorXd mean_by_unknowns(int slot) const {
    VectorXd sum = VectorXd::Zero(unknowns);
    for (std::size_t p = 0; p < points.size(); ++p) {
      const auto i = static_cast<Eigen::Index>(unknowns + p);
      sum -= weight(slot, p) / (information(i, i) * point(p).rho) * information.row(i).head(unknowns).transpose();
    }
    return sum / total_weight(slot);
  }
  MatrixXd covariance(int slot, const VectorXd& held) const {
    const auto all = information.rows();
    MatrixXd constraints = MatrixXd::Zero(7, all);
    constraints.block<6, 6>(0, 8 * slot).setIdentity();
    constraints.row(6).head(unknowns) = held.transpose();
    const MatrixXd free = Eigen::FullPivLU<MatrixXd>(constraints).kernel();
    return (free * (free.transpose() * information * free).ldlt().solve(free.transpose()))
        .topLeftCorner(unknowns, unknowns);
  }
};

void expect_brute_force_value(keyframes::Window window) {
  const int slot = window.size() - 1;
  const StepUncertainty step = step_uncertainty(window, slot, kVariance);
  const BruteForce oracle(window);
  const VectorXd here = oracle.mean_by_unknowns(slot);
  const MatrixXd covariance = oracle.covariance(slot - 1, oracle.mean_by_unknowns(slot - 1));
  const auto pose = covariance.block<6, 6>(8 * slot, 8 * slot);
  EXPECT_LT((step.pose - pose).norm(), 1e-3 * pose.norm());
  double log_scale = here.dot(covariance * here);
  for (std::size_t p = 0; p < oracle.points.size(); ++p) {
    const double difference =
        oracle.weight(slot, p) / oracle.total_weight(slot) - oracle.weight(slot - 1, p) / oracle.total_weight(slot - 1);
    const auto i = static_cast<Eigen::Index>(oracle.unknowns + p);
    const double information = oracle.information(i, i) * oracle.point(p).rho * oracle.point(p).rho;
    log_scale += difference * difference / information;
  }
  // If every point is seen by both keyframes the scale cannot change, up to the weight that fixes it.
  EXPECT_NEAR(step.log_scale, log_scale, 1e-3 * log_scale + 1e-8);
}

TEST(StepUncertainty, IsTheBruteForceOne) { expect_brute_force_value(test_support::random_window(4, 25, 1)); }

TEST(StepUncertainty, IsTheBruteForceOneWithTheLens) {
  expect_brute_force_value(test_support::random_window(3, 25, 5, true));
}

TEST(StepUncertainty, IsTheBruteForceOneWherePointsAreNotSeenEverywhere) {
  keyframes::Window window = test_support::random_window(4, 25, 2);
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    for (std::size_t p = 0; p < keyframe.points.size(); p += 2) {
      std::erase_if(keyframe.points[p].observations, [](const keyframes::Observation& o) { return o.target == 3; });
    }
  }
  expect_brute_force_value(window);
}

TEST(StepUncertainty, OfNothingSharedSaysThatTheScaleIsUnknown) {
  keyframes::Window window = test_support::random_window(3, 10, 3);
  window.keyframes[2].points.clear();
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    for (keyframes::ActivePoint& point : keyframe.points)
      std::erase_if(point.observations, [](const keyframes::Observation& o) { return o.target == 2; });
  }
  EXPECT_GT(step_uncertainty(window, 2, kVariance).log_scale, 1.0);
  EXPECT_EQ(step_uncertainty(window, 2, kVariance).points, 0);
}

TEST(StepUncertainty, LeavesTheWindowAsItWas) {
  keyframes::Window window = test_support::random_window(3, 10, 4);
  window.keyframes[1].points[3].information = 17.0F;
  step_uncertainty(window, 2, kVariance);
  EXPECT_EQ(window.keyframes[1].points[3].information, 17.0F);
  EXPECT_EQ(step_uncertainty(window, 0, kVariance).pose.norm(), 0.0);
}

}  // namespace
}  // namespace tileflight::mapping::step_uncertainty_test
