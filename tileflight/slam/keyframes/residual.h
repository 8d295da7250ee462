#pragma once

// One photometric residual, a host patch against a target (DSO, eq. 4 and 11), and its linearisation (eq. 12 and 13).
//
//   r_k = I_target(p'_k) - (gain I_host(p_k) + offset),  gain = e^(a_t - a_h), offset = b_t - gain b_h
//
// The eight residuals share the derivative of the pixel by pose and inverse distance (at the centre pixel and the
// linearisation point; DSO's two approximations below eq. 13), so only sums of grey-value gradients are kept: with G =
// d(pixel)/d(pose 6, rho 1) and A_k
// = -(gain (I_host - b_h), 1) = d(r_k)/d(a_rel, b_rel),  H = sum w (g_k G, A_k)^T (g_k G, A_k).

// It can be evaluated at once, or in two steps: where the patch falls (warp_residual()), then what is there.

#include "tileflight/slam/keyframes/patch.h"

namespace tileflight::keyframes {

enum class ResidualState { kGood, kOutlier, kOutside };

/// Sums over the pattern with weight w = gradient weight times Huber weight; g: gradient (2), A: derivative by the
/// brightness parameters a, b (2), r: residual.
struct PatternSums {
  Eigen::Matrix2f gg = Eigen::Matrix2f::Zero();
  Eigen::Matrix2f gA = Eigen::Matrix2f::Zero();
  Eigen::Matrix2f AA = Eigen::Matrix2f::Zero();
  Eigen::Vector2f gr = Eigen::Vector2f::Zero();
  Eigen::Vector2f Ar = Eigen::Vector2f::Zero();

  PatternSums& operator*=(float weight) {
    gg *= weight, gA *= weight, AA *= weight, gr *= weight, Ar *= weight;
    return *this;
  }
};

struct Linearization {
  Eigen::Matrix<float, 2, 6> d_pixel_d_pose =
      Eigen::Matrix<float, 2, 6>::Zero();  ///< left increment of T_target_host (translation, rotation)
  Eigen::Vector2f d_pixel_d_rho = Eigen::Vector2f::Zero();
  Eigen::Matrix<float, 2, 4> d_pixel_d_intrinsics = Eigen::Matrix<float, 2, 4>::Zero();  ///< only set if the intrinsics
                                                                                         ///< are estimated
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

/// Derivative of the target pixel by the IntrinsicsDelta. It has two parts, because the intrinsics change both the
/// target's projection and the ray of the host's pixel: d(target)/d(lens) - d(target)/d(host's pixel) d(host)/d(lens).
template <class T>
Eigen::Matrix<T, 2, 4> intrinsics_jacobian(const Lens& lens, const Eigen::Matrix<T, 2, 1>& target,
                                           const Eigen::Matrix<T, 2, 1>& host,
                                           const Eigen::Matrix<T, 2, 2>& target_by_host) {
  return lens.d_pixel_d_delta<T>(target) - target_by_host * lens.d_pixel_d_delta<T>(host);
}

/// Host-target transforms of a residual: values at the current state, derivatives at the linearisation point.
struct HostTargetPrecalc {
  PairTransform current;
  Eigen::Matrix3f R_linear;
  Eigen::Vector3f t_linear;
  float gain_linear = 1.0F;
  float host_b_linear = 0.0F;  ///< b_h, for d(r)/d(a_rel)
};

struct ResidualValue {
  ResidualState state = ResidualState::kOutside;
  float energy = 0.0F;  ///< sum of weighted Huber energies
};

/// Energy at the current state; `linearization` (may be null) receives the derivatives. kOutside if the pattern leaves
/// the image; otherwise kGood: the caller applies the outlier threshold. `lens_linear`: the lens at its linearisation
/// point if the intrinsics are estimated, else null.
ResidualValue evaluate_residual(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                                const HostTargetPrecalc& frame, float huber, Linearization* linearization,
                                const Lens* lens_linear = nullptr);

/// The pattern's weighted energy with its gradient b and Gauss-Newton Hessian H by rho only, at the current state (used
/// by activation).
struct RhoLinearization {
  ResidualState state = ResidualState::kOutside;
  float energy = 0.0F;
  float H = 0.0F;
  float b = 0.0F;
};
RhoLinearization evaluate_rho(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                              const PairTransform& pair, float huber);

/// Place of a patch in a target. Most of a residual's time is spent on waiting for the target's grey values;
/// warp_residual() asks for them, so that they are there when a residual that was warped some time ago is evaluated.
struct ResidualWarp {
  bool inside = false;
  WarpedPatch warped;
};

void warp_residual(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                   const HostTargetPrecalc& frame, ResidualWarp& out);
/// Evaluates a residual that was warped before; it gives the same bits as evaluate_residual() in one step.
ResidualValue evaluate_residual(const ResidualWarp& warp, const Lens& lens, const PyramidLevel& target,
                                const Patch& patch, float rho, const HostTargetPrecalc& frame, float huber,
                                Linearization* linearization, const Lens* lens_linear = nullptr);

}  // namespace tileflight::keyframes
