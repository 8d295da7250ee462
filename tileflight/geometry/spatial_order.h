#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::geometry {

/// Indices of the points along a Morton curve (Morton 1966) through their bounds, so that neighbours in the list are
/// neighbours in space: what is asked or stored in this order is found in the cache. The points must be finite, and
/// fewer than 2^32.
std::vector<std::uint32_t> spatial_order(const std::vector<Vec3>& points);

/// `count` of the points at even steps along spatial_order(), in its order: each stands for as many of its neighbours.
/// All of them, in their own order, where they are no more. The same points give the same choice.
std::vector<std::uint32_t> evenly_chosen(const std::vector<Vec3>& points, std::size_t count);

}  // namespace tileflight::geometry
