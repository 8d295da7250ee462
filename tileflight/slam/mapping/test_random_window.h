#pragma once

// For the tests of mapping: a window with random poses and random linearised residuals, and its normal equations as
// dense matrices.

#include <random>

#include "tileflight/slam/mapping/marginalization.h"

namespace tileflight::mapping::test_support {

inline geometry::SE3 random_pose(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  geometry::Vec6 twist;
  for (int i = 0; i < 6; ++i) twist[i] = size * unit(random);
  return geometry::SE3::exp(twist);
}

/// A linearisation of eight random residuals with random derivatives.
inline keyframes::Linearization random_linearization(std::mt19937& random) {
  std::normal_distribution<float> normal(0.0F, 1.0F);
  keyframes::Linearization lin;
  for (int i = 0; i < 2; ++i) {
    for (int d = 0; d < 6; ++d) lin.d_pixel_d_pose(i, d) = normal(random);
    lin.d_pixel_d_rho[i] = normal(random);
  }
  for (int k = 0; k < keyframes::kPatternSize; ++k) {
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

/// Random residuals of a point in stereo pictures: without derivatives by the pose, which they do not have.
inline std::vector<keyframes::Observation> random_stereo_observations(int cameras, std::mt19937& random) {
  std::vector<keyframes::Observation> observations(static_cast<std::size_t>(cameras));
  for (int c = 0; c < cameras; ++c) {
    observations[c].target = c;
    observations[c].linearization = random_linearization(random);
    observations[c].linearization.d_pixel_d_pose.setZero();
  }
  return observations;
}

/// Random window. `lens`: the intrinsics are unknowns too. `stereo_cameras`: each keyframe has images of so many.
inline keyframes::Window random_window(int keyframes, int points_each, std::uint32_t seed, bool lens = false,
                                       int stereo_cameras = 0) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal(0.0F, 1.0F);
  keyframes::Window window;
  if (lens) add_intrinsics_unknowns(window, {1.0, 1.0, 1.0});
  window.stereo_cameras.resize(static_cast<std::size_t>(stereo_cameras));
  for (int i = 0; i < keyframes; ++i) {
    keyframes::Keyframe keyframe;
    keyframe.id = i;
    keyframe.T_camera_map_linear = random_pose(random, 0.5);
    keyframe.brightness_linear = {0.1 * i, 1.0 - i};
    keyframe.brightness_information = {1.0, 0.5};
    keyframe.stereo.resize(window.stereo_cameras.size());
    for (keyframes::StereoPicture& picture : keyframe.stereo) {
      picture.brightness_linear = {0.05 * i, 0.5};
      picture.brightness_information = {0.7, 0.9};
    }
    for (int p = 0; p < points_each; ++p) {
      keyframes::ActivePoint point;
      point.rho = 1.0F;
      for (int t = 0; t < keyframes; ++t) {
        if (t == i) continue;
        keyframes::Observation observation;
        observation.target = t;
        observation.linearization = random_linearization(random);
        if (lens) {
          for (int d = 0; d < 8; ++d) observation.linearization.d_pixel_d_intrinsics(d % 2, d / 2) = normal(random);
        }
        point.observations.push_back(observation);
      }
      point.stereo_observations = random_stereo_observations(stereo_cameras, random);
      keyframe.points.push_back(point);
    }
    add_keyframe(window, std::move(keyframe));
  }
  return window;
}

/// Adds one residual with the derivatives J of its pixel (rows 0, 1) and brightness (2, 3); the sums are the quadratic
/// form over these four.
inline void add_dense(const keyframes::PatternSums& s, const Eigen::MatrixXd& J, NormalEquations& dense) {
  Eigen::Matrix4d W;
  W << s.gg.cast<double>(), s.gA.cast<double>(), s.gA.transpose().cast<double>(), s.AA.cast<double>();
  Eigen::Vector4d r;
  r << s.gr.cast<double>(), s.Ar.cast<double>();
  dense.H += J.transpose() * W * J;
  dense.b += J.transpose() * r;
}

/// Dense normal equations without the prior. Unknowns: 8 per keyframe, then 4 intrinsics if estimated, or 8 per
/// keyframe for its stereo pictures, then one per point in the order of `points`.
inline NormalEquations dense_equations(const keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                                       const std::vector<PointRef>& points) {
  const int n = window.size(), unknowns = window.unknowns() + static_cast<int>(points.size());
  NormalEquations dense{Eigen::MatrixXd::Zero(unknowns, unknowns), Eigen::VectorXd::Zero(unknowns)};
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (const keyframes::Observation& o : window.keyframes[points[i].host].points[points[i].index].observations) {
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(4, unknowns);
      Eigen::Matrix<double, 4, 8> relative = Eigen::Matrix<double, 4, 8>::Zero();
      relative.topLeftCorner<2, 6>() = o.linearization.d_pixel_d_pose.cast<double>();
      relative.bottomRightCorner<2, 2>().setIdentity();
      J.middleCols<8>(8 * o.target) = relative;
      J.middleCols<8>(8 * points[i].host) = relative * pairs[points[i].host * n + o.target].d_relative_d_host;
      if (window.intrinsics.estimated) J.block<2, 4>(0, 8 * n) = o.linearization.d_pixel_d_intrinsics.cast<double>();
      J.block<2, 1>(0, window.unknowns() + i) = o.linearization.d_pixel_d_rho.cast<double>();
      add_dense(o.linearization.sums, J, dense);
    }
    for (const keyframes::Observation& o :
         window.keyframes[points[i].host].points[points[i].index].stereo_observations) {
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(4, unknowns);
      J.block<2, 2>(2, window.stereo_unknown(points[i].host) + 2 * o.target).setIdentity();
      J.block<2, 1>(0, window.unknowns() + i) = o.linearization.d_pixel_d_rho.cast<double>();
      add_dense(o.linearization.sums, J, dense);
    }
  }
  return dense;
}

/// Matrix of the window's photometric residuals with the points eliminated, in double.
inline Eigen::MatrixXd dense_reduced(keyframes::Window& window) {
  const std::vector<PointRef> points = all_points(window);
  const NormalEquations dense = dense_equations(window, make_host_target_pairs(window), points);
  const int n = window.unknowns();
  const Eigen::MatrixXd across = dense.H.topRightCorner(n, points.size());
  const Eigen::VectorXd inverse = dense.H.diagonal().tail(points.size()).cwiseInverse();
  return dense.H.topLeftCorner(n, n) - across * inverse.asDiagonal() * across.transpose();
}

}  // namespace tileflight::mapping::test_support
