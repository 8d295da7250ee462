#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

/// Indices of the points along a Z-order curve (Morton 1966) over their bounding box: neighbours in the list are
/// neighbours in space, so that searches find what they need in the cache. Equal cells keep the points' own order.
std::vector<std::uint32_t> spatial_order(const std::vector<geometry::Vec3>& points);

}  // namespace tileflight::alignment
