#include "tileflight/slam/self_calibration/lens_parameters.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <variant>

namespace tileflight::self_calibration {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kWidestPinhole_deg = 150.0;  // tan grows without bound at 180

template <class Model>
Model with_values(const LensVector& values) {
  Model lens;
  lens.fx = std::exp(values[kLogFocal]);
  lens.fy = std::exp(values[kLogFocal] + values[kLogAspect]);
  lens.cx = values[kCenterX];
  lens.cy = values[kCenterY];
  return lens;
}

template <class Model>
void take_focal_and_center(const Model& lens, LensVector& values) {
  values[kLogFocal] = std::log(lens.fx);
  values[kLogAspect] = std::log(lens.fy / lens.fx);
  values[kCenterX] = lens.cx;
  values[kCenterY] = lens.cy;
}

}  // namespace

std::string to_string(LensModel model) { return model == LensModel::kPinhole ? "pinhole" : "fisheye"; }

imaging::Camera LensParameters::camera() const {
  if (model == LensModel::kPinhole) {
    auto lens = with_values<imaging::PinholeRadtan>(values);
    for (int i = 0; i < 4; ++i) lens.d[i] = values[kFirstDistortion + i];
    return {lens, width, height};
  }
  auto lens = with_values<imaging::KannalaBrandt>(values);
  for (int i = 0; i < 4; ++i) lens.k[i] = values[kFirstDistortion + i];
  return {lens, width, height};
}

imaging::Calibration LensParameters::calibration() const {
  imaging::Calibration result;
  result.camera = camera();
  result.line_delay_s = values[kReadout] / height;
  result.assumes_T_cam_imu = true;
  return result;
}

LensParameters LensParameters::resized(double factor, int new_width, int new_height) const {
  LensParameters result = *this;
  result.width = new_width;
  result.height = new_height;
  result.values[kLogFocal] += std::log(factor);
  for (const int i : {kCenterX, kCenterY}) result.values[i] = (values[i] + 0.5) * factor - 0.5;
  return result;
}

LensParameters undistorted_lens(LensModel model, int width, int height, double horizontal_fov_deg) {
  const double half_rad = 0.5 * horizontal_fov_deg * geometry::kRadiansPerDegree;
  const double radius = model == LensModel::kPinhole
                            ? std::tan(std::min(half_rad, 0.5 * kWidestPinhole_deg * geometry::kRadiansPerDegree))
                            : half_rad;
  LensParameters lens{.model = model, .width = width, .height = height, .values = LensVector::Zero()};
  lens.values[kLogFocal] = std::log(0.5 * width / radius);
  lens.values[kCenterX] = 0.5 * (width - 1);
  lens.values[kCenterY] = 0.5 * (height - 1);
  return lens;
}

LensParameters lens_of(const imaging::Calibration& calibration, LensModel model, int width, int height) {
  const imaging::Camera camera = calibration.camera.scaled_to(width, height);
  const auto* pinhole = std::get_if<imaging::PinholeRadtan>(&camera.model());
  const auto* fisheye = std::get_if<imaging::KannalaBrandt>(&camera.model());
  LensParameters lens = undistorted_lens(model, width, height, camera.horizontal_fov_deg());
  if (pinhole != nullptr && model == LensModel::kPinhole) {
    take_focal_and_center(*pinhole, lens.values);
    for (int i = 0; i < 4; ++i) lens.values[kFirstDistortion + i] = pinhole->d[i];
  } else if (fisheye != nullptr && model == LensModel::kFisheye) {
    take_focal_and_center(*fisheye, lens.values);
    for (int i = 0; i < 4; ++i) lens.values[kFirstDistortion + i] = fisheye->k[i];
  }
  lens.values[kReadout] = calibration.line_delay_s * calibration.camera.height();
  return lens;
}

LensModel model_of(const imaging::Camera& camera) {
  constexpr double kWide_deg = 110.0;
  if (std::holds_alternative<imaging::PinholeRadtan>(camera.model())) return LensModel::kPinhole;
  if (std::holds_alternative<imaging::KannalaBrandt>(camera.model())) return LensModel::kFisheye;
  return camera.horizontal_fov_deg() > kWide_deg ? LensModel::kFisheye : LensModel::kPinhole;
}

Eigen::Matrix<double, 2, kLensUnknowns> pixel_by_lens(const LensParameters& lens, const geometry::Vec3& point,
                                                      const geometry::Vec2& pixel) {
  Eigen::Matrix<double, 2, kLensUnknowns> derivative = Eigen::Matrix<double, 2, kLensUnknowns>::Zero();
  const double u = pixel.x() - lens.values[kCenterX], v = pixel.y() - lens.values[kCenterY];
  derivative.col(kLogFocal) << u, v;
  derivative(1, kLogAspect) = v;
  derivative(0, kCenterX) = derivative(1, kCenterY) = 1.0;
  const double fx = std::exp(lens.values[kLogFocal]), fy = fx * std::exp(lens.values[kLogAspect]);
  const geometry::Vec2 focal(fx, fy);
  const auto distortion = [&](int i) { return derivative.col(kFirstDistortion + i); };
  if (lens.model == LensModel::kPinhole) {
    const geometry::Vec2 flat = point.head<2>() / point.z();
    const double r2 = flat.squaredNorm(), xy = flat.x() * flat.y();
    distortion(0) = focal.cwiseProduct(flat) * r2;
    distortion(1) = focal.cwiseProduct(flat) * r2 * r2;
    distortion(2) = focal.cwiseProduct(geometry::Vec2(2.0 * xy, r2 + 2.0 * flat.y() * flat.y()));
    distortion(3) = focal.cwiseProduct(geometry::Vec2(r2 + 2.0 * flat.x() * flat.x(), 2.0 * xy));
    return derivative;
  }
  const double across = point.head<2>().norm();
  if (!(across > 0.0)) return derivative;
  const double theta = std::atan2(across, point.z()), theta2 = theta * theta;
  geometry::Vec2 power = focal.cwiseProduct(point.head<2>()) / across * theta;
  for (int i = 0; i < 4; ++i) distortion(i) = power *= theta2;
  return derivative;
}

LensVector usual_spread(LensModel model, int width, double focal_sigma) {
  LensVector spread;
  spread << focal_sigma, 0.003, 0.015 * width, 0.015 * width, 0.0, 0.0, 0.0, 0.0, 0.03;
  if (model == LensModel::kPinhole)
    spread.segment<4>(kFirstDistortion) << 0.2, 0.2, 0.003, 0.003;
  else
    spread.segment<4>(kFirstDistortion) << 0.15, 0.1, 0.05, 0.02;
  return spread;
}

}  // namespace tileflight::self_calibration
