#pragma once

namespace tileflight::base {
class StrictSection;
}

#include <optional>
#include <span>
#include <string>

#include "tileflight/capture/flight_path/b_spline.h"
#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/flight_path/rotation_spline.h"

namespace tileflight::flight_path {

/// Least-squares fit of a spline to positions at their times (banded normal equations: de Boor, chapter XIV). Across
/// knots without data, control points minimize bending. `times_s` is strictly increasing and has as many entries as
/// `positions_m`. Sums are formed in a fixed order, so the result does not depend on the number of threads.
BSpline<3> fit_positions(std::span<const double> times_s, std::span<const geometry::Vec3> positions_m,
                         const UniformKnots& knots);

/// Least-squares fit of a rotation spline: Gauss–Newton on the residual angles, starting from the given rotations.
RotationSpline fit_rotations(std::span<const double> times_s, std::span<const Eigen::Quaterniond> rotations,
                             const UniformKnots& knots);

/// Strength of the smoothing of a path through measured poses. The knot spacing determines it; if it is not given, it
/// is chosen from the noise if that is known, else by generalized cross validation.
struct SmoothingOptions {
  std::optional<double> knot_spacing_s = {};      ///< for positions and rotations
  std::optional<double> position_sigma_m = {};    ///< noise of a pose on each axis
  std::optional<double> rotation_sigma_rad = {};  ///< noise of a pose about each axis
};

/// Reads the key `smooth` of a section: `none` (interpolate every pose), `auto`, or seconds between knots. Returns
/// `fallback` if the key is absent. Throws InputError for anything else.
std::optional<SmoothingOptions> read_smoothing(base::StrictSection& section,
                                               const std::optional<SmoothingOptions>& fallback);

/// Describes the smoothing in words.
std::string smoothing_text(const std::optional<SmoothingOptions>& smoothing);

/// Properties of a fitted spline and its residuals.
struct SplineFit {
  double knot_spacing_s = 0.0;
  std::size_t control_count = 0;
  double rms = 0.0;    ///< residual per axis: metres or radians
  double sigma = 0.0;  ///< estimated noise: residual per axis with the degrees of freedom as divisor
};

/// A smoothed path and the fits that it consists of.
struct SmoothPath {
  Path path;
  SplineFit position, rotation;
};

/// Smallest number of poses that are smoothed.
inline constexpr std::size_t kMinPosesToSmooth = 8;

/// Least-squares fit to poses: a cubic B-spline of positions and a cumulative one of rotations, each over evenly spaced
/// knots. Velocity, acceleration and angular rates are the splines' derivatives. The path starts and ends at the times
/// of the first and last pose. Throws InputError: fewer than kMinPosesToSmooth poses, a knot spacing or noise that is
/// not positive.
SmoothPath smooth_path(const geometry::Trajectory& trajectory, const SmoothingOptions& options = {});

/// Smoothed positions without orientations.
struct SmoothPositions {
  BSpline<3> spline;
  SplineFit fit;
};
/// Smooths positions at times (strictly increasing, at least kMinPosesToSmooth) as smooth_path() does.
SmoothPositions smooth_positions(std::span<const double> times_s, std::span<const geometry::Vec3> positions_m,
                                 const SmoothingOptions& options = {});

}  // namespace tileflight::flight_path
