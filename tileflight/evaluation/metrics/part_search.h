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

/// Returns the exact nearest distance of every point, infinity beyond `radius_m`. Runs in parallel along
/// geometry::morton_order(). Each search is bounded by the previous point's distance plus the distance between both
/// points (triangle inequality); the result does not depend on the bound.
std::vector<double> nearest_distances(const std::vector<geometry::Vec3>& points, double radius_m,
                                      const NearestWithin& nearest);

/// Searches one part for the objects nearest to the asked points (by index, neighbours in space together) and lowers
/// the reach of these points to the distance.
using PartSearch = std::function<void(std::size_t part, const std::vector<std::uint32_t>& asked)>;

/// Finds the nearest object of each point when the objects come in parts, of which one at a time is held in memory.
/// `bounds`: box around each part; empty: the part holds nothing. `reach_m`: for each point, the distance beyond which
/// no object matters, at most infinity. A part is visited at most twice: first by the points next to it, then, after
/// all of these, by the points whose reach is at least their distance to its bounds. No object that is as near as the
/// one found is skipped, so the result does not depend on the parts. The points must be finite.
void search_parts(const std::vector<geometry::Vec3>& points, const std::vector<geometry::Box3>& bounds,
                  std::vector<double>& reach_m, const PartSearch& search);

/// Lowers the reach of the asked points to the distance of the nearest object, in parallel. Each search is bounded by
/// the reach, and as in nearest_distances().
void lower_reach(const std::vector<geometry::Vec3>& points, const std::vector<std::uint32_t>& asked,
                 const NearestWithin& nearest, std::vector<double>& reach_m);

}  // namespace tileflight::metrics
