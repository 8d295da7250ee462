#pragma once

#include "tileflight/core/alignment/icp.h"
#include "tileflight/core/alignment/plane_system.h"

namespace tileflight::alignment {

/// Eigenvalues of the mean point-to-plane Hessian of matched points; Gelfand et al., 3DIM 2003, "Geometrically stable
/// sampling for the ICP algorithm". For a plane the eigenvalues of two translations and one rotation are zero.
/// `with_scale` false excludes the scale.
Constraint analyze_constraint(const PointToPlaneSystem& system, std::size_t points, bool with_scale);

}  // namespace tileflight::alignment
