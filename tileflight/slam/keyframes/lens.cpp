#include "tileflight/slam/keyframes/lens.h"

#include <algorithm>
#include <numbers>
#include <variant>

#include "tileflight/core/imaging/lens_distortion.h"

namespace tileflight::keyframes {
namespace {

using geometry::Vec2;
using geometry::Vec3;

constexpr int kCells = 2048;
constexpr double kMarginRad = 0.1;       ///< the table extends this far beyond the image corners
constexpr double kWidestTableRad = 2.9;  ///< r/sin(theta) has a pole at 180 degrees

/// r(theta)/sin(theta) of the camera along its horizontal axis, from imaging::Camera's projection.
double radial_ratio(const imaging::Camera& camera, double fx, double cx, double c) {
  constexpr double kSmall = 1e-5;  // below it the ratio differs from its limit by 1e-11
  const double s = std::max(std::sqrt(std::max(0.0, 1.0 - c * c)), kSmall);
  const auto pixel = camera.project(Vec3(s, 0.0, s > kSmall ? c : std::sqrt(1.0 - s * s)));
  return pixel ? (pixel->x() - cx) / (fx * s) : 0.0;
}

/// Largest angle from the axis within the image; the model's limit if a corner is outside the model's domain.
double widest_angle_rad(const imaging::Camera& camera) {
  double widest = 0.0;
  for (const double u : {0.0, camera.width() - 1.0}) {
    for (const double v : {0.0, camera.height() - 1.0}) {
      const auto ray = camera.unproject(Vec2(u, v));
      widest = std::max(widest, ray ? std::acos(std::clamp(ray->z(), -1.0, 1.0)) : camera.max_theta_rad());
    }
  }
  return std::min(widest, kWidestTableRad);
}

/// Cubic through four neighbouring samples at -1, 0, 1, 2, for the cell 0..1 (Lagrange).
Eigen::Vector4d fit_cubic(double a, double b, double c, double d) {
  return {b, c - b / 2 - a / 3 - d / 6, (a + c) / 2 - b, (d - a) / 6 + (b - c) / 2};
}

/// Focal lengths and principal point, pixels of level 0.
struct Intrinsics {
  double fx, fy, cx, cy;
};

Intrinsics intrinsics(const imaging::Camera& camera) {
  return std::visit(
      [](const auto& model) {
        return Intrinsics{model.fx, model.fy, model.cx, model.cy};
      },
      camera.model());
}

Intrinsics with_delta(const Intrinsics& own, const IntrinsicsDelta& delta) {
  return {own.fx * (1.0 + delta[0]), own.fy * (1.0 + delta[1]), own.cx + delta[2] * own.fx, own.cy + delta[3] * own.fy};
}

/// Whether the distance of a pixel from the principal point depends only on the angle from the axis (for lenses without
/// a closed form here).
bool is_symmetric(const imaging::Camera& camera) {
  if (std::holds_alternative<imaging::Equirectangular>(camera.model())) return false;
  const auto* rational = std::get_if<imaging::PinholeRational>(&camera.model());
  return rational == nullptr || imaging::rational::is_radial(rational->d);
}

}  // namespace

imaging::Camera apply_delta(const imaging::Camera& camera, const IntrinsicsDelta& delta) {
  const Intrinsics now = with_delta(intrinsics(camera), delta);
  auto model = camera.model();
  std::visit([&now](auto& m) { m.fx = now.fx, m.fy = now.fy, m.cx = now.cx, m.cy = now.cy; }, model);
  return imaging::Camera(model, camera.width(), camera.height());
}

Lens::Lens(const imaging::Camera& camera) : camera_(camera) {
  set_level(0);
  if (const auto* radtan = std::get_if<imaging::PinholeRadtan>(&camera.model())) {
    radtan_ = radtan->d;
    formula_ = Formula::kRadtan;
    distortionless_ = radtan->d == std::array<double, 4>{};
    min_cos_ = std::max(std::cos(camera.max_theta_rad()), 0.02);
    return;
  }
  if (!is_symmetric(camera)) {
    formula_ = Formula::kCamera;
    // A pinhole's pixel goes to infinity near 90 degrees; a panorama has no such limit.
    min_cos_ = camera.max_theta_rad() < std::numbers::pi ? std::max(std::cos(camera.max_theta_rad()), 0.02) : -2.0;
    return;
  }
  min_cos_ = std::cos(std::min(camera.max_theta_rad(), widest_angle_rad(camera) + kMarginRad));
  if (const auto* unified = std::get_if<imaging::UnifiedModel>(&camera.model());
      unified != nullptr && (unified->d[2] != 0.0 || unified->d[3] != 0.0)) {
    radtan_ = unified->d;
    xi_ = unified->xi;
    formula_ = Formula::kRadtan;
    return;
  }
  table_ = radial_table(camera);
}

std::shared_ptr<const Lens::Table> Lens::radial_table(const imaging::Camera& camera) const {
  // A margin of two cells beyond each end would leave the model; the end cells reuse the nearest inner cubic instead.
  auto table = std::make_shared<Table>();
  table->min_cos = min_cos_;
  table->cells_per_unit = kCells / (1.0 - min_cos_);
  std::vector<double> samples(kCells + 1);
  for (int i = 0; i <= kCells; ++i) {
    // The model may reject its last valid angle, so stay slightly inside.
    const double c = std::min(1.0, min_cos_ + (i == 0 ? 1e-9 : i / table->cells_per_unit));
    samples[i] = radial_ratio(camera, fx_, cx_, c);
  }
  samples[0] = 4 * samples[1] - 6 * samples[2] + 4 * samples[3] - samples[4];
  const double below = 4 * samples[0] - 6 * samples[1] + 4 * samples[2] - samples[3];
  const double above = 4 * samples[kCells] - 6 * samples[kCells - 1] + 4 * samples[kCells - 2] - samples[kCells - 3];
  for (int i = 0; i < kCells; ++i) {
    const Eigen::Vector4d k =
        fit_cubic(i == 0 ? below : samples[i - 1], samples[i], samples[i + 1], i + 2 > kCells ? above : samples[i + 2]);
    table->cubic_d.push_back(k);
    table->cubic.push_back(k.cast<float>());
  }
  return table;
}

void Lens::set_level(int level) {
  const Intrinsics now = with_delta(intrinsics(camera_), delta_);
  const double scale = std::ldexp(1.0, -level);
  level_ = level;
  fx_ = now.fx * scale;
  fy_ = now.fy * scale;
  cx_ = (now.cx + 0.5) * scale - 0.5;
  cy_ = (now.cy + 0.5) * scale - 0.5;
}

Lens Lens::at_level(int level) const {
  Lens lens = *this;
  lens.set_level(level);
  return lens;
}

Lens Lens::apply_delta(const IntrinsicsDelta& delta) const {
  Lens lens = *this;
  lens.delta_ = delta;
  lens.set_level(level_);
  return lens;
}

bool Lens::project_by_camera(const Vec3& X, Vec2& pixel, Eigen::Matrix<double, 2, 3>* derivative) const {
  const auto own = derivative != nullptr ? camera_.project(X, *derivative) : camera_.project(X);
  if (!own) return false;
  const Intrinsics nominal = intrinsics(camera_);
  const Vec2 scale(fx_ / nominal.fx, fy_ / nominal.fy);
  pixel = Vec2(cx_, cy_) + scale.cwiseProduct(*own - Vec2(nominal.cx, nominal.cy));
  if (derivative != nullptr) *derivative = scale.asDiagonal() * *derivative;
  return true;
}

Vec2 Lens::nominal_pixel(const Vec2& pixel) const {
  if (!has_delta()) return pixel;
  const double own_fx = fx_ / (1.0 + delta_[0]), own_fy = fy_ / (1.0 + delta_[1]);
  return {cx_ - delta_[2] * own_fx + (pixel.x() - cx_) / (1.0 + delta_[0]),
          cy_ - delta_[3] * own_fy + (pixel.y() - cy_) / (1.0 + delta_[1])};
}

std::optional<Vec3> Lens::unproject(const Vec2& pixel) const {
  const double scale = std::ldexp(1.0, level_);
  const auto ray = camera_.unproject((nominal_pixel(pixel) + Vec2::Constant(0.5)) * scale - Vec2::Constant(0.5));
  if (!ray || ray->z() < min_cos_) return std::nullopt;
  return ray;
}

}  // namespace tileflight::keyframes
