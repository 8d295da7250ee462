#pragma once

// Lens::project for eight directions at once: the same formulas on SIMD vectors.

#include "tileflight/core/base/simd.h"
#include "tileflight/slam/keyframes/lens.h"

namespace tileflight::keyframes {

/// Pixels of eight directions, with the derivatives by the direction.
struct Pixels8 {
  base::Float8 u, v;
  std::array<base::Float8, 3> d_u_d_X, d_v_d_X;
  base::Mask8 valid;  ///< inside the lens's valid cone
};

class Lens8 {
 public:
  explicit Lens8(const Lens& lens) : lens_(lens) {}

  TILEFLIGHT_LANE_INLINE void project(const std::array<base::Float8, 3>& X, Pixels8& out) const {
    base::Float8 norm;
    base::square_root(X[0] * X[0] + X[1] * X[1] + X[2] * X[2], norm);
    const base::Float8 inverse_norm = 1.0F / norm;
    out.valid = X[2] * inverse_norm >= static_cast<float>(lens_.min_cos_);
    if (lens_.formula_ == Lens::Formula::kTable) {
      project_radial(X, inverse_norm, out);
    } else if (lens_.formula_ == Lens::Formula::kRadtan) {
      project_radtan(X, inverse_norm, out);
    } else {
      project_by_camera(X, out);
    }
  }

 private:
  TILEFLIGHT_LANE_INLINE void project_radial(const std::array<base::Float8, 3>& X, const base::Float8& inverse_norm,
                                             Pixels8& out) const {
    const std::array<base::Float8, 3> d{X[0] * inverse_norm, X[1] * inverse_norm, X[2] * inverse_norm};
    base::Float8 g, g_prime;
    for (int i = 0; i < base::kLanes; ++i) {
      float value, slope;
      lens_.radial(d[2][i], value, slope);
      g[i] = value;
      g_prime[i] = slope;
    }
    const auto fx = static_cast<float>(lens_.fx_), fy = static_cast<float>(lens_.fy_);
    out.u = static_cast<float>(lens_.cx_) + fx * g * d[0];
    out.v = static_cast<float>(lens_.cy_) + fy * g * d[1];
    const base::Float8 f_u = fx * inverse_norm, f_v = fy * inverse_norm, bend = g + g_prime * d[2];
    const base::Float8 common_u = -d[0] * bend, common_v = -d[1] * bend;
    out.d_u_d_X = {f_u * (common_u * d[0] + g), f_u * (common_u * d[1]), f_u * (common_u * d[2] + d[0] * g_prime)};
    out.d_v_d_X = {f_v * (common_v * d[0]), f_v * (common_v * d[1] + g), f_v * (common_v * d[2] + d[1] * g_prime)};
  }

  TILEFLIGHT_LANE_INLINE void project_radtan(const std::array<base::Float8, 3>& X, const base::Float8& inverse_norm,
                                             Pixels8& out) const {
    const auto fx = static_cast<float>(lens_.fx_), fy = static_cast<float>(lens_.fy_);
    const auto xi = static_cast<float>(lens_.xi_);
    const auto k1 = static_cast<float>(lens_.radtan_[0]), k2 = static_cast<float>(lens_.radtan_[1]);
    const auto p1 = static_cast<float>(lens_.radtan_[2]), p2 = static_cast<float>(lens_.radtan_[3]);
    const base::Float8 inverse = 1.0F / (X[2] + xi / inverse_norm);
    const base::Float8 x = X[0] * inverse, y = X[1] * inverse, r2 = x * x + y * y;
    const base::Float8 radial_factor = 1.0F + r2 * (k1 + r2 * k2);
    out.u = static_cast<float>(lens_.cx_) + fx * (x * radial_factor + 2.0F * p1 * x * y + p2 * (r2 + 2.0F * x * x));
    out.v = static_cast<float>(lens_.cy_) + fy * (y * radial_factor + p1 * (r2 + 2.0F * y * y) + 2.0F * p2 * x * y);
    const base::Float8 d = 2.0F * (k1 + 2.0F * k2 * r2);
    const base::Float8 du_dx = fx * (radial_factor + d * x * x + 2.0F * p1 * y + 6.0F * p2 * x);
    const base::Float8 du_dy = fx * (d * x * y + 2.0F * p1 * x + 2.0F * p2 * y);
    const base::Float8 dv_dx = fy * (d * x * y + 2.0F * p1 * x + 2.0F * p2 * y);
    const base::Float8 dv_dy = fy * (radial_factor + d * y * y + 6.0F * p1 * y + 2.0F * p2 * x);
    for (int i = 0; i < 3; ++i) {
      const base::Float8 D_by_X = (i == 2 ? 1.0F : 0.0F) + xi * inverse_norm * X[i];
      const base::Float8 x_by = ((i == 0 ? 1.0F : 0.0F) - x * D_by_X) * inverse;
      const base::Float8 y_by = ((i == 1 ? 1.0F : 0.0F) - y * D_by_X) * inverse;
      out.d_u_d_X[i] = du_dx * x_by + du_dy * y_by;
      out.d_v_d_X[i] = dv_dx * x_by + dv_dy * y_by;
    }
  }

  void project_by_camera(const std::array<base::Float8, 3>& X, Pixels8& out) const {
    for (int i = 0; i < base::kLanes; ++i) {
      geometry::Vec2 pixel = geometry::Vec2::Zero();
      Eigen::Matrix<double, 2, 3> derivative = Eigen::Matrix<double, 2, 3>::Zero();
      if (!lens_.project_by_camera({X[0][i], X[1][i], X[2][i]}, pixel, &derivative)) out.valid[i] = 0;
      out.u[i] = static_cast<float>(pixel.x());
      out.v[i] = static_cast<float>(pixel.y());
      for (int k = 0; k < 3; ++k) {
        out.d_u_d_X[k][i] = static_cast<float>(derivative(0, k));
        out.d_v_d_X[k][i] = static_cast<float>(derivative(1, k));
      }
    }
  }

  const Lens& lens_;
};

}  // namespace tileflight::keyframes
