#pragma once

// One photometric residual: a patch of its host against a target (eq. 4 and 13 of the paper), and its linearisation.
//
//   r_k = I_target(p'_k) - (gain I_host(p_k) + offset),  gain = e^(a_t - a_h), offset = b_t - gain b_h
//
// The eight residuals share the derivative of the pixel by pose and inverse distance (at the centre, at the
// linearisation point), so that only sums of grey-value gradients are kept: with G = d(pixel)/d(pose 6, rho 1) and A_k
// = -(gain (I_host - b_h), 1) = d(r_k)/d(a_rel, b_rel),  H = sum w (g_k G, A_k)^T (g_k G, A_k).

#include "tileflight/odometry/patch.h"

namespace tileflight::odometry {

enum class ResidualState { kGood, kOutlier, kOutside };

/// Sums over the pattern, w = gradient weight times Huber weight; g: gradient (2), A: derivative by the light (2), r:
/// residual.
struct PatternSums {
  Eigen::Matrix2f gg = Eigen::Matrix2f::Zero();
  Eigen::Matrix2f gA = Eigen::Matrix2f::Zero();
  Eigen::Matrix2f AA = Eigen::Matrix2f::Zero();
  Eigen::Vector2f gr = Eigen::Vector2f::Zero();
  Eigen::Vector2f Ar = Eigen::Vector2f::Zero();
};

struct Linearization {
  Eigen::Matrix<float, 2, 6> pixel_by_pose =
      Eigen::Matrix<float, 2, 6>::Zero();  ///< left increment of T_target_host (translation, rotation)
  Eigen::Vector2f pixel_by_rho = Eigen::Vector2f::Zero();
  Eigen::Matrix<float, 2, 4> pixel_by_lens = Eigen::Matrix<float, 2, 4>::Zero();  ///< only where it is estimated
  PatternSums sums;
};

/// Derivative of the pixel by a left increment of T_target_host and by rho, for X = R r + rho t.
template <class T>
void pixel_derivatives(const Eigen::Matrix<T, 2, 3>& pixel_by_X, const Eigen::Matrix<T, 3, 1>& X,
                       const Eigen::Matrix<T, 3, 1>& t, T rho, Eigen::Matrix<T, 2, 6>& pixel_by_pose,
                       Eigen::Matrix<T, 2, 1>& pixel_by_rho) {
  // exp(v, w) moves the point by v + w x P; times rho: dX = rho v + w x X.
  pixel_by_pose.template leftCols<3>() = pixel_by_X * rho;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Matrix<T, 3, 1> row = pixel_by_X.row(i).transpose();
    pixel_by_pose.template block<1, 3>(i, 3) = X.cross(row).transpose();
  }
  pixel_by_rho = pixel_by_X * t;
}

/// Derivative of the pixel by the LensDelta, which changes where the target shows a direction, and which direction the
/// host's pixel shows: d(target)/d(lens) - d(target)/d(host's pixel) d(host)/d(lens).
template <class T>
Eigen::Matrix<T, 2, 4> pixel_by_lens(const Lens& lens, const Eigen::Matrix<T, 2, 1>& target,
                                     const Eigen::Matrix<T, 2, 1>& host, const Eigen::Matrix<T, 2, 2>& target_by_host) {
  return lens.pixel_by_delta<T>(target) - target_by_host * lens.pixel_by_delta<T>(host);
}

/// What a residual needs to know of the pair: values at the current state, derivatives at the linearisation point.
struct ResidualFrame {
  PairTransform current;
  Eigen::Matrix3f R_linear;
  Eigen::Vector3f t_linear;
  float gain_linear = 1.0F;
  float host_b_linear = 0.0F;  ///< b_h, for d(r)/d(a)
};

struct ResidualValue {
  ResidualState state = ResidualState::kOutside;
  float energy = 0.0F;  ///< sum of weighted Huber energies
};

/// Energy at the current state; `linearization` (may be null) gets the derivatives. kOutside where the pattern leaves
/// the picture; otherwise kGood: the caller judges the energy. `lens_linear`: the lens at its linearisation point where
/// it is estimated too, else null.
ResidualValue evaluate_residual(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                                const ResidualFrame& frame, float huber, Linearization* linearization,
                                const Lens* lens_linear = nullptr);

/// The pattern's weighted energy and its first two derivatives by rho only, at the current state (activation).
struct RhoLinearization {
  ResidualState state = ResidualState::kOutside;
  float energy = 0.0F;
  float H = 0.0F;
  float b = 0.0F;
};
RhoLinearization evaluate_rho(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                              const PairTransform& pair, float huber);

}  // namespace tileflight::odometry
