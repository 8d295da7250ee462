#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/alignment/robust_kernel.h"
#include "tileflight/alignment/umeyama.h"
#include "tileflight/alignment/uncertainty.h"
#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/nearest.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/triangle_index.h"

namespace tileflight::alignment {

enum class IcpMethod {
  kPointToPoint,
  kPointToPlane,
  kPointToMesh,
  kGeneralized  ///< plane to plane: both sides' normals count (Segal, Haehnel and Thrun, RSS 2009)
};

enum class IcpStop {
  kRmsChange,  ///< the paper's: the RMS changes by less than rms_change_m from one iteration to the next
  kStep        ///< the next step would move the points by less than step_m
};

/// Defaults are the paper's settings: radius 1 m, RMS change 1e-5, at most 1500 iterations.
struct IcpOptions {
  IcpMethod method = IcpMethod::kPointToPoint;
  double radius_m = 1.0;       ///< correspondences farther apart do not count
  double rms_change_m = 1e-5;  ///< stop when the RMS changes by less from one iteration to the next
  int max_iterations = 1500;
  ScaleMode scale = ScaleMode::kEstimated;
  double max_scale_change = 1.2;  ///< scale stays within [1/x, x] of the start, so that it cannot collapse
  double scale_center = 0.0;      ///< the bound is about this scale instead; 0: the start's
  std::vector<geometry::Box3>
      regions{};  ///< source points (after the initial transform) inside any of these take part; none: all

  RobustKernel kernel{};    ///< of the residuals; none is least squares within the radius
  double kept_share = 1.0;  ///< share of the points, nearest first, that counts in each iteration; the rest is trimmed
                            ///< (Chetverikov et al., ICPR 2002)

  IcpStop stop = IcpStop::kRmsChange;
  double step_m = 1e-4;     ///< of IcpStop::kStep, and of the check of the other rule (RMS over the points)
  bool accelerate = false;  ///< Anderson acceleration: the same fixed point in a fraction of the iterations
  double false_stop_m =
      0.01;            ///< a stop by RMS change is false if going on would move the points farther than this (RMS)
  bool go_on = false;  ///< after a false stop the result is where going on leads, instead of where the rule stopped
};

/// Settings that reach the fixed point, and fast: accelerated, stopped by step length. Same radius and scale bound as
/// the paper's.
IcpOptions converging_icp();

/// How firmly the matched surface holds the transform.
struct Constraint {
  std::vector<double>
      strengths;  ///< eigenvalues of the mean point-to-plane Hessian, increasing: 6, or 7 with scale; at most about 1
  geometry::Vec7 weakest = geometry::Vec7::Zero();  ///< motion of the first: translation, rotation about the points'
                                                    ///< centre, stretch; unit length
  std::string weakest_motion;    ///< in words, e.g. "scale"; of open motions, all: "rotation about y, scale"
  bool well_constrained = true;  ///< no strength below 0.003 (a plane has zeros)
};

struct AlignmentResult {
  geometry::Sim3 T_target_source;
  double rmse_m = 0.0;   ///< of the method's residuals over the correspondences at the end
  double fitness = 0.0;  ///< share of the source points that take part which have a correspondence
  std::size_t correspondences = 0;
  int iterations = 0;
  bool converged = false;  ///< stop rule met before max_iterations, and checked: no large step is left (see note)
  std::string method;
  std::string note;  ///< empty, or one line: what is doubtful about this result

  double left_to_move_m = 0.0;  ///< how far going on after a stop by RMS change moved the points (RMS); 0 if not tried
  std::size_t points = 0;       ///< source points that took part
  Constraint constraint;        ///< of the end
  std::optional<AlignmentUncertainty> uncertainty;  ///< of the end; none where a motion is open
};

/// Besl and McKay, IEEE TPAMI 14(2), 1992. Throws InputError for empty or non-finite input; no correspondence within
/// the radius is a result with converged = false and a note. Point-to-plane takes the target's normals, or estimates
/// them where it has none; generalised ICP does so for the source as well.
AlignmentResult icp(const geometry::PointCloud& source, const geometry::PointCloud& target,
                    const geometry::Sim3& initial, const IcpOptions& options = {});

/// Against the triangles themselves: nearest point of the surface, with the point-to-plane step, or, if the method is
/// kGeneralized, with the triangle's and the source's normals.
AlignmentResult icp(const geometry::PointCloud& source, const geometry::TriangleIndex& target,
                    const geometry::TriangleMesh& target_mesh, const geometry::Sim3& initial,
                    const IcpOptions& options);

}  // namespace tileflight::alignment
