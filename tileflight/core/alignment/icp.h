#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/alignment/uncertainty.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/triangle_index.h"

namespace tileflight::alignment {

enum class KernelType {
  kNone,          ///< least squares
  kHuber,         ///< quadratic up to the scale, linear beyond (Huber, Annals of Mathematical Statistics 35(1), 1964)
  kTukey,         ///< zero weight beyond the scale (Beaton and Tukey's biweight, Technometrics 16(2), 1974)
  kGemanMcClure,  ///< saturates towards the scale's square (Geman and McClure, Bull. Int. Stat. Inst. 52(4), 1987)
};

/// rho(r) of a robust M-estimator and its weight rho'(r) / (2 r) in iteratively reweighted least squares; rho is close
/// to r^2 for small r, so costs are in square metres.
struct RobustKernel {
  KernelType kind = KernelType::kNone;
  double scale_m = 0.3;  ///< scale parameter of the kernel

  double weight(double squared_m2) const {
    const double ratio = squared_m2 / (scale_m * scale_m);
    switch (kind) {
      case KernelType::kNone:
        return 1.0;
      case KernelType::kHuber:
        return ratio <= 1.0 ? 1.0 : 1.0 / std::sqrt(ratio);
      case KernelType::kTukey:
        return ratio >= 1.0 ? 0.0 : (1.0 - ratio) * (1.0 - ratio);
      case KernelType::kGemanMcClure:
        return 1.0 / ((1.0 + ratio) * (1.0 + ratio));
    }
    return 1.0;
  }

  double cost_m2(double squared_m2) const {
    const double unit_m2 = scale_m * scale_m;
    const double ratio = squared_m2 / unit_m2;
    switch (kind) {
      case KernelType::kNone:
        return squared_m2;
      case KernelType::kHuber:
        return ratio <= 1.0 ? squared_m2 : unit_m2 * (2.0 * std::sqrt(ratio) - 1.0);
      case KernelType::kTukey:
        return unit_m2 / 3.0 * (ratio >= 1.0 ? 1.0 : 1.0 - std::pow(1.0 - ratio, 3));
      case KernelType::kGemanMcClure:
        return squared_m2 / (1.0 + ratio);
    }
    return squared_m2;
  }
};

enum class IcpMethod {
  kPointToPoint,
  kPointToPlane,
  kPointToMesh,
  kGeneralized  ///< plane to plane, with the normals of both clouds (Segal, Haehnel and Thrun, RSS 2009)
};

enum class IcpStop {
  kRmsChange,  ///< the paper's rule: the RMS changes by less than rms_change_m from one iteration to the next
  kStep        ///< the next step would move the points by less than step_m
};

/// Defaults are the paper's settings: radius 1 m, RMS change 1e-5, at most 1500 iterations.
struct IcpOptions {
  IcpMethod method = IcpMethod::kPointToPoint;
  double radius_m = 1.0;       ///< largest distance of a correspondence
  double rms_change_m = 1e-5;  ///< for IcpStop::kRmsChange
  int max_iterations = 1500;
  ScaleMode scale = ScaleMode::kEstimated;
  double max_scale_change = 1.2;  ///< scale is bounded to [1/x, x] times the start's, so that it cannot collapse
  double scale_center = 0.0;      ///< centre of the scale bound; 0: the start's scale
  std::vector<geometry::Box3>
      regions{};  ///< only source points inside any of these (after the initial transform) are used; none: all

  RobustKernel kernel{};    ///< of the residuals; kNone is least squares within the radius
  double kept_share = 1.0;  ///< share of the points, nearest first, used in each iteration; the rest is trimmed
                            ///< (Chetverikov et al., ICPR 2002)

  IcpStop stop = IcpStop::kRmsChange;
  double step_m = 1e-4;     ///< for IcpStop::kStep and for the check of a stop by RMS change (RMS over the points)
  bool accelerate = false;  ///< Anderson acceleration: the same fixed point in a fraction of the iterations
  double false_stop_m =
      0.01;  ///< a stop by RMS change is false if further iterations would move the points farther than this (RMS)
  bool continue_after_false_stop =
      false;  ///< after a false stop, return the converged result instead of the one at the stop
};

/// Returns settings that reach the fixed point quickly: accelerated, stopped by step length. Radius and scale bound are
/// the paper's.
IcpOptions converging_icp_options();

/// Describes how well the matched surface constrains the transform.
struct Constraint {
  std::vector<double>
      eigenvalues;  ///< eigenvalues of the mean point-to-plane Hessian, increasing: 6, or 7 with scale; at most about 1
  geometry::Vec7 weakest_direction = geometry::Vec7::Zero();  ///< eigenvector of the smallest one: translation,
                                                              ///< rotation about the points' centre, scale; unit length
  std::string weakest_motion;    ///< in words, e.g. "scale"; lists all unconstrained motions: "rotation about y, scale"
  bool well_constrained = true;  ///< no eigenvalue below 0.003 (a plane has zeros)
};

struct IcpResult {
  geometry::Sim3 T_target_source;
  double rmse_m = 0.0;   ///< RMS of the method's residuals over the final correspondences
  double fitness = 0.0;  ///< share of the used source points with a correspondence
  std::size_t correspondences = 0;
  int iterations = 0;
  bool converged = false;  ///< stopping rule met before max_iterations, and confirmed: no large step remains (see note)
  std::string method;
  std::string note;  ///< warning about this result, one line; empty: none

  double remaining_motion_m = 0.0;  ///< RMS distance by which further iterations after a stop by RMS change moved the
                                    ///< points; 0 if not tried
  std::size_t points = 0;           ///< source points used
  Constraint constraint;            ///< of the end
  std::optional<AlignmentUncertainty> uncertainty;  ///< of the final transform; none if a motion is unconstrained
};

/// Aligns a cloud to another one by iterated closest points (Besl and McKay, IEEE TPAMI 14(2), 1992). Throws InputError
/// for empty or non-finite input; if no correspondence lies within the radius, the result has converged = false and a
/// note. Point-to-plane uses the target's normals, or estimates them if there are none; generalised ICP does the same
/// for the source.
IcpResult icp(const geometry::PointCloud& source, const geometry::PointCloud& target, const geometry::Sim3& initial,
              const IcpOptions& options = {});

/// Aligns a cloud to a triangle mesh: nearest points of the surface with the point-to-plane step or, for kGeneralized,
/// with the triangle's and the source's normals.
IcpResult icp(const geometry::PointCloud& source, const geometry::TriangleIndex& target,
              const geometry::TriangleMesh& target_mesh, const geometry::Sim3& initial, const IcpOptions& options);

}  // namespace tileflight::alignment
