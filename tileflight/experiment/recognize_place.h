#pragma once

#include <optional>
#include <vector>

#include "tileflight/alignment/evidence.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/localization/place_recognition.h"

namespace tileflight::experiment {

/// What a flight shows of its place, for localization::PlaceRecognizer: its pictures where odometry has their pose
/// (`path`: T_map_camera with the pictures' times), its map, and what may be up there: `up` where it is known, and
/// unless it was given, as the camera was carried (alignment::up_of_trajectory()), else across the planes that most
/// points lie on. The pictures are read when they are asked for.
localization::FlightEvidence flight_evidence(const dataset::Dataset& dataset, const geometry::Trajectory& path,
                                             const geometry::PointCloud& map,
                                             const std::optional<alignment::UpDirection>& up = std::nullopt);

}  // namespace tileflight::experiment
