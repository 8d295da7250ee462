#pragma once

#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/localization/flight_localizer.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {

/// Returns the dataset's images with the odometry's poses and their sigmas, for localization::locate_flight(). The
/// dataset must outlive the result. Throws InputError for an unreadable trajectory or quality.csv.
localization::FlightImages flight_images(const dataset::Dataset& dataset, const MapInputs& map);

}  // namespace tileflight::scoring
