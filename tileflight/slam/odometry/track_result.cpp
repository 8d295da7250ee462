#include "tileflight/slam/odometry/track_result.h"

#include <algorithm>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>
#include <variant>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::odometry {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

json loops_json(const TrackResult& result) {
  json loops = json::array();
  for (const LoopClosure& loop : result.odometry.loops) {
    loops.push_back({{"from", result.frame_ids[static_cast<std::size_t>(loop.from_frame)]},
                     {"to", result.frame_ids[static_cast<std::size_t>(loop.to_frame)]},
                     {"scale_change", loop.scale_change},
                     {"inliers", loop.inliers}});
  }
  return loops;
}

/// Returns focal lengths and principal point, pixels.
json intrinsics_json(const imaging::Camera& camera, bool estimated) {
  return std::visit(
      [estimated](const auto& model) {
        return json{{"fx", model.fx}, {"fy", model.fy}, {"cx", model.cx}, {"cy", model.cy}, {"estimated", estimated}};
      },
      camera.model());
}

/// Returns `stereo` of odometry.json.
json stereo_json(const StereoResult& stereo) {
  json cameras = json::array();
  for (const OtherCameraResult& camera : stereo.cameras) {
    cameras.push_back({{"name", camera.name},
                       {"frames", camera.frames},
                       {"frames_blind", camera.frames_blind},
                       {"keyframes", camera.keyframes},
                       {"keyframes_unmatched", camera.keyframes_unmatched},
                       {"matched_share", camera.matched_share}});
    json& fit = cameras.back()["fit"];
    if (camera.fit)
      fit = {{"matches", camera.fit->matches},
             {"rotation_deg", camera.fit->rotation_rad / geometry::kRadiansPerDegree},
             {"behind_share", camera.fit->behind_share}};
    json& turn = cameras.back()["turn"];
    if (camera.turn) {
      const RigTurn& t = *camera.turn;
      turn = {{"segments", t.segments},
              {"rotation_deg", geometry::json_numbers(t.turn_rad / geometry::kRadiansPerDegree)},
              {"along_parallax_deg", t.along_parallax_rad() / geometry::kRadiansPerDegree},
              {"along_parallax_sigma_deg", t.along_parallax_sigma_rad() / geometry::kRadiansPerDegree},
              {"distance_error", t.distance_error()}};
    }
  }
  return {{"metric", stereo.metric}, {"cameras", cameras}};
}

/// Returns `inertial` of odometry.json.
json inertial_json(const inertial::InertialAlignment& a, const std::optional<double>& coupled_since_s) {
  json result = {{"reason", a.reason}, {"covered_share", a.covered_share}};
  if (coupled_since_s) result["coupled_since_s"] = *coupled_since_s;
  if (!a.metric) return result;
  result["scale"] = a.mean_scale;
  result["sigma_log_scale"] = a.sigma_log_scale;
  result["sigma_up_deg"] = a.sigma_up_rad / geometry::kRadiansPerDegree;
  result["time_offset_s"] = a.time_offset_s;
  result["sigma_time_offset_s"] = a.sigma_time_offset_s;
  result["mounting_correction_deg"] = a.mounting_correction_rad / geometry::kRadiansPerDegree;
  result["residual_ratio"] = a.residual_ratio;
  result["gyroscope_bias_rad_s"] = geometry::json_numbers(a.bias.front().gyroscope_rad_s);
  result["accelerometer_bias_m_s2"] = geometry::json_numbers(a.bias.front().accelerometer_m_s2);
  return result;
}

/// Returns inertial.csv: scale, velocity and biases at each keyframe.
std::string inertial_csv(const inertial::InertialAlignment& a, const geometry::Trajectory& keyframes) {
  std::string table =
      "time_s,scale,vx,vy,vz,gyroscope_bias_x,gyroscope_bias_y,gyroscope_bias_z,accelerometer_bias_x,"
      "accelerometer_bias_y,accelerometer_bias_z\n";
  for (std::size_t k = 0; k < a.scale.size(); ++k) {
    base::append_number(table, keyframes.poses[k].time_s);
    table += ',';
    base::append_number(table, a.scale[k]);
    for (const geometry::Vec3& v : {a.velocity_m_s[k], a.bias[k].gyroscope_rad_s, a.bias[k].accelerometer_m_s2}) {
      for (int axis = 0; axis < 3; ++axis) {
        table += ',';
        base::append_number(table, v[axis]);
      }
    }
    table += '\n';
  }
  return table;
}

/// Returns quality.csv: a line for each image, in time order.
std::string quality_csv(const std::vector<FrameQuality>& quality, const std::vector<dataset::Frame>& frames) {
  std::ostringstream table;
  table << std::setprecision(6)
        << "frame,time_s,tracked,keyframe,rmse,inside_share,saturated_share,known_points,step,"
           "sigma_position,sigma_rotation_rad,sigma_log_scale\n";
  for (const FrameQuality& q : quality) {
    const dataset::Frame& frame = frames[static_cast<std::size_t>(q.frame)];
    table << frame.id << ',' << std::setprecision(17) << frame.time_s << std::setprecision(6) << ',' << q.tracked << ','
          << q.is_keyframe << ',' << q.rmse << ',' << q.inside_share << ',' << q.saturated_share << ','
          << q.known_points << ',' << q.distance_to_keyframe << ',' << q.sigma_position << ',' << q.sigma_rotation_rad
          << ',' << q.sigma_log_scale << '\n';
  }
  return table.str();
}

std::string focal_length_csv(const std::vector<FocalSegment>& segments, const std::vector<dataset::Frame>& frames) {
  std::ostringstream table;
  table << "frame,time_s,since_frame,factor,sigma,residual_px,one_focal_length_px\n";
  for (const FocalSegment& segment : segments) {
    const std::string& since = frames[static_cast<std::size_t>(segment.images.front().frame)].id;
    for (std::size_t i = 1; i < segment.images.size(); ++i) {
      const FocalSegment::Image& image = segment.images[i];
      const dataset::Frame& frame = frames[static_cast<std::size_t>(image.frame)];
      const double factor = std::exp(image.log_change);
      table << frame.id << ',' << std::setprecision(17) << frame.time_s << std::setprecision(6) << ',' << since << ','
            << factor << ',' << factor * image.sigma << ',' << segment.residual_px << ',' << segment.one_focal_length_px
            << '\n';
    }
  }
  return table.str();
}

json dispersion_json(const std::optional<Dispersion>& dispersion) {
  if (!dispersion) return nullptr;
  return {{"pictures", dispersion->pictures}, {"position", dispersion->position}, {"rotation", dispersion->rotation}};
}

json line_delay_json(const FoundLineDelay& found) {
  return {{"passes", found.passes},
          {"used_s", found.used_s},
          {"estimate_s", found.estimate ? json(found.estimate->line_delay_s) : json(nullptr)},
          {"sigma_s", found.estimate ? json(found.estimate->sigma_s) : json(nullptr)}};
}

}  // namespace

json to_json(const TrackResult& result) {
  const OdometryResult& run = result.odometry;
  json about = {
      {"frames", run.frames},
      {"frames_tracked", run.frames_tracked},
      {"frames_before_start", run.frames_before_start},
      {"frames_tracked_backwards", run.frames_tracked_backwards},
      {"frames_skipped", result.frames_skipped},
      {"lost", run.lost},
      {"lost_reason", run.lost_reason},
      {"keyframes", run.keyframes.size()},
      {"points", run.map.size()},
      {"seconds", run.wall_time_s},
      {"frames_per_second", run.wall_time_s > 0 ? static_cast<double>(run.frames) / run.wall_time_s : 0.0},
      {"path_warnings", result.path_warnings},
      {"warnings", to_json(result.warnings)},
      {"backwards", result.backwards},
      {"dispersion", dispersion_json(result.dispersion)},
      {"residual_pattern_px", run.systematic_displacement ? json(run.systematic_displacement->rms_px) : json(nullptr)},
      {"mode", to_string(result.mode)},
      {"scale", result.is_metric() ? "metric" : "unknown"},
      {"intrinsics", intrinsics_json(result.calibration.camera, result.intrinsics_estimated)}};
  if (run.stereo) about["stereo"] = stereo_json(*run.stereo);
  if (run.inertial) about["inertial"] = inertial_json(*run.inertial, run.coupled_since_s);
  if (result.line_delay) about["line_delay"] = line_delay_json(*result.line_delay);
  if (result.loops_searched) {
    about["loops"] = loops_json(result);
    about["loops_closed"] = run.loops_closed;
  }
  return about;
}

void write_track_result(const fs::path& folder, const TrackResult& result, const std::vector<dataset::Frame>& frames) {
  const OdometryResult& run = result.odometry;
  if (run.inertial && run.inertial->metric)
    base::write_file(folder / "inertial.csv", inertial_csv(*run.inertial, run.keyframes));
  base::write_file(folder / "quality.csv", quality_csv(run.quality, frames));
  base::write_file(folder / "focal_length.csv", focal_length_csv(run.focal_segments, frames));
  geometry::write_tum(folder / "trajectory.txt", run.trajectory);
  geometry::write_tum(folder / "keyframes.txt", run.keyframes);
  geometry::write_cloud(folder / "map.ply", run.map);
  imaging::write_kalibr(folder / "camera.yaml", result.calibration);
  base::write_file(folder / "odometry.json", to_json(result).dump(2) + "\n");
}

std::vector<FrameQuality> read_quality_csv(const fs::path& file) {
  const std::string text = base::read_text(file);
  std::string_view rest = text;
  const std::vector<std::string_view> head = base::split_fields(base::take_line(rest).value_or(""), ",");
  std::vector<FrameQuality> qualities;
  while (const auto line = base::take_line(rest)) {
    const std::string where = file.string() + ", line " + std::to_string(qualities.size() + 2);
    const std::vector<std::string_view> fields = base::split_fields(*line, ",");
    if (fields.size() != head.size()) throw InputError(where, "has another number of columns than the heading");
    const auto number = [&](std::string_view name) {
      const auto at = static_cast<std::size_t>(std::ranges::find(head, name) - head.begin());
      const auto value = at < fields.size() ? base::parse_number<double>(fields[at]) : std::nullopt;
      if (!value) throw InputError(where, "has no number in the column " + std::string(name));
      return *value;
    };
    qualities.push_back({.frame = static_cast<std::int64_t>(qualities.size()),
                         .time_s = number("time_s"),
                         .tracked = number("tracked") > 0.0,
                         .is_keyframe = number("keyframe") > 0.0,
                         .rmse = number("rmse"),
                         .inside_share = number("inside_share"),
                         .saturated_share = number("saturated_share"),
                         .known_points = static_cast<int>(number("known_points")),
                         .distance_to_keyframe = number("step"),
                         .sigma_position = number("sigma_position"),
                         .sigma_rotation_rad = number("sigma_rotation_rad"),
                         .sigma_log_scale = number("sigma_log_scale")});
  }
  return qualities;
}

}  // namespace tileflight::odometry
