#include "tileflight/experiment/score.h"

#include "tileflight/alignment/align_map.h"
#include "tileflight/alignment/transform_file.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/experiment/extract.h"
#include "tileflight/experiment/positions.h"
#include "tileflight/experiment/true_region.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/ground_truth/extract.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// What a map is aligned to, held together with what it points into.
struct Target {
  geometry::PointCloud cloud;
  geometry::TriangleMesh mesh;
  std::optional<geometry::TriangleIndex> index;
  std::optional<geometry::Geodetic> origin;
  std::vector<geometry::Box3> regions;  ///< over which there is truth; empty: not known

  alignment::AlignmentTarget view() const {
    return {.cloud = &cloud, .index = index ? &*index : nullptr, .mesh = index ? &mesh : nullptr};
  }
};

/// Over the region at any height: a map's points above or below the truth must be pulled in as well.
geometry::Box3 column(const geometry::Box3& box) {
  geometry::Box3 tall = box;
  tall.min().z() -= 1e6;
  tall.max().z() += 1e6;
  return tall;
}

Target read_target(const fs::path& path) {
  Target target;
  if (!fs::is_directory(path)) {
    target.cloud = geometry::read_cloud(path);
    return target;
  }
  const json about = read_extract_json(path);
  ground_truth::GroundTruth truth = ground_truth::read_ground_truth(path);
  target.cloud = std::move(truth.voxel_centers);
  target.mesh = std::move(truth.mesh);
  if (!target.mesh.triangles.empty()) target.index.emplace(target.mesh);
  target.origin = origin_of(about);
  target.regions = {column(region_of(about).box)};
  return target;
}

std::vector<alignment::PositionFix> receiver_positions(const fs::path& gps_csv, const geometry::Geodetic& origin) {
  const std::vector<dataset::GpsFix> gps = dataset::read_gps_csv(gps_csv);
  const std::vector<geometry::Vec3> positions = local_positions(gps, geometry::LocalFrame(origin));
  std::vector<alignment::PositionFix> fixes;
  for (std::size_t i = 0; i < gps.size(); ++i) {
    fixes.push_back({gps[i].time_s, positions[i], gps[i].horizontal_sigma_m, gps[i].vertical_sigma_m});
  }
  return fixes;
}

std::vector<alignment::PositionFix> true_positions(const fs::path& trajectory) {
  std::vector<alignment::PositionFix> fixes;
  for (const geometry::StampedPose& pose : geometry::read_tum(trajectory).poses) {
    fixes.push_back({pose.time_s, pose.T_local_camera.translation, 0.0, 0.0});
  }
  return fixes;
}

/// Voxel centres pull a map off the surface, by up to half a cell where the ground is level. What is measured to the
/// exact surface is therefore aligned to the surface, from where the chosen alignment ended.
alignment::AlignmentResult refined_to_surface(const geometry::PointCloud& cloud, const geometry::Sim3& T_local_map,
                                              const Target& target, const alignment::AlignMapOptions& options) {
  alignment::IcpOptions icp = alignment::converging_icp();
  icp.method = alignment::IcpMethod::kPointToMesh;
  icp.scale = options.icp.scale;
  icp.regions = options.icp.regions;
  return alignment::icp(cloud, *target.index, target.mesh, T_local_map, icp);
}

}  // namespace

nlohmann::json align(const MapInputs& map, const fs::path& target_path, const alignment::AlignMapOptions& options,
                     const fs::path& out, const Progress& progress) {
  const geometry::PointCloud cloud = read_map(map.map);
  const Target target = read_target(target_path);
  alignment::AlignMapOptions chosen = options;
  if (chosen.icp.regions.empty()) chosen.icp.regions = target.regions;

  const bool by_receiver = !map.trajectory.empty() && !map.gps.empty() && target.origin;
  const bool by_true_poses = !map.trajectory.empty() && !map.truth_trajectory.empty();
  alignment::MapAlignment aligned;
  if (by_receiver || by_true_poses) {
    // True poses are on the pictures' own clock; a receiver lags by an unknown time.
    if (!by_receiver) chosen.trajectory.estimate_time_offset = false;
    aligned = alignment::align_map(
        cloud, geometry::read_tum(map.trajectory),
        by_receiver ? receiver_positions(map.gps, *target.origin) : true_positions(map.truth_trajectory), target.view(),
        chosen, progress);
  } else {
    aligned = alignment::align_map(cloud, geometry::Sim3(), target.view(), chosen, progress);
  }
  json result = alignment::to_json(aligned);
  if (target.index) {
    result["to_surface"] =
        alignment::to_json(refined_to_surface(cloud, aligned.result.T_target_source, target, chosen));
  }
  result["start"] = by_receiver ? "receiver positions" : by_true_poses ? "true poses" : "as it is";
  geometry::write_file(out, result.dump(2) + "\n");
  return result;
}

}  // namespace tileflight::experiment
