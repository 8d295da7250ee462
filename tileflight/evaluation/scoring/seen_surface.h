#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/evaluation/metrics/missed_places.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/evaluation/scoring/truth_surface.h"

namespace tileflight::scoring {

/// Returns evenly distributed samples of the true surface that the flight's camera saw; all samples if camera or poses
/// are unknown.
geometry::PointCloud sample_seen_surface(const MapInputs& map, TruthSurface& surface, const place::TruthRegion& region,
                                         const geometry::Sim3& T_local_map, double per_m2);

/// The file in which evaluate() stores the samples of the true surface seen by the flight's camera, with the scalar
/// `map_distance`: distance to the nearest map point over the region, metres.
std::filesystem::path seen_surface_file(const std::filesystem::path& metrics_json);

/// Writes the samples that the camera saw, each with its distance to the map, to seen_surface_file(). Throws
/// InputError.
void write_seen_surface(const std::filesystem::path& metrics_json, geometry::PointCloud seen,
                        const std::vector<double>& seen_m);

/// Reads the samples of seen_surface_file() with their distances to the map. Throws InputError.
metrics::SeenSurface read_seen_surface(const std::filesystem::path& seen_ply);

}  // namespace tileflight::scoring
