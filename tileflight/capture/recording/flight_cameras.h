#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/events/event_options.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::recording {

/// A camera mounted on the flying body. The body's axes are those of a camera that looks along the path's orientation:
/// x right, y down, z forward.
struct MountedCamera {
  std::string name;  ///< empty: the only camera of a flight, which is the body itself
  imaging::Calibration calibration;
  geometry::SE3 T_body_camera;
  std::optional<double> fps;  ///< of its own, from the flight's start on; nullopt: the flight's frames
  double offset_s = 0.0;      ///< its exposures are centred this much later than the flight's instants
  /// Its clock is this much behind the body's: an image stamped t is exposed at t + timeshift_s (Kalibr's
  /// timeshift_cam_imu).
  double timeshift_s = 0.0;
  std::optional<render::ImageFormation> degrade;  ///< its own degradations; nullopt: the flight's
  std::optional<events::EventOptions> events{};   ///< of an event camera with the same lens; nullopt: it is none
};

/// Reads the cameras of a FLIGHT file: that of `camera`, or those of `cameras` (docs/rigs.md), which is a Kalibr
/// camchain or a list whose entries have the keys name, camera, camera_id, resolution, T_body_camera | position with
/// yaw_deg, pitch_deg and roll_deg, fps, offset_s, degrade, events (for `camera`, a key beside it). A mission file
/// in place of it has the camera that its survey was planned for, else a pinhole of 1280 x 720 pixels and 70 degrees;
/// the calibration's notes say which. The settings' camera replaces that of `camera`, their image size that of each.
/// T_cam_imu of the cameras after the first follow from the first one's. Throws InputError (file, line, key).
std::vector<MountedCamera> read_flight_cameras(const RenderedFlightConfig& flight);

/// Reads the cameras of a rig that was flown: those of a Kalibr camchain, or of `cameras` of a FLIGHT file (whose other
/// keys are left alone). Throws InputError (file, line, key).
std::vector<MountedCamera> read_rig_cameras(const std::filesystem::path& file);

}  // namespace tileflight::recording
