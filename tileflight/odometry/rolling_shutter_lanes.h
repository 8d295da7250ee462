#pragma once

// Projection of eight directions at once into a picture with a rolling shutter (rolling_shutter.h).

#include "tileflight/odometry/lens_lanes.h"

namespace tileflight::odometry {

/// A readout at one pyramid level.
struct RowMotion {
  float share_per_row = 0.0F;  ///< s = share_per_row v + share_at_zero, v of this level
  float share_at_zero = 0.0F;
  std::array<float, 3> v{};    ///< of the twist over the readout: translation
  std::array<float, 3> w{};    ///< and rotation, radians
  float twist_by_pose = 0.0F;  ///< d(twist)/d(pose): the pose moves the velocity with it
};

TILEFLIGHT_LANE_INLINE void cross(const std::array<float, 3>& a, const std::array<Lanes, 3>& b,
                                  std::array<Lanes, 3>& out) {
  out = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Change of X (a point times its inverse distance rho) with the share: w x X + rho v.
TILEFLIGHT_LANE_INLINE void motion_of(const RowMotion& rows, const std::array<Lanes, 3>& X, const Lanes& rho,
                                      std::array<Lanes, 3>& out) {
  cross(rows.w, X, out);
  for (int d = 0; d < 3; ++d) out[d] += rho * rows.v[d];
}

/// Pixels of the points X of the middle row's camera, with the derivatives at the row on which they land, and that
/// row's share. exp(s xi) X to second order in the angle.
TILEFLIGHT_LANE_INLINE void project_by_row(const LensLanes& lens, const RowMotion& rows, const std::array<Lanes, 3>& X,
                                           const Lanes& rho, std::array<Lanes, 3>& X_row, LanePixels& pixel,
                                           Lanes& share) {
  constexpr int kIterations = 2;  // each leaves the error times the picture's motion over a readout in picture heights
  std::array<Lanes, 3> change, bend;
  motion_of(rows, X, rho, change);
  cross(rows.w, change, bend);
  lens.project(X, pixel);
  const Lanes zero{}, most = zero + 0.5F;
  for (int i = 0; i < kIterations; ++i) {
    share = pixel.v * rows.share_per_row + rows.share_at_zero;
    share = pixel.valid ? share : zero;
    share = share > most ? most : (share < -most ? -most : share);
    for (int d = 0; d < 3; ++d) X_row[d] = X[d] + share * (change[d] + 0.5F * share * bend[d]);
    lens.project(X_row, pixel);
  }
}

/// Derivative of the grey value by X of the middle row's camera: a point that moves up or down also changes its row.
TILEFLIGHT_LANE_INLINE void grey_by_middle(const RowMotion& rows, const std::array<Lanes, 3>& X_row, const Lanes& rho,
                                           const LanePixels& pixel, const Lanes& share, const Lanes& gx,
                                           const Lanes& gy, std::array<Lanes, 3>& by_X) {
  std::array<Lanes, 3> change, turned;
  motion_of(rows, X_row, rho, change);
  Lanes u_by_share{}, v_by_share{};
  for (int d = 0; d < 3; ++d) {
    u_by_share += pixel.u_by[d] * change[d];
    v_by_share += pixel.v_by[d] * change[d];
  }
  const Lanes by_row =
      rows.share_per_row * (gx * u_by_share + gy * v_by_share) / (1.0F - rows.share_per_row * v_by_share);
  for (int d = 0; d < 3; ++d) by_X[d] = pixel.u_by[d] * gx + (gy + by_row) * pixel.v_by[d];
  cross(rows.w, by_X, turned);  // back to the middle row: R^T b = b - s w x b
  const Lanes with_velocity = 1.0F + rows.twist_by_pose * share;
  for (int d = 0; d < 3; ++d) by_X[d] = with_velocity * (by_X[d] - share * turned[d]);
}

}  // namespace tileflight::odometry
