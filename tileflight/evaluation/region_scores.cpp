#include "tileflight/evaluation/region_scores.h"

#include <nlohmann/json.hpp>

#include <algorithm>

namespace tileflight::evaluation {

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

json statistics(const DistanceStatistics& s) {
  return {{"points", s.count}, {"mean", s.mean}, {"std", s.std}, {"median", s.median}, {"rmse", s.rmse}};
}

json numbers(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

DistanceStatistics read_statistics(JsonReader& reader) {
  DistanceStatistics s;
  s.count = reader.count("points");
  s.mean = reader.number("mean");
  s.std = reader.number("std");
  s.median = reader.number("median");
  s.rmse = reader.number("rmse");
  return s;
}

DistanceStatistics read_whole(JsonReader reader) {
  const DistanceStatistics s = read_statistics(reader);
  reader.expect_all_read();
  return s;
}

Vec3 read_vector(JsonReader& reader, const std::string& key) {
  const std::vector<double> v = reader.numbers(key);
  if (v.size() != 3) reader.fail(key, "must be three numbers");
  return {v[0], v[1], v[2]};
}

RegionScore read_region(JsonReader reader) {
  RegionScore region;
  const Vec3 center = read_vector(reader, "center"), half = 0.5 * read_vector(reader, "size");
  if (!(half.minCoeff() > 0.0)) reader.fail("size", "must be positive");
  region.box = Box3(center - half, center + half);
  const std::string use = reader.text("use");
  if (use != "held-out" && use != "aligned-on") reader.fail("use", "must be \"aligned-on\" or \"held-out\"");
  region.held_out = use == "held-out";
  region.distances = read_statistics(reader);
  reader.expect_all_read();
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
    json entry = statistics(region.distances);
    entry["use"] = region.held_out ? "held-out" : "aligned-on";
    entry["center"] = numbers(region.box.center());
    entry["size"] = numbers(region.box.sizes());
    each.push_back(std::move(entry));
  }
  return {{"aligned_on", statistics(scores.aligned_on)}, {"held_out", statistics(scores.held_out)}, {"each", each}};
}

RegionScores read_region_scores(JsonReader reader, const std::string& where) {
  RegionScores scores;
  scores.aligned_on = read_whole(reader.object("aligned_on"));
  scores.held_out = read_whole(reader.object("held_out"));
  const json& each = reader.value("each");
  if (!each.is_array()) reader.fail("each", "must be a list of regions");
  for (std::size_t k = 0; k < each.size(); ++k)
    scores.each.push_back(read_region(JsonReader(each[k], where, reader.name("each." + std::to_string(k)))));
  reader.expect_all_read();
  return scores;
}

}  // namespace tileflight::evaluation
