#pragma once

#include "tileflight/core/alignment/icp.h"
#include "tileflight/core/alignment/umeyama.h"

namespace tileflight::alignment {

/// Normal equations of sum (n . (y - q))^2 for a small similarity motion of the points y about the origin:
/// y' = y + translation + rotation x y + stretch y. The unknowns are, in this order, translation, rotation * length and
/// stretch * length, all in metres. Chen and Medioni, Image and Vision Computing 10(3), 1992.
struct PointToPlaneSystem {
  Eigen::Matrix<double, 7, 7> hessian = Eigen::Matrix<double, 7, 7>::Zero();
  geometry::Vec7 gradient = geometry::Vec7::Zero();

  void add(const geometry::Vec3& y, const geometry::Vec3& q, const geometry::Vec3& normal, double length_m,
           double weight = 1.0);
  /// Adds the term weight (y - q)^T information (y - q).
  void add(const geometry::Vec3& y, const geometry::Vec3& q, const geometry::Mat3& information, double length_m,
           double weight = 1.0);
  PointToPlaneSystem& operator+=(const PointToPlaneSystem& other);
};

/// Returns the derivative of a residual along `normal` at `y` by the seven unknowns.
geometry::Vec7 plane_jacobian(const geometry::Vec3& y, const geometry::Vec3& normal, double length_m);

/// Returns the motion that minimises the system, as a similarity to apply after the present one; the scale is bounded
/// to `range` (factors of the present scale). Unconstrained directions do not move.
geometry::Sim3 solve(const PointToPlaneSystem& system, const ScaleRange& range, double length_m);

/// Computes the eigenvalues of the mean point-to-plane Hessian of matched points; Gelfand et al., 3DIM 2003,
/// "Geometrically stable sampling for the ICP algorithm". For a plane the eigenvalues of two translations and one
/// rotation are zero. `with_scale` false excludes the scale.
Constraint analyze_constraint(const PointToPlaneSystem& system, std::size_t points, bool with_scale);

}  // namespace tileflight::alignment
