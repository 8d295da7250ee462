#include "tileflight/slam/mapping/line_delay.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "tileflight/slam/mapping/test_random_window.h"

namespace tileflight::mapping::line_delay_test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using geometry::SE3;
using geometry::Vec6;

constexpr int kWidth = 320, kHeight = 240;

/// A window whose points have rays and whose keyframes have images, as far as the row of a point needs them.
keyframes::Window window_with_rays(const keyframes::Lens& lens, std::mt19937& random, bool with_lens) {
  keyframes::Window window = test_support::random_window(4, 25, 5, with_lens);
  std::uniform_real_distribution<float> column(20, kWidth - 20), row(20, kHeight - 20);
  const auto pyramid =
      std::make_shared<const keyframes::Pyramid>(keyframes::build_pyramid(imaging::FloatImage(kWidth, kHeight), 1));
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    keyframe.pyramid = pyramid;
    keyframe.T_camera_map_linear = test_support::random_pose(random, 0.2);
    for (keyframes::ActivePoint& point : keyframe.points) {
      point.patch.pixel = {column(random), row(random)};
      point.patch.ray = lens.unproject(point.patch.pixel.cast<double>())->cast<float>();
    }
  }
  return window;
}

/// Returns how the delay moves a point of `host` in `target`, as a change of their relative pose: by a difference
/// quotient.
Vec6 relative_motion(const keyframes::Window& window, const keyframes::Lens& lens, const PointRef& ref, int target,
                     const std::vector<Vec6>& velocities) {
  const keyframes::Keyframe &host = window.keyframes[ref.host], &other = window.keyframes[target];
  const SE3 T_target_host = other.T_camera_map() * host.T_camera_map().inverse();
  const keyframes::ActivePoint& point = host.points[ref.index];
  geometry::Vec2 pixel;
  const geometry::Vec3 X = T_target_host.rotation * point.patch.ray.cast<double>() +
                           static_cast<double>(point.rho) * T_target_host.translation;
  EXPECT_TRUE(lens.project<double>(X, pixel));
  constexpr double kStep_s = 1e-7;
  const double middle = 0.5 * (kHeight - 1);
  const SE3 host_row = SE3::exp(kStep_s * (static_cast<double>(point.patch.pixel.y()) - middle) * velocities[ref.host]);
  const SE3 target_row = SE3::exp(kStep_s * (pixel.y() - middle) * velocities[target]);
  return (target_row * T_target_host * host_row.inverse() * T_target_host.inverse()).log() / kStep_s;
}

/// The normal equations with every unknown, the delay the last one, and then all but the last five eliminated.
LineDelaySystem dense_system(const keyframes::Window& window, const keyframes::Lens& lens,
                             const std::vector<Vec6>& velocities) {
  const auto pairs = make_host_target_pairs(window);
  const std::vector<PointRef> points = all_points(window);
  const int n = window.unknowns(), poses = 8 * window.size(), all = n + static_cast<int>(points.size());
  NormalEquations dense{MatrixXd::Zero(all + 1, all + 1), VectorXd::Zero(all + 1)};
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (const keyframes::Observation& o : window.keyframes[points[i].host].points[points[i].index].observations) {
      MatrixXd J = MatrixXd::Zero(4, all + 1);
      Eigen::Matrix<double, 4, 8> relative = Eigen::Matrix<double, 4, 8>::Zero();
      relative.topLeftCorner<2, 6>() = o.linearization.d_pixel_d_pose.cast<double>();
      relative.bottomRightCorner<2, 2>().setIdentity();
      J.middleCols<8>(8 * o.target) = relative;
      J.middleCols<8>(8 * points[i].host) =
          relative * pairs[points[i].host * window.size() + o.target].d_relative_d_host;
      if (window.intrinsics.estimated) J.block<2, 4>(0, poses) = o.linearization.d_pixel_d_intrinsics.cast<double>();
      J.block<2, 1>(0, n + static_cast<int>(i)) = o.linearization.d_pixel_d_rho.cast<double>();
      J.col(all) = relative.leftCols<6>() * relative_motion(window, lens, points[i], o.target, velocities);
      test_support::add_dense(o.linearization.sums, J, dense);
    }
  }
  const int kept = n - poses + 1;
  std::vector<int> order;
  for (int k = 0; k < all + 1; ++k) {
    if (k < poses || (k >= n && k < all)) order.push_back(k);
  }
  const int eliminated = static_cast<int>(order.size());
  for (int k = poses; k < n; ++k) order.push_back(k);
  order.push_back(all);
  const MatrixXd H = dense.H(order, order);
  const VectorXd b = dense.b(order);
  const MatrixXd across = H.topRightCorner(eliminated, kept);
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> inverse(H.topLeftCorner(eliminated, eliminated));
  LineDelaySystem out;
  out.H.bottomRightCorner(kept, kept) = H.bottomRightCorner(kept, kept) - across.transpose() * inverse.solve(across);
  out.b.tail(kept) = b.tail(kept) - across.transpose() * inverse.solve(b.head(eliminated));
  return out;
}

TEST(LineDelaySystem, IsTheDenseOneWithAllElseEliminated) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 1.0);
  const keyframes::Lens lens(imaging::make_fisheye(kWidth, kHeight, 190.0));
  for (const bool with_lens : {false, true}) {
    const keyframes::Window window = window_with_rays(lens, random, with_lens);
    std::vector<Vec6> velocities(4);
    for (Vec6& velocity : velocities) {
      for (int i = 0; i < 6; ++i) velocity[i] = normal(random);
    }
    const LineDelaySystem dense = dense_system(window, lens, velocities);
    const LineDelaySystem found = line_delay_system(window, lens, velocities);
    const LineDelaySystem::Vec5 size = (dense.H.diagonal().array() + 1e-12).sqrt().inverse();
    EXPECT_LT((size.asDiagonal() * (found.H - dense.H) * size.asDiagonal()).norm(), 2e-3) << found.H << "\n\n"
                                                                                          << dense.H;
    EXPECT_LT(size.cwiseProduct(found.b - dense.b).norm(), 2e-3 * size.cwiseProduct(dense.b).norm());
    EXPECT_GT(dense.H(4, 4), 0.0);
  }
}

/// Windows that see the delay through normal noise, coupled with the focal length.
std::vector<LineDelaySystem> noisy_windows(double line_delay_s, int count, std::mt19937& random) {
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<LineDelaySystem> windows(static_cast<std::size_t>(count));
  for (LineDelaySystem& window : windows) {
    for (int k = 0; k < 20; ++k) {
      LineDelaySystem::Vec5 J = LineDelaySystem::Vec5::Zero();
      J << 10.0 * normal(random), 0.0, 0.0, 0.0, 1e5 * normal(random);
      J[4] += 5e3 * J[0];
      const double r = normal(random) - J[4] * line_delay_s;
      window.H += J * J.transpose();
      window.b += J * r;
    }
  }
  return windows;
}

TEST(LineDelayEstimate, IsAsSureAsItIsRight) {
  constexpr double kDelay_s = 3e-5;
  constexpr int kExperiments = 400;
  std::mt19937 random(1);
  double squares = 0.0, error_s = 0.0;
  for (int i = 0; i < kExperiments; ++i) {
    const auto found = estimate_line_delay(noisy_windows(kDelay_s, 40, random), Eigen::Matrix4d::Zero());
    ASSERT_TRUE(found);
    EXPECT_EQ(found->windows, 40);
    const double error = (found->line_delay_s - kDelay_s) / found->sigma_s;
    squares += error * error / kExperiments;
    error_s += (found->line_delay_s - kDelay_s) / kExperiments;
  }
  EXPECT_NEAR(squares, 1.15, 0.35);  // Student's t with 15 degrees of freedom: 15 / 13
  EXPECT_LT(std::abs(error_s), 2e-7);
}

TEST(LineDelayEstimate, NeedsTenWindows) {
  std::mt19937 random(2);
  EXPECT_FALSE(estimate_line_delay(noisy_windows(3e-5, 9, random), Eigen::Matrix4d::Zero()));
  EXPECT_TRUE(estimate_line_delay(noisy_windows(3e-5, 10, random), Eigen::Matrix4d::Zero()));
}

}  // namespace
}  // namespace tileflight::mapping::line_delay_test
