#include "tileflight/evaluation/scoring/align_stage.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/alignment/align_globally.h"
#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/alignment/regions.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/evaluation/scoring/align_target.h"
#include "tileflight/evaluation/scoring/register_flight.h"
#include "tileflight/evaluation/scoring/warnings.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Aligning to voxel centres pulls a map off the surface, by up to half a cell on level ground. Distances to the exact
/// surface are therefore measured after another alignment to the surface, starting from the chosen one.
alignment::IcpResult refine_to_surface(const geometry::PointCloud& cloud, const geometry::Sim3& T_local_map,
                                       const AlignTarget& target, const alignment::AlignMapOptions& options) {
  alignment::IcpOptions icp = alignment::converging_icp_options();
  icp.method = alignment::IcpMethod::kPointToMesh;
  icp.scale = options.icp.scale;
  icp.regions = options.icp.regions;
  return alignment::icp(cloud, *target.index, target.mesh, T_local_map, icp);
}

/// Aligns by the shapes alone; the up direction is fixed if the camera's path or the options determine it.
alignment::MapAlignment align_by_geometry(const geometry::PointCloud& cloud, const MapInputs& map,
                                          const AlignTarget& target, const alignment::AlignMapOptions& options,
                                          const Progress& progress) {
  std::optional<geometry::Vec3> up = options.map_up;
  if (!up && !map.trajectory.empty()) up = alignment::estimate_up_from_trajectory(geometry::read_tum(map.trajectory));
  return alignment::align_map_globally(cloud, up, target.to_alignment_target(), options, progress);
}

/// Aligns from the map's present pose; if it does not fit there, globally.
alignment::MapAlignment align_without_telemetry(const geometry::PointCloud& cloud, const MapInputs& map,
                                                const AlignTarget& target, const alignment::AlignMapOptions& options,
                                                std::string& start, const Progress& progress) {
  constexpr double kFits = 0.5;  // minimum share of points with a correspondence
  start = "as it is";
  alignment::MapAlignment aligned =
      alignment::align_map(cloud, geometry::Sim3(), target.to_alignment_target(), options, progress);
  const alignment::IcpResult& end = aligned.result;
  if (end.converged && end.fitness >= kFits && end.constraint.well_constrained) return aligned;
  try {
    alignment::MapAlignment found = align_by_geometry(cloud, map, target, options, progress);
    if (*found.closeness <= alignment::compute_closeness(cloud, end.T_target_source, target.to_alignment_target()))
      return aligned;
    start = "geometry";
    return found;
  } catch (const InputError&) {
    return aligned;  // its note describes the problem
  }
}

/// Aligns from the start chosen by the options; `start` receives its name.
alignment::MapAlignment align_from(const geometry::PointCloud& cloud, const MapInputs& map, const AlignTarget& target,
                                   const alignment::AlignMapOptions& options, std::string& start,
                                   const Progress& progress) {
  using alignment::AlignmentStart;
  if (options.start == AlignmentStart::kGiven || options.start == AlignmentStart::kAsItIs) {
    const bool given = options.start == AlignmentStart::kGiven;
    start = given ? "given" : "as it is";
    return alignment::align_map(cloud, given ? options.given_start : geometry::Sim3(), target.to_alignment_target(),
                                options, progress);
  }
  if (options.start == AlignmentStart::kGeometry) {
    start = "geometry";
    return align_by_geometry(cloud, map, target, options, progress);
  }
  const bool by_true_poses = options.start == AlignmentStart::kTruePoses;
  const bool by_receiver = !by_true_poses && !map.gps.empty() && target.origin;
  if (by_true_poses && map.truth_trajectory.empty())
    throw InputError("--start true-poses", "needs the dataset's groundtruth.txt (--dataset)");
  if (map.trajectory.empty() || (!by_receiver && !by_true_poses))
    return align_without_telemetry(cloud, map, target, options, start, progress);

  start = by_receiver ? "receiver positions" : "true poses";
  alignment::AlignMapOptions chosen = options;
  // True poses are on the images' clock; a receiver has an unknown delay.
  if (!by_receiver) chosen.trajectory.estimate_time_offset = false;
  return alignment::align_map(
      cloud, geometry::read_tum(map.trajectory),
      by_receiver ? read_receiver_positions(map.gps, *target.origin) : read_true_positions(map.truth_trajectory),
      target.to_alignment_target(), chosen, progress);
}

/// The points of the other flights' maps, coarsely aligned by their telemetry. Maps without telemetry are left out.
std::vector<geometry::PointCloud> other_maps(const MapInputs& map, const AlignTarget& target,
                                             const alignment::AlignMapOptions& options) {
  std::vector<geometry::PointCloud> maps;
  for (const MapInputs& other : map.others) {
    const bool by_true_poses =
        options.start == alignment::AlignmentStart::kTruePoses && !other.truth_trajectory.empty();
    const bool by_receiver = !by_true_poses && !other.gps.empty() && target.origin;
    if (other.trajectory.empty() || (!by_receiver && !by_true_poses)) continue;
    const auto fixes =
        by_receiver ? read_receiver_positions(other.gps, *target.origin) : read_true_positions(other.truth_trajectory);
    const geometry::Sim3 T =
        alignment::align_trajectory(geometry::read_tum(other.trajectory), fixes, options.trajectory).T_local_map;
    maps.push_back(geometry::transformed(T, read_map(other.map)));
  }
  return maps;
}

std::vector<geometry::Box3> boxes_of(const std::vector<alignment::FoundRegion>& regions) {
  std::vector<geometry::Box3> boxes;
  for (const alignment::FoundRegion& region : regions) boxes.push_back(region.box);
  return boxes;
}

/// Repeats the final step on well-constrained regions; others are held out for scoring.
alignment::RegionList refine_on_found_regions(const geometry::PointCloud& cloud, const MapInputs& map,
                                              const AlignTarget& target, alignment::AlignMapOptions& options,
                                              alignment::MapAlignment& aligned) {
  if (!target.index) throw InputError("regions", "can only be found in a ground truth with a mesh");
  const geometry::PointCloud placed = geometry::transformed(aligned.result.T_target_source, cloud);
  const std::vector<geometry::PointCloud> others = other_maps(map, target, options);
  std::vector<const geometry::PointCloud*> maps = {&placed};
  for (const geometry::PointCloud& other : others) maps.push_back(&other);
  const alignment::FoundRegions found = alignment::find_regions(target.mesh, maps);
  if (found.aligned_on.empty()) {
    aligned.result.note +=
        std::string(aligned.result.note.empty() ? "" : "; ") +
        "found no regions to align on (corners of planes with points of every map); the whole map was aligned";
    return {};
  }
  alignment::RegionList list{boxes_of(found.aligned_on), boxes_of(found.held_out), true};
  options.icp.regions = list.aligned_on;
  options.icp.scale_center = aligned.result.T_target_source.scale;
  aligned.steps.push_back(aligned.result);
  aligned.result =
      alignment::align_step(cloud, aligned.result.T_target_source, target.to_alignment_target(), options.icp);
  return list;
}

/// Converts ICP's notes and flags to warnings.
Warnings icp_warnings(const alignment::IcpResult& result) {
  constexpr double kLowFitness = 0.3;
  Warnings warnings;
  if (!result.converged) {
    warnings.push_back({"ICP did not converge" + (result.note.empty() ? "" : ": " + result.note), "alignment",
                        Severity::kError, "give a better start, or leave out --method"});
  } else if (!result.note.empty()) {
    warnings.push_back({result.note, "alignment", Severity::kNote, "compare with the default method"});
  }
  if (result.fitness < kLowFitness) {
    warnings.push_back({"only " + std::to_string(static_cast<int>(100.0 * result.fitness)) +
                            " % of the map's points have a correspondence",
                        "alignment", Severity::kWarning, "check place, region and start"});
  }
  return warnings;
}

/// Whether the map's odometry says that it is in metres (odometry.json).
bool is_metric(const MapInputs& map) {
  const fs::path file = map.map / "odometry.json";
  if (!fs::is_directory(map.map) || !fs::exists(file)) return false;
  const json about = json::parse(base::read_text(file), nullptr, false);
  return about.is_object() && about.contains("scale") && about["scale"] == "metric";
}

/// The options with the scale of a metric map held at 1. A given start keeps what was asked for.
alignment::AlignMapOptions hold_metric_scale(alignment::AlignMapOptions options) {
  options.icp.scale = options.trajectory.scale = alignment::ScaleMode::kFixed;
  return options;
}

/// Returns the share by which a metric map's lengths are too long, from the scale that the surface would choose;
/// nullopt if the fit does not converge.
std::optional<double> scale_error(const geometry::PointCloud& cloud, const geometry::Sim3& T_local_map,
                                  const AlignTarget& target, alignment::AlignMapOptions options) {
  options.icp.scale = alignment::ScaleMode::kEstimated;
  const alignment::IcpResult free = refine_to_surface(cloud, T_local_map, target, options);
  if (!free.converged) return std::nullopt;
  return T_local_map.scale / free.T_target_source.scale - 1.0;
}

/// Aligns a map by ICP alone. `chosen`: the options as the ground truth and a metric map change them.
IcpAlignment align_by_icp(const geometry::PointCloud& cloud, const MapInputs& map, const AlignTarget& target,
                          const alignment::AlignMapOptions& options, alignment::AlignMapOptions& chosen,
                          const Progress& progress) {
  IcpAlignment icp{.regions = {options.icp.regions, options.held_out}};
  icp.aligned = align_from(cloud, map, target, chosen, icp.start, progress);
  if (options.find_regions) icp.regions = refine_on_found_regions(cloud, map, target, chosen, icp.aligned);
  if (target.index) icp.to_surface = refine_to_surface(cloud, icp.aligned.result.T_target_source, target, chosen);
  return icp;
}

}  // namespace

AlignResult align(const MapInputs& map, const fs::path& target_path, const alignment::AlignMapOptions& options,
                  const fs::path& out, const Progress& progress) {
  const geometry::PointCloud cloud = alignment::subsample(read_map(map.map), options.max_points);
  const AlignTarget target = read_align_target(
      target_path, [&](const auto& origin) { return reach_of_map(map, cloud, options, origin); }, progress);
  if (options.start == alignment::AlignmentStart::kAsItIs || options.start == alignment::AlignmentStart::kGiven) {
    const bool is_given = options.start == alignment::AlignmentStart::kGiven;
    require_overlap(cloud, is_given ? options.given_start : geometry::Sim3(), target, options);
  }
  alignment::AlignMapOptions chosen = options;
  if (chosen.icp.regions.empty()) chosen.icp.regions = target.regions;
  const bool metric = options.start != alignment::AlignmentStart::kGiven && is_metric(map);
  if (metric) chosen = hold_metric_scale(std::move(chosen));

  AlignResult result{.holds_scale = metric && target.index, .blocks_read = target.blocks_read, .blocks = target.blocks};
  if (chosen.use_all_evidence && target.index) {
    RegisteredFlight registered = register_flight(map, target, chosen, progress);
    result.warnings = registered.registration.warnings;
    result.found = std::move(registered);
  } else {
    IcpAlignment icp = align_by_icp(cloud, map, target, options, chosen, progress);
    result.warnings = odometry_warnings(map);
    append_distinct(result.warnings, icp_warnings(icp.aligned.result));
    result.found = std::move(icp);
  }
  if (result.holds_scale) result.scale_error = scale_error(cloud, result.T_local_map(), target, chosen);
  base::write_file(out, to_json(result).dump(2) + "\n");
  return result;
}

}  // namespace tileflight::scoring
