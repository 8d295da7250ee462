#include "tileflight/evaluation/metrics/region_scores.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/evaluation/metrics/distance_statistics.h"

namespace tileflight::metrics {

using base::StrictSection;
using geometry::Box3;
using geometry::Vec3;
using nlohmann::json;

namespace {

bool inside(const std::vector<Box3>& boxes, const Vec3& p) {
  return std::ranges::any_of(boxes, [&](const Box3& box) { return box.contains(p); });
}

/// Statistics over the points for which `takes` is true.
template <class Takes>
DistanceStatistics score_of(const std::vector<Vec3>& points, const std::vector<double>& distances_m,
                            const Takes& takes) {
  std::vector<double> taken;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (takes(points[i])) taken.push_back(distances_m[i]);
  }
  return compute_statistics(std::move(taken));
}

Vec3 read_vector(StrictSection& reader, const std::string& key) {
  const std::vector<double> v = reader.required_numbers(key);
  if (v.size() != 3) throw reader.error(key, "must be three numbers");
  return {v[0], v[1], v[2]};
}

RegionScore read_region(StrictSection reader) {
  RegionScore region;
  const Vec3 center = read_vector(reader, "center"), half = 0.5 * read_vector(reader, "size");
  if (!(half.minCoeff() > 0.0)) throw reader.error("size", "must be positive");
  region.box = Box3(center - half, center + half);
  const std::string use = reader.required_text("use");
  if (use != "held-out" && use != "aligned-on") throw reader.error("use", "must be \"aligned-on\" or \"held-out\"");
  region.held_out = use == "held-out";
  region.distances = take_distance_statistics(reader);
  reader.require_all_keys_used();
  return region;
}

}  // namespace

RegionScores score_regions(const std::vector<Vec3>& points, const std::vector<double>& distances_m,
                           const std::vector<Box3>& aligned_on, const std::vector<Box3>& held_out) {
  RegionScores scores;
  const auto add = [&](const std::vector<Box3>& boxes, bool kept_back) {
    for (const Box3& box : boxes) {
      const auto contains = [&](const Vec3& p) { return box.contains(p); };
      scores.each.push_back({box, kept_back, score_of(points, distances_m, contains)});
    }
  };
  add(aligned_on, false);
  add(held_out, true);
  scores.aligned_on = score_of(points, distances_m, [&](const Vec3& p) { return inside(aligned_on, p); });
  scores.held_out =
      score_of(points, distances_m, [&](const Vec3& p) { return inside(held_out, p) && !inside(aligned_on, p); });
  return scores;
}

json to_json(const RegionScores& scores) {
  json each = json::array();
  for (const RegionScore& region : scores.each) {
    json entry = distance_statistics_json(region.distances);
    entry["use"] = region.held_out ? "held-out" : "aligned-on";
    entry["center"] = geometry::json_numbers(region.box.center());
    entry["size"] = geometry::json_numbers(region.box.sizes());
    each.push_back(std::move(entry));
  }
  return {{"aligned_on", distance_statistics_json(scores.aligned_on)},
          {"held_out", distance_statistics_json(scores.held_out)},
          {"each", each}};
}

RegionScores read_region_scores(StrictSection reader) {
  RegionScores scores;
  scores.aligned_on = read_distance_statistics(reader.required_section("aligned_on"));
  scores.held_out = read_distance_statistics(reader.required_section("held_out"));
  reader.require("each");
  for (const StrictSection& region : reader.sections("each")) scores.each.push_back(read_region(region));
  reader.require_all_keys_used();
  return scores;
}

}  // namespace tileflight::metrics
