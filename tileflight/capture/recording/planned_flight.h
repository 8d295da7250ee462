#pragma once

#include <cstddef>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/events/event_options.h"
#include "tileflight/capture/recording/frame_groups.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/recording/sensor_recorder.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/jobs/balanced_ranges.h"
#include "tileflight/tiles/tileset/view_criteria.h"
#include "tileflight/world/scene/traffic.h"

namespace tileflight::recording {

/// The images and events that one camera takes on a flight. Times are those of its own clock: `timeshift_s` later on
/// the flight's.
struct PlannedCamera {
  std::string name;  ///< empty: the flight's only one
  imaging::Calibration calibration;
  geometry::SE3 T_body_camera;
  double timeshift_s = 0.0;
  geometry::Trajectory frames;   ///< the camera's pose for each image
  render::PoseFunction pose_at;  ///< the camera's pose at any time, for the shutter
  render::FlightRenderOptions options;
  std::optional<events::EventOptions> events;  ///< nullopt: it is no event camera
};

/// A flight that is ready to be rendered: as planned for its first camera, and for the others of a rig.
struct PlannedFlight : PlannedCamera {
  std::vector<PlannedCamera> others;
  geometry::Trajectory body;  ///< the body's poses at the flight's instants; with a single camera, its own
  std::shared_ptr<SensorRecorder> sensor_recorder;  ///< sensors besides the cameras
  std::shared_ptr<const scene::Traffic> traffic;    ///< cars and people; null without any
  nlohmann::json vehicle;                           ///< flight record of the vehicle; null without one
  std::vector<std::string> notes;                   ///< what was assumed where a mission file leaves it open

  std::size_t camera_count() const { return 1 + others.size(); }
  const PlannedCamera& camera(std::size_t i) const { return i == 0 ? *this : others[i - 1]; }
  std::size_t image_count() const;  ///< of all cameras
  bool has_events() const;          ///< whether any is an event camera
  PlannedCamera& camera(std::size_t i) { return i == 0 ? *this : others[i - 1]; }
};

/// An image of a flight: which camera's, and its number among that camera's frames.
struct ImageId {
  std::size_t camera = 0;
  std::size_t frame = 0;
};

/// All images of a flight in the order of their times on its clock, those of one instant in the order of their cameras.
/// Images are numbered by it; with a single camera their numbers are those of its frames. Any range of images is a
/// range of each camera's frames.
class ImageOrder {
 public:
  explicit ImageOrder(const PlannedFlight& mission);

  std::size_t count() const { return images_.size(); }
  const ImageId& operator[](std::size_t image) const { return images_[image]; }
  /// Number of a camera's frame.
  std::size_t number_of(std::size_t camera, std::size_t frame) const { return numbers_[camera][frame]; }
  /// The frames of a camera among the images from `begin` up to, not including, `end`.
  jobs::IndexRange frames_between(std::size_t camera, std::size_t begin, std::size_t end) const;

 private:
  std::vector<ImageId> images_;
  std::vector<std::vector<std::size_t>> numbers_;  ///< by camera and frame
};

/// Plans the flight of the settings' files. Throws InputError.
PlannedFlight plan_flight(const RenderSettings& settings, const Progress& progress);

/// Returns the view cones of every image of one camera, including its motion during exposure and readout, and to the
/// next frame if it is an event camera. Each frame has the same number of cones. They widen to all directions if
/// something beside the images needs the tiles there.
std::vector<tileset::ViewCone> flight_view_cones(const PlannedFlight& mission, std::size_t camera = 0);

/// Divides the frames of the first camera into groups that each have their own selection of tiles (frame_groups.h).
/// Without a pixel error there is one group: the cut of a region is the same for all frames.
FrameGroups group_flight_frames(const PlannedFlight& mission, const RenderSettings& settings);

/// Divides images, given the positions of the body, as group_flight_frames() does.
FrameGroups group_images(const std::vector<geometry::Vec3>& body_positions, const PlannedFlight& mission,
                         const RenderSettings& settings);

/// Returns the position of the body at a camera's frame.
geometry::Vec3 body_position(const PlannedCamera& camera, std::size_t frame);

}  // namespace tileflight::recording
