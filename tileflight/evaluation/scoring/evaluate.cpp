#include "tileflight/evaluation/scoring/evaluate.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/alignment/regions.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/ply.h"
#include "tileflight/evaluation/metrics/distances.h"
#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/metrics/metrics_file.h"
#include "tileflight/evaluation/metrics/voxel_wasserstein.h"
#include "tileflight/evaluation/scoring/align_result.h"
#include "tileflight/evaluation/scoring/map_points.h"
#include "tileflight/evaluation/scoring/map_tiles.h"
#include "tileflight/evaluation/scoring/points_on_actors.h"
#include "tileflight/evaluation/scoring/receiver_truth.h"
#include "tileflight/evaluation/scoring/seen_surface.h"
#include "tileflight/evaluation/scoring/tiled_scores.h"
#include "tileflight/evaluation/scoring/truth_surface.h"
#include "tileflight/evaluation/scoring/warnings.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/place/extract.h"
#include "tileflight/world/place/extract_result.h"

namespace tileflight::scoring {

namespace fs = std::filesystem;
namespace {

/// Distances of a map's points to the true surface, metres. All empty if there is no surface.
struct SurfaceDistances {
  std::vector<double> over_m, off_m;  ///< of the points that are over the region, and of the others, in order
  std::vector<bool> is_over;          ///< of each point of the map
};

/// Splits the distances by region without a second copy.
SurfaceDistances split_by_region(std::vector<double> distances_m, std::vector<bool> is_over) {
  SurfaceDistances split{std::move(distances_m), {}, std::move(is_over)};
  std::size_t over = 0;
  for (std::size_t i = 0; i < split.is_over.size(); ++i) {
    if (split.is_over[i]) {
      split.over_m[over++] = split.over_m[i];
    } else {
      split.off_m.push_back(split.over_m[i]);
    }
  }
  split.over_m.resize(over);
  return split;
}

/// Writes the points of metrics::write_point_errors() block by block. `voxel_m`: distance of each point to the voxel
/// centres. Throws InputError.
void write_errors(const std::filesystem::path& ply, const MapPoints& map, const geometry::Sim3& T_local_map,
                  const std::vector<double>& voxel_m, const SurfaceDistances& surface, double cutoff_m) {
  std::size_t next = 0;
  auto over = surface.over_m.begin(), off = surface.off_m.begin();
  geometry::write_ply_in_blocks(ply, map.size(), [&] {
    metrics::PointErrors errors{geometry::transformed(T_local_map, map.read_block(next)), {}, {}};
    for (std::size_t i = 0; i < errors.aligned_map.size(); ++i, ++next) {
      errors.voxel_m.push_back(voxel_m[next]);
      if (surface.is_over.empty()) continue;
      errors.surface_m.push_back(surface.is_over[next] ? *over++ : *off++);
      errors.over_region.push_back(surface.is_over[next]);
    }
    return metrics::cloud_with_errors(std::move(errors), cutoff_m);
  });
}

using nlohmann::json;

/// Estimated poses, and the true ones, if known, or those that were located in the tiles.
struct TrajectoryPair {
  geometry::Trajectory estimate, truth;
  bool has_both() const { return !estimate.empty() && !truth.empty(); }
};

TrajectoryPair read_poses(const MapInputs& map) {
  TrajectoryPair poses;
  if (!map.trajectory.empty()) poses.estimate = geometry::read_tum(map.trajectory);
  if (!map.reference.empty())
    poses.truth = geometry::read_tum(map.reference / "trajectory.txt");
  else if (!map.truth_trajectory.empty())
    poses.truth = read_true_poses(map.truth_trajectory);
  return poses;
}

/// RMS distance between the map's points as aligned and the points placed by the similarity that best fits the path's
/// poses, including rotations, to the true ones or the reference.
std::optional<double> distance_to_true_poses_m(const TrajectoryPair& poses, const geometry::Sim3& T_local_map,
                                               const MapPoints& map) {
  constexpr double kSameTime_s = 0.01;
  std::vector<geometry::SE3> estimated, known;
  for (const auto& [e, t] : geometry::associate(poses.estimate, poses.truth, kSameTime_s)) {
    estimated.push_back(poses.estimate.poses[e].T_local_camera);
    known.push_back(poses.truth.poses[t].T_local_camera);
  }
  if (estimated.size() < 3) return {};
  const geometry::Sim3 T_true_map = alignment::fit_poses(estimated, known);
  double squares = 0.0;
  map.visit([&](std::size_t, const geometry::PointCloud& block) {
    for (const geometry::Vec3& p : block.positions) squares += (T_local_map * p - T_true_map * p).squaredNorm();
  });
  return std::sqrt(squares / static_cast<double>(map.size()));
}

/// Scores of the regions used for the alignment and of those held out, if there are any.
std::optional<metrics::RegionScores> score_regions(const std::optional<alignment::RegionList>& regions,
                                                   const MapPoints& map, const geometry::Sim3& T_surface_map,
                                                   const std::vector<double>& surface_m) {
  if (!regions) return std::nullopt;
  std::vector<geometry::Vec3> positions;
  map.visit([&](std::size_t, const geometry::PointCloud& block) {
    for (const geometry::Vec3& p : block.positions) positions.push_back(T_surface_map * p);
  });
  return metrics::score_regions(positions, surface_m, regions->aligned_on, regions->held_out);
}

/// Quantization floor measured by `extract` on its surface samples. nullopt if the cut-off is within its distances.
std::optional<metrics::DistanceStatistics> recorded_floor(const place::ExtractResult& extracted, double cutoff_m) {
  const auto& floor = extracted.quantization_floor;
  if (!floor || !(floor->max_m <= cutoff_m)) return std::nullopt;
  return metrics::DistanceStatistics{.count = floor->count,
                                     .mean = floor->mean_m,
                                     .std = floor->std_m.value_or(std::numeric_limits<double>::quiet_NaN()),
                                     .median = floor->median_m,
                                     .rmse = floor->rmse_m};
}

/// A ground truth folder and its metadata.
struct Truth {
  place::ExtractResult extracted;
  place::TruthRegion region;
  ground_truth::TruthFolder folder;
};

Truth read_truth(const fs::path& folder) {
  place::ExtractResult extracted = place::read_extract_json(folder);
  place::TruthRegion region = extracted.scored_region();
  return {std::move(extracted), std::move(region), ground_truth::TruthFolder(folder)};
}

/// Which of the map's points are over the region. Outside it there is no reference surface: such points count as map
/// points, but not as errors. Throws InputError if there is none.
std::vector<bool> find_over_region(const MapPoints& points, const geometry::Sim3& T_surface_map, const Truth& truth,
                                   const MapInputs& map) {
  std::vector<bool> is_over(points.size());
  points.visit([&](std::size_t first, const geometry::PointCloud& block) {
    for (std::size_t i = 0; i < block.size(); ++i)
      is_over[first + i] = truth.region.contains_horizontally(T_surface_map * block.positions[i]);
  });
  if (std::ranges::find(is_over, true) == is_over.end()) {
    throw InputError(map.map.string(), "no map point lies over the region of " + truth.folder.folder().string() +
                                           ": the alignment is wrong, or map and truth show different places");
  }
  return is_over;
}

/// The aligned points, or those over the region, one by one.
metrics::PointVisits visits_of(const MapPoints& points, const geometry::Sim3& T_local_map,
                               const std::vector<bool>* is_over) {
  return [&points, T_local_map, is_over](const auto& visit) {
    points.visit([&](std::size_t first, const geometry::PointCloud& block) {
      for (std::size_t i = 0; i < block.size(); ++i) {
        if (!is_over || (*is_over)[first + i]) visit(T_local_map * block.positions[i]);
      }
    });
  };
}

metrics::VoxelWassersteinOptions wasserstein_options(const EvaluationSettings& settings) {
  return {.voxel_m = settings.wasserstein_voxel_m,
          .min_points = static_cast<std::size_t>(settings.wasserstein_min_points)};
}

/// The floor that `extract` recorded, else measured again on its samples of the surface.
metrics::DistanceStatistics quantization_floor(const Truth& truth, double cutoff_m) {
  if (const auto recorded = recorded_floor(truth.extracted, cutoff_m)) return *recorded;
  const geometry::PointCloud samples = truth.folder.read_surface_samples();
  if (samples.empty()) return {};
  return metrics::compute_quantization_floor(VoxelCenters(truth.folder).distances(samples, "surface samples"),
                                             cutoff_m);
}

/// A map to score: without the points on its flight's actors, which are measured apart.
struct StaticMap {
  MapPoints points;
  std::optional<PointsOnActors> on_actors;
  ApartPoints apart;
};

/// Only of a map with actors all points are in memory.
StaticMap read_static_map(const MapInputs& map, const geometry::Sim3& T_published_map,
                          const geometry::Sim3& T_surface_map, const Truth& truth) {
  if (!has_actor_boxes(map)) return {MapPoints(map.map), {}, {}};
  geometry::PointCloud cloud = read_map(map.map);
  std::optional<PointsOnActors> found = find_points_on_actors(map, cloud, T_surface_map);
  ApartPoints apart;
  if (found && found->count() > 0) {
    apart = measure_apart(take_points_on_actors(*found, map, cloud), T_published_map, T_surface_map, truth.folder,
                          truth.region);
  }
  return {MapPoints(std::move(cloud)), std::move(found), std::move(apart)};
}

bool are_equal(const geometry::Sim3& a, const geometry::Sim3& b) {
  return a.scale == b.scale && a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

/// Inputs and settings of one evaluation.
struct Task {
  const MapInputs& map;
  const MapPoints& points;
  const Truth& truth;
  const TrajectoryPair& poses;
  const ScoringTransform& transform;
  const EvaluationSettings& settings;
  const fs::path& out;
};

/// Scores without a surface: the paper's metric, the path, and the map's entropy. Returns the distances to the voxel
/// centres.
std::vector<double> score_without_surface(const Task& task, const MapTiles& tiles, const Progress& progress,
                                          metrics::Metrics& metrics) {
  const EvaluationSettings& settings = task.settings;
  report_progress(progress, 0, 4, "distances to voxel centres");
  std::vector<double> voxel_m = distances_to_voxels(tiles, task.points.size(), task.truth.folder);
  metrics.map =
      metrics::score_map(voxel_m, quantization_floor(task.truth, settings.cutoff_m), {.cutoff_m = settings.cutoff_m});
  report_progress(progress, 3, 4, "trajectory");
  if (!task.poses.estimate.empty() && !task.map.reference.empty()) {
    metrics.trajectory = score_by_recorded_positions(task.poses.estimate, task.map.reference, metrics.warnings);
  } else if (task.poses.has_both()) {
    metrics.trajectory = metrics::evaluate_trajectory(task.poses.estimate, task.poses.truth);
  } else if (!task.poses.estimate.empty() && !task.map.gps.empty()) {
    metrics.trajectory = score_by_recorded_positions(task.poses.estimate, task.map.dataset, metrics.warnings);
  }
  metrics.entropy = map_entropy(tiles, {.radius_m = settings.entropy_radius_m});
  report_progress(progress, 4, 4, "scored");
  return voxel_m;
}

/// RMS of the standard deviations of the positions that the path was compared with, if these were located in the tiles.
std::optional<double> reference_sigma_m(const MapInputs& map, const std::optional<metrics::TrajectoryMetrics>& path) {
  if (map.reference.empty() || !path || !path->receiver) return std::nullopt;
  return path->receiver->expected_rmse_m;
}

/// The map's own normals at the chosen points, in the local frame; none if it has none.
std::vector<Eigen::Vector3f> own_normals(const Task& task, const std::vector<std::uint32_t>& chosen) {
  std::vector<Eigen::Vector3f> normals;
  task.points.visit([&](std::size_t first, const geometry::PointCloud& block) {
    if (block.normals.empty()) return;
    normals.resize(chosen.size());
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      if (chosen[k] >= first && chosen[k] < first + block.size()) normals[k] = block.normals[chosen[k] - first];
    }
  });
  return geometry::transformed(task.transform.T_surface_map, {{}, std::move(normals), {}, {}}).normals;
}

/// Results that need the surface, kept after its memory is freed.
struct OnSurface {
  SurfaceMatch match;
  geometry::PointCloud seen;  ///< sample_seen_surface()
};

OnSurface measure_on_surface(const Task& task, const MapTiles& tiles, const std::vector<std::uint32_t>& chosen) {
  TruthSurface surface(task.truth.folder);
  SurfaceMatch match = match_tiles(tiles, task.points.size(), surface, chosen, task.settings.cutoff_m);
  return {std::move(match), sample_seen_surface(task.map, surface, task.truth.region, task.transform.T_surface_map,
                                                task.settings.completeness_samples_per_m2)};
}

/// Scores against the exact surface, except for those of points on actors. `tiles`: the map's in T_published_map; left
/// empty.
SurfaceDistances score_against_surface(const Task& task, std::optional<MapTiles>& tiles, metrics::Metrics& metrics) {
  constexpr std::size_t kMostForNormals = 200000, kNeighbors = 16;
  const EvaluationSettings& settings = task.settings;
  const fs::path folder = task.out.parent_path();
  std::vector<bool> is_over = find_over_region(task.points, task.transform.T_surface_map, task.truth, task.map);
  if (!are_equal(task.transform.T_surface_map, task.transform.T_published_map))
    tiles.emplace(task.points, task.transform.T_surface_map, folder, MapTiles::Options{});
  std::optional<MapTiles> part;
  if (std::ranges::find(is_over, false) != is_over.end())
    part.emplace(task.points, task.transform.T_surface_map, folder, MapTiles::Options{.chosen = &is_over});
  const MapTiles& over = part ? *part : *tiles;
  const MapTiles::Points chosen = over.at(over.sample_evenly(kMostForNormals));
  OnSurface measured = measure_on_surface(task, *tiles, chosen.numbers);
  SurfaceMatch& match = measured.match;
  const geometry::PointCloud& seen = measured.seen;
  if (part) tiles.reset();
  metrics.regions = score_regions(task.transform.regions, task.points, task.transform.T_surface_map, match.distances_m);
  geometry::PointCloud asked{chosen.positions, own_normals(task, chosen.numbers), {}, {}};
  const bool own = !asked.normals.empty();
  MapNeighbors near =
      find_neighbors(over, seen.positions, own ? std::vector<geometry::Vec3>() : chosen.positions, kNeighbors);
  if (!own) asked.normals = std::move(near.normals);
  SurfaceDistances distances = split_by_region(std::move(match.distances_m), std::move(is_over));
  const std::vector<double>& over_m = distances.over_m;
  metrics.surface = metrics::score_surface(over_m, near.distances_m, settings.thresholds_m);
  metrics.surface->normals =
      metrics::normal_consistency(asked, match.directions, settings.cutoff_m, own ? 0 : kNeighbors);
  metrics.surface->normals->points = over.points();
  if (!seen.empty())
    metrics.wasserstein = metrics::voxel_wasserstein(
        visits_of(task.points, task.transform.T_surface_map, &distances.is_over), seen, wasserstein_options(settings));
  metrics.error_budget = metrics::error_budget(
      {.floor_rmse_m = metrics.map.quantization_floor.rmse,
       .geometric_error_m = task.truth.extracted.geometric_error_max_m,
       .alignment_sigma_m = task.transform.sigma_m,
       .rms_to_true_poses_m = distance_to_true_poses_m(task.poses, task.transform.T_surface_map, task.points),
       .reference_sigma_m = reference_sigma_m(task.map, metrics.trajectory),
       .surface_m = over_m,
       .within_m = settings.cutoff_m});
  write_seen_surface(task.out, seen, near.distances_m);
  tiles.reset();
  return distances;
}

/// All warnings about the scores: those of the map, its transform, the truth and the images, and those that the scores
/// show.
Warnings score_warnings(const MapInputs& map, const place::ExtractResult& extracted, const ScoringTransform& transform,
                        const EvaluationSettings& settings, const metrics::Metrics& metrics) {
  Warnings warnings = transform.warnings;
  append_distinct(warnings, metrics.warnings);
  append_distinct(warnings, odometry_warnings(map));
  append_distinct(warnings, truth_warnings(extracted));
  append_distinct(warnings, dataset_warnings(map.dataset));
  if (!metrics.surface) {
    warnings.push_back({"the ground truth has no exact surface: distances to its voxel centres have a floor of " +
                            std::to_string(metrics.map.quantization_floor.mean).substr(0, 4) +
                            " m, which hides differences between good maps",
                        "truth", Severity::kNote, "extract from meshes, or with smaller voxels"});
  }
  constexpr double kFewNear = 0.5;
  if (metrics.surface) {
    const auto& accuracy = metrics.surface->accuracy;
    if (!accuracy.empty() && accuracy.rbegin()->second < kFewNear) {
      warnings.push_back(
          {"only " + std::to_string(static_cast<int>(100.0 * accuracy.rbegin()->second)) +
               " % of the map's points over the region lie within " +
               std::to_string(accuracy.rbegin()->first).substr(0, 4) + " m of the true surface",
           "evaluation", Severity::kWarning,
           "check the map over the truth in the report: the transform may be wrong, or the place another"});
    }
  }
  if (metrics.moving) append_distinct(warnings, moving_warnings(*metrics.moving, settings.share_margin));
  return warnings;
}

}  // namespace

fs::path moving_points_file(const fs::path& metrics_json) { return metrics_json.parent_path() / "moving.ply"; }

metrics::Metrics evaluate(const MapInputs& map, const fs::path& truth_folder, const fs::path& transform_file,
                          const EvaluationSettings& settings, const fs::path& out, const Progress& progress) {
  map_file(map.map);
  const ScoringTransform transform = read_scoring_transform(transform_file);
  const geometry::Sim3& T_published_map = transform.T_published_map;
  const Truth truth = read_truth(truth_folder);
  const TrajectoryPair poses = read_poses(map);
  const StaticMap static_map = read_static_map(map, T_published_map, transform.T_surface_map, truth);
  const Task task{map, static_map.points, truth, poses, transform, settings, out};
  metrics::Metrics metrics;
  std::optional<MapTiles> tiles;
  tiles.emplace(task.points, T_published_map, out.parent_path(), MapTiles::Options{});
  const CommonPlace common = most_common_place(*tiles);
  const std::vector<double> voxel_m = score_without_surface(task, *tiles, progress, metrics);
  SurfaceDistances surface;
  // A truth of points alone has cells but no surface.
  if (truth.folder.has_mesh()) {
    surface = score_against_surface(task, tiles, metrics);
  } else {
    metrics.wasserstein =
        metrics::voxel_wasserstein(visits_of(task.points, T_published_map, nullptr),
                                   truth.folder.read_surface_samples(), wasserstein_options(settings));
  }
  if (static_map.on_actors) {
    const auto over_m = truth.folder.has_mesh() ? std::optional(surface.over_m) : std::nullopt;
    metrics.moving = score_apart(*static_map.on_actors, static_map.apart, voxel_m, over_m, settings.cutoff_m);
  }
  metrics.warnings = score_warnings(map, truth.extracted, transform, settings, metrics);
  append_distinct(metrics.warnings, common_place_warnings(common, task.points.size(), settings.share_margin));
  write_apart_points(moving_points_file(out), static_map.apart, settings.cutoff_m);
  write_errors(metrics::errors_file(out), task.points, T_published_map, voxel_m, surface, settings.cutoff_m);
  metrics::write_metrics(out, metrics);
  return metrics;
}

}  // namespace tileflight::scoring
