#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::imaging {

/// Largest image side accepted in a calibration, pixels.
inline constexpr int kMaxImageSide_px = 1 << 20;

/// Largest calibration file that is read, bytes.
inline constexpr std::uintmax_t kMaxCalibrationBytes = std::uintmax_t{1} << 20;

/// Lens parameters of a calibration file, as plain numbers.
struct LensParameters {
  std::string distortion;              ///< radtan, rational, equidistant, fov or none
  std::span<const double> intrinsics;  ///< fx fy cx cy, pixels
  std::span<const double> distortion_coefficients;
  int width = 0, height = 0;
  std::string model = "pinhole";                ///< pinhole, omni, ds, eucm (Kalibr's names) or equirectangular
  std::span<const double> sphere_parameters{};  ///< of omni: xi; ds: xi alpha; eucm: alpha beta
};

/// Number of parameters that precede fx fy cx cy in a model. Throws InputError(file, cause) for an unknown name.
std::size_t sphere_parameter_count(const std::string& file, const std::string& model);

/// Builds the camera after checking counts, finiteness and signs. Throws InputError(file, cause).
Camera make_camera(const std::string& file, const LensParameters& numbers);

/// A distortion model by name and coefficients, as in LensParameters.
struct NamedDistortion {
  std::string name;
  std::vector<double> coefficients;
};

/// Interprets OpenCV's coefficients k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]: radtan if those beyond the
/// fourth are 0, otherwise rational; an empty list means zeros. Throws InputError(where, cause, cure) for another
/// count, or for a tilted sensor.
NamedDistortion parse_opencv_distortion(const std::string& where, std::span<const double> coefficients);

/// Shortest text that reads back as the same number.
std::string format_number(double value);
/// "[1, 2.5]", a list in YAML, of numbers by format_number().
std::string number_list(std::span<const double> values);
std::string number_list(std::initializer_list<double> values);

}  // namespace tileflight::imaging
