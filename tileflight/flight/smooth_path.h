#pragma once

#include <span>

#include "tileflight/flight/b_spline.h"
#include "tileflight/flight/path.h"
#include "tileflight/flight/rotation_spline.h"
#include "tileflight/flight/smoothing.h"

namespace tileflight::flight {

/// What a fitted spline is made of, and how far it is from what it was fitted to.
struct SplineFit {
  double knot_spacing_s = 0.0;
  std::size_t controls = 0;
  double rms = 0.0;    ///< of what is left, on an axis: metres or radians
  double sigma = 0.0;  ///< the noise that this tells of: the same with the degrees of freedom as divisor
};

struct SmoothPath {
  Path path;
  SplineFit position, rotation;
};

/// Fewer poses than this are not smoothed.
inline constexpr std::size_t kLeastPosesToSmooth = 8;

/// The path nearest to poses by least squares: a cubic B-spline of positions and a cumulative one of rotations, each
/// over evenly spaced knots. Velocity, acceleration and turning rates are the splines' own derivatives. It begins and
/// ends with the poses. Throws InputError: fewer than kLeastPosesToSmooth poses, a spacing or noise that is not above
/// 0.
SmoothPath smooth_path(const geometry::Trajectory& trajectory, const SmoothingOptions& options = {});

/// Positions at times (strictly increasing, at least kLeastPosesToSmooth), smoothed in the same way.
struct SmoothPositions {
  BSpline<3> spline;
  SplineFit fit;
};
SmoothPositions smooth_positions(std::span<const double> times_s, std::span<const geometry::Vec3> positions_m,
                                 const SmoothingOptions& options = {});

}  // namespace tileflight::flight
