#pragma once

// For this stage's tests: a window with random poses and random linearised residuals, and its normal equations written
// out in full.

#include <random>

#include "tileflight/odometry/marginalization.h"

namespace tileflight::odometry::tests {

inline SE3 random_pose(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  geometry::Vec6 twist;
  for (int i = 0; i < 6; ++i) twist[i] = size * unit(random);
  return SE3::exp(twist);
}

/// A linearisation of eight random residuals with random derivatives.
inline Linearization random_linearization(std::mt19937& random) {
  std::normal_distribution<float> normal(0.0F, 1.0F);
  Linearization lin;
  for (int i = 0; i < 2; ++i) {
    for (int d = 0; d < 6; ++d) lin.pixel_by_pose(i, d) = normal(random);
    lin.pixel_by_rho[i] = normal(random);
  }
  for (int k = 0; k < kPatternSize; ++k) {
    const Eigen::Vector2f g(normal(random), normal(random)), A(normal(random), -1.0F);
    const float r = normal(random);
    lin.sums.gg += g * g.transpose();
    lin.sums.gA += g * A.transpose();
    lin.sums.AA += A * A.transpose();
    lin.sums.gr += g * r;
    lin.sums.Ar += A * r;
  }
  return lin;
}

/// `lens`: its intrinsics are unknowns too.
inline Window random_window(int keyframes, int points_each, std::uint32_t seed, bool lens = false) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0.0F, 1.0F);
  Window window;
  if (lens) estimate_lens(window, {1.0, 1.0, 1.0});
  for (int i = 0; i < keyframes; ++i) {
    Keyframe keyframe;
    keyframe.id = i;
    keyframe.T_camera_map_linear = random_pose(random, 0.5);
    keyframe.light_linear = {0.1 * i, 1.0 - i};
    keyframe.light_information = {1.0, 0.5};
    for (int p = 0; p < points_each; ++p) {
      ActivePoint point;
      point.rho = 1.0F;
      for (int t = 0; t < keyframes; ++t) {
        if (t == i) continue;
        Observation observation;
        observation.target = t;
        observation.linearization = random_linearization(random);
        if (lens) {
          for (int d = 0; d < 8; ++d) observation.linearization.pixel_by_lens(d % 2, d / 2) = normal(random);
        }
        point.observations.push_back(observation);
      }
      keyframe.points.push_back(point);
    }
    add_keyframe(window, std::move(keyframe));
  }
  return window;
}

/// Unknowns: 8 a keyframe, then the lens's, then one a point in the order of `points`. Without the prior.
inline NormalEquations dense_equations(const Window& window, const std::vector<Pair>& pairs,
                                       const std::vector<PointRef>& points) {
  const int n = window.size(), unknowns = window.unknowns() + static_cast<int>(points.size());
  NormalEquations dense{Eigen::MatrixXd::Zero(unknowns, unknowns), Eigen::VectorXd::Zero(unknowns)};
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (const Observation& o : window.keyframes[points[i].host].points[points[i].index].observations) {
      const PatternSums& s = o.linearization.sums;
      // Rows: pixel (2) and light (2) by all unknowns; the sums are the quadratic form over these four.
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(4, unknowns);
      Eigen::Matrix<double, 4, 8> relative = Eigen::Matrix<double, 4, 8>::Zero();
      relative.topLeftCorner<2, 6>() = o.linearization.pixel_by_pose.cast<double>();
      relative.bottomRightCorner<2, 2>().setIdentity();
      J.middleCols<8>(8 * o.target) = relative;
      J.middleCols<8>(8 * points[i].host) = relative * pairs[points[i].host * n + o.target].relative_by_host;
      if (window.lens.estimated) J.block<2, 4>(0, 8 * n) = o.linearization.pixel_by_lens.cast<double>();
      J.block<2, 1>(0, window.unknowns() + i) = o.linearization.pixel_by_rho.cast<double>();
      Eigen::Matrix4d W;
      W << s.gg.cast<double>(), s.gA.cast<double>(), s.gA.transpose().cast<double>(), s.AA.cast<double>();
      Eigen::Vector4d r;
      r << s.gr.cast<double>(), s.Ar.cast<double>();
      dense.H += J.transpose() * W * J;
      dense.b += J.transpose() * r;
    }
  }
  return dense;
}

}  // namespace tileflight::odometry::tests
