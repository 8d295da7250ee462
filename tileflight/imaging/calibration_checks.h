#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tileflight/imaging/camera.h"

namespace tileflight::imaging {

/// Largest image side that a calibration may name, pixels.
inline constexpr int kMaxImageSide_px = 1 << 20;

/// Largest calibration file that is read.
inline constexpr std::uintmax_t kMaxCalibrationBytes = std::uintmax_t{1} << 20;

/// What a calibration file says of the lens, as plain numbers.
struct LensNumbers {
  std::string distortion;         ///< radtan, rational, equidistant, fov or none
  std::span<const double> focal;  ///< fx fy cx cy, pixels
  std::span<const double> distortion_coefficients;
  int width = 0, height = 0;
  std::string model = "pinhole";     ///< pinhole, omni, ds, eucm (Kalibr's names) or equirectangular
  std::span<const double> sphere{};  ///< of omni: xi; ds: xi alpha; eucm: alpha beta
};

/// How many numbers a model has before fx fy cx cy. Throws InputError(file, cause) for a name that is not known.
std::size_t sphere_number_count(const std::string& file, const std::string& model);

/// The camera, after checking counts, finiteness and signs. Throws InputError(file, cause).
Camera checked_camera(const std::string& file, const LensNumbers& numbers);

/// A distortion by name and numbers, as LensNumbers has them.
struct NamedDistortion {
  std::string name;
  std::vector<double> numbers;
};

/// Of OpenCV's coefficients k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]: radtan where those beyond the fourth
/// are 0, else rational; none at all are zeros. Throws InputError(where, cause, cure) for another count, or for a
/// tilted sensor.
NamedDistortion distortion_of_opencv(const std::string& where, std::span<const double> coefficients);

/// Shortest text that reads back as the same number.
std::string number_text(double value);

}  // namespace tileflight::imaging
