#include "tileflight/core/alignment/align_map.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/alignment/coarse_alignment.h"
#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment {

using geometry::PointCloud;
using geometry::Sim3;
using geometry::Vec3;
using nlohmann::json;

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

namespace {

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
