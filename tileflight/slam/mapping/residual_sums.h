#pragma once

// Sums that one residual adds to the normal equations, in SIMD lanes (DSO, eq. 10 and 13): by the relative unknowns of
// its host and target (pose 0 to 5, brightness 6 and 7), by the intrinsics, and by the brightness of stereo pictures.

#include <array>

#include "tileflight/core/base/simd.h"
#include "tileflight/slam/keyframes/keyframe.h"

namespace tileflight::mapping {

/// Element of a std::vector of SIMD values; the bare vector type is not always allocated with its alignment.
struct alignas(sizeof(base::Float8)) AlignedFloat8 {
  base::Float8 value{};
};

/// Jacobian of a residual by the relative unknowns, one lane each (DSO, eq. 13: geometric and photometric part). With
/// x, y: derivatives of the pixel by the pose (lanes 0 to 5), and p, q: sums of gradient times derivative by the
/// brightness (lanes 6, 7), row i of its J^T W J (eq. 10) is
///   (gg_00 x_i + gg_01 y_i) x + (gg_01 x_i + gg_11 y_i) y + x_i p + y_i q.
struct RelativeJacobian8 {
  base::Float8 x{}, y{}, p{}, q{};

  explicit TILEFLIGHT_LANE_INLINE RelativeJacobian8(const keyframes::Linearization& lin) {
    for (int i = 0; i < 6; ++i) {
      x[i] = lin.d_pixel_d_pose(0, i);
      y[i] = lin.d_pixel_d_pose(1, i);
    }
    for (int i = 0; i < 2; ++i) {
      p[6 + i] = lin.sums.gA(0, i);
      q[6 + i] = lin.sums.gA(1, i);
    }
  }
};

/// Sums J^T W J and J^T W r of one pair by the relative unknowns; only the upper triangle of H is used.
struct alignas(sizeof(base::Float8)) PairSums {
  std::array<base::Float8, 8> H{};
  base::Float8 b{};
};

inline constexpr int kLensUnknowns = 4;

/// Sums of one pair by the intrinsics (c in DSO, eq. 11), in the first four lanes of each row.
struct alignas(sizeof(base::Float8)) LensSums {
  std::array<base::Float8, 8> by_relative{};  ///< a row for each relative unknown
  std::array<base::Float8, kLensUnknowns> H{};
  base::Float8 b{};
};

/// Derivatives of a residual's pixel by the intrinsics.
struct LensJacobian8 {
  base::Float8 x{}, y{};

  explicit TILEFLIGHT_LANE_INLINE LensJacobian8(const keyframes::Linearization& lin) {
    for (int i = 0; i < kLensUnknowns; ++i) {
      x[i] = lin.d_pixel_d_intrinsics(0, i);
      y[i] = lin.d_pixel_d_intrinsics(1, i);
    }
  }
};

/// Adds a residual to the sums by the intrinsics.
TILEFLIGHT_LANE_INLINE void add_lens(const keyframes::Linearization& lin, const RelativeJacobian8& r,
                                     const LensJacobian8& lens, LensSums& sums) {
  const Eigen::Matrix2f& gg = lin.sums.gg;
  const base::Float8 gradient_x = gg(0, 0) * lens.x + gg(0, 1) * lens.y,
                     gradient_y = gg(0, 1) * lens.x + gg(1, 1) * lens.y;
  for (int i = 0; i < 6; ++i) sums.by_relative[i] += r.x[i] * gradient_x + r.y[i] * gradient_y;
  for (int i = 0; i < 2; ++i) sums.by_relative[6 + i] += lin.sums.gA(0, i) * lens.x + lin.sums.gA(1, i) * lens.y;
  for (int i = 0; i < kLensUnknowns; ++i) sums.H[i] += lens.x[i] * gradient_x + lens.y[i] * gradient_y;
  sums.b += lin.sums.gr[0] * lens.x + lin.sums.gr[1] * lens.y;
}

/// Off-diagonal entries of one residual's J^T W J between intrinsics and rho.
TILEFLIGHT_LANE_INLINE void rho_lens_coupling(const keyframes::Linearization& lin, const LensJacobian8& lens,
                                              base::Float8& coupling) {
  const Eigen::Vector2f gg_rho = lin.sums.gg * lin.d_pixel_d_rho;
  coupling = gg_rho[0] * lens.x + gg_rho[1] * lens.y;
}

/// Adds a residual to the sums by the relative unknowns of its pair.
TILEFLIGHT_LANE_INLINE void add_residual(const keyframes::Linearization& lin, const RelativeJacobian8& r,
                                         PairSums& sums) {
  const Eigen::Matrix2f& gg = lin.sums.gg;
  for (int i = 0; i < 6; ++i) {
    const float along_x = gg(0, 0) * r.x[i] + gg(0, 1) * r.y[i], along_y = gg(0, 1) * r.x[i] + gg(1, 1) * r.y[i];
    // DSO, eq. 10: J^T W J with J = (grad I d(pixel)/d(pose), d(r)/d(a, b)) of eq. 13, summed over the pattern.
    sums.H[i] += along_x * r.x + along_y * r.y + r.x[i] * r.p + r.y[i] * r.q;
  }
  // J^T W r: the negative of b in DSO, eq. 10.
  base::Float8 b = lin.sums.gr[0] * r.x + lin.sums.gr[1] * r.y;
  for (int i = 0; i < 2; ++i) {
    b[6 + i] = lin.sums.Ar[i];
    for (int j = i; j < 2; ++j) sums.H[6 + i][6 + j] += lin.sums.AA(i, j);
  }
  sums.b += b;
}

/// Off-diagonal entries of one residual's J^T W J between relative unknowns and rho.
TILEFLIGHT_LANE_INLINE void rho_coupling(const keyframes::Linearization& lin, const RelativeJacobian8& r,
                                         base::Float8& coupling) {
  const Eigen::Vector2f gg_rho = lin.sums.gg * lin.d_pixel_d_rho;
  coupling = gg_rho[0] * r.x + gg_rho[1] * r.y + lin.d_pixel_d_rho[0] * r.p + lin.d_pixel_d_rho[1] * r.q;
}

/// Adds a residual in the host's stereo picture `camera` to the sums by the brightness of these pictures (two lanes a
/// camera). Returns the off-diagonal entries between them and rho.
TILEFLIGHT_LANE_INLINE void add_stereo(const keyframes::Linearization& lin, int camera, PairSums& sums,
                                       base::Float8& rho_coupling) {
  const Eigen::Vector2f by_rho = lin.sums.gA.transpose() * lin.d_pixel_d_rho;
  for (int i = 0; i < 2; ++i) {
    for (int j = i; j < 2; ++j) sums.H[2 * camera + i][2 * camera + j] += lin.sums.AA(i, j);
    sums.b[2 * camera + i] += lin.sums.Ar[i];
    rho_coupling[2 * camera + i] += by_rho[i];
  }
}

}  // namespace tileflight::mapping
