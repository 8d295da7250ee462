#pragma once

// Projection of eight directions at once into a rolling-shutter image (rolling_shutter.h).

#include "tileflight/slam/keyframes/lens8.h"

namespace tileflight::keyframes {

/// Motion during the readout, at one pyramid level.
struct RowMotion {
  float share_per_row = 0.0F;  ///< s = share_per_row v + share_at_zero with row v of this level
  float share_at_zero = 0.0F;
  std::array<float, 3> v{};     ///< translation part of the twist over the readout
  std::array<float, 3> w{};     ///< rotation part, radians
  float d_twist_d_pose = 0.0F;  ///< d(twist)/d(pose): share by which a pose increment changes the twist
};

TILEFLIGHT_LANE_INLINE void cross(const std::array<float, 3>& a, const std::array<base::Float8, 3>& b,
                                  std::array<base::Float8, 3>& out) {
  out = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Derivative of X (a point times its inverse distance rho) by the share s: w x X + rho v.
TILEFLIGHT_LANE_INLINE void point_motion(const RowMotion& rows, const std::array<base::Float8, 3>& X,
                                         const base::Float8& rho, std::array<base::Float8, 3>& out) {
  cross(rows.w, X, out);
  for (int d = 0; d < 3; ++d) out[d] += rho * rows.v[d];
}

/// Projects points X given in the middle row's camera. Returns the pixels with derivatives at the row they fall on, X
/// in that row's camera, and the row's share s. exp(s xi) X is expanded to second order in the angle.
TILEFLIGHT_LANE_INLINE void project_rolling_shutter(const Lens8& lens, const RowMotion& rows,
                                                    const std::array<base::Float8, 3>& X, const base::Float8& rho,
                                                    std::array<base::Float8, 3>& X_row, Pixels8& pixel,
                                                    base::Float8& share) {
  constexpr int kIterations = 2;  // each multiplies the error by the image motion over a readout, in image heights
  std::array<base::Float8, 3> change, bend;
  point_motion(rows, X, rho, change);
  cross(rows.w, change, bend);
  lens.project(X, pixel);
  const base::Float8 zero{}, most = zero + 0.5F;
  for (int i = 0; i < kIterations; ++i) {
    share = pixel.v * rows.share_per_row + rows.share_at_zero;
    share = pixel.valid ? share : zero;
    share = share > most ? most : (share < -most ? -most : share);
    for (int d = 0; d < 3; ++d) X_row[d] = X[d] + share * (change[d] + 0.5F * share * bend[d]);
    lens.project(X_row, pixel);
  }
}

/// Derivative of the grey value by X in the middle row's camera; a point that moves up or down also changes its row.
TILEFLIGHT_LANE_INLINE void intensity_jacobian(const RowMotion& rows, const std::array<base::Float8, 3>& X_row,
                                               const base::Float8& rho, const Pixels8& pixel, const base::Float8& share,
                                               const base::Float8& gx, const base::Float8& gy,
                                               std::array<base::Float8, 3>& by_X) {
  std::array<base::Float8, 3> change, turned;
  point_motion(rows, X_row, rho, change);
  base::Float8 u_by_share{}, v_by_share{};
  for (int d = 0; d < 3; ++d) {
    u_by_share += pixel.d_u_d_X[d] * change[d];
    v_by_share += pixel.d_v_d_X[d] * change[d];
  }
  const base::Float8 by_row =
      rows.share_per_row * (gx * u_by_share + gy * v_by_share) / (1.0F - rows.share_per_row * v_by_share);
  for (int d = 0; d < 3; ++d) by_X[d] = pixel.d_u_d_X[d] * gx + (gy + by_row) * pixel.d_v_d_X[d];
  cross(rows.w, by_X, turned);  // back to the middle row: R^T b = b - s w x b
  const base::Float8 with_velocity = 1.0F + rows.d_twist_d_pose * share;
  for (int d = 0; d < 3; ++d) by_X[d] = with_velocity * (by_X[d] - share * turned[d]);
}

}  // namespace tileflight::keyframes
