#pragma once

#include <cstddef>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/actors/traffic.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/render/render_flight.h"
#include "tileflight/survey/frame_groups.h"
#include "tileflight/survey/render_stage.h"
#include "tileflight/survey/sensor_recorder.h"
#include "tileflight/tiles/view_criteria.h"

namespace tileflight::survey {

/// A flight that is ready to be rendered.
struct PlannedFlight {
  imaging::Calibration calibration;
  geometry::Trajectory frames;   ///< a pose for each image
  render::PoseFunction pose_at;  ///< pose at any time, for the shutter
  render::FlightRenderOptions options;
  std::shared_ptr<SensorRecorder> sensor_recorder;  ///< sensors besides the camera
  std::shared_ptr<const actors::Traffic> traffic;   ///< cars and people; null without any
  nlohmann::json vehicle;                           ///< flight record of the vehicle; null without one
};

/// Plans the flight of the settings' files. Throws InputError.
PlannedFlight plan_flight(const RenderSettings& settings, const Progress& progress);

/// The view cones of every image, including the camera's motion during exposure and readout: the same number of cones
/// for each frame.
std::vector<tiles::ViewCone> flight_view_cones(const PlannedFlight& mission);

/// The same for parts of one image, `cones` being theirs in the camera's frame (tiles::view_cone_of_region).
/// Precondition: images may be divided.
std::vector<tiles::ViewCone> region_view_cones(const PlannedFlight& mission, std::size_t frame,
                                               const std::vector<tiles::ViewCone>& cones);

/// Whether a region of an image depends on the tiles in its view alone: nothing casts shadows, and no other sensor
/// needs the scene.
bool may_divide_images(const PlannedFlight& mission);

/// The frames in groups that each have their own selection of tiles (frame_groups.h). Without a pixel error they are
/// one: the cut of a region is the same for all frames, however far they fly.
FrameGroups group_flight_frames(const PlannedFlight& mission, const RenderSettings& settings);

}  // namespace tileflight::survey
