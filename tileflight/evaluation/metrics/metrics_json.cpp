#include <charconv>
#include <nlohmann/json.hpp>

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

json to_json(const TrajectoryMetrics& m) {
  return {{"ate_rmse", m.ate_rmse_m},
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

}  // namespace tileflight::metrics
