#include "tileflight/experiment/evaluate.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

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
#include "tileflight/geometry/nearest.h"
#include "tileflight/geometry/spatial_order.h"
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

/// The triangles that meet the box, with all vertices.
geometry::TriangleMesh part_near(const geometry::TriangleMesh& mesh, const geometry::Box3& box) {
  geometry::TriangleMesh part{mesh.vertices, {}};
  for (const geometry::Triangle& t : mesh.triangles) {
    geometry::Box3 around;
    for (const std::uint32_t corner : t) around.extend(mesh.vertices[corner]);
    if (box.intersects(around)) part.triangles.push_back(t);
  }
  return part;
}

/// Even samples of the true surface that the flight's camera saw; all of them where it is not known where or what the
/// camera was. Of a large place only what is in the camera's reach is sampled and stands in its way.
geometry::PointCloud seen_samples(const MapInputs& map, const geometry::TriangleMesh& mesh, const TrueRegion& region,
                                  const geometry::Sim3& T_local_map, double per_m2) {
  const geometry::Trajectory poses = thinned(local_poses(map, T_local_map));
  if (map.camera.empty() || poses.empty())
    return over_region(ground_truth::sample_surface(mesh, region.box, per_m2), region);
  const geometry::Box3 reach = ground_truth::reach_of(poses);
  const geometry::PointCloud samples =
      over_region(ground_truth::sample_surface_near(mesh, region.box, reach, per_m2), region);
  imaging::TexturedMesh in_reach{.mesh = part_near(mesh, reach)};
  if (in_reach.mesh.triangles.empty()) return {};
  const scene::Scene scene({std::move(in_reach)}, geometry::bounds(mesh).center());
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

/// Positions and normals alone.
geometry::PointCloud shape_of(const geometry::PointCloud& cloud) { return {cloud.positions, cloud.normals, {}, {}}; }

/// The map's own normals, else those of its neighbourhoods, of all points or of evenly chosen ones of a large map.
/// `points`: the index of the map's.
evaluation::NormalConsistency normals_of(const geometry::PointCloud& map, const geometry::NearestIndex& points,
                                         const geometry::TriangleMesh& surface, const geometry::TriangleIndex& index,
                                         double within_m) {
  constexpr std::size_t kNeighbors = 16, kMostPoints = 200000;
  const bool own = !map.normals.empty();
  const std::vector<std::uint32_t> chosen = geometry::evenly_chosen(map.positions, kMostPoints);
  geometry::PointCloud asked;
  asked.positions.resize(chosen.size());
  asked.normals.resize(chosen.size());
  tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t k) {
    const geometry::Vec3& p = asked.positions[k] = map.positions[chosen[k]];
    asked.normals[k] =
        own ? map.normals[chosen[k]] : alignment::estimate_normal(map.positions, points, p, kNeighbors).cast<float>();
  });
  evaluation::NormalConsistency result =
      evaluation::normal_consistency(asked, surface, index, within_m, own ? 0 : kNeighbors);
  result.points = map.size();
  return result;
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

/// What `extract` measured on its samples of the surface. None in a folder of an older version, or where the cut-off is
/// within its distances.
std::optional<evaluation::DistanceStatistics> known_floor(const json& extract_json, double cutoff_m) {
  const json floor = extract_json.value("quantization_floor", json());
  if (!floor.is_object() || !floor.contains("max") || !(floor["max"].get<double>() <= cutoff_m)) return std::nullopt;
  return evaluation::DistanceStatistics{floor.at("count"), floor.at("mean"), floor.at("std"), floor.at("median"),
                                        floor.at("rmse")};
}

/// A ground truth and what is known of it.
struct KnownTruth {
  fs::path folder;
  json about;  ///< extract.json
  TrueRegion region;
  ground_truth::GroundTruth parts;
};

KnownTruth read_truth(const fs::path& folder) {
  json about = read_extract_json(folder);
  const TrueRegion region = region_of(about);
  return {folder, std::move(about), region, ground_truth::read_ground_truth(folder)};
}

/// The map's points over the region. What lies beside has no surface to be measured against: it counts as a map point,
/// but not as an error.
struct OverRegion {
  std::vector<bool> is_over;  ///< of all the map's points
  geometry::PointCloud points;
  std::vector<double> surface_m;  ///< of `points`
};

/// `surface_m`: of all points. Throws InputError where none is over the region.
OverRegion part_over_region(geometry::PointCloud on_surface, const std::vector<double>& surface_m,
                            const KnownTruth& truth, const MapInputs& map) {
  OverRegion part{.is_over = std::vector<bool>(on_surface.size())};
  for (std::size_t i = 0; i < on_surface.size(); ++i) {
    part.is_over[i] = truth.region.is_over_or_under(on_surface.positions[i]);
    if (part.is_over[i]) part.surface_m.push_back(surface_m[i]);
  }
  if (part.surface_m.empty()) {
    throw InputError(map.map.string(), "no map point lies over the region of " + truth.folder.string() +
                                           ": the alignment is wrong, or map and truth are of different places");
  }
  const bool all = part.surface_m.size() == on_surface.size();
  part.points = all ? std::move(on_surface) : geometry::filtered(on_surface, part.is_over);
  return part;
}

/// The paper's part, the path's, and the map's own sharpness. The cloud, in the map's frame, goes into the score's
/// errors; `index` becomes that of its aligned points.
evaluation::Score score_without_surface(geometry::PointCloud cloud, const geometry::Sim3& T_local_map,
                                        const KnownTruth& truth, const Poses& poses, const EvaluationSettings& settings,
                                        const Progress& progress, std::optional<geometry::NearestIndex>& index) {
  const auto floor = known_floor(truth.about, settings.cutoff_m);
  const geometry::PointCloud samples =
      floor ? geometry::PointCloud() : ground_truth::read_surface_samples(truth.folder);
  evaluation::Score score =
      evaluation::evaluate(geometry::transformed(T_local_map, std::move(cloud)),
                           {.voxel_centers = &truth.parts.voxel_centers,
                            .surface_samples = &samples,
                            .estimate = poses.both() ? &poses.estimate : nullptr,
                            .truth = poses.both() ? &poses.truth : nullptr,
                            .floor = floor},
                           {.map = {.cutoff_m = settings.cutoff_m}, .thresholds_m = settings.thresholds_m}, progress);
  index.emplace(score.errors.aligned_map.positions);
  score.metrics.entropy =
      evaluation::map_entropy(score.errors.aligned_map, *index, {.radius_m = settings.entropy_radius_m});
  return score;
}

/// Everything that may make the scores wrong: of the map, its transform, the truth and the pictures, and what the
/// scores show themselves.
Doubts doubts_of_scores(const MapInputs& map, const json& about_truth, const fs::path& transform_file,
                        const evaluation::Metrics& metrics) {
  Doubts doubts = doubts_in(transform_file);
  append(doubts, doubts_of_odometry(map));
  append(doubts, doubts_of_truth(about_truth));
  append(doubts, doubts_of_dataset(map.dataset));
  if (!metrics.surface) {
    doubts.push_back({"the ground truth has no exact surface: distances to its cells' centres have a floor of " +
                          std::to_string(metrics.map.quantization_floor.mean).substr(0, 4) +
                          " m, which hides what good maps differ in",
                      "truth", "possible", "extract from meshes, or with smaller cells"});
  }
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
  geometry::PointCloud cloud = read_map(map.map);
  const geometry::Sim3 T_published_map = published_transform(transform_file);
  const geometry::Sim3 T_surface_map = surface_transform(transform_file);
  const KnownTruth truth = read_truth(truth_folder);
  const Poses poses = read_poses(map);
  const std::optional<double> path_m = to_true_poses_m(poses, T_surface_map, cloud);
  geometry::PointCloud on_surface = geometry::transformed(T_surface_map, shape_of(cloud));

  std::optional<geometry::NearestIndex> index;
  evaluation::Score score =
      score_without_surface(std::move(cloud), T_published_map, truth, poses, settings, progress, index);
  evaluation::Metrics& metrics = score.metrics;
  // A truth of points alone has cells, and no surface.
  if (const geometry::TriangleMesh& mesh = truth.parts.mesh; !mesh.triangles.empty()) {
    const geometry::TriangleIndex triangles(mesh);
    score.errors.surface_m = evaluation::surface_distances(on_surface, triangles);
    metrics.regions = scores_of_regions(transform_file, on_surface, score.errors.surface_m);
    OverRegion part = part_over_region(std::move(on_surface), score.errors.surface_m, truth, map);
    if (part.points.positions != score.errors.aligned_map.positions) index.emplace(part.points.positions);

    const geometry::PointCloud seen =
        seen_samples(map, mesh, truth.region, T_surface_map, settings.completeness_samples_per_m2);
    std::vector<double> seen_m;
    if (!seen.empty()) seen_m = evaluation::cloud_distances(seen, *index, "surface samples");
    metrics.surface = evaluation::score_surface(part.surface_m, seen_m, settings.thresholds_m);
    metrics.surface->normals = normals_of(part.points, *index, mesh, triangles, settings.cutoff_m);
    metrics.error_budget = evaluation::error_budget({.floor_rmse_m = metrics.map.quantization_floor.rmse,
                                                     .geometric_error_m = number_of(truth.about, "geometric_error_max"),
                                                     .alignment_sigma_m = alignment_sigma_m(transform_file),
                                                     .to_true_poses_m = path_m,
                                                     .surface_m = part.surface_m,
                                                     .within_m = settings.cutoff_m});
    score.errors.over_region = std::move(part.is_over);
    write_seen(out, seen, seen_m);
  }
  metrics.doubts = doubts_of_scores(map, truth.about, transform_file, metrics);
  evaluation::write_metrics(out, metrics, std::move(score.errors));
  return evaluation::to_json(metrics);
}

evaluation::SeenSurface read_seen(const fs::path& seen_ply) {
  geometry::PointCloud cloud = geometry::read_cloud(seen_ply);
  const auto distances = cloud.scalars.find("map_distance");
  if (distances == cloud.scalars.end()) throw InputError(seen_ply.string(), "has no property 'map_distance'");
  return {std::move(cloud.positions), {distances->second.begin(), distances->second.end()}};
}

}  // namespace tileflight::experiment
