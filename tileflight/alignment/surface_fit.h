#pragma once

// Registration of a map to the exact surface of the ground truth: each point counts by what is known of it (a distance
// along its ray, an angle across), points that fit nowhere do not pull, and what is known beside the shapes (telemetry,
// pictures) joins in with its own weight.

#include <optional>
#include <string>
#include <vector>

#include "tileflight/alignment/icp.h"
#include "tileflight/alignment/observed_points.h"
#include "tileflight/alignment/similarity_estimate.h"

namespace tileflight::alignment {

struct SurfaceFitOptions {
  /// Correspondences farther apart do not count: one step of the fit each, from coarse to fine.
  std::vector<double> radii_m = {4.0, 2.0, 1.0, 0.5};
  double surface_sigma_m = 0.01;  ///< of the truth's surface itself
  double angle_sigma_rad = 1e-3;  ///< of a point across its ray, about half a pixel of a wide lens
  double max_scale_change = 1.3;  ///< scale stays within [1/x, x] of scale_center
  double scale_center = 0.0;      ///< 0: the start's
  ScaleMode scale = ScaleMode::kEstimated;
  std::vector<geometry::Box3>
      regions{};  ///< points (after the initial transform) inside any of these take part; none: all
  std::optional<SimilarityEstimate> known{};  ///< beside the shapes; must be near the start
  int max_iterations = 60;                    ///< of each step
  double step_m = 1e-4;  ///< a step ends when the next iteration would move the points by less (RMS)
};

struct SurfaceFit {
  geometry::Sim3 T_target_source;
  std::size_t points = 0;   ///< that took part
  std::size_t matched = 0;  ///< within the last radius
  double rmse_m = 0.0;      ///< distance to the surface of the matched ones
  double fitness = 0.0;     ///< matched over points
  double agreeing = 0.0;    ///< share of the points within three of their sigmas
  double noise = 1.0;       ///< observed over stated sigma of the points (robust); all sigmas were scaled by it
  int iterations = 0;       ///< of all steps
  bool converged = false;   ///< the last step ended by its rule
  double last_step_m = 0.0;
  Constraint constraint;        ///< how firmly the surface holds it, without what is known beside
  SimilarityEstimate shapes;    ///< by the shapes alone, at the result: errors of neighbours counted once
  SimilarityEstimate estimate;  ///< all together
};

/// Gauss-Newton on sum rho(e / sigma) with e = n . (T p - q) for the nearest surface point q with its normal n (Chen
/// and Medioni 1992) and rho of Geman and McClure, iteratively reweighted; sigma^2 = k^2 ((s d n.r)^2 + (a d)^2 (1 -
/// (n.r)^2)) + surface^2 for a point seen along the ray r from a distance d, whose relative sigma s the map states. k
/// is found from the residuals. Points without a viewpoint all have one sigma. Neighbours' errors hang together: their
/// information is divided by how much (`shapes`, a cluster-robust covariance over blocks of space and over keyframes:
/// Liang and Zeger 1986; Cameron, Gelbach and Miller 2011), before what is known beside the shapes is weighed against
/// it. Throws InputError for empty or non-finite input.
SurfaceFit fit_to_surface(const ObservedPoints& points, const geometry::TriangleIndex& index,
                          const geometry::TriangleMesh& mesh, const geometry::Sim3& start,
                          const SurfaceFitOptions& options = {});

}  // namespace tileflight::alignment
