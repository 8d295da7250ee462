#include "tileflight/evaluation/metrics/moving_points.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/strict_section.h"
#include "tileflight/evaluation/metrics/distance_statistics.h"
#include "tileflight/evaluation/metrics/distances.h"

namespace tileflight::metrics {

using base::StrictSection;
using geometry::Vec3;
using nlohmann::json;

namespace {

json point_scores_json(const PointScores& scores) {
  return {{"points", scores.points},
          {"voxel", distance_statistics_json(scores.voxel)},
          {"surface", scores.surface ? distance_statistics_json(*scores.surface) : json(nullptr)}};
}

PointScores read_point_scores(StrictSection& reader) {
  PointScores scores{.points = reader.required_count("points"),
                     .voxel = read_distance_statistics(reader.required_section("voxel")),
                     .surface = std::nullopt};
  reader.require("surface");
  if (const auto surface = reader.section("surface")) scores.surface = read_distance_statistics(*surface);
  return scores;
}

double share_apart(std::size_t part, std::size_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

}  // namespace

bool is_on(const PlacedBox& box, const Vec3& point, const BoxMargins& margins) {
  const Vec3 own = box.T_local_box.inverse() * point;
  const Vec3 half = 0.5 * box.size_m;
  const double bottom = -half.z() + std::min(margins.lifted_m, box.size_m.z() / 3.0);
  return std::abs(own.x()) <= half.x() + margins.grown_m && std::abs(own.y()) <= half.y() + margins.grown_m &&
         own.z() >= bottom && own.z() <= half.z() + margins.grown_m;
}

PointScores score_points(const std::vector<double>& voxel_m, const std::optional<std::vector<double>>& surface_m,
                         double cutoff_m) {
  std::vector<double> kept;
  std::ranges::copy_if(voxel_m, std::back_inserter(kept), [&](double d) { return d <= cutoff_m; });
  PointScores scores{.points = voxel_m.size(), .voxel = compute_statistics(std::move(kept)), .surface = std::nullopt};
  if (surface_m) scores.surface = compute_statistics(*surface_m);
  return scores;
}

json to_json(const MovingPoints& moving) {
  json object = point_scores_json(moving.apart);
  object["share"] = share_apart(moving.apart.points, moving.with_them.points);
  object["objects"] = moving.objects;
  object["at"] = moving.by_keyframe ? "keyframe" : "any-time";
  object["grown"] = moving.margins.grown_m;
  object["lifted"] = moving.margins.lifted_m;
  object["with_them"] = point_scores_json(moving.with_them);
  return object;
}

MovingPoints read_moving_points(StrictSection reader) {
  MovingPoints moving;
  moving.apart = read_point_scores(reader);
  moving.objects = reader.required_count("objects");
  const std::string at = reader.required_text("at");
  if (at != "keyframe" && at != "any-time") throw reader.error("at", "must be \"keyframe\" or \"any-time\"");
  moving.by_keyframe = at == "keyframe";
  moving.margins = {reader.required_number("grown"), reader.required_number("lifted")};
  StrictSection with_them = reader.required_section("with_them");
  moving.with_them = read_point_scores(with_them);
  with_them.require_all_keys_used();
  if (moving.apart.points > moving.with_them.points) throw reader.error("points", "must not exceed those of with_them");
  reader.ignore({"share"});  // follows from the points
  reader.require_all_keys_used();
  return moving;
}

}  // namespace tileflight::metrics
