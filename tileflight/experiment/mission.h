#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/experiment/fly.h"
#include "tileflight/experiment/sensor_files.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/sensors/fly.h"
#include "tileflight/tiles/viewing.h"

namespace tileflight::experiment {

/// One flight, ready to be filmed.
struct Mission {
  imaging::Calibration calibration;
  geometry::Trajectory frames;    ///< a pose for each picture
  sensors::PoseFunction pose_at;  ///< in between, for the shutter
  sensors::FlightOptions options;
  std::shared_ptr<SensorFiles> sensor_files;  ///< beside the camera
  nlohmann::json vehicle;                     ///< how the vehicle flew; null without
};

/// The flight that the settings' files describe. Throws InputError.
Mission plan_mission(const RenderSettings& settings, const Progress& progress);

/// What every picture looks at, and the camera a whole exposure and readout before and after it: as many eyes for each
/// frame.
std::vector<tiles::Eye> eyes_of(const Mission& mission);

}  // namespace tileflight::experiment
