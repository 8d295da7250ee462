// Lens models. Notation: a point (x, y, z) in the camera frame, rho = |(x, y)|, theta = atan2(rho, z) its angle from
// the optical axis, r its distance from the principal point in units of the focal length. A pixel is (fx mx + cx, fy my
// + cy) with (mx, my) the distorted coordinates. The valid cone ends where r(theta) stops increasing: beyond it two
// directions share a pixel and no inverse exists.
#include "tileflight/core/imaging/camera.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/lens_distortion.h"

namespace tileflight::imaging {

namespace {

using geometry::Vec2;
using geometry::Vec3;
using Mat2 = Eigen::Matrix2d;
using Jacobian = Eigen::Matrix<double, 2, 3>;

constexpr double kPi = std::numbers::pi;
constexpr double kOnAxis = 1e-30;  ///< rho^2 / z^2 below which the limit on the optical axis is used

// ---- radially symmetric models: r as a function of (rho, z), with its derivatives ----

struct Radius {
  double r = 0.0;
  double d_rho = 0.0;
  double d_z = 0.0;
};

/// r = theta + k1 theta^3 + k2 theta^5 + k3 theta^7 + k4 theta^9 (Kannala and Brandt 2006, eq. 6).
double kannala_radius(const std::array<double, 4>& k, double theta) {
  const double t = theta * theta;
  return theta * (1.0 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3]))));
}

double kannala_slope(const std::array<double, 4>& k, double theta) {
  const double t = theta * theta;
  return 1.0 + t * (3.0 * k[0] + t * (5.0 * k[1] + t * (7.0 * k[2] + t * 9.0 * k[3])));
}

Radius radius_of(const KannalaBrandt& m, double rho, double z, double theta) {
  const double slope = kannala_slope(m.k, theta);
  const double squared_range = rho * rho + z * z;
  return {kannala_radius(m.k, theta), slope * z / squared_range, -slope * rho / squared_range};
}

/// r = atan(2 tan(theta) tan(w/2)) / w (Devernay and Faugeras 2001, eq. 13); tan(theta) for w = 0.
Radius radius_of(const FovModel& m, double rho, double z, double /*theta*/) {
  if (m.w == 0.0) return {rho / z, 1.0 / z, -rho / (z * z)};
  const double a = 2.0 * std::tan(0.5 * m.w);
  const double denominator = m.w * (a * a * rho * rho + z * z);
  return {std::atan2(a * rho, z) / m.w, a * z / denominator, -a * rho / denominator};
}

/// Distorted coordinates of a point, on or off the axis, for both radial models.
template <class Model>
std::optional<Vec2> project_radial(const Model& m, double max_theta, const Vec3& p, Jacobian* jacobian) {
  const double rho2 = p.x() * p.x() + p.y() * p.y();
  const double rho = std::sqrt(rho2);
  const double theta = std::atan2(rho, p.z());
  if (!(theta <= max_theta) || (rho2 == 0.0 && !(p.z() > 0.0))) return std::nullopt;
  const bool on_axis = rho2 <= kOnAxis * p.z() * p.z() && p.z() > 0.0;
  const Radius radius = radius_of(m, rho, p.z(), theta);
  const double scale = on_axis ? radius.d_rho : radius.r / rho;
  if (jacobian != nullptr) {
    const double bend = on_axis ? 0.0 : (radius.d_rho - scale) / rho2;
    const double along = on_axis ? -radius.d_rho / p.z() : radius.d_z / rho;
    *jacobian << m.fx * (scale + p.x() * p.x() * bend), m.fx * p.x() * p.y() * bend, m.fx * p.x() * along,
        m.fy * p.x() * p.y() * bend, m.fy * (scale + p.y() * p.y() * bend), m.fy * p.y() * along;
  }
  return Vec2(m.fx * scale * p.x() + m.cx, m.fy * scale * p.y() + m.cy);
}

Vec3 ray_at_angle(const Vec2& m, double r, double theta) {
  const double sideways = r > 0.0 ? std::sin(theta) / r : 1.0;
  return {sideways * m.x(), sideways * m.y(), std::cos(theta)};
}

std::optional<Vec3> unproject_normalized(const KannalaBrandt& m, double max_theta, const Vec2& d) {
  const double r = d.norm();
  if (!(r <= kannala_radius(m.k, max_theta))) return std::nullopt;
  const double theta = solve_increasing(
      r, r, 0.0, max_theta, [&](double t) { return kannala_radius(m.k, t); },
      [&](double t) { return kannala_slope(m.k, t); });
  return ray_at_angle(d, r, theta);
}

std::optional<Vec3> unproject_normalized(const FovModel& m, double /*max_theta*/, const Vec2& d) {
  const double r = d.norm();
  if (m.w == 0.0) return Vec3(d.x(), d.y(), 1.0).normalized();
  if (!(r * m.w < 0.5 * kPi)) return std::nullopt;
  return ray_at_angle(d, r, std::atan(std::tan(r * m.w) / (2.0 * std::tan(0.5 * m.w))));
}

// ---- pinholes with distortion ----

DistortedPoint apply_distortion(const PinholeRadtan& m, const Vec2& flat) { return brown_conrady::distort(m.d, flat); }
DistortedPoint apply_distortion(const PinholeRational& m, const Vec2& flat) { return rational::distort(m.d, flat); }

std::optional<double> max_radius(double max_theta) {
  return max_theta < 0.5 * kPi ? std::optional<double>(std::tan(max_theta)) : std::nullopt;
}

template <class Model>
std::optional<Vec2> project_flat(const Model& m, double max_theta, const Vec3& p, Jacobian* jacobian) {
  if (!(p.z() > 0.0)) return std::nullopt;
  const double inverse_z = 1.0 / p.z();
  const Vec2 flat = p.head<2>() * inverse_z;
  const std::optional<double> largest = max_radius(max_theta);
  if (largest && flat.squaredNorm() > *largest * *largest) return std::nullopt;
  const DistortedPoint distorted = apply_distortion(m, flat);
  if (!(distorted.jacobian.determinant() > 0.0)) return std::nullopt;  // folded by the tangential part
  if (jacobian != nullptr) {
    const Mat2 d = Vec2(m.fx, m.fy).asDiagonal() * distorted.jacobian * inverse_z;
    *jacobian << d, -d * flat;
  }
  return Vec2(m.fx * distorted.point.x() + m.cx, m.fy * distorted.point.y() + m.cy);
}

std::optional<Vec3> unproject_normalized(const PinholeRadtan& m, double max_theta, const Vec2& d) {
  const std::optional<Vec2> flat = brown_conrady::undistort(m.d, max_radius(max_theta), d);
  if (!flat) return std::nullopt;
  return Vec3(flat->x(), flat->y(), 1.0).normalized();
}

std::optional<Vec3> unproject_normalized(const PinholeRational& m, double max_theta, const Vec2& d) {
  const std::optional<Vec2> flat = rational::undistort(m.d, std::tan(max_theta), d);
  if (!flat) return std::nullopt;
  return Vec3(flat->x(), flat->y(), 1.0).normalized();
}

// ---- panorama ----

std::optional<Vec2> project_panorama(const Equirectangular& m, const Vec3& p, Jacobian* jacobian) {
  const double level2 = p.x() * p.x() + p.z() * p.z();
  const double level = std::sqrt(level2);
  const double range2 = level2 + p.y() * p.y();
  if (!(range2 > 0.0)) return std::nullopt;
  if (jacobian != nullptr) {
    if (level == 0.0) return std::nullopt;
    *jacobian << m.fx * p.z() / level2, 0.0, -m.fx * p.x() / level2,  //
        -m.fy * p.y() * p.x() / (level * range2), m.fy * level / range2, -m.fy * p.y() * p.z() / (level * range2);
  }
  return Vec2(m.fx * std::atan2(p.x(), p.z()) + m.cx, m.fy * std::atan2(p.y(), level) + m.cy);
}

std::optional<Vec3> unproject_normalized(const Equirectangular& /*m*/, double /*max_theta*/, const Vec2& d) {
  constexpr double kRounding = 1.0 + 1e-12;  // includes the image's own borders
  if (!(std::abs(d.x()) <= kPi * kRounding && std::abs(d.y()) <= 0.5 * kPi * kRounding)) return std::nullopt;
  const double level = std::cos(d.y());
  return Vec3(level * std::sin(d.x()), std::sin(d.y()), level * std::cos(d.x()));
}

// ---- lenses with projection spheres ----

// Lens models that project by way of one or two unit spheres, in normalised coordinates m = (x, y) / D(x, y, z):
// double sphere, unified (a sphere and a pinhole) and extended unified (an ellipsoid and a pinhole). Notation: theta
// is the ray's angle from the axis; phi its angle seen from the centre shifted by xi, tan phi = sin theta / (xi + cos
// theta).
namespace sphere_lenses {

struct Denominator {
  double value = 0.0;
  geometry::Vec3 gradient = geometry::Vec3::Zero();
};

/// sin phi / (alpha + (1 - alpha) cos phi) stops increasing (alpha > 1/2) or becomes infinite at cos phi = -w; returns
/// w.
double widest_cosine(double alpha) { return alpha > 0.5 ? (1.0 - alpha) / alpha : alpha / (1.0 - alpha); }

/// The angle theta for which cos phi = -w, or at which phi itself stops increasing (1 + xi cos theta = 0, xi > 1).
double theta_at(double xi, double w) {
  const double fold = xi > 1.0 ? -1.0 / xi : -1.0;
  const double root = 1.0 - xi * xi * (1.0 - w * w);
  if (root < 0.0) return std::acos(fold);
  const double cosine = -xi * (1.0 - w * w) - w * std::sqrt(root);
  return std::acos(std::clamp(std::max(cosine, fold), -1.0, 1.0));
}

/// z coordinate of the point on the second sphere (or ellipsoid) at squared radius r2 in the plane of m: (1 - alpha^2
/// r2) / (alpha sqrt(1 - (2 alpha - 1) r2) + 1 - alpha).
std::optional<double> height_at(double alpha, double r2) {
  const double root = 1.0 - (2.0 * alpha - 1.0) * r2;
  if (!(root >= 0.0)) return std::nullopt;
  return (1.0 - alpha * alpha * r2) / (alpha * std::sqrt(root) + 1.0 - alpha);
}

/// Converts the direction (m, mz) at the centre shifted by xi to the ray at the sphere's own centre.
std::optional<Vec3> through_sphere(double xi, const Vec2& m, double mz) {
  const double n2 = mz * mz + m.squaredNorm();
  const double root = mz * mz + (1.0 - xi * xi) * m.squaredNorm();
  if (!(root >= 0.0)) return std::nullopt;
  const double length = (mz * xi + std::sqrt(root)) / n2;
  return Vec3(length * m.x(), length * m.y(), length * mz - xi);
}

/// Usenko, Demmel, Cremers, "The double sphere camera model", 3DV 2018, eq. 40 to 42.
Denominator denominator(const DoubleSphere& m, const Vec3& p) {
  const double d1 = p.norm();
  const double shifted = m.xi * d1 + p.z();
  const Vec3 shifted_by_point = m.xi / d1 * p + Vec3::UnitZ();
  const double d2 = std::sqrt(p.x() * p.x() + p.y() * p.y() + shifted * shifted);
  const Vec3 d2_by_point = (Vec3(p.x(), p.y(), 0.0) + shifted * shifted_by_point) / d2;
  return {m.alpha * d2 + (1.0 - m.alpha) * shifted, m.alpha * d2_by_point + (1.0 - m.alpha) * shifted_by_point};
}

/// Mei and Rives, "Single view point omnidirectional camera calibration from planar grids", ICRA 2007, section III.
Denominator denominator(const UnifiedModel& m, const Vec3& p) {
  const double d = p.norm();
  return {m.xi * d + p.z(), m.xi / d * p + Vec3::UnitZ()};
}

/// Khomutenko, Garcia, Martinet, "An enhanced unified camera model", RA-L 2016, eq. 6.
Denominator denominator(const ExtendedUnifiedModel& m, const Vec3& p) {
  const double d = std::sqrt(m.beta * (p.x() * p.x() + p.y() * p.y()) + p.z() * p.z());
  const Vec3 d_by_point = Vec3(m.beta * p.x(), m.beta * p.y(), p.z()) / d;
  return {m.alpha * d + (1.0 - m.alpha) * p.z(), m.alpha * d_by_point + (1.0 - m.alpha) * Vec3::UnitZ()};
}

/// Double sphere unprojection: the same paper, eq. 46 to 50.
std::optional<Vec3> unproject(const DoubleSphere& m, const Vec2& normalized) {
  const std::optional<double> mz = height_at(m.alpha, normalized.squaredNorm());
  if (!mz) return std::nullopt;
  return through_sphere(m.xi, normalized, *mz);
}

std::optional<Vec3> unproject(const UnifiedModel& m, const Vec2& normalized) {
  return through_sphere(m.xi, normalized, 1.0);
}

std::optional<Vec3> unproject(const ExtendedUnifiedModel& m, const Vec2& normalized) {
  const std::optional<double> mz = height_at(m.alpha, m.beta * normalized.squaredNorm());
  if (!mz) return std::nullopt;
  return Vec3(normalized.x(), normalized.y(), *mz);
}

double max_theta_rad(const DoubleSphere& m) { return theta_at(m.xi, widest_cosine(m.alpha)); }

double max_theta_rad(const UnifiedModel& m) {
  const double sphere = theta_at(m.xi, 0.0);
  const std::optional<double> radius = brown_conrady::max_valid_radius(m.d);
  if (!radius) return sphere;
  const std::optional<Vec3> ray = unproject(m, Vec2(*radius, 0.0));
  return ray ? std::min(sphere, std::atan2(ray->x(), ray->z())) : sphere;
}

double max_theta_rad(const ExtendedUnifiedModel& m) {
  const double phi = std::acos(-widest_cosine(m.alpha));
  return phi >= kPi ? kPi : std::atan2(std::sin(phi), std::sqrt(m.beta) * std::cos(phi));
}

}  // namespace sphere_lenses

/// Largest radius before distortion.
std::optional<double> max_radius(const UnifiedModel& m) { return brown_conrady::max_valid_radius(m.d); }

DistortedPoint apply_distortion(const UnifiedModel& m, const Vec2& flat) { return brown_conrady::distort(m.d, flat); }
template <class Model>
DistortedPoint apply_distortion(const Model& /*m*/, const Vec2& flat) {
  return {flat, Mat2::Identity()};
}

template <class Model>
std::optional<Vec2> project_by_sphere(const Model& m, double max_theta, const Vec3& p, Jacobian* jacobian) {
  const double rho = std::hypot(p.x(), p.y());
  if (!(std::atan2(rho, p.z()) <= max_theta) || (rho == 0.0 && !(p.z() > 0.0))) return std::nullopt;
  const sphere_lenses::Denominator denominator = sphere_lenses::denominator(m, p);
  if (!(denominator.value > 0.0)) return std::nullopt;
  const Vec2 flat = p.head<2>() / denominator.value;
  const DistortedPoint distorted = apply_distortion(m, flat);
  if (!(distorted.jacobian.determinant() > 0.0)) return std::nullopt;
  if (jacobian != nullptr) {
    Jacobian flat_by_point = -flat * denominator.gradient.transpose();
    flat_by_point.leftCols<2>() += Mat2::Identity();
    *jacobian = Vec2(m.fx, m.fy).asDiagonal() * distorted.jacobian * flat_by_point / denominator.value;
  }
  return Vec2(m.fx * distorted.point.x() + m.cx, m.fy * distorted.point.y() + m.cy);
}

std::optional<Vec3> limit_to_cone(double max_theta, const std::optional<Vec3>& ray) {
  if (!ray || std::atan2(std::hypot(ray->x(), ray->y()), ray->z()) > max_theta) return std::nullopt;
  return ray->normalized();
}

std::optional<Vec3> unproject_normalized(const DoubleSphere& m, double max_theta, const Vec2& d) {
  return limit_to_cone(max_theta, sphere_lenses::unproject(m, d));
}
std::optional<Vec3> unproject_normalized(const UnifiedModel& m, double max_theta, const Vec2& d) {
  const std::optional<Vec2> flat = brown_conrady::undistort(m.d, max_radius(m), d);
  return flat ? limit_to_cone(max_theta, sphere_lenses::unproject(m, *flat)) : std::nullopt;
}
std::optional<Vec3> unproject_normalized(const ExtendedUnifiedModel& m, double max_theta, const Vec2& d) {
  return limit_to_cone(max_theta, sphere_lenses::unproject(m, d));
}

// ---- one entry point for each operation, so that callers visit the variant once ----

std::optional<Vec2> project_by(const KannalaBrandt& m, double max_theta, const Vec3& p, Jacobian* j) {
  return project_radial(m, max_theta, p, j);
}
std::optional<Vec2> project_by(const FovModel& m, double max_theta, const Vec3& p, Jacobian* j) {
  if (!(p.z() > 0.0)) return std::nullopt;
  return project_radial(m, max_theta, p, j);
}
std::optional<Vec2> project_by(const PinholeRadtan& m, double max_theta, const Vec3& p, Jacobian* j) {
  return project_flat(m, max_theta, p, j);
}
std::optional<Vec2> project_by(const PinholeRational& m, double max_theta, const Vec3& p, Jacobian* j) {
  return project_flat(m, max_theta, p, j);
}
std::optional<Vec2> project_by(const Equirectangular& m, double /*max_theta*/, const Vec3& p, Jacobian* j) {
  return project_panorama(m, p, j);
}
std::optional<Vec2> project_by(const DoubleSphere& m, double max_theta, const Vec3& p, Jacobian* j) {
  return project_by_sphere(m, max_theta, p, j);
}
std::optional<Vec2> project_by(const UnifiedModel& m, double max_theta, const Vec3& p, Jacobian* j) {
  return project_by_sphere(m, max_theta, p, j);
}
std::optional<Vec2> project_by(const ExtendedUnifiedModel& m, double max_theta, const Vec3& p, Jacobian* j) {
  return project_by_sphere(m, max_theta, p, j);
}

/// Angle at which r(theta) stops increasing, at most 180 degrees.
double max_theta_of(const KannalaBrandt& m) {
  const std::array<double, 5> slope{1.0, 3.0 * m.k[0], 5.0 * m.k[1], 7.0 * m.k[2], 9.0 * m.k[3]};  // in theta^2
  return std::sqrt(first_nonpositive(slope, kPi * kPi).value_or(kPi * kPi));
}
double max_theta_of(const FovModel& /*m*/) { return 0.5 * kPi; }
double max_theta_of(const PinholeRadtan& m) {
  const std::optional<double> radius = brown_conrady::max_valid_radius(m.d);
  return radius ? std::atan(*radius) : 0.5 * kPi;
}
double max_theta_of(const PinholeRational& m) { return std::atan(rational::max_valid_radius(m.d)); }
double max_theta_of(const Equirectangular& /*m*/) { return kPi; }
double max_theta_of(const DoubleSphere& m) { return sphere_lenses::max_theta_rad(m); }
double max_theta_of(const UnifiedModel& m) { return sphere_lenses::max_theta_rad(m); }
double max_theta_of(const ExtendedUnifiedModel& m) { return sphere_lenses::max_theta_rad(m); }

}  // namespace

Camera::Camera(CameraModel model, int width, int height)
    : model_(std::move(model)),
      width_(width),
      height_(height),
      max_theta_rad_(std::visit([](const auto& m) { return max_theta_of(m); }, model_)) {
  assert(width > 0 && height > 0);
  assert(std::visit([](const auto& m) { return m.fx > 0 && m.fy > 0 && std::isfinite(m.cx + m.cy); }, model_));
}

std::optional<Vec2> Camera::project(const Vec3& point_camera) const {
  return std::visit([&](const auto& m) { return project_by(m, max_theta_rad_, point_camera, nullptr); }, model_);
}

std::optional<Vec2> Camera::project(const Vec3& point_camera, Jacobian& d_pixel_d_point) const {
  return std::visit([&](const auto& m) { return project_by(m, max_theta_rad_, point_camera, &d_pixel_d_point); },
                    model_);
}

std::optional<Vec3> Camera::unproject(const Vec2& pixel) const {
  return std::visit(
      [&](const auto& m) {
        return unproject_normalized(m, max_theta_rad_, Vec2((pixel.x() - m.cx) / m.fx, (pixel.y() - m.cy) / m.fy));
      },
      model_);
}

double Camera::max_image_angle_rad() const {
  double widest = 0.0;
  const auto take = [&](double x, double y) {
    const std::optional<Vec3> ray = unproject({x, y});
    widest = std::max(widest, ray ? std::acos(std::clamp(ray->z(), -1.0, 1.0)) : max_theta_rad_);
  };
  constexpr int kSteps = 32;  // even, to include the middles of the sides, where a panorama sees farthest
  for (int i = 0; i <= kSteps; ++i) {
    const double share = static_cast<double>(i) / kSteps;
    for (const double y : {-0.5, height_ - 0.5}) take(share * width_ - 0.5, y);
    for (const double x : {-0.5, width_ - 0.5}) take(x, share * height_ - 0.5);
  }
  return widest;
}

double Camera::horizontal_fov_deg() const {
  const double row = 0.5 * (height_ - 1);
  const double middle = 0.5 * (width_ - 1);
  // Angle from the image centre to an edge, or to the lens's valid limit.
  const auto angle_at = [&](double edge) {
    if (!unproject({middle, row})) return 0.0;
    double seen = 0.0;
    double unseen = 1.0;
    if (unproject({edge, row})) seen = 1.0;
    while (seen < 1.0 && unseen - seen > 1e-12) {
      const double half = 0.5 * (seen + unseen);
      (unproject({middle + half * (edge - middle), row}) ? seen : unseen) = half;
    }
    const std::optional<Vec3> ray = unproject({middle + seen * (edge - middle), row});
    return ray ? std::atan2(ray->x(), ray->z()) : 0.0;
  };
  return (angle_at(width_ - 0.5) - angle_at(-0.5)) * 180.0 / kPi;
}

Camera Camera::scaled_to(int width, int height) const {
  const auto sizes = [&] {
    return std::to_string(width_) + "x" + std::to_string(height_) + " to " + std::to_string(width) + "x" +
           std::to_string(height);
  };
  if (width <= 0 || height <= 0) throw InputError("camera", "cannot be scaled from " + sizes());
  // Compares heights at the smaller width: rounding to whole pixels may change them by one.
  const double smaller_width = std::min(width, width_);
  if (std::abs(height * smaller_width / width - height_ * smaller_width / width_) > 1.0 + 1e-9)
    throw InputError("camera", "cannot be scaled from " + sizes() + ": the aspect ratio differs");
  const double scale_x = static_cast<double>(width) / width_;
  const double scale_y = static_cast<double>(height) / height_;
  CameraModel scaled = model_;
  std::visit(
      [&](auto& m) {
        m.fx *= scale_x;
        m.fy *= scale_y;
        m.cx = (m.cx + 0.5) * scale_x - 0.5;
        m.cy = (m.cy + 0.5) * scale_y - 0.5;
      },
      scaled);
  return {scaled, width, height};
}

Camera make_fisheye(int width, int height, double fov_deg, std::array<double, 4> k) {
  KannalaBrandt model{1.0, 1.0, 0.5 * (width - 1), 0.5 * (height - 1), k};
  const double theta = 0.5 * fov_deg * kPi / 180.0;
  if (!(theta > 0.0 && theta <= max_theta_of(model)))
    throw InputError("field of view", std::to_string(fov_deg) + " degrees is outside the range of this fisheye lens");
  model.fx = model.fy = 0.5 * width / kannala_radius(k, theta);
  return {model, width, height};
}

Camera make_pinhole(int width, int height, double fov_deg) {
  if (!(fov_deg > 0.0 && fov_deg < 180.0))
    throw InputError("field of view",
                     std::to_string(fov_deg) + " degrees is outside the range of a pinhole: above 0 and below 180");
  const double f = 0.5 * width / std::tan(0.5 * fov_deg * kPi / 180.0);
  return {PinholeRadtan{f, f, 0.5 * (width - 1), 0.5 * (height - 1), {}}, width, height};
}

Camera make_panorama(int width, int height) {
  return {Equirectangular{width / (2.0 * kPi), height / kPi, 0.5 * (width - 1), 0.5 * (height - 1)}, width, height};
}

}  // namespace tileflight::imaging
