#pragma once

#include <optional>
#include <vector>

#include "tileflight/core/alignment/align_map.h"

namespace tileflight::alignment {

/// Spreads `count` points evenly over a mesh's area; none for a mesh without area. Deterministic.
std::vector<geometry::Vec3> sample_surface_evenly(const geometry::TriangleMesh& mesh, std::size_t count);

/// Aligns a map to ground truth without telemetry or a start. The best candidates of register_globally() are refined by
/// the coarse steps; the one with the highest closeness (relative to the map's own size) is finished as in align_map().
/// `map_up`: direction against gravity in the map's frame, if known (the target's is z). A fixed scale means one target
/// metre per map unit. A note reports another place that fits nearly as well. Throws InputError as align_map() does,
/// and if no place is found.
MapAlignment align_map_globally(const geometry::PointCloud& map, const std::optional<geometry::Vec3>& map_up,
                                const AlignmentTarget& target, const AlignMapOptions& options = {},
                                const Progress& progress = {});

/// Computes the closeness of an aligned map to the target relative to its own size (MapAlignment::closeness): mean of
/// max(0, 1 - (distance / tolerance)^2); the tolerance is a hundredth of the aligned map's size.
double compute_closeness(const geometry::PointCloud& map, const geometry::Sim3& T_local_map,
                         const AlignmentTarget& target);

}  // namespace tileflight::alignment
