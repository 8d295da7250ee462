#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/evaluation/registration/similarity_estimate.h"

// What the residuals of a map against a surface say of the map's transform, with errors that are correlated.

namespace tileflight::registration {

/// Scale of the robust kernel in sigmas: a residual of three sigmas has a quarter of the full weight.
inline constexpr double kSurfaceKernel = 3.0;
/// Weight rho'(z) / (2 z) and cost rho(z) of Geman and McClure's kernel; `z2`: squared residual in sigmas.
inline double kernel_weight(double z2) {
  const double ratio = z2 / (kSurfaceKernel * kSurfaceKernel);
  return 1.0 / ((1.0 + ratio) * (1.0 + ratio));
}
inline double kernel_cost(double z2) { return z2 / (1.0 + z2 / (kSurfaceKernel * kSurfaceKernel)); }

/// A point of the map that is matched to the surface.
struct SurfaceResidual {
  geometry::Vec3 y, normal;  ///< the moved point relative to the target's centre, metres; the surface's unit normal
  double residual_m = 0.0, sigma_m = 1.0;  ///< distance along the normal, and its standard deviation
};

struct SurfaceMatches {
  std::vector<SurfaceResidual> residuals;
  std::vector<std::size_t> keyframes;  ///< in which each point was seen; empty: unknown
};

/// About the target's centre, in metres: rotation and scale are multiplied by a length (alignment::plane_jacobian()).
struct ShapeInformation {
  Mat7 hessian = Mat7::Zero();           ///< of the surface alone
  Mat7 gradient_scatter = Mat7::Zero();  ///< covariance of the gradient
};

/// Gradients of neighbours (in one cube of a grid) and of points of one keyframe are correlated: their scatter is that
/// of the sums over cubes and over keyframes, less that over both (Cameron, Gelbach and Miller 2011, eq. 2.11).
/// `length_m`: the RMS extent of the map.
ShapeInformation shape_information(const SurfaceMatches& matches, double length_m);

/// Inverse of the sandwich covariance H^-1 S H^-1 (Liang and Zeger 1986), limited to the points' own information H, for
/// motions as of motion_between(). Directions that the surface leaves open have none.
Mat7 sandwich_information(const ShapeInformation& information, double length_m);

/// Factor by which the points' own information is overstated: mean over the directions of scatter over Hessian, at
/// least 1.
double information_discount(const ShapeInformation& information);

}  // namespace tileflight::registration
