#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::evaluation {

/// Distance to the nearest of something within a radius (inclusive), or nullopt.
using NearestWithin = std::function<std::optional<double>(const geometry::Vec3& query, double radius_m)>;

/// The exact distance of every point, infinity beyond `radius_m`; in parallel, along geometry::spatial_order(). Each
/// search is bounded by the distance of the point before it and the way from there (triangle inequality); what it finds
/// does not depend on the bound.
std::vector<double> distances_along_walk(const std::vector<geometry::Vec3>& points, double radius_m,
                                         const NearestWithin& nearest);

}  // namespace tileflight::evaluation
