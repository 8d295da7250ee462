#include "tileflight/experiment/score.h"

#include <algorithm>

#include "tileflight/alignment/align_map.h"
#include "tileflight/alignment/transform_file.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/evaluation/distances.h"
#include "tileflight/evaluation/evaluate.h"
#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/metrics_file.h"
#include "tileflight/experiment/extract.h"
#include "tileflight/experiment/positions.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/prism.h"
#include "tileflight/ground_truth/extract.h"
#include "tileflight/ground_truth/surface_samples.h"
#include "tileflight/imaging/camera.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Poses from which visibility is asked: neighbouring frames see nearly the same.
constexpr std::size_t kVisibilityPoses = 200;

geometry::PointCloud read_map(const fs::path& map) {
  const fs::path file = fs::is_directory(map) ? map / "map.ply" : map;
  geometry::PointCloud cloud = geometry::read_cloud(file);
  if (cloud.empty()) throw InputError(file.string(), "the map has no points; there is nothing to score");
  return cloud;
}

/// What the truth is of: a box, or the polygons in it.
struct TrueRegion {
  geometry::Box3 box;
  std::vector<geometry::PolygonArea> polygons;

  bool is_over_or_under(const geometry::Vec3& p) const {
    const auto beside = [&](int axis) { return p[axis] < box.min()[axis] || p[axis] > box.max()[axis]; };
    if (beside(0) || beside(1)) return false;
    return polygons.empty() ||
           std::ranges::any_of(polygons, [&](const auto& polygon) { return polygon.contains(p.head<2>()); });
  }
};

geometry::PolygonArea polygon_of(const json& polygon) {
  std::vector<geometry::Ring> rings;
  for (const json& ring : polygon.at("rings")) {
    rings.emplace_back();
    for (const json& corner : ring) rings.back().emplace_back(corner.at(0).get<double>(), corner.at(1).get<double>());
  }
  return geometry::PolygonArea(std::move(rings));
}

TrueRegion region_of(const json& extract_json) {
  const json& region = extract_json.at("region");
  const std::vector<double> center = region.at("center");
  const std::vector<double> size = region.at("size");
  const geometry::Vec3 c(center[0], center[1], center[2]);
  const geometry::Vec3 half = 0.5 * geometry::Vec3(size[0], size[1], size[2]);
  TrueRegion out{{c - half, c + half}, {}};
  for (const json& polygon : region.value("polygons", json::array())) out.polygons.push_back(polygon_of(polygon));
  return out;
}

/// Points over the scored region; what lies beside it has no truth to be measured against.
geometry::PointCloud over_region(const geometry::PointCloud& cloud, const TrueRegion& region) {
  std::vector<bool> keep(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) keep[i] = region.is_over_or_under(cloud.positions[i]);
  return geometry::filtered(cloud, keep);
}

geometry::Trajectory thinned(const geometry::Trajectory& trajectory) {
  const std::size_t step = std::max<std::size_t>(1, trajectory.size() / kVisibilityPoses);
  geometry::Trajectory result;
  for (std::size_t i = 0; i < trajectory.size(); i += step) result.poses.push_back(trajectory.poses[i]);
  return result;
}

/// The true poses where they are known, else the estimated ones, moved to the local frame.
geometry::Trajectory local_poses(const MapInputs& map, const geometry::Sim3& T_local_map) {
  if (!map.truth_trajectory.empty()) return geometry::read_tum(map.truth_trajectory);
  if (!map.trajectory.empty()) return geometry::transformed(T_local_map, geometry::read_tum(map.trajectory));
  return {};
}

/// Even samples of the true surface that the flight's camera saw; all of them where it is not known where or what the
/// camera was.
geometry::PointCloud seen_samples(const MapInputs& map, const ground_truth::GroundTruth& truth,
                                  const TrueRegion& region, const geometry::Sim3& T_local_map, double per_m2) {
  const geometry::PointCloud samples =
      over_region(ground_truth::sample_surface(truth.mesh, region.box, per_m2), region);
  const geometry::Trajectory poses = thinned(local_poses(map, T_local_map));
  if (map.camera.empty() || poses.empty()) return samples;
  const scene::Scene scene({imaging::TexturedMesh{.mesh = truth.mesh}});
  const imaging::Camera camera = imaging::read_calibration(map.camera).camera;
  return geometry::filtered(samples, ground_truth::seen_by_camera(scene, samples, poses, camera));
}

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

/// Estimated and true poses, where they are known.
struct Poses {
  geometry::Trajectory estimate, truth;
  bool both() const { return !estimate.empty() && !truth.empty(); }
};

Poses read_poses(const MapInputs& map) {
  Poses poses;
  if (!map.trajectory.empty()) poses.estimate = geometry::read_tum(map.trajectory);
  if (!map.truth_trajectory.empty()) poses.truth = geometry::read_tum(map.truth_trajectory);
  return poses;
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

/// map to local for distances to the exact surface: `to_surface` where align() left it, else the transform itself.
geometry::Sim3 surface_transform(const fs::path& transform_file) {
  const json all = json::parse(geometry::read_text(transform_file), nullptr, false);
  if (all.is_object() && all.contains("to_surface")) {
    return alignment::alignment_from_json(all["to_surface"], transform_file.string() + ": to_surface").T_target_source;
  }
  return alignment::read_transform(transform_file).T_target_source;
}

}  // namespace

MapInputs map_inputs(const fs::path& map, const fs::path& dataset_folder) {
  const auto if_there = [](const fs::path& file) { return fs::exists(file) ? file : fs::path(); };
  MapInputs inputs{.map = map};
  if (fs::is_directory(map)) inputs.trajectory = if_there(map / "trajectory.txt");
  if (dataset_folder.empty()) return inputs;
  if (!fs::is_directory(dataset_folder)) throw InputError(dataset_folder.string(), "no such dataset folder");
  inputs.truth_trajectory = if_there(dataset_folder / "groundtruth.txt");
  inputs.gps = if_there(dataset_folder / "gps.csv");
  inputs.camera = if_there(dataset_folder / "camera.yaml");
  return inputs;
}

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

nlohmann::json evaluate(const MapInputs& map, const fs::path& truth_folder, const fs::path& transform_file,
                        const EvaluationSettings& settings, const fs::path& out, const Progress& progress) {
  const geometry::PointCloud cloud = read_map(map.map);
  const geometry::PointCloud aligned =
      geometry::transformed(alignment::read_transform(transform_file).T_target_source, cloud);
  const geometry::Sim3 T_surface_map = surface_transform(transform_file);
  const geometry::PointCloud on_surface = geometry::transformed(T_surface_map, cloud);
  const TrueRegion region = region_of(read_extract_json(truth_folder));
  const ground_truth::GroundTruth truth = ground_truth::read_ground_truth(truth_folder);
  const Poses poses = read_poses(map);

  evaluation::Score score =
      evaluation::evaluate(aligned,
                           {.voxel_centers = &truth.voxel_centers,
                            .surface_samples = &truth.surface,
                            .estimate = poses.both() ? &poses.estimate : nullptr,
                            .truth = poses.both() ? &poses.truth : nullptr},
                           {.map = {.cutoff_m = settings.cutoff_m}, .thresholds_m = settings.thresholds_m}, progress);
  // A truth of points alone has cells, and no surface. A point beside the region has no surface to be measured against:
  // it counts as a map point, but not as an error.
  if (!truth.mesh.triangles.empty()) {
    const geometry::PointCloud seen =
        seen_samples(map, truth, region, T_surface_map, settings.completeness_samples_per_m2);
    score.metrics.surface =
        evaluation::evaluate_surface(over_region(on_surface, region), truth.mesh, seen, settings.thresholds_m);
    score.errors.surface_m = evaluation::surface_distances(on_surface, geometry::TriangleIndex(truth.mesh));
  }
  evaluation::write_metrics(out, score.metrics, score.errors);
  return evaluation::to_json(score.metrics);
}

nlohmann::json compare(const fs::path& simulated, const fs::path& real, const EvaluationSettings& settings,
                       std::uint64_t seed) {
  const evaluation::MetricsFile a = evaluation::read_metrics(simulated);
  const evaluation::MetricsFile b = evaluation::read_metrics(real);
  return evaluation::to_json(
      evaluation::compare(a.voxel, b.voxel, {.equivalence_margin_m = settings.equivalence_margin_m, .seed = seed}));
}

}  // namespace tileflight::experiment
