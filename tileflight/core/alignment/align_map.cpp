#include "tileflight/core/alignment/align_map.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment {
using geometry::PointCloud;
using geometry::Sim3;
using geometry::Vec3;
using nlohmann::json;

namespace {

IcpOptions coarse_options(const AlignMapOptions& options, const AlignmentTarget& target, std::size_t level) {
  IcpOptions coarse = converging_icp_options();
  coarse.method = options.coarse_method;
  if (coarse.method == IcpMethod::kPointToMesh && !target.index) coarse.method = IcpMethod::kPointToPoint;
  coarse.radius_m = options.coarse_radii_m[level];
  coarse.step_m = std::max(options.icp.step_m, 1e-3 * coarse.radius_m);
  coarse.max_iterations = 200;
  coarse.regions = options.icp.regions;
  coarse.scale = level == 0 ? ScaleMode::kFixed : options.icp.scale;
  coarse.max_scale_change = options.icp.max_scale_change;
  coarse.scale_center = options.icp.scale_center;
  return coarse;
}

/// Scales the start about the centre of the points used.
Sim3 scale_about_center(const Sim3& T, double factor, const PointCloud& map,
                        const std::vector<geometry::Box3>& regions) {
  Vec3 sum = Vec3::Zero();
  double n = 0.0;
  for (const Vec3& p : map.positions) {
    const Vec3 moved = T * p;
    if (!regions.empty() && std::ranges::none_of(regions, [&](const auto& box) { return box.contains(moved); }))
      continue;
    sum += moved;
    n += 1.0;
  }
  const Vec3 center = n > 0.0 ? Vec3(sum / n) : T.translation;
  return {T.scale * factor, T.rotation, center + factor * (T.translation - center)};
}

/// The steps from one scale seed.
struct Attempt {
  std::vector<IcpResult> steps;
  Sim3 T;
  double cost_m2 = 0.0;  ///< mean of min(distance, last radius)^2
};

Attempt align_from_scale(const PointCloud& few, const Sim3& start, const AlignmentTarget& target,
                         const AlignMapOptions& options) {
  Attempt a;
  a.T = start;
  for (std::size_t level = 0; level < options.coarse_radii_m.size(); ++level) {
    a.steps.push_back(align_step(few, a.T, target, coarse_options(options, target, level)));
    a.T = a.steps.back().T_target_source;
  }
  const IcpResult& end = a.steps.back();
  const double radius_m = options.coarse_radii_m.back();
  a.cost_m2 = end.fitness * end.rmse_m * end.rmse_m + (1.0 - end.fitness) * radius_m * radius_m;
  return a;
}

/// Note about a different result that fits nearly as well as the best.
std::string rival_note(const std::vector<Attempt>& attempts, std::size_t best, const PointSpread& spread,
                       double apart_m) {
  constexpr double kAsGood = 1.1;
  for (std::size_t k = 0; k < attempts.size(); ++k) {
    const double away_m = rms_motion_m(attempts[best].T, attempts[k].T, spread);
    if (k == best || away_m < apart_m || attempts[k].cost_m2 > kAsGood * attempts[best].cost_m2) continue;
    return base::formatted("ambiguous: a scale of %.4g, which moves the map by %.1f m (RMS), fits as well",
                           attempts[k].T.scale, away_m);
  }
  return {};
}

std::vector<Vec3> positions(const geometry::Trajectory& trajectory) {
  std::vector<Vec3> result;
  for (const auto& pose : trajectory.poses) result.push_back(pose.T_local_camera.translation);
  return result;
}

void add_note(std::string& note, const std::string& text) {
  if (!text.empty()) note += (note.empty() ? "" : "; ") + text;
}

/// Adds a note if ICP moved the map farther than the error of telemetry can explain, since it may have matched the
/// wrong surface. Measured at the camera positions, which telemetry refers to.
void note_distance(const geometry::Trajectory& T_map_camera, MapAlignment& alignment) {
  const TrajectoryAlignment& start = *alignment.trajectory;
  const double moved_m =
      rms_motion_m(start.T_local_map, alignment.result.T_target_source, compute_spread(positions(T_map_camera)));
  if (moved_m <= std::max(5.0, 3.0 * start.rmse_m)) return;
  add_note(alignment.result.note,
           base::formatted("ICP moved the camera path %.1f m (RMS) away from its telemetry", moved_m));
}

json telemetry_json(const TrajectoryAlignment& t) {
  return {{"scale", t.T_local_map.scale},
          {"time_offset", t.time_offset_s},
          {"time_offset_sigma", t.time_offset_sigma_s},
          {"pairs", t.pairs},
          {"inliers", t.inliers},
          {"rmse", t.rmse_m},
          {"roll_sigma", t.roll_sigma_rad},
          {"note", t.note}};
}

}  // namespace

PointCloud subsample(const PointCloud& map, std::size_t most) {
  const std::size_t stride = std::max<std::size_t>(1, (map.size() + most - 1) / most);
  PointCloud few;
  for (std::size_t i = 0; i < map.size(); i += stride) {
    few.positions.push_back(map.positions[i]);
    if (!map.normals.empty()) few.normals.push_back(map.normals[i]);
  }
  return few;
}

IcpResult align_step(const PointCloud& map, const Sim3& start, const AlignmentTarget& target,
                     const IcpOptions& options) {
  if (options.method == IcpMethod::kPointToMesh || (options.method == IcpMethod::kGeneralized && target.index)) {
    if (!target.index || !target.mesh)
      throw InputError("alignment method", "point-to-mesh needs a ground truth with a mesh");
    return icp(map, *target.index, *target.mesh, start, options);
  }
  if (!target.cloud)
    throw InputError("alignment method", "point-to-point and point-to-plane need a ground truth cloud");
  return icp(map, *target.cloud, start, options);
}

CoarseAlignment align_coarsely(const PointCloud& map, const Sim3& T_local_map_start, const AlignmentTarget& target,
                               const AlignMapOptions& options) {
  if (options.coarse_radii_m.empty()) return {.T_local_map = T_local_map_start};
  constexpr std::size_t kEnough = 10000;
  const PointCloud few = subsample(map, kEnough);
  std::vector<double> seeds = options.scale_seeds;
  if (options.icp.scale == ScaleMode::kFixed || seeds.empty()) seeds = {1.0};

  std::vector<Attempt> attempts(seeds.size());
  for (std::size_t k = 0; k < seeds.size(); ++k) {
    attempts[k] = align_from_scale(few, scale_about_center(T_local_map_start, seeds[k], few, options.icp.regions),
                                   target, options);
  }
  const auto least =
      std::ranges::min_element(attempts, {}, [](const Attempt& a) { return a.cost_m2; }) - attempts.begin();
  const auto best = static_cast<std::size_t>(least);
  return {attempts[best].T, attempts[best].steps, seeds[best],
          rival_note(attempts, best, compute_spread(few.positions), options.coarse_radii_m.back())};
}

IcpOptions final_icp_options() {
  IcpOptions options;
  options.continue_after_false_stop = true;
  options.max_scale_change = 1.3;
  return options;
}

AlignMapOptions paper_options() {
  AlignMapOptions options;
  options.use_all_evidence = false;
  options.coarse_radii_m.clear();
  options.icp = IcpOptions();
  return options;
}

MapAlignment align_map(const PointCloud& map, const Sim3& T_local_map_start, const AlignmentTarget& target,
                       const AlignMapOptions& options, const Progress& progress) {
  MapAlignment alignment;
  AlignMapOptions centered = options;
  if (!(centered.icp.scale_center > 0.0)) centered.icp.scale_center = T_local_map_start.scale;
  report_progress(progress, 0, 2, "aligning the map");
  CoarseAlignment coarse = align_coarsely(map, T_local_map_start, target, centered);
  alignment.steps = std::move(coarse.steps);
  alignment.scale_seed = coarse.best_scale_seed;
  report_progress(progress, 1, 2, "aligning the map");
  constexpr double kHopelessFitness = 0.1;  // of the map's points; without surface near them, ICP wanders
  constexpr int kFewIterations = 100;
  if (!alignment.steps.empty() && alignment.steps.back().fitness < kHopelessFitness)
    centered.icp.max_iterations = std::min(centered.icp.max_iterations, kFewIterations);
  alignment.result = align_step(map, coarse.T_local_map, target, centered.icp);
  add_note(alignment.result.note, coarse.note);
  report_progress(progress, 2, 2, "aligning the map");
  alignment.moved_from_start_m =
      rms_motion_m(T_local_map_start, alignment.result.T_target_source, compute_spread(map.positions));
  return alignment;
}

MapAlignment align_map(const PointCloud& map, const geometry::Trajectory& T_map_camera,
                       const std::vector<PositionFix>& fixes, const AlignmentTarget& target,
                       const AlignMapOptions& options, const Progress& progress) {
  const TrajectoryAlignment start = align_trajectory(T_map_camera, fixes, options.trajectory);
  MapAlignment alignment = align_map(map, start.T_local_map, target, options, progress);
  alignment.trajectory = start;
  add_note(alignment.result.note, start.note);
  note_distance(T_map_camera, alignment);
  return alignment;
}

json to_json(const MapAlignment& alignment) {
  json object = to_json(alignment.result);
  object["moved_from_start"] = alignment.moved_from_start_m;
  object["telemetry"] = alignment.trajectory ? telemetry_json(*alignment.trajectory) : json(nullptr);
  object["scale_seed"] = alignment.scale_seed;
  if (alignment.closeness) object["closeness"] = *alignment.closeness;
  object["steps"] = json::array();
  for (const IcpResult& s : alignment.steps) object["steps"].push_back(to_json(s));
  return object;
}

}  // namespace tileflight::alignment
