#include "tileflight/scoring/evaluate.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "tileflight/alignment/normals.h"
#include "tileflight/alignment/pose_alignment.h"
#include "tileflight/alignment/region_list.h"
#include "tileflight/alignment/transform_file.h"
#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/evaluation/distances.h"
#include "tileflight/evaluation/evaluate.h"
#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/metrics_file.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/morton_order.h"
#include "tileflight/geometry/nearest.h"
#include "tileflight/ground_truth/truth_folder.h"
#include "tileflight/place/extract.h"
#include "tileflight/place/truth_region.h"
#include "tileflight/scoring/doubts.h"
#include "tileflight/scoring/points_on_actors.h"
#include "tileflight/scoring/truth_surface.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

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

/// Evenly distributed samples of the true surface that the flight's camera saw; all samples if camera or poses are
/// unknown.
geometry::PointCloud sample_seen_surface(const MapInputs& map, TruthSurface& surface, const place::TruthRegion& region,
                                         const geometry::Sim3& T_local_map, double per_m2) {
  const geometry::Trajectory poses = subsample_poses(local_poses(map, T_local_map));
  if (map.camera.empty() || poses.empty()) return surface.sample(region, per_m2);
  return surface.sample_seen(region, per_m2, poses, read_flight_camera(map.camera));
}

/// Estimated and true poses, if known.
struct TrajectoryPair {
  geometry::Trajectory estimate, truth;
  bool has_both() const { return !estimate.empty() && !truth.empty(); }
};

TrajectoryPair read_poses(const MapInputs& map) {
  TrajectoryPair poses;
  if (!map.trajectory.empty()) poses.estimate = geometry::read_tum(map.trajectory);
  if (!map.truth_trajectory.empty()) poses.truth = read_true_poses(map.truth_trajectory);
  return poses;
}

/// map to local: the transform that align() stored under `key`, else the transform itself. `published` (the paper's
/// last step) is for distances to voxel centres, `to_surface` for those to the exact surface.
geometry::Sim3 read_transform_of(const fs::path& transform_file, const std::string& key) {
  const json all = json::parse(base::read_text(transform_file), nullptr, false);
  if (all.is_object() && all.contains(key))
    return alignment::alignment_from_json(all[key], transform_file.string() + ": " + key).T_target_source;
  return alignment::read_transform(transform_file).T_target_source;
}

std::optional<double> number_of(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
}

/// Standard deviation of the aligned points due to noise, if the transform file states it.
std::optional<double> alignment_sigma_m(const fs::path& transform_file) {
  const json all = json::parse(base::read_text(transform_file), nullptr, false);
  for (const char* place : {"/to_surface/uncertainty/rms_motion_sigma", "/uncertainty/rms_motion_sigma"}) {
    const json::json_pointer pointer(place);
    if (all.is_object() && all.contains(pointer) && all.at(pointer).is_number()) return all.at(pointer).get<double>();
  }
  return {};
}

/// RMS distance between the map's points as aligned and the points placed by the similarity that best fits the path's
/// poses, including rotations, to the true ones.
std::optional<double> distance_to_true_poses_m(const TrajectoryPair& poses, const geometry::Sim3& T_local_map,
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

/// Drops everything but positions and normals.
geometry::PointCloud positions_and_normals(const geometry::PointCloud& cloud) {
  return {cloud.positions, cloud.normals, {}, {}};
}

/// Points of a map at which its normals are compared with the surface's: all, or evenly chosen ones of a large map.
std::vector<std::uint32_t> choose_for_normals(const geometry::PointCloud& map) {
  constexpr std::size_t kMostPoints = 200000;
  return geometry::sample_evenly(map.positions, kMostPoints);
}

/// The map's own normals at the chosen points, else normals estimated from neighbourhoods, against those of the nearest
/// triangles. `points`: index of the map's points.
evaluation::NormalConsistency evaluate_normals(const geometry::PointCloud& map, const geometry::NearestIndex& points,
                                               const std::vector<std::uint32_t>& chosen,
                                               const std::vector<geometry::Vec3>& nearest, double within_m) {
  constexpr std::size_t kNeighbors = 16;
  const bool own = !map.normals.empty();
  geometry::PointCloud asked;
  asked.positions.resize(chosen.size());
  asked.normals.resize(chosen.size());
  tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t k) {
    const geometry::Vec3& p = asked.positions[k] = map.positions[chosen[k]];
    asked.normals[k] =
        own ? map.normals[chosen[k]] : alignment::estimate_normal(map.positions, points, p, kNeighbors).cast<float>();
  });
  evaluation::NormalConsistency result = evaluation::normal_consistency(asked, nearest, within_m, own ? 0 : kNeighbors);
  result.points = map.size();
  return result;
}

/// Scores of the regions used for the alignment and of those held out, if transform.json lists any.
std::optional<evaluation::RegionScores> evaluate_regions(const fs::path& transform_file,
                                                         const geometry::PointCloud& on_surface,
                                                         const std::vector<double>& surface_m) {
  const json all = json::parse(base::read_text(transform_file), nullptr, false);
  if (!all.is_object() || !all.contains("regions")) return std::nullopt;
  const alignment::RegionList regions = alignment::regions_from_json(all["regions"], transform_file.string());
  return evaluation::score_regions(on_surface.positions, surface_m, regions.aligned_on, regions.held_out);
}

/// Writes the samples that the camera saw, each with its distance to the map, beside metrics.json.
void write_seen_surface(const fs::path& metrics_json, geometry::PointCloud seen, const std::vector<double>& seen_m) {
  seen.scalars["map_distance"] = {seen_m.begin(), seen_m.end()};
  geometry::write_cloud(seen_surface_file(metrics_json), seen);
}

/// Quantization floor measured by `extract` on its surface samples. nullopt for a folder of an older version, or if the
/// cut-off is within its distances.
std::optional<evaluation::DistanceStatistics> recorded_floor(const json& extract_json, double cutoff_m) {
  const json floor = extract_json.value("quantization_floor", json());
  if (!floor.is_object() || !floor.contains("max") || !(floor["max"].get<double>() <= cutoff_m)) return std::nullopt;
  return evaluation::DistanceStatistics{floor.at("count"), floor.at("mean"), floor.at("std"), floor.at("median"),
                                        floor.at("rmse")};
}

/// A ground truth folder and its metadata.
struct Truth {
  json extract_json;  ///< extract.json
  place::TruthRegion region;
  ground_truth::TruthFolder folder;
};

Truth read_truth(const fs::path& folder) {
  json about = place::read_extract_json(folder);
  const place::TruthRegion region = place::region_from_json(about);
  return {std::move(about), region, ground_truth::TruthFolder(folder)};
}

/// The map's points over the region. Outside it there is no reference surface: such points count as map points, but not
/// as errors.
struct RegionPart {
  std::vector<bool> is_over;           ///< for all of the map's points
  std::vector<std::uint32_t> numbers;  ///< of those that are
  geometry::PointCloud points;         ///< those, unless all are

  /// `map`: the cloud of which this is the part.
  const geometry::PointCloud& points_of(const geometry::PointCloud& map) const {
    return numbers.size() == map.size() ? map : points;
  }
};

/// Throws InputError if no point is over the region.
RegionPart select_over_region(const geometry::PointCloud& on_surface, const Truth& truth, const MapInputs& map) {
  RegionPart part{.is_over = std::vector<bool>(on_surface.size())};
  for (std::size_t i = 0; i < on_surface.size(); ++i) {
    part.is_over[i] = truth.region.contains_horizontally(on_surface.positions[i]);
    if (part.is_over[i]) part.numbers.push_back(static_cast<std::uint32_t>(i));
  }
  if (part.numbers.empty()) {
    throw InputError(map.map.string(), "no map point lies over the region of " + truth.folder.folder().string() +
                                           ": the alignment is wrong, or map and truth show different places");
  }
  if (part.numbers.size() < on_surface.size()) part.points = geometry::filter_points(on_surface, part.is_over);
  return part;
}

template <typename T>
std::vector<T> chosen_of(const std::vector<T>& values, const std::vector<std::uint32_t>& numbers) {
  std::vector<T> chosen(numbers.size());
  for (std::size_t k = 0; k < numbers.size(); ++k) chosen[k] = values[numbers[k]];
  return chosen;
}

evaluation::VoxelWassersteinOptions wasserstein_options(const EvaluationSettings& settings) {
  return {.voxel_m = settings.wasserstein_voxel_m,
          .min_points = static_cast<std::size_t>(settings.wasserstein_min_points)};
}

/// The floor that `extract` recorded, else measured again on its samples of the surface.
evaluation::DistanceStatistics quantization_floor(const Truth& truth, double cutoff_m) {
  if (const auto recorded = recorded_floor(truth.extract_json, cutoff_m)) return *recorded;
  const geometry::PointCloud samples = truth.folder.read_surface_samples();
  if (samples.empty()) return {};
  return evaluation::compute_quantization_floor(distances_to_voxel_centers(samples, truth.folder, "surface samples"),
                                                cutoff_m);
}

/// Scores without a surface: the paper's metric, the path, and the map's entropy. The cloud, in the map's frame, is
/// moved into the score's errors; `index` becomes the index of its aligned points.
evaluation::MapEvaluation score_without_surface(geometry::PointCloud cloud, const geometry::Sim3& T_local_map,
                                                const Truth& truth, const TrajectoryPair& poses,
                                                const EvaluationSettings& settings, const Progress& progress,
                                                std::optional<geometry::NearestIndex>& index) {
  cloud = geometry::transformed(T_local_map, std::move(cloud));
  report_progress(progress, 0, 4, "distances to voxel centres");
  std::vector<double> voxel_m = distances_to_voxel_centers(cloud, truth.folder, "map");
  evaluation::MapEvaluation score =
      evaluation::evaluate(std::move(cloud),
                           {.estimate = poses.has_both() ? &poses.estimate : nullptr,
                            .truth = poses.has_both() ? &poses.truth : nullptr,
                            .floor = quantization_floor(truth, settings.cutoff_m),
                            .voxel_m = std::move(voxel_m)},
                           {.map = {.cutoff_m = settings.cutoff_m}, .thresholds_m = settings.thresholds_m}, progress);
  index.emplace(score.errors.aligned_map.positions);
  score.metrics.entropy =
      evaluation::map_entropy(score.errors.aligned_map, *index, {.radius_m = settings.entropy_radius_m});
  return score;
}

/// All doubts about the scores: those of the map, its transform, the truth and the images, and those that the scores
/// show.
Doubts score_doubts(const MapInputs& map, const json& about_truth, const fs::path& transform_file,
                    const EvaluationSettings& settings, const evaluation::Metrics& metrics) {
  Doubts doubts = read_doubts(transform_file);
  append_distinct(doubts, odometry_doubts(map));
  append_distinct(doubts, truth_doubts(about_truth));
  append_distinct(doubts, dataset_doubts(map.dataset));
  if (!metrics.surface) {
    doubts.push_back({"the ground truth has no exact surface: distances to its voxel centres have a floor of " +
                          std::to_string(metrics.map.quantization_floor.mean).substr(0, 4) +
                          " m, which hides differences between good maps",
                      "truth", "possible", "extract from meshes, or with smaller voxels"});
  }
  constexpr double kFewNear = 0.5;
  if (metrics.surface) {
    const auto& accuracy = metrics.surface->accuracy;
    if (!accuracy.empty() && accuracy.rbegin()->second < kFewNear) {
      doubts.push_back(
          {"only " + std::to_string(static_cast<int>(100.0 * accuracy.rbegin()->second)) +
               " % of the map's points over the region lie within " +
               std::to_string(accuracy.rbegin()->first).substr(0, 4) + " m of the true surface",
           "evaluation", "likely",
           "check the map over the truth in the report: the transform may be wrong, or the place another"});
    }
  }
  if (metrics.moving) append_distinct(doubts, moving_doubts(*metrics.moving, settings.share_margin));
  return doubts;
}

}  // namespace

fs::path moving_points_file(const fs::path& metrics_json) { return metrics_json.parent_path() / "moving.ply"; }

fs::path seen_surface_file(const fs::path& metrics_json) { return metrics_json.parent_path() / "seen.ply"; }

nlohmann::json evaluate(const MapInputs& map, const fs::path& truth_folder, const fs::path& transform_file,
                        const EvaluationSettings& settings, const fs::path& out, const Progress& progress) {
  geometry::PointCloud cloud = read_map(map.map);
  const geometry::Sim3 T_published_map = read_transform_of(transform_file, "published");
  const geometry::Sim3 T_surface_map = read_transform_of(transform_file, "to_surface");
  const Truth truth = read_truth(truth_folder);
  const TrajectoryPair poses = read_poses(map);
  const std::optional<PointsOnActors> on_actors = find_points_on_actors(map, cloud, T_surface_map);
  ApartPoints apart;
  if (on_actors && on_actors->count() > 0) {
    apart = measure_apart(take_points_on_actors(*on_actors, map, cloud), T_published_map, T_surface_map, truth.folder,
                          truth.region);
  }
  const std::optional<double> path_m = distance_to_true_poses_m(poses, T_surface_map, cloud);
  const geometry::PointCloud on_surface = geometry::transformed(T_surface_map, positions_and_normals(cloud));

  std::optional<geometry::NearestIndex> index;
  evaluation::MapEvaluation score =
      score_without_surface(std::move(cloud), T_published_map, truth, poses, settings, progress, index);
  evaluation::Metrics& metrics = score.metrics;
  std::optional<std::vector<double>> static_m;
  // A truth of points alone has cells but no surface.
  if (truth.folder.has_mesh()) {
    RegionPart part = select_over_region(on_surface, truth, map);
    const geometry::PointCloud& over = part.points_of(on_surface);
    const std::vector<std::uint32_t> chosen = choose_for_normals(over);
    TruthSurface surface(truth.folder);
    SurfaceMatch match = surface.match(on_surface, chosen_of(part.numbers, chosen), settings.cutoff_m);
    score.errors.surface_m = std::move(match.distances_m);
    metrics.regions = evaluate_regions(transform_file, on_surface, score.errors.surface_m);
    const std::vector<double> surface_m = chosen_of(score.errors.surface_m, part.numbers);
    if (over.positions != score.errors.aligned_map.positions) index.emplace(over.positions);

    const geometry::PointCloud seen =
        sample_seen_surface(map, surface, truth.region, T_surface_map, settings.completeness_samples_per_m2);
    std::vector<double> seen_m;
    if (!seen.empty()) seen_m = evaluation::cloud_distances(seen, *index, "surface samples");
    metrics.surface = evaluation::score_surface(surface_m, seen_m, settings.thresholds_m);
    metrics.surface->normals = evaluate_normals(over, *index, chosen, match.directions, settings.cutoff_m);
    if (!seen.empty()) metrics.wasserstein = evaluation::voxel_wasserstein(over, seen, wasserstein_options(settings));
    metrics.error_budget =
        evaluation::error_budget({.floor_rmse_m = metrics.map.quantization_floor.rmse,
                                  .geometric_error_m = number_of(truth.extract_json, "geometric_error_max"),
                                  .alignment_sigma_m = alignment_sigma_m(transform_file),
                                  .rms_to_true_poses_m = path_m,
                                  .surface_m = surface_m,
                                  .within_m = settings.cutoff_m});
    score.errors.over_region = std::move(part.is_over);
    write_seen_surface(out, seen, seen_m);
    static_m = surface_m;
  } else {
    metrics.wasserstein = evaluation::voxel_wasserstein(score.errors.aligned_map, truth.folder.read_surface_samples(),
                                                        wasserstein_options(settings));
  }
  if (on_actors) metrics.moving = score_apart(*on_actors, apart, score.errors.voxel_m, static_m, settings.cutoff_m);
  metrics.doubts = score_doubts(map, truth.extract_json, transform_file, settings, metrics);
  write_apart_points(moving_points_file(out), apart, settings.cutoff_m);
  evaluation::write_metrics(out, metrics, std::move(score.errors));
  return evaluation::to_json(metrics);
}

evaluation::SeenSurface read_seen_surface(const fs::path& seen_ply) {
  geometry::PointCloud cloud = geometry::read_cloud(seen_ply);
  const auto distances = cloud.scalars.find("map_distance");
  if (distances == cloud.scalars.end()) throw InputError(seen_ply.string(), "has no property 'map_distance'");
  return {std::move(cloud.positions), {distances->second.begin(), distances->second.end()}};
}

}  // namespace tileflight::scoring
