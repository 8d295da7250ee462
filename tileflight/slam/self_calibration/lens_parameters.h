#pragma once

// A lens as the unknowns of a bundle adjustment.

#include <Eigen/Core>
#include <string>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::self_calibration {

/// Names the lens models that can be estimated.
enum class LensModel {
  kPinhole,  ///< imaging::PinholeRadtan: k1 k2 p1 p2
  kFisheye   ///< imaging::KannalaBrandt: k1 k2 k3 k4
};

/// "pinhole" or "fisheye".
std::string to_string(LensModel model);

/// States the number of unknowns of a lens: ln fx, ln (fy / fx), cx, cy, four of the distortion, readout. Principal
/// point in pixels; readout: seconds from the first row to the last.
inline constexpr int kLensUnknowns = 9;
using LensVector = Eigen::Matrix<double, kLensUnknowns, 1>;
enum LensUnknown { kLogFocal = 0, kLogAspect = 1, kCenterX = 2, kCenterY = 3, kFirstDistortion = 4, kReadout = 8 };

/// Holds a lens for images of a size.
struct LensParameters {
  LensModel model = LensModel::kPinhole;
  int width = 0, height = 0;
  LensVector values = LensVector::Zero();

  imaging::Camera camera() const;
  imaging::Calibration calibration() const;
  /// Returns the lens for images that are larger by a factor: pixel centres are at integers.
  LensParameters resized(double factor, int new_width, int new_height) const;
};

/// Returns a lens without distortion of the given horizontal field of view, degrees: a pinhole, or an equidistant lens.
LensParameters undistorted_lens(LensModel model, int width, int height, double horizontal_fov_deg);

/// Returns a calibration as a lens of a model, for images of a size. Distortion and principal point are kept if the
/// model is the calibration's; else the horizontal field of view is (at most 150 degrees of a pinhole).
LensParameters lens_of(const imaging::Calibration& calibration, LensModel model, int width, int height);

/// Returns the model of a calibration: that of its own lens, or for other lenses the fisheye beyond 110 degrees.
LensModel model_of(const imaging::Camera& camera);

/// Returns the derivative of a pixel by the unknowns; zero by the readout. `point`: in the camera frame; `pixel`: its
/// projection.
Eigen::Matrix<double, 2, kLensUnknowns> pixel_by_lens(const LensParameters& lens, const geometry::Vec3& point,
                                                      const geometry::Vec2& pixel);

/// Returns the standard deviations of the unknowns before any image is seen, for lenses of cameras that fly. Chosen by
/// hand, wide: squares of 0.3 %, a centre within 1.5 % of the width.
LensVector usual_spread(LensModel model, int width, double focal_sigma);

}  // namespace tileflight::self_calibration
