#pragma once

#include "tileflight/alignment/icp.h"
#include "tileflight/alignment/plane_system.h"

namespace tileflight::alignment {

/// Eigenvalues of the mean point-to-plane Hessian of matched points; Gelfand et al., 3DIM 2003, "Geometrically stable
/// sampling for the ICP algorithm". A plane leaves two translations and one rotation at zero. `with_scale` false leaves
/// the stretch out.
Constraint constraint_of(const PlaneSystem& system, std::size_t points, bool with_scale);

}  // namespace tileflight::alignment
