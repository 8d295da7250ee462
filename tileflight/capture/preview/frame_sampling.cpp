#include "tileflight/capture/preview/frame_sampling.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/capture/recording/flight_cameras.h"
#include "tileflight/capture/vehicle/flight_plan.h"

namespace tileflight::preview {

FrameSampling sample_frames(const CoverageSettings& settings) {
  const vehicle::FlightPlan plan = vehicle::read_flight_plan(settings.flight);
  recording::RenderedFlightConfig flight;
  flight.flight = settings.flight;
  const recording::MountedCamera camera = recording::read_flight_cameras(flight).front();  // of a rig, the first
  FrameSampling watch{camera.calibration.camera, vehicle::frame_poses(plan), {}};
  for (geometry::StampedPose& pose : watch.trajectory.poses)
    pose.T_local_camera = pose.T_local_camera * camera.T_body_camera;
  const std::size_t all = watch.trajectory.size();
  if (all == 0) throw InputError(settings.flight.string(), "has no frames");
  const std::size_t count = std::min<std::size_t>(all, static_cast<std::size_t>(settings.frames));
  for (std::size_t i = 0; i < count; ++i)
    watch.frames.push_back(count == 1 ? 0 : (i * (all - 1) + (count - 1) / 2) / (count - 1));
  return watch;
}

imaging::Camera scale_to_width(const imaging::Camera& camera, int width) {
  if (width >= camera.width()) return camera;
  const double scale = static_cast<double>(width) / camera.width();
  return camera.scaled_to(width, std::max(1, static_cast<int>(std::lround(scale * camera.height()))));
}

}  // namespace tileflight::preview
