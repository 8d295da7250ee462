#include "tileflight/evaluation/metrics_file.h"

#include <nlohmann/json.hpp>

#include <charconv>
#include <cmath>
#include <limits>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/json_file.h"
#include "tileflight/evaluation/distances.h"
#include "tileflight/evaluation/doubts_json.h"
#include "tileflight/evaluation/json_reader.h"
#include "tileflight/geometry/cloud_files.h"

namespace tileflight::evaluation {

using nlohmann::json;

namespace {

constexpr const char* kVoxelScalar = "voxel_distance";
constexpr const char* kSurfaceScalar = "surface_distance";
constexpr const char* kRegionScalar = "over_region";

DistanceStatistics read_statistics(JsonReader& reader, std::size_t count) {
  DistanceStatistics s;
  s.count = count;
  s.mean = reader.number("mean");
  s.std = reader.number("std");
  s.median = reader.number("median");
  s.rmse = reader.number("rmse");
  return s;
}

/// Empty for older files without percentiles.
Percentiles read_percentiles(JsonReader& parent) {
  Percentiles percentiles;
  if (!parent.has("percentiles")) return percentiles;
  JsonReader reader = parent.object("percentiles");
  for (const std::string& key : reader.keys()) {
    int percent = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), percent);
    const bool whole = error == std::errc() && end == key.data() + key.size();
    if (!whole || percent < 0 || percent > 100) reader.fail(key, "must be a whole percentage, 0 to 100");
    percentiles[percent] = reader.number(key);
  }
  return percentiles;
}

Histogram read_histogram(JsonReader reader) {
  Histogram histogram{reader.numbers("edges"), reader.counts("counts")};
  if (histogram.edges.size() != histogram.counts.size() + 1)
    reader.fail("edges", "must have one more entry than counts");
  reader.expect_all_read();
  return histogram;
}

DistanceStatistics read_floor(JsonReader reader) {
  const DistanceStatistics floor = read_statistics(reader, reader.count("count"));
  reader.expect_all_read();
  return floor;
}

MapMetrics read_map(JsonReader reader) {
  MapMetrics m;
  m.points = reader.count("points");
  m.correspondences = reader.count("correspondences");
  if (m.correspondences > m.points) reader.fail("correspondences", "must not exceed the number of points");
  m.distances = read_statistics(reader, m.correspondences);
  m.percentiles = read_percentiles(reader);
  m.histogram = read_histogram(reader.object("histogram"));
  m.cutoff_m = reader.number("cutoff");
  m.quantization_floor = read_floor(reader.object("quantization_floor"));
  reader.number("share_kept");  // redundant with the counts, as is the next key
  if (reader.has("cumulative")) reader.numbers("cumulative");
  if (reader.text("truth") != "voxel-centres") reader.fail("truth", "must be \"voxel-centres\"");
  reader.expect_all_read();
  return m;
}

std::map<double, double> read_shares(JsonReader reader) {
  std::map<double, double> shares;
  for (const std::string& key : reader.keys()) {
    double threshold_m = 0.0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), threshold_m);
    if (error != std::errc() || end != key.data() + key.size()) reader.fail(key, "must be a threshold in metres");
    shares[threshold_m] = reader.number(key);
  }
  return shares;
}

/// Empty for older files without a curve.
CumulativeCurve read_cumulative(JsonReader& parent) {
  if (!parent.has("cumulative")) return {};
  JsonReader reader = parent.object("cumulative");
  CumulativeCurve curve{reader.numbers("thresholds"), reader.numbers("shares")};
  reader.expect_all_read();
  return curve;
}

bool is_given(JsonReader& reader, const std::string& key) { return reader.has(key) && !reader.value(key).is_null(); }

std::optional<SurfaceMetrics> read_surface(JsonReader& parent, const std::string& where) {
  if (parent.value("surface").is_null()) return std::nullopt;
  JsonReader reader = parent.object("surface");
  SurfaceMetrics m;
  m.distances = read_statistics(reader, reader.count("points"));
  m.percentiles = read_percentiles(reader);
  m.cumulative = read_cumulative(reader);
  if (is_given(reader, "normals")) m.normals = normals_from_json(reader.value("normals"), where);
  m.accuracy = read_shares(reader.object("accuracy"));
  m.completeness = read_shares(reader.object("completeness"));
  m.f_score = read_shares(reader.object("f_score"));
  reader.expect_all_read();
  return m;
}

RelativePoseError read_relative_error(JsonReader reader) {
  RelativePoseError e;
  e.delta_m = reader.number("delta_m");
  e.pairs = reader.count("pairs");
  e.translation_rmse_m = reader.number("translation_rmse_m");
  e.rotation_rmse_deg = reader.number("rotation_rmse_deg");
  reader.expect_all_read();
  return e;
}

PathDrift read_drift(JsonReader reader) {
  PathDrift d;
  d.segment_length_m = reader.number("stretch_m");
  d.subpaths = reader.count("subpaths");
  d.translation_percent = reader.number("translation_percent");
  d.rotation_deg_per_m = reader.number("rotation_deg_per_m");
  reader.expect_all_read();
  return d;
}

ScaleDrift read_scale_drift(JsonReader reader) {
  ScaleDrift d;
  d.segment_length_m = reader.number("stretch_m");
  d.segments = reader.count("stretches");
  d.max_deviation = reader.number("largest");
  d.rms = reader.number("rms");
  reader.expect_all_read();
  return d;
}

std::optional<TrajectoryMetrics> read_trajectory(JsonReader& parent, const std::string& where) {
  if (parent.value("trajectory").is_null()) return std::nullopt;
  JsonReader reader = parent.object("trajectory");
  TrajectoryMetrics m;
  m.ate_rmse_m = reader.number("ate_rmse");
  m.ate_mean_m = reader.number("ate_mean");
  m.ate_max_m = reader.number("ate_max");
  m.path_length_m = reader.number("path_length");
  m.scale = reader.number("scale");
  m.poses = reader.count("poses");
  if (reader.has("drift")) m.drift = read_drift(reader.object("drift"));  // older files lack both
  if (reader.has("scale_drift")) m.scale_drift = read_scale_drift(reader.object("scale_drift"));
  const json& list = reader.value("rpe");
  if (!list.is_array()) reader.fail("rpe", "must be a list");
  for (const json& entry : list) m.rpe.push_back(read_relative_error({entry, where, reader.name("rpe")}));
  reader.expect_all_read();
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
                 {"error_budget", metrics.error_budget ? to_json(*metrics.error_budget) : json(nullptr)}};
  if (metrics.regions) object["regions"] = to_json(*metrics.regions);
  object["doubts"] = to_json(metrics.doubts);
  return object;
}

Metrics metrics_from_json(const json& object, const std::string& where) {
  JsonReader reader(object, where, "");
  Metrics metrics;
  metrics.map = read_map(reader.object("map"));
  metrics.surface = read_surface(reader, where);
  metrics.trajectory = read_trajectory(reader, where);
  if (is_given(reader, "entropy")) metrics.entropy = map_entropy_from_json(reader.value("entropy"), where);
  if (is_given(reader, "error_budget"))
    metrics.error_budget = error_budget_from_json(reader.value("error_budget"), where);
  if (reader.has("regions")) metrics.regions = read_region_scores(reader.object("regions"), where);
  if (reader.has("doubts")) metrics.doubts = doubts_from_json(reader.value("doubts"), where);  // absent in older files
  reader.expect_all_read();
  return metrics;
}

std::filesystem::path errors_file(const std::filesystem::path& metrics_json) {
  return metrics_json.parent_path() / "errors.ply";
}

void write_metrics(const std::filesystem::path& metrics_json, const Metrics& metrics, PointErrors errors) {
  geometry::PointCloud cloud = std::move(errors.aligned_map);
  cloud.scalars[kVoxelScalar] = as_floats(errors.voxel_m, metrics.map.cutoff_m);
  if (!errors.surface_m.empty()) {
    cloud.scalars[kSurfaceScalar] = as_floats(errors.surface_m, metrics.map.cutoff_m);
    std::vector<float>& over = cloud.scalars[kRegionScalar];
    over.assign(cloud.size(), 1.0f);
    for (std::size_t i = 0; i < errors.over_region.size(); ++i) over[i] = errors.over_region[i] ? 1.0f : 0.0f;
  }
  geometry::write_cloud(errors_file(metrics_json), cloud);
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

}  // namespace tileflight::evaluation
