#pragma once

// Fast camera projection for the inner loops. A radially symmetric lens is tabulated over one variable and read by
// cubic interpolation; pinhole and unified models with tangential distortion are evaluated in closed form; all others
// (panoramas, rational distortion with a tangential part) call imaging::Camera. Supports fields of view beyond 180
// degrees.
//
// With n = |X|, c = z/n = cos(theta), m = (x, y)/n:   u = cx + fx g(c) m_x,   v = cy + fy g(c) m_y,
// g(c) = r(theta)/sin(theta), which is smooth in c up to the axis.

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::keyframes {

/// A change d of focal lengths and principal point: the new values are fx (1 + d[0]), fy (1 + d[1]), cx + d[2] fx, cy +
/// d[3] fy, in terms of the camera's own fx, fy, cx, cy. In every model these four only scale and shift the projected
/// coordinates.
using IntrinsicsDelta = Eigen::Vector4d;

/// The camera with its focal lengths and principal point changed.
imaging::Camera apply_delta(const imaging::Camera& camera, const IntrinsicsDelta& delta);

/// A lens at one pyramid level. Pixel centres at integers; level l's pixel is u_l = (u_0 + 0.5) / 2^l - 0.5.
class Lens {
 public:
  Lens() = default;
  explicit Lens(const imaging::Camera& camera);

  /// Returns the lens for pyramid level `level` (the image halved `level` times).
  Lens at_level(int level) const;
  /// Returns the lens with its camera's focal lengths and principal point changed by `delta`, which replaces any
  /// present change.
  Lens apply_delta(const IntrinsicsDelta& delta) const;

  /// Projects the direction X (any length) to a pixel. False outside the model's valid cone; the pixel may lie outside
  /// the image.
  template <class T>
  bool project(const Eigen::Matrix<T, 3, 1>& X, Eigen::Matrix<T, 2, 1>& pixel) const;
  /// Same, with the derivative of the pixel by X.
  template <class T>
  bool project(const Eigen::Matrix<T, 3, 1>& X, Eigen::Matrix<T, 2, 1>& pixel,
               Eigen::Matrix<T, 2, 3>& d_pixel_d_X) const;
  /// Derivative of a projected pixel by the IntrinsicsDelta.
  template <class T>
  Eigen::Matrix<T, 2, 4> d_pixel_d_delta(const Eigen::Matrix<T, 2, 1>& pixel) const;
  bool has_delta() const { return !delta_.isZero(0); }
  /// Pixel of the unchanged lens, at the same level, that has the same ray as `pixel` in this one.
  geometry::Vec2 nominal_pixel(const geometry::Vec2& pixel) const;
  /// Unit ray of a pixel of this level; nullopt outside the model's valid domain.
  std::optional<geometry::Vec3> unproject(const geometry::Vec2& pixel) const;

  /// Mean focal length of this level, pixels per radian near the axis.
  double focal_px() const { return 0.5 * (fx_ + fy_); }

 private:
  friend class Lens8;  // the same projection for eight directions at once
  enum class Formula { kTable, kRadtan, kCamera };
  struct Table {
    double min_cos = 0.0;
    double cells_per_unit = 0.0;
    std::vector<Eigen::Vector4f> cubic;  ///< coefficients of each cell in its own coordinate 0..1
    std::vector<Eigen::Vector4d> cubic_d;
  };
  std::shared_ptr<const Table> radial_table(const imaging::Camera& camera) const;
  void set_level(int level);
  template <class T>
  void radial(T c, T& g, T& g_prime) const;
  template <class T>
  bool project_radtan(const Eigen::Matrix<T, 3, 1>& X, T inverse_norm, Eigen::Matrix<T, 2, 1>& pixel,
                      Eigen::Matrix<T, 2, 3>* derivative) const;
  bool project_by_camera(const geometry::Vec3& X, geometry::Vec2& pixel, Eigen::Matrix<double, 2, 3>* derivative) const;
  template <class T>
  bool project_evaluated(const Eigen::Matrix<T, 3, 1>& X, T inverse_norm, Eigen::Matrix<T, 2, 1>& pixel,
                         Eigen::Matrix<T, 2, 3>* derivative) const;

  imaging::Camera camera_;  ///< of level 0, as it was given
  IntrinsicsDelta delta_ = IntrinsicsDelta::Zero();
  int level_ = 0;
  double fx_ = 0, fy_ = 0, cx_ = 0, cy_ = 0;
  double min_cos_ = 0;
  Formula formula_ = Formula::kTable;
  bool distortionless_ = false;  ///< a pinhole
  double xi_ = 0;                ///< of the unified model; 0: pinhole
  std::array<double, 4> radtan_{};
  std::shared_ptr<const Table> table_;
};

template <class T>
inline Eigen::Matrix<T, 2, 4> Lens::d_pixel_d_delta(const Eigen::Matrix<T, 2, 1>& pixel) const {
  const T own_fx = T(fx_ / (1.0 + delta_[0])), own_fy = T(fy_ / (1.0 + delta_[1]));
  Eigen::Matrix<T, 2, 4> derivative = Eigen::Matrix<T, 2, 4>::Zero();
  derivative(0, 0) = (pixel[0] - T(cx_)) / T(1.0 + delta_[0]);
  derivative(1, 1) = (pixel[1] - T(cy_)) / T(1.0 + delta_[1]);
  derivative(0, 2) = own_fx;
  derivative(1, 3) = own_fy;
  return derivative;
}

template <class T>
inline void Lens::radial(T c, T& g, T& g_prime) const {
  const Table& table = *table_;
  const T x = (c - T(table.min_cos)) * T(table.cells_per_unit);
  const int last = static_cast<int>(table.cubic.size()) - 1;
  int cell = static_cast<int>(x);
  cell = cell < 0 ? 0 : (cell > last ? last : cell);
  const T s = x - T(cell);
  const auto evaluate = [&](const auto& k) {
    g = k[0] + s * (k[1] + s * (k[2] + s * k[3]));
    g_prime = (k[1] + s * (T(2) * k[2] + s * T(3) * k[3])) * T(table.cells_per_unit);
  };
  if constexpr (std::is_same_v<T, float>) {
    evaluate(table.cubic[cell]);
  } else {
    evaluate(table.cubic_d[cell]);
  }
}

/// Distortion (k1 k2 p1 p2) of (x, y) = X_xy / D with D = X_z + xi |X|.
template <class T>
inline bool Lens::project_radtan(const Eigen::Matrix<T, 3, 1>& X, T inverse_norm, Eigen::Matrix<T, 2, 1>& pixel,
                                 Eigen::Matrix<T, 2, 3>* derivative) const {
  const T xi = T(xi_);
  const T inverse = T(1) / (X[2] + xi / inverse_norm);
  const T x = X[0] * inverse, y = X[1] * inverse;
  if (distortionless_) {
    pixel[0] = T(cx_) + T(fx_) * x;
    pixel[1] = T(cy_) + T(fy_) * y;
    if (derivative != nullptr) {
      *derivative << T(fx_) * inverse, T(0), -T(fx_) * x * inverse, T(0), T(fy_) * inverse, -T(fy_) * y * inverse;
    }
    return true;
  }
  const T k1 = T(radtan_[0]), k2 = T(radtan_[1]), p1 = T(radtan_[2]), p2 = T(radtan_[3]);
  const T r2 = x * x + y * y;
  const T radial_factor = T(1) + r2 * (k1 + r2 * k2);
  pixel[0] = T(cx_) + T(fx_) * (x * radial_factor + T(2) * p1 * x * y + p2 * (r2 + T(2) * x * x));
  pixel[1] = T(cy_) + T(fy_) * (y * radial_factor + p1 * (r2 + T(2) * y * y) + T(2) * p2 * x * y);
  if (derivative == nullptr) return true;
  const T d = T(2) * (k1 + T(2) * k2 * r2);  // d(radial)/dx = d x, d(radial)/dy = d y
  const T du_dx = T(fx_) * (radial_factor + d * x * x + T(2) * p1 * y + T(6) * p2 * x);
  const T du_dy = T(fx_) * (d * x * y + T(2) * p1 * x + T(2) * p2 * y);
  const T dv_dx = T(fy_) * (d * x * y + T(2) * p1 * x + T(2) * p2 * y);
  const T dv_dy = T(fy_) * (radial_factor + d * y * y + T(6) * p1 * y + T(2) * p2 * x);
  // d(x, y)/dX = (e_x - x dD, e_y - y dD) / D.
  const Eigen::Matrix<T, 1, 3> D_by_X(xi * inverse_norm * X[0], xi * inverse_norm * X[1],
                                      T(1) + xi * inverse_norm * X[2]);
  derivative->row(0) = inverse * (Eigen::Matrix<T, 1, 3>(du_dx, du_dy, T(0)) - (du_dx * x + du_dy * y) * D_by_X);
  derivative->row(1) = inverse * (Eigen::Matrix<T, 1, 3>(dv_dx, dv_dy, T(0)) - (dv_dx * x + dv_dy * y) * D_by_X);
  return true;
}

template <class T>
inline bool Lens::project_evaluated(const Eigen::Matrix<T, 3, 1>& X, T inverse_norm, Eigen::Matrix<T, 2, 1>& pixel,
                                    Eigen::Matrix<T, 2, 3>* derivative) const {
  if (formula_ == Formula::kRadtan) return project_radtan<T>(X, inverse_norm, pixel, derivative);
  geometry::Vec2 exact_pixel;
  Eigen::Matrix<double, 2, 3> exact_derivative;
  const geometry::Vec3 direction = X.template cast<double>();
  if (!project_by_camera(direction, exact_pixel, derivative != nullptr ? &exact_derivative : nullptr)) return false;
  pixel = exact_pixel.template cast<T>();
  if (derivative != nullptr) *derivative = exact_derivative.template cast<T>();
  return true;
}

template <class T>
inline bool Lens::project(const Eigen::Matrix<T, 3, 1>& X, Eigen::Matrix<T, 2, 1>& pixel) const {
  const T n2 = X.squaredNorm();
  const T in = T(1) / std::sqrt(n2);
  const T c = X[2] * in;
  if (!(c >= T(min_cos_))) return false;
  if (formula_ != Formula::kTable) return project_evaluated<T>(X, in, pixel, nullptr);
  T g, g_prime;
  radial(c, g, g_prime);
  pixel[0] = T(cx_) + T(fx_) * g * X[0] * in;
  pixel[1] = T(cy_) + T(fy_) * g * X[1] * in;
  return true;
}

template <class T>
inline bool Lens::project(const Eigen::Matrix<T, 3, 1>& X, Eigen::Matrix<T, 2, 1>& pixel,
                          Eigen::Matrix<T, 2, 3>& d_pixel_d_X) const {
  const T in = T(1) / std::sqrt(X.squaredNorm());
  const Eigen::Matrix<T, 3, 1> d = X * in;
  if (!(d[2] >= T(min_cos_))) return false;
  if (formula_ != Formula::kTable) return project_evaluated<T>(X, in, pixel, &d_pixel_d_X);
  T g, g_prime;
  radial(d[2], g, g_prime);
  pixel[0] = T(cx_) + T(fx_) * g * d[0];
  pixel[1] = T(cy_) + T(fy_) * g * d[1];
  // d(g m) = g dm + m g' dc, with dm = (e - m d^T)/n and dc = (e_z - c d^T)/n.
  for (int i = 0; i < 2; ++i) {
    const T f = T(i == 0 ? fx_ : fy_) * in;
    const T common = -d[i] * (g + g_prime * d[2]);
    d_pixel_d_X(i, 0) = f * (common * d[0] + (i == 0 ? g : T(0)));
    d_pixel_d_X(i, 1) = f * (common * d[1] + (i == 1 ? g : T(0)));
    d_pixel_d_X(i, 2) = f * (common * d[2] + d[i] * g_prime);
  }
  return true;
}

}  // namespace tileflight::keyframes
