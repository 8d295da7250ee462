#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/alignment/align_trajectory.h"
#include "tileflight/alignment/icp.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::alignment {

/// The paper's ICP settings, but that a false stop of its rule is not left where it is, and that a start whose scale is
/// 20 % too small (true scale: 1.25 of it) has its true scale within the bound.
IcpOptions final_icp();

/// Where an alignment begins.
enum class AlignmentStart {
  kAuto,       ///< telemetry or true poses where there are any; else the map as it is, and if it does not fit there,
               ///< geometry
  kAsItIs,     ///< the map is in the local frame, but for small errors
  kGiven,      ///< the given transform
  kTruePoses,  ///< true poses, for who asks for them: nothing that a flight knows of itself
  kGeometry    ///< found from the shapes alone (align_map_globally())
};

struct AlignMapOptions {
  /// Registration to the exact surface by all that is known (register_map.h), where the ground truth has a surface;
  /// false: ICP from one start with the settings below. For who calls align_map(): it is ICP's.
  bool by_all_evidence = true;
  AlignmentStart start = AlignmentStart::kAuto;  ///< for who calls align_map(): it begins where it is told
  geometry::Sim3 given_start{};                  ///< map to local, of AlignmentStart::kGiven
  std::optional<geometry::Vec3> map_up{};        ///< against gravity in the map's frame; else from the trajectory
  AlignTrajectoryOptions trajectory{};
  /// Radii of the steps that pull in the error of the telemetry, metres; the first keeps the scale. Empty: the final
  /// step only.
  std::vector<double> coarse_radii_m = {8.0, 4.0, 2.0, 1.0};
  /// Factors of the start's scale from which the coarse steps are tried; the end that fits best is gone on with. Only
  /// the first step's scale is theirs: the bound stays about the start's own. With a fixed scale: the start's only.
  std::vector<double> scale_seeds = {1.0, 0.87, 1.15};
  IcpMethod coarse_method = IcpMethod::kPointToMesh;  ///< without a mesh: point-to-point
  IcpOptions icp = final_icp();       ///< of the final step; its regions and scale mode hold for all steps
  std::size_t most_points = 1000000;  ///< of the map; more are thinned evenly (scores still take all)
  bool find_regions = false;  ///< for who calls align_map(): a last step on regions found where the map then lies
  std::vector<geometry::Box3> held_out{};  ///< regions named by hand that nothing is aligned on, for scoring
};

/// The paper's alignment and nothing else: point to point, radius 1 m, RMS change 1e-5, at most 1500 iterations, from
/// the start as it is. A false stop of its rule stays, and is said.
AlignMapOptions paper_preset();

/// Ground truth to align to. The mesh may be missing (both null), then only the methods between clouds can be used.
struct AlignmentTarget {
  const geometry::PointCloud* cloud =
      nullptr;  ///< voxel centres, or any cloud; needed for point-to-point and point-to-plane
  const geometry::TriangleIndex* index = nullptr;
  const geometry::TriangleMesh* mesh = nullptr;
};

struct MapAlignment {
  AlignmentResult result;  ///< T_local_map and its diagnostics, of the final step; notes of all steps
  std::optional<TrajectoryAlignment> trajectory;  ///< the step from telemetry, where there was one
  std::vector<AlignmentResult> steps;             ///< coarse ones, in order, from the scale seed that won
  double scale_seed = 1.0;                        ///< that seed
  std::optional<double> closeness;  ///< of one found from geometry: 1 if all points lie on the surface, 0 if none is
                                    ///< within a hundredth of the map's size
  double moved_from_start_m = 0.0;  ///< how far all ICP steps together moved the map's points (RMS)
};

/// From a start (telemetry, or known otherwise) to the map's place: ICP steps with a radius that shrinks, then the
/// final step, by default with the paper's settings. Regions choose the points that take part; the transform is for the
/// whole map. Throws InputError as icp() does, and where a method lacks its target.
MapAlignment align_map(const geometry::PointCloud& map, const geometry::Sim3& T_local_map_start,
                       const AlignmentTarget& target, const AlignMapOptions& options = {},
                       const Progress& progress = {});

/// The same, started from the camera's trajectory (map frame) and a receiver's positions (local frame).
MapAlignment align_map(const geometry::PointCloud& map, const geometry::Trajectory& T_map_camera,
                       const std::vector<PositionFix>& fixes, const AlignmentTarget& target,
                       const AlignMapOptions& options = {}, const Progress& progress = {});

/// The final result's keys (transform.json), with `telemetry` and `steps` for the diagnostics.
nlohmann::json to_json(const MapAlignment& alignment);

/// `transform.json` with those keys. Throws InputError.
void write_transform(const std::filesystem::path& file, const MapAlignment& alignment);

}  // namespace tileflight::alignment
