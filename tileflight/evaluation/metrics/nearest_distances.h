#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::metrics {

/// Distance to the nearest object within a radius (inclusive), or nullopt.
using NearestWithin = std::function<std::optional<double>(const geometry::Vec3& query, double radius_m)>;

/// Exact nearest distance of every point, infinity beyond `radius_m`; in parallel, along geometry::morton_order(). Each
/// search is bounded by the previous point's distance plus the distance between both points (triangle inequality); the
/// result does not depend on the bound.
std::vector<double> nearest_distances(const std::vector<geometry::Vec3>& points, double radius_m,
                                      const NearestWithin& nearest);

}  // namespace tileflight::metrics
