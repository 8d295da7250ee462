#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::tiling {

/// A flat polygon (convex or not, without holes) as triangles of its corners' indices, with the polygon's winding: ears
/// are cut off one by one (de Berg et al., Computational Geometry, section 3). `corners` - 2 triangles; where no ear
/// can be found (the outline crosses itself), the rest is a fan. Fewer than three corners give none.
std::vector<std::array<std::size_t, 3>> triangulated(std::span<const geometry::Vec3> corners);

}  // namespace tileflight::tiling
