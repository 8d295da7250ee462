#pragma once

// Registration of a map to the exact surface of the ground truth. Each point is weighted by its uncertainty (distance
// along its ray, angle across it), outliers are suppressed by a robust kernel, and other evidence (telemetry, images)
// enters as a prior with its own information. The residuals' errors are correlated, which reduces the information that
// the surface gives about the transform.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/alignment/icp.h"
#include "tileflight/evaluation/registration/observed_points.h"
#include "tileflight/evaluation/registration/similarity_estimate.h"

namespace tileflight::registration {

/// Scale of the robust kernel in sigmas: a residual of three sigmas has a quarter of the full weight.
inline constexpr double kSurfaceKernel = 3.0;
/// Returns the weight rho'(z) / (2 z) of Geman and McClure's kernel; `z2`: squared residual in sigmas.
inline double kernel_weight(double z2) {
  const double ratio = z2 / (kSurfaceKernel * kSurfaceKernel);
  return 1.0 / ((1.0 + ratio) * (1.0 + ratio));
}
/// Returns the cost rho(z) of that kernel.
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

/// Information of a surface about a transform, about the target's centre, in metres: rotation and scale are multiplied
/// by a length (alignment::plane_jacobian()).
struct ShapeInformation {
  Mat7 hessian = Mat7::Zero();           ///< of the surface alone
  Mat7 gradient_scatter = Mat7::Zero();  ///< covariance of the gradient
};

/// Returns the information of matches whose errors are correlated. Gradients of neighbours (in one cube of a grid) and
/// of points of one keyframe are correlated: their scatter is that of the sums over cubes and over keyframes, less that
/// over both (Cameron, Gelbach and Miller 2011, eq. 2.11). `length_m`: the RMS extent of the map.
ShapeInformation shape_information(const SurfaceMatches& matches, double length_m);

/// Returns the inverse of the sandwich covariance H^-1 S H^-1 (Liang and Zeger 1986), limited to the points' own
/// information H, for motions as of motion_between(). Directions that the surface leaves open have no information.
Mat7 sandwich_information(const ShapeInformation& information, double length_m);

/// Returns the factor by which the points' own information is overstated: the mean over the directions of scatter over
/// Hessian, at least 1.
double information_discount(const ShapeInformation& information);

struct SurfaceFitOptions {
  /// Largest distance of a correspondence, one value per step of the fit, coarse to fine.
  std::vector<double> radii_m = {4.0, 2.0, 1.0, 0.5};
  double surface_sigma_m = 0.01;  ///< of the truth's surface itself
  double angle_sigma_rad = 1e-3;  ///< of a point perpendicular to its ray; about half a pixel of a wide lens
  double max_scale_change = 1.3;  ///< scale stays within [1/x, x] of scale_center
  double scale_center = 0.0;      ///< 0: the start's
  alignment::ScaleMode scale = alignment::ScaleMode::kEstimated;
  std::vector<geometry::Box3>
      regions{};  ///< only points inside any of these (after the initial transform) are used; none: all
  std::optional<SimilarityEstimate> prior{};  ///< other evidence; must be near the start
  int max_iterations = 60;                    ///< per step
  double step_m = 1e-4;  ///< a step ends when an iteration would move the points by less than this (RMS)
};

struct SurfaceFit {
  geometry::Sim3 T_target_source;
  std::size_t points = 0;     ///< points used
  std::size_t matched = 0;    ///< points within the last radius
  double rmse_m = 0.0;        ///< RMS distance of the matched points to the surface
  double fitness = 0.0;       ///< matched over points
  double inlier_share = 0.0;  ///< share of points within three sigmas
  double noise_factor = 1.0;  ///< observed over stated sigma of the points (robust); all sigmas are scaled by it
  int iterations = 0;         ///< of all steps
  bool converged = false;     ///< the last step ended by its stopping rule
  double last_step_m = 0.0;
  alignment::Constraint constraint;   ///< how well the surface alone constrains the transform
  SimilarityEstimate shape_estimate;  ///< from the surface alone, at the result; accounts for correlated errors
  SimilarityEstimate estimate;        ///< from surface and prior
};

/// Fits a map to a surface by Gauss-Newton on sum rho(e / sigma) with e = n . (T p - q) for the nearest surface point q
/// with its normal n (Chen and Medioni 1992) and rho of Geman and McClure, iteratively reweighted. For a point seen
/// along the ray r from a distance d, sigma^2 = k^2 ((s d n.r)^2 + (a d)^2 (1 - (n.r)^2)) + surface^2, where the map
/// states the relative sigma s and k is found from the residuals. Points without a viewpoint share one sigma.
/// Errors of neighbouring points are correlated. Therefore the surface's information (`shape_estimate`) is reduced by a
/// cluster-robust covariance over blocks of space and over keyframes (Liang and Zeger 1986; Cameron, Gelbach and Miller
/// 2011) before it is combined with the prior. Throws InputError for empty or non-finite input.
SurfaceFit fit_to_surface(const ObservedPoints& points, const geometry::TriangleIndex& index,
                          const geometry::TriangleMesh& mesh, const geometry::Sim3& start,
                          const SurfaceFitOptions& options = {});

}  // namespace tileflight::registration
