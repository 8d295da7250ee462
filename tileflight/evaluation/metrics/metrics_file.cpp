#include "tileflight/evaluation/metrics/metrics_file.h"

#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/evaluation/metrics/distances.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::metrics {

using nlohmann::json;

namespace {

/// Shortest text that reads back as the same number: "0.1", "1".
std::string key_of(double threshold_m) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, threshold_m).ptr;
  return {text, end};
}

json by_threshold(const std::map<double, double>& shares) {
  json object = json::object();
  for (const auto& [threshold_m, share] : shares) object[key_of(threshold_m)] = share;
  return object;
}

json by_percentage(const Percentiles& percentiles) {
  json object = json::object();
  for (const auto& [percent, distance_m] : percentiles) object[std::to_string(percent)] = distance_m;
  return object;
}

/// Cumulative share of all points at the histogram's edges; the last is the share kept.
std::vector<double> cumulative(const MapMetrics& m) {
  std::vector<double> shares{0.0};
  std::size_t within = 0;
  for (const std::size_t count : m.histogram.counts) {
    within += count;
    shares.push_back(m.points > 0 ? static_cast<double>(within) / static_cast<double>(m.points) : 0.0);
  }
  return shares;
}

json statistics(const DistanceStatistics& s) {
  return {{"mean", s.mean}, {"std", s.std}, {"median", s.median}, {"rmse", s.rmse}};
}

json curve_json(const CumulativeCurve& c) {
  const auto area = [&](const std::vector<double>& shares) { return area_under_curve(c.thresholds_m, shares); };
  return {
      {"thresholds", c.thresholds_m},
      {"shares", c.shares},
      {"completeness", c.completeness},
      {"f_score", c.f_score},
      {"area", {{"accuracy", area(c.shares)}, {"completeness", area(c.completeness)}, {"f_score", area(c.f_score)}}}};
}

double share_kept(const MapMetrics& m) {
  return m.points > 0 ? static_cast<double>(m.correspondences) / static_cast<double>(m.points) : 0.0;
}

}  // namespace

json to_json(const MapMetrics& m) {
  json object = statistics(m.distances);
  object["percentiles"] = by_percentage(m.percentiles);
  object["points"] = m.points;
  object["correspondences"] = m.correspondences;
  object["share_kept"] = share_kept(m);
  object["histogram"] = {{"edges", m.histogram.edges}, {"counts", m.histogram.counts}};
  object["cumulative"] = cumulative(m);
  object["cutoff"] = m.cutoff_m;
  object["truth"] = "voxel-centres";
  object["quantization_floor"] = statistics(m.quantization_floor);
  object["quantization_floor"]["count"] = m.quantization_floor.count;
  return object;
}

json to_json(const SurfaceMetrics& m) {
  json object = statistics(m.distances);
  object["percentiles"] = by_percentage(m.percentiles);
  object["points"] = m.distances.count;
  object["cumulative"] = curve_json(m.cumulative);
  object["normals"] = m.normals ? to_json(*m.normals) : json(nullptr);
  object["accuracy"] = by_threshold(m.accuracy);
  object["completeness"] = by_threshold(m.completeness);
  object["f_score"] = by_threshold(m.f_score);
  return object;
}

json to_json(const PathDrift& d) {
  return {{"stretch_m", d.segment_length_m},
          {"subpaths", d.subpaths},
          {"translation_percent", d.translation_percent},
          {"rotation_deg_per_m", d.rotation_deg_per_m}};
}

json to_json(const ScaleDrift& d) {
  return {{"stretch_m", d.segment_length_m}, {"stretches", d.segments}, {"largest", d.max_deviation}, {"rms", d.rms}};
}

json spread_json(const PoseErrorSpread& s) {
  return {{"mean", s.mean}, {"median", s.median}, {"std", s.std}, {"min", s.min}, {"max", s.max}};
}

/// One entry by path length or, if it has one, by number of frames.
json to_json(const RelativePoseError& e) {
  json object = {{"pairs", e.pairs},
                 {"translation_rmse_m", e.translation_rmse_m},
                 {"rotation_rmse_deg", e.rotation_rmse_deg},
                 {"translation_m", spread_json(e.translation_m)},
                 {"rotation_deg", spread_json(e.rotation_deg)}};
  if (e.delta_frames > 0) {
    object["delta_frames"] = e.delta_frames;
  } else {
    object["delta_m"] = e.delta_m;
  }
  return object;
}

json to_json(const std::vector<RelativePoseError>& errors) {
  json list = json::array();
  for (const RelativePoseError& e : errors) list.push_back(to_json(e));
  return list;
}

json to_json(const ReceiverError& r) {
  return {{"horizontal_sigma_m", r.horizontal_sigma_m},
          {"vertical_sigma_m", r.vertical_sigma_m},
          {"expected_rmse_m", r.expected_rmse_m},
          {"beyond_receiver_m", r.beyond_receiver_m ? json(*r.beyond_receiver_m) : json(nullptr)},
          {"normalized_error_squared", r.normalized_error_squared},
          {"time_offset_s", r.time_offset_s},
          {"time_offset_sigma_s", r.time_offset_sigma_s},
          {"lever_arm_m", geometry::json_numbers(r.lever_arm_m)}};
}

/// Sets the errors of rotations to null.
void remove_rotations(json& trajectory) {
  for (const char* list : {"rpe", "rpe_frames"}) {
    for (json& one : trajectory[list])
      for (const char* key : {"rotation_rmse_deg", "rotation_deg"}) one[key] = nullptr;
  }
  trajectory["drift"]["rotation_deg_per_m"] = nullptr;
}

json to_json(const TrajectoryMetrics& m) {
  json object{{"ate_rmse", m.ate_rmse_m},
              {"ate_mean", m.ate_mean_m},
              {"ate_median", m.ate_median_m},
              {"ate_std", m.ate_std_m},
              {"ate_min", m.ate_min_m},
              {"ate_max", m.ate_max_m},
              {"rpe", to_json(m.rpe)},
              {"rpe_frames", to_json(m.rpe_frames)},
              {"drift", to_json(m.drift)},
              {"scale_drift", to_json(m.scale_drift)},
              {"path_length", m.path_length_m},
              {"scale", m.scale},
              {"alignment", m.alignment ? json(name_of(*m.alignment)) : json(nullptr)},
              {"poses", m.poses},
              {"poses_estimated", m.estimated_poses},
              {"poses_true", m.true_poses},
              {"time_covered", m.time_covered}};
  if (m.receiver) {
    object["receiver"] = to_json(*m.receiver);
    remove_rotations(object);
  }
  return object;
}

json to_json(const MeanDifference& d) {
  return {{"mean_difference", d.difference_m},
          {"mean_difference_ci95", d.ci95},
          {"verdict", d.verdict},
          {"equivalent_within_m", d.equivalent_within_m ? json(*d.equivalent_within_m) : json(nullptr)}};
}

json to_json(const DistanceComparison& c) {
  return {{"mean_difference", c.mean_difference_m},
          {"std_difference", c.std_difference_m},
          {"points_ratio", c.points_ratio},
          {"ks_statistic", c.ks_statistic},
          {"wasserstein_m", c.wasserstein_m},
          {"mean_difference_ci95", c.mean_difference_ci95},
          {"equivalence_margin_m", c.equivalence_margin_m},
          {"mean_difference_verdict", c.verdict},
          {"equivalent_within_m", c.equivalent_within_m ? json(*c.equivalent_within_m) : json(nullptr)},
          {"blocks", c.blocks},
          {"share_kept", {{"simulated", c.share_kept[0]}, {"real", c.share_kept[1]}}},
          {"unit", c.sampling_unit},
          {"runs", {{"simulated", c.runs[0]}, {"real", c.runs[1]}}},
          {"within_run", c.within_run ? to_json(*c.within_run) : json(nullptr)}};
}

using base::StrictSection;
using nlohmann::json;

namespace {

constexpr const char* kVoxelScalar = "voxel_distance";
constexpr const char* kSurfaceScalar = "surface_distance";
constexpr const char* kRegionScalar = "over_region";

DistanceStatistics read_statistics(StrictSection& reader, std::size_t count) {
  DistanceStatistics s;
  s.count = count;
  s.mean = reader.required_number("mean");
  s.std = reader.required_number("std");
  s.median = reader.required_number("median");
  s.rmse = reader.required_number("rmse");
  return s;
}

/// Empty for older files without percentiles.
Percentiles read_percentiles(StrictSection& parent) {
  Percentiles percentiles;
  if (!parent.has("percentiles")) return percentiles;
  StrictSection reader = parent.required_section("percentiles");
  for (const std::string& key : reader.keys()) {
    int percent = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), percent);
    const bool whole = error == std::errc() && end == key.data() + key.size();
    if (!whole || percent < 0 || percent > 100) throw reader.error(key, "must be a whole percentage, 0 to 100");
    percentiles[percent] = reader.required_number(key);
  }
  return percentiles;
}

Histogram read_histogram(StrictSection reader) {
  Histogram histogram{reader.required_numbers("edges"), reader.required_counts("counts")};
  if (histogram.edges.size() != histogram.counts.size() + 1)
    throw reader.error("edges", "must have one more entry than counts");
  reader.require_all_keys_used();
  return histogram;
}

DistanceStatistics read_floor(StrictSection reader) {
  const DistanceStatistics floor = read_statistics(reader, reader.required_count("count"));
  reader.require_all_keys_used();
  return floor;
}

MapMetrics read_map(StrictSection reader) {
  MapMetrics m;
  m.points = reader.required_count("points");
  m.correspondences = reader.required_count("correspondences");
  if (m.correspondences > m.points) throw reader.error("correspondences", "must not exceed the number of points");
  m.distances = read_statistics(reader, m.correspondences);
  m.percentiles = read_percentiles(reader);
  m.histogram = read_histogram(reader.required_section("histogram"));
  m.cutoff_m = reader.required_number("cutoff");
  m.quantization_floor = read_floor(reader.required_section("quantization_floor"));
  reader.required_number("share_kept");  // redundant with the counts, as is the next key
  if (reader.has("cumulative")) reader.required_numbers("cumulative");
  if (reader.required_text("truth") != "voxel-centres") throw reader.error("truth", "must be \"voxel-centres\"");
  reader.require_all_keys_used();
  return m;
}

std::map<double, double> read_shares(StrictSection reader) {
  std::map<double, double> shares;
  for (const std::string& key : reader.keys()) {
    double threshold_m = 0.0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), threshold_m);
    if (error != std::errc() || end != key.data() + key.size())
      throw reader.error(key, "must be a threshold in metres");
    shares[threshold_m] = reader.required_number(key);
  }
  return shares;
}

/// Empty for older files without a curve.
CumulativeCurve read_cumulative(StrictSection& parent) {
  if (!parent.has("cumulative")) return {};
  StrictSection reader = parent.required_section("cumulative");
  CumulativeCurve curve{reader.required_numbers("thresholds"), reader.required_numbers("shares"), {}, {}};
  if (reader.has("completeness")) curve.completeness = reader.required_numbers("completeness");
  if (reader.has("f_score")) curve.f_score = reader.required_numbers("f_score");
  reader.ignore({"area"});  // follows from the curves
  reader.require_all_keys_used();
  return curve;
}

SurfaceMetrics read_surface(StrictSection reader) {
  SurfaceMetrics m;
  m.distances = read_statistics(reader, reader.required_count("points"));
  m.percentiles = read_percentiles(reader);
  m.cumulative = read_cumulative(reader);
  if (const auto normals = reader.section("normals")) m.normals = read_normal_consistency(*normals);
  m.accuracy = read_shares(reader.required_section("accuracy"));
  m.completeness = read_shares(reader.required_section("completeness"));
  m.f_score = read_shares(reader.required_section("f_score"));
  reader.require_all_keys_used();
  return m;
}

PoseErrorSpread read_spread(StrictSection reader) {
  PoseErrorSpread s;
  s.mean = reader.required_number("mean");
  s.median = reader.required_number("median");
  s.std = reader.required_number("std");
  s.min = reader.required_number("min");
  s.max = reader.required_number("max");
  reader.require_all_keys_used();
  return s;
}

RelativePoseError read_relative_error(StrictSection reader, bool by_frames) {
  RelativePoseError e;
  if (by_frames) {
    e.delta_frames = reader.required_count("delta_frames");
  } else {
    e.delta_m = reader.required_number("delta_m");
  }
  e.pairs = reader.required_count("pairs");
  e.translation_rmse_m = reader.required_number("translation_rmse_m");
  e.rotation_rmse_deg = reader.required_number("rotation_rmse_deg");
  if (reader.has("translation_m")) e.translation_m = read_spread(reader.required_section("translation_m"));
  if (reader.is_map("rotation_deg")) e.rotation_deg = read_spread(reader.required_section("rotation_deg"));
  reader.ignore({"rotation_deg"});  // null: by a receiver's positions
  reader.require_all_keys_used();
  return e;
}

PathDrift read_drift(StrictSection reader) {
  PathDrift d;
  d.segment_length_m = reader.required_number("stretch_m");
  d.subpaths = reader.required_count("subpaths");
  d.translation_percent = reader.required_number("translation_percent");
  d.rotation_deg_per_m = reader.required_number("rotation_deg_per_m");
  reader.require_all_keys_used();
  return d;
}

ScaleDrift read_scale_drift(StrictSection reader) {
  ScaleDrift d;
  d.segment_length_m = reader.required_number("stretch_m");
  d.segments = reader.required_count("stretches");
  d.max_deviation = reader.required_number("largest");
  d.rms = reader.required_number("rms");
  reader.require_all_keys_used();
  return d;
}

std::optional<TrajectoryAlignment> read_alignment(StrictSection& reader) {
  const std::optional<std::string> name = reader.choice("alignment", {"sim3", "se3", "none"});
  if (!name) return std::nullopt;
  if (*name == "none") return TrajectoryAlignment::kNone;
  return *name == "se3" ? TrajectoryAlignment::kSE3 : TrajectoryAlignment::kSim3;
}

/// The keys that older files lack.
void read_newer_keys(StrictSection& reader, TrajectoryMetrics& m) {
  const auto number = [&](const char* key, double& value) {
    if (reader.has(key)) value = reader.required_number(key);
  };
  const auto count = [&](const char* key, std::size_t& value) {
    if (reader.has(key)) value = reader.required_count(key);
  };
  number("ate_median", m.ate_median_m);
  number("ate_std", m.ate_std_m);
  number("ate_min", m.ate_min_m);
  number("time_covered", m.time_covered);
  count("poses_estimated", m.estimated_poses);
  count("poses_true", m.true_poses);
  m.alignment = read_alignment(reader);
  if (reader.has("drift")) m.drift = read_drift(reader.required_section("drift"));
  if (reader.has("scale_drift")) m.scale_drift = read_scale_drift(reader.required_section("scale_drift"));
  if (!reader.has("rpe_frames")) return;
  for (const StrictSection& entry : reader.sections("rpe_frames"))
    m.rpe_frames.push_back(read_relative_error(entry, true));
}

ReceiverError read_receiver_error(StrictSection reader) {
  ReceiverError r;
  r.horizontal_sigma_m = reader.required_number("horizontal_sigma_m");
  r.vertical_sigma_m = reader.required_number("vertical_sigma_m");
  r.expected_rmse_m = reader.required_number("expected_rmse_m");
  reader.require("beyond_receiver_m");
  r.beyond_receiver_m = reader.number("beyond_receiver_m");
  r.normalized_error_squared = reader.required_number("normalized_error_squared");
  r.time_offset_s = reader.required_number("time_offset_s");
  r.time_offset_sigma_s = reader.required_number("time_offset_sigma_s");
  if (const auto lever_arm = reader.numbers("lever_arm_m", 3, 3))
    r.lever_arm_m = geometry::Vec3((*lever_arm)[0], (*lever_arm)[1], (*lever_arm)[2]);
  reader.require_all_keys_used();
  return r;
}

TrajectoryMetrics read_trajectory(StrictSection reader) {
  TrajectoryMetrics m;
  m.ate_rmse_m = reader.required_number("ate_rmse");
  m.ate_mean_m = reader.required_number("ate_mean");
  m.ate_max_m = reader.required_number("ate_max");
  m.path_length_m = reader.required_number("path_length");
  m.scale = reader.required_number("scale");
  m.poses = reader.required_count("poses");
  reader.require("rpe");
  for (const StrictSection& entry : reader.sections("rpe")) m.rpe.push_back(read_relative_error(entry, false));
  read_newer_keys(reader, m);
  if (reader.has("receiver")) m.receiver = read_receiver_error(reader.required_section("receiver"));
  reader.require_all_keys_used();
  return m;
}

/// Nearest float on the same side of the cut-off.
float on_same_side(double distance_m, double cutoff_m) {
  float rounded = static_cast<float>(distance_m);
  if (distance_m <= cutoff_m && static_cast<double>(rounded) > cutoff_m) rounded = std::nextafter(rounded, 0.0f);
  if (distance_m > cutoff_m && static_cast<double>(rounded) <= cutoff_m) {
    rounded = std::nextafter(rounded, std::numeric_limits<float>::infinity());
  }
  return rounded;
}

std::vector<float> as_floats(const std::vector<double>& distances, double cutoff_m) {
  std::vector<float> result;
  result.reserve(distances.size());
  for (const double d : distances) result.push_back(on_same_side(d, cutoff_m));
  return result;
}

std::vector<double> scalar_of(const geometry::PointCloud& cloud, const char* name, const std::filesystem::path& file) {
  const auto found = cloud.scalars.find(name);
  if (found == cloud.scalars.end()) throw InputError(file.string(), std::string("has no property '") + name + "'");
  return {found->second.begin(), found->second.end()};
}

/// Points over the region with ground truth, `count` in all; nullopt if the file does not mark them.
std::optional<KeptDistances> over_region(const geometry::PointCloud& cloud, const std::vector<double>& distances,
                                         std::size_t count) {
  const auto over = cloud.scalars.find(kRegionScalar);
  if (over == cloud.scalars.end() && count != cloud.size()) return std::nullopt;
  KeptDistances kept{.points = cloud.size()};
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (over != cloud.scalars.end() && over->second[i] == 0.0f) continue;
    kept.positions.push_back(cloud.positions[i]);
    kept.distances.push_back(distances[i]);
  }
  return kept;
}

}  // namespace

json to_json(const Metrics& metrics) {
  json object = {{"map", to_json(metrics.map)},
                 {"surface", metrics.surface ? to_json(*metrics.surface) : json(nullptr)},
                 {"trajectory", metrics.trajectory ? to_json(*metrics.trajectory) : json(nullptr)},
                 {"entropy", metrics.entropy ? to_json(*metrics.entropy) : json(nullptr)},
                 {"wasserstein", metrics.wasserstein ? to_json(*metrics.wasserstein) : json(nullptr)},
                 {"error_budget", metrics.error_budget ? to_json(*metrics.error_budget) : json(nullptr)}};
  if (metrics.regions) object["regions"] = to_json(*metrics.regions);
  if (metrics.moving) object["moving_objects"] = to_json(*metrics.moving);
  object["warnings"] = to_json(metrics.warnings);
  return object;
}

Metrics metrics_from_json(const json& object, const std::string& where) {
  StrictSection reader(object, where);
  Metrics metrics;
  metrics.map = read_map(reader.required_section("map"));
  for (const char* key : {"surface", "trajectory"}) reader.require(key);  // null if they were not computed
  if (const auto surface = reader.section("surface")) metrics.surface = read_surface(*surface);
  if (const auto trajectory = reader.section("trajectory")) metrics.trajectory = read_trajectory(*trajectory);
  if (const auto entropy = reader.section("entropy")) metrics.entropy = read_map_entropy(*entropy);
  if (const auto wasserstein = reader.section("wasserstein"))
    metrics.wasserstein = read_voxel_wasserstein(*wasserstein);
  if (const auto budget = reader.section("error_budget")) metrics.error_budget = read_error_budget(*budget);
  if (const auto regions = reader.section("regions")) metrics.regions = read_region_scores(*regions);
  if (const auto moving = reader.section("moving_objects")) metrics.moving = read_moving_points(*moving);
  metrics.warnings = read_warnings(reader);  // absent in older files
  reader.require_all_keys_used();
  return metrics;
}

std::filesystem::path errors_file(const std::filesystem::path& metrics_json) {
  return metrics_json.parent_path() / "errors.ply";
}

geometry::PointCloud cloud_with_errors(PointErrors errors, double cutoff_m) {
  geometry::PointCloud cloud = std::move(errors.aligned_map);
  cloud.scalars[kVoxelScalar] = as_floats(errors.voxel_m, cutoff_m);
  if (!errors.surface_m.empty()) {
    cloud.scalars[kSurfaceScalar] = as_floats(errors.surface_m, cutoff_m);
    std::vector<float>& over = cloud.scalars[kRegionScalar];
    over.assign(cloud.size(), 1.0f);
    for (std::size_t i = 0; i < errors.over_region.size(); ++i) over[i] = errors.over_region[i] ? 1.0f : 0.0f;
  }
  return cloud;
}

void write_point_errors(const std::filesystem::path& ply, PointErrors errors, double cutoff_m) {
  geometry::write_cloud(ply, cloud_with_errors(std::move(errors), cutoff_m));
}

void write_metrics(const std::filesystem::path& metrics_json, const Metrics& metrics, PointErrors errors) {
  write_point_errors(errors_file(metrics_json), std::move(errors), metrics.map.cutoff_m);
  write_metrics(metrics_json, metrics);
}

void write_metrics(const std::filesystem::path& metrics_json, const Metrics& metrics) {
  base::write_file(metrics_json, to_json(metrics).dump(2) + "\n");
}

MetricsFile read_metrics(const std::filesystem::path& metrics_json) {
  const json object = base::read_json(metrics_json);
  MetricsFile result;
  result.metrics = metrics_from_json(object, metrics_json.string());
  const std::filesystem::path file = errors_file(metrics_json);
  const geometry::PointCloud cloud = geometry::read_cloud(file);
  const MapMetrics& map = result.metrics.map;
  result.voxel = keep_within_cutoff(cloud.positions, scalar_of(cloud, kVoxelScalar, file), map.cutoff_m);
  if (result.voxel.points != map.points || result.voxel.distances.size() != map.correspondences) {
    throw InputError(file.string(), "belongs to a different run than " + metrics_json.string() + ": " +
                                        std::to_string(result.voxel.distances.size()) + " correspondences instead of " +
                                        std::to_string(map.correspondences) + "; evaluate the map again");
  }
  if (result.metrics.surface)
    result.surface =
        over_region(cloud, scalar_of(cloud, kSurfaceScalar, file), result.metrics.surface->distances.count);
  return result;
}

}  // namespace tileflight::metrics
