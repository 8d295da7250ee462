#include "tileflight/experiment/recognize_place.h"

#include "tileflight/alignment/gravity.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/localization/ground_direction.h"

namespace tileflight::experiment {

localization::FlightEvidence flight_evidence(const dataset::Dataset& dataset, const geometry::Trajectory& path,
                                             const geometry::PointCloud& map, const std::optional<geometry::Vec3>& up) {
  localization::FlightEvidence evidence;
  geometry::Trajectory times;
  for (const dataset::Frame& frame : dataset.frames) times.poses.push_back({frame.time_s, geometry::SE3()});
  constexpr double kSameTime_s = 1e-3;
  std::vector<std::filesystem::path> files;
  for (const auto& [pose, frame] : geometry::associate(path, times, kSameTime_s)) {
    evidence.pictures.T_map_camera.push_back(path.poses[pose].T_local_camera);
    files.push_back(dataset.frames[frame].image);
  }
  evidence.pictures.camera = dataset.calibration.camera;
  evidence.pictures.picture = [files](std::size_t k) { return imaging::read_rgb(files[k]); };
  evidence.points = map.positions;
  if (const auto known = up ? up : alignment::up_of_trajectory(path)) {
    evidence.ups = {known->normalized()};
  } else {
    for (const auto& plane : localization::ground_planes(map.positions, evidence.pictures.T_map_camera))
      evidence.ups.push_back(plane.up);
  }
  return evidence;
}

}  // namespace tileflight::experiment
