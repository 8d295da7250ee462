#include "tileflight/evaluation/scoring/seen_surface.h"

#include <algorithm>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

/// Number of poses used to compute visibility: neighbouring frames see nearly the same.
constexpr std::size_t kVisibilityPoses = 200;

geometry::Trajectory subsample_poses(const geometry::Trajectory& trajectory) {
  const std::size_t step = std::max<std::size_t>(1, trajectory.size() / kVisibilityPoses);
  geometry::Trajectory result;
  for (std::size_t i = 0; i < trajectory.size(); i += step) result.poses.push_back(trajectory.poses[i]);
  return result;
}

/// The true poses if known, else the estimated ones, in the local frame.
geometry::Trajectory local_poses(const MapInputs& map, const geometry::Sim3& T_local_map) {
  if (!map.truth_trajectory.empty()) return read_true_poses(map.truth_trajectory);
  if (!map.trajectory.empty()) return geometry::transformed(T_local_map, geometry::read_tum(map.trajectory));
  return {};
}

}  // namespace

geometry::PointCloud sample_seen_surface(const MapInputs& map, TruthSurface& surface, const place::TruthRegion& region,
                                         const geometry::Sim3& T_local_map, double per_m2) {
  const geometry::Trajectory poses = subsample_poses(local_poses(map, T_local_map));
  if (map.camera.empty() || poses.empty()) return surface.sample(region, per_m2);
  return surface.sample_seen(region, per_m2, poses, read_flight_camera(map.camera));
}

fs::path seen_surface_file(const fs::path& metrics_json) { return metrics_json.parent_path() / "seen.ply"; }

void write_seen_surface(const fs::path& metrics_json, geometry::PointCloud seen, const std::vector<double>& seen_m) {
  seen.scalars["map_distance"] = {seen_m.begin(), seen_m.end()};
  geometry::write_cloud(seen_surface_file(metrics_json), seen);
}

metrics::SeenSurface read_seen_surface(const fs::path& seen_ply) {
  geometry::PointCloud cloud = geometry::read_cloud(seen_ply);
  const auto distances = cloud.scalars.find("map_distance");
  if (distances == cloud.scalars.end()) throw InputError(seen_ply.string(), "has no property 'map_distance'");
  return {std::move(cloud.positions), {distances->second.begin(), distances->second.end()}};
}

}  // namespace tileflight::scoring
