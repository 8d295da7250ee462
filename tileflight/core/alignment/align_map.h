#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/alignment/icp.h"
#include "tileflight/core/base/progress.h"

namespace tileflight::alignment {

/// Returns the paper's ICP settings with two changes: after a false stop of the stopping rule the iteration continues,
/// and the scale bound is wide enough for a start whose scale is 20 % too small (true scale: 1.25 times it).
IcpOptions final_icp_options();

/// The start of an alignment.
enum class AlignmentStart {
  kAuto,       ///< telemetry or true poses if available; else the map as it is, and if it does not fit there, geometry
  kAsItIs,     ///< the map is already in the local frame, except for small errors
  kGiven,      ///< the given transform
  kTruePoses,  ///< true poses; only on explicit request, since a real flight does not have them
  kGeometry    ///< found from geometry alone (align_map_globally())
};

struct AlignMapOptions {
  /// Register to the exact surface with all available evidence (register_map.h), if the ground truth has a surface;
  /// false: ICP from one start with the settings below. Read by the caller; align_map() itself always uses ICP.
  bool use_all_evidence = true;
  AlignmentStart start = AlignmentStart::kAuto;  ///< read by the caller; align_map() starts at the given transform
  geometry::Sim3 given_start{};                  ///< map to local, for AlignmentStart::kGiven
  std::optional<geometry::Vec3> map_up{};        ///< direction against gravity, map frame; none: estimated from the
                                                 ///< trajectory
  AlignTrajectoryOptions trajectory{};
  /// Radii of the coarse steps that correct the error of the telemetry, metres; the first step keeps the scale. Empty:
  /// final step only.
  std::vector<double> coarse_radii_m = {8.0, 4.0, 2.0, 1.0};
  /// Multiples of the start's scale at which the coarse steps are tried; the best result is kept. They set only the
  /// scale of the first step: the scale bound stays around the start's own. With a fixed scale only 1 is used.
  std::vector<double> scale_seeds = {1.0, 0.87, 1.15};
  IcpMethod coarse_method = IcpMethod::kPointToMesh;  ///< without a mesh: point-to-point
  IcpOptions icp = final_icp_options();               ///< final step; its regions and scale mode apply to all steps
  std::size_t max_points = 1000000;  ///< map points used; larger maps are subsampled evenly (scores still use all
                                     ///< points)
  bool find_regions = false;         ///< read by the caller: add a last step on regions found around the aligned map
  std::vector<geometry::Box3> held_out{};  ///< regions given by the user that are excluded from alignment and used for
                                           ///< scoring
};

/// Returns the settings of the paper's alignment alone: point to point, radius 1 m, RMS change 1e-5, at most 1500
/// iterations, from the unmodified start. A false stop of the rule is kept and reported.
AlignMapOptions paper_options();

/// Ground truth to align to. The mesh may be missing (both null); then only cloud-to-cloud methods can be used.
struct AlignmentTarget {
  const geometry::PointCloud* cloud =
      nullptr;  ///< voxel centres or any point cloud; required for point-to-point and point-to-plane
  const geometry::TriangleIndex* index = nullptr;
  const geometry::TriangleMesh* mesh = nullptr;
};

struct MapAlignment {
  IcpResult result;                               ///< T_local_map and diagnostics of the final step; notes of all steps
  std::optional<TrajectoryAlignment> trajectory;  ///< the alignment by telemetry, if there was one
  std::vector<IcpResult> steps;                   ///< coarse steps in order, from the best scale seed
  double scale_seed = 1.0;                        ///< the best scale seed
  std::optional<double> closeness;  ///< only for a start from geometry: 1 if all points lie on the surface, 0 if none
                                    ///< is within a hundredth of the map's size
  double moved_from_start_m = 0.0;  ///< RMS distance by which all ICP steps together moved the map's points
};

/// Aligns a map from a start: ICP steps with decreasing radius, then the final step, by default with the paper's
/// settings. Regions select the points used; the transform applies to the whole map. Throws InputError as icp() does,
/// and if the target of a method is missing.
MapAlignment align_map(const geometry::PointCloud& map, const geometry::Sim3& T_local_map_start,
                       const AlignmentTarget& target, const AlignMapOptions& options = {},
                       const Progress& progress = {});

/// Aligns a map from the start that align_trajectory() finds: from the camera's trajectory (map frame) and a receiver's
/// positions (local frame).
MapAlignment align_map(const geometry::PointCloud& map, const geometry::Trajectory& T_map_camera,
                       const std::vector<PositionFix>& fixes, const AlignmentTarget& target,
                       const AlignMapOptions& options = {}, const Progress& progress = {});

/// Returns the keys of the final result (transform.json), with `telemetry` and `steps` as diagnostics.
nlohmann::json to_json(const MapAlignment& alignment);

/// Returns every k-th point (position and normal), with the smallest k that leaves at most about `most` points.
geometry::PointCloud subsample(const geometry::PointCloud& map, std::size_t most);

/// Makes one ICP step against the part of the target that the method needs. Throws InputError if that is missing, and
/// as icp() does.
IcpResult align_step(const geometry::PointCloud& map, const geometry::Sim3& start, const AlignmentTarget& target,
                     const IcpOptions& options);

/// Result of the coarse steps.
struct CoarseAlignment {
  geometry::Sim3 T_local_map;
  std::vector<IcpResult> steps;  ///< in order, from the best scale seed
  double best_scale_seed = 1.0;  ///< best scale seed, as a multiple of the start's scale
  std::string note;              ///< empty, or a note that another scale fits as well
};

/// Runs ICP with decreasing radii from each scale seed, over at most about 10 000 evenly chosen points, and returns the
/// result with the smallest mean of min(distance, last radius)^2. Several seeds are needed because a map that is too
/// small has surface close to all its points at many places, so that a start with a wrong scale gets stuck at a wrong
/// place.
CoarseAlignment align_coarsely(const geometry::PointCloud& map, const geometry::Sim3& T_local_map_start,
                               const AlignmentTarget& target, const AlignMapOptions& options);

}  // namespace tileflight::alignment
