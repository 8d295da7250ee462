#pragma once

#include <optional>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/localization/flight_localizer.h"
#include "tileflight/evaluation/localization/place_recognition.h"
#include "tileflight/evaluation/registration/telemetry_estimate.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {

/// Estimates the up direction of a map from its flight's IMU: the dataset's readings, rotated into the camera
/// frame by the calibration's T_cam_imu. nullopt if there is no IMU, or if its readings do not look like gravity.
/// `path`: T_map_camera on the dataset's clock. Throws InputError for a malformed file.
std::optional<registration::UpDirection> up_from_imu(const dataset::Dataset& dataset, const geometry::Trajectory& path);

/// Returns the evidence for localization::PlaceRecognizer: the images with odometry poses (`path`: T_map_camera with
/// the images' times), the map, and candidates for the up direction. These are `up` if it is known and, unless it was
/// given by the user, the direction estimated from the camera's attitude (alignment::estimate_up_from_trajectory()) or
/// else the normals of the planes with the most points. Images are read on demand.
localization::FlightEvidence make_flight_evidence(const dataset::Dataset& dataset, const geometry::Trajectory& path,
                                                  const geometry::PointCloud& map,
                                                  const std::optional<registration::UpDirection>& up = std::nullopt);

/// Returns the dataset's images with the odometry's poses and their sigmas, for localization::locate_flight(). The
/// dataset must outlive the result. Throws InputError for an unreadable trajectory or quality.csv.
localization::FlightImages flight_images(const dataset::Dataset& dataset, const MapInputs& map);

}  // namespace tileflight::scoring
