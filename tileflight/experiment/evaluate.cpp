#include "tileflight/experiment/evaluate.h"

#include <algorithm>
#include <cmath>

#include "tileflight/alignment/normals.h"
#include "tileflight/alignment/pose_alignment.h"
#include "tileflight/alignment/region_list.h"
#include "tileflight/alignment/transform_file.h"
#include "tileflight/evaluation/distances.h"
#include "tileflight/evaluation/evaluate.h"
#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/metrics_file.h"
#include "tileflight/experiment/doubts.h"
#include "tileflight/experiment/extract.h"
#include "tileflight/experiment/true_region.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/ground_truth/extract.h"
#include "tileflight/ground_truth/surface_samples.h"
#include "tileflight/imaging/camera.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Poses from which visibility is asked: neighbouring frames see nearly the same.
constexpr std::size_t kVisibilityPoses = 200;

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

/// map to local for distances to voxel centres: `published` where align() left it (the paper's last step), else the
/// transform itself.
geometry::Sim3 published_transform(const fs::path& transform_file) {
  const json all = json::parse(geometry::read_text(transform_file), nullptr, false);
  if (all.is_object() && all.contains("published")) {
    return alignment::alignment_from_json(all["published"], transform_file.string() + ": published").T_target_source;
  }
  return alignment::read_transform(transform_file).T_target_source;
}

/// map to local for distances to the exact surface: `to_surface` where align() left it, else the transform itself.
geometry::Sim3 surface_transform(const fs::path& transform_file) {
  const json all = json::parse(geometry::read_text(transform_file), nullptr, false);
  if (all.is_object() && all.contains("to_surface")) {
    return alignment::alignment_from_json(all["to_surface"], transform_file.string() + ": to_surface").T_target_source;
  }
  return alignment::read_transform(transform_file).T_target_source;
}

std::optional<double> number_of(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
}

/// How far noise may have moved the aligned points, where the transform says it.
std::optional<double> alignment_sigma_m(const fs::path& transform_file) {
  const json all = json::parse(geometry::read_text(transform_file), nullptr, false);
  for (const char* place : {"/to_surface/uncertainty/rms_motion_sigma", "/uncertainty/rms_motion_sigma"}) {
    const json::json_pointer pointer(place);
    if (all.is_object() && all.contains(pointer) && all.at(pointer).is_number()) return all.at(pointer).get<double>();
  }
  return {};
}

/// RMS distance between the map's points as aligned and as the path puts them whose poses, turns included,
/// fit the true ones best.
std::optional<double> to_true_poses_m(const Poses& poses, const geometry::Sim3& T_local_map,
                                      const geometry::PointCloud& cloud) {
  constexpr double kSameTime_s = 0.01;
  std::vector<geometry::SE3> estimated, known;
  for (const auto& [e, t] : geometry::associate(poses.estimate, poses.truth, kSameTime_s)) {
    estimated.push_back(poses.estimate.poses[e].T_local_camera);
    known.push_back(poses.truth.poses[t].T_local_camera);
  }
  if (estimated.size() < 3) return {};
  const geometry::Sim3 T_true_map = alignment::fit_poses(estimated, known);
  double squares = 0.0;
  for (const geometry::Vec3& p : cloud.positions) squares += (T_local_map * p - T_true_map * p).squaredNorm();
  return std::sqrt(squares / static_cast<double>(cloud.size()));
}

/// The map's own normals, else those of its neighbourhoods.
evaluation::NormalConsistency normals_of(const geometry::PointCloud& aligned, const geometry::TriangleMesh& surface,
                                         const geometry::TriangleIndex& index, double within_m) {
  constexpr std::size_t kNeighbors = 16;
  if (!aligned.normals.empty()) return evaluation::normal_consistency(aligned, surface, index, within_m, 0);
  const geometry::PointCloud estimated = alignment::with_normals(aligned, kNeighbors);
  return evaluation::normal_consistency(estimated, surface, index, within_m, kNeighbors);
}

/// Everything to the exact surface. A point beside the region has no surface to be measured against: it counts as a map
/// point, but not as an error. Returns the distances of the points over the region.
std::vector<double> score_to_surface(const geometry::PointCloud& on_surface, const TrueRegion& region,
                                     const geometry::TriangleMesh& mesh, const std::vector<double>& seen_m,
                                     const EvaluationSettings& settings, evaluation::Score& score) {
  const geometry::TriangleIndex index(mesh);
  score.errors.surface_m = evaluation::surface_distances(on_surface, index);
  std::vector<double> over_region_m;
  for (std::size_t i = 0; i < on_surface.size(); ++i) {
    if (region.is_over_or_under(on_surface.positions[i])) over_region_m.push_back(score.errors.surface_m[i]);
  }
  score.metrics.surface = evaluation::score_surface(over_region_m, seen_m, settings.thresholds_m);
  score.metrics.surface->normals = normals_of(over_region(on_surface, region), mesh, index, settings.cutoff_m);
  return over_region_m;
}

/// Scores of the regions that the alignment took and left, where transform.json names any.
std::optional<evaluation::RegionScores> scores_of_regions(const fs::path& transform_file,
                                                          const geometry::PointCloud& on_surface,
                                                          const std::vector<double>& surface_m) {
  const json all = json::parse(geometry::read_text(transform_file), nullptr, false);
  if (!all.is_object() || !all.contains("regions")) return std::nullopt;
  const alignment::RegionList regions = alignment::regions_from_json(all["regions"], transform_file.string());
  return evaluation::score_regions(on_surface.positions, surface_m, regions.aligned_on, regions.held_out);
}

/// The samples that the camera saw, each with its distance to the map, beside metrics.json.
void write_seen(const fs::path& metrics_json, geometry::PointCloud seen, const std::vector<double>& seen_m) {
  seen.scalars["map_distance"] = {seen_m.begin(), seen_m.end()};
  geometry::write_cloud(seen_file(metrics_json), seen);
}

/// Everything that may make the scores wrong: of the map, its transform, the truth and the pictures, and what the scores
/// show themselves.
Doubts doubts_of_scores(const MapInputs& map, const json& about_truth, const fs::path& transform_file,
                        const evaluation::Metrics& metrics) {
  Doubts doubts = doubts_in(transform_file);
  append(doubts, doubts_of_odometry(map));
  append(doubts, doubts_of_truth(about_truth));
  append(doubts, doubts_of_dataset(map.dataset));
  constexpr double kFewNear = 0.5;
  if (metrics.surface) {
    const auto& accuracy = metrics.surface->accuracy;
    if (!accuracy.empty() && accuracy.rbegin()->second < kFewNear) {
      doubts.push_back({"only " + std::to_string(static_cast<int>(100.0 * accuracy.rbegin()->second)) +
                            " % of the map's points over the region lie within " +
                            std::to_string(accuracy.rbegin()->first).substr(0, 4) + " m of the true surface",
                        "evaluation", "likely",
                        "look at the map over the truth in the report: a wrong transform, or another place"});
    }
  }
  return doubts;
}

}  // namespace

fs::path seen_file(const fs::path& metrics_json) { return metrics_json.parent_path() / "seen.ply"; }

nlohmann::json evaluate(const MapInputs& map, const fs::path& truth_folder, const fs::path& transform_file,
                        const EvaluationSettings& settings, const fs::path& out, const Progress& progress) {
  const geometry::PointCloud cloud = read_map(map.map);
  const geometry::PointCloud aligned = geometry::transformed(published_transform(transform_file), cloud);
  const json about_truth = read_extract_json(truth_folder);
  const TrueRegion region = region_of(about_truth);
  const ground_truth::GroundTruth truth = ground_truth::read_ground_truth(truth_folder);
  const Poses poses = read_poses(map);

  evaluation::Score score =
      evaluation::evaluate(aligned,
                           {.voxel_centers = &truth.voxel_centers,
                            .surface_samples = &truth.surface,
                            .estimate = poses.both() ? &poses.estimate : nullptr,
                            .truth = poses.both() ? &poses.truth : nullptr},
                           {.map = {.cutoff_m = settings.cutoff_m}, .thresholds_m = settings.thresholds_m}, progress);
  score.metrics.entropy = evaluation::map_entropy(aligned, {.radius_m = settings.entropy_radius_m});
  // A truth of points alone has cells, and no surface.
  if (!truth.mesh.triangles.empty()) {
    const geometry::Sim3 T_surface_map = surface_transform(transform_file);
    const geometry::PointCloud on_surface = geometry::transformed(T_surface_map, cloud);
    const geometry::PointCloud on_region = over_region(on_surface, region);
    if (on_region.empty()) {
      throw InputError(map.map.string(), "no map point lies over the region of " + truth_folder.string() +
                                             ": the alignment is wrong, or map and truth are of different places");
    }
    const geometry::PointCloud seen =
        seen_samples(map, truth, region, T_surface_map, settings.completeness_samples_per_m2);
    std::vector<double> seen_m;
    if (!seen.empty()) seen_m = evaluation::cloud_distances(seen, on_region, "surface samples", "map");
    const std::vector<double> surface_m = score_to_surface(on_surface, region, truth.mesh, seen_m, settings, score);
    score.metrics.regions = scores_of_regions(transform_file, on_surface, score.errors.surface_m);
    score.metrics.error_budget =
        evaluation::error_budget({.floor_rmse_m = score.metrics.map.quantization_floor.rmse,
                                  .geometric_error_m = number_of(about_truth, "geometric_error_max"),
                                  .alignment_sigma_m = alignment_sigma_m(transform_file),
                                  .to_true_poses_m = to_true_poses_m(poses, T_surface_map, cloud),
                                  .surface_m = surface_m,
                                  .within_m = settings.cutoff_m});
    write_seen(out, seen, seen_m);
  }
  score.metrics.doubts = doubts_of_scores(map, about_truth, transform_file, score.metrics);
  evaluation::write_metrics(out, score.metrics, score.errors);
  return evaluation::to_json(score.metrics);
}

nlohmann::json compare(const std::vector<fs::path>& simulated, const std::vector<fs::path>& real,
                       const EvaluationSettings& settings, std::uint64_t seed) {
  const auto distances_of = [](const std::vector<fs::path>& files) {
    std::vector<evaluation::KeptDistances> runs;
    for (const fs::path& file : files) runs.push_back(evaluation::read_metrics(file).voxel);
    return runs;
  };
  return evaluation::to_json(
      evaluation::compare_runs(distances_of(simulated), distances_of(real),
                               {.equivalence_margin_m = settings.equivalence_margin_m, .seed = seed}));
}

}  // namespace tileflight::experiment
