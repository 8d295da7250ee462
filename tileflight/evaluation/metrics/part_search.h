#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::metrics {

/// Distance to the nearest object within a radius (inclusive), or nullopt.
using NearestWithin = std::function<std::optional<double>(const geometry::Vec3& query, double radius_m)>;

/// Exact nearest distance of every point, infinity beyond `radius_m`; in parallel, along geometry::morton_order(). Each
/// search is bounded by the previous point's distance plus the distance between both points (triangle inequality); the
/// result does not depend on the bound.
std::vector<double> nearest_distances(const std::vector<geometry::Vec3>& points, double radius_m,
                                      const NearestWithin& nearest);

/// Searches one part for what is nearest to the asked points (by index, neighbours in space together) and lowers their
/// reach to its distance.
using PartSearch = std::function<void(std::size_t part, const std::vector<std::uint32_t>& asked)>;

/// Searches what is nearest to each point where that comes in parts, of which one at a time is held in memory.
/// `bounds`: what each part lies within; empty: the part holds nothing. `reach_m`: of each point, the distance beyond
/// which nothing is wanted, at most infinity. A part is visited at most twice: by the points next to it, and, after
/// all of these, by the points whose reach is then not below their distance to its bounds. Nothing that is nearer than,
/// or as near as, what a point has found is left out, so that the result does not depend on the parts. The points must
/// be finite.
void search_parts(const std::vector<geometry::Vec3>& points, const std::vector<geometry::Box3>& bounds,
                  std::vector<double>& reach_m, const PartSearch& search);

/// Lowers the reach of the asked points to the distance of what is nearest, in parallel; each search is bounded by the
/// reach, and as in nearest_distances().
void lower_reach(const std::vector<geometry::Vec3>& points, const std::vector<std::uint32_t>& asked,
                 const NearestWithin& nearest, std::vector<double>& reach_m);

}  // namespace tileflight::metrics
