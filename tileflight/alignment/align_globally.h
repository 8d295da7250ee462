#pragma once

#include <optional>
#include <vector>

#include "tileflight/alignment/align_map.h"

namespace tileflight::alignment {

/// `count` points spread evenly over a mesh's area; none for a mesh without area. Deterministic.
std::vector<geometry::Vec3> even_surface_points(const geometry::TriangleMesh& mesh, std::size_t count);

/// A map to ground truth without telemetry and without a start: the best places of register_globally(), each followed
/// by the coarse steps; the one that then lies closest, in terms of the map's own size, is gone on with as align_map()
/// does. `map_up`: the direction against gravity in the map's frame, where it is known (the target's is z). A fixed
/// scale is one target metre for each map unit. Notes say when another place fits nearly as well. Throws InputError as
/// align_map() does, and where no place is found.
MapAlignment align_map_globally(const geometry::PointCloud& map, const std::optional<geometry::Vec3>& map_up,
                                const AlignmentTarget& target, const AlignMapOptions& options = {},
                                const Progress& progress = {});

/// How closely a moved map lies on the target in terms of its own size, MapAlignment::closeness: mean of
/// 1 - (distance / tolerance)^2, not below zero, the tolerance being a hundredth of the moved map's size.
double closeness_of(const geometry::PointCloud& map, const geometry::Sim3& T_local_map, const AlignmentTarget& target);

}  // namespace tileflight::alignment
