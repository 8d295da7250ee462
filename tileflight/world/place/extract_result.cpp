#include "tileflight/world/place/extract_result.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::place {
namespace {

using nlohmann::json;

/// The file in a folder written by extract().
std::filesystem::path extract_file(const std::filesystem::path& folder) { return folder / "extract.json"; }

/// A number that JSON may hold: null if there is none.
json number_or_null(const std::optional<double>& number) { return number ? json(*number) : json(); }

/// Sets `value` from the object's key; a missing key or null leaves it.
template <class Value>
void take(const json& object, const char* key, Value& value) {
  const auto found = object.find(key);
  if (found != object.end() && !found->is_null()) found->get_to(value);
}

template <class Value>
void take(const json& object, const char* key, std::optional<Value>& value) {
  const auto found = object.find(key);
  if (found != object.end() && !found->is_null()) value = found->get<Value>();
}

json floor_json(const std::optional<ground_truth::FloorStatistics>& floor) {
  if (!floor) return nullptr;
  return {{"count", floor->count},     {"mean", floor->mean_m}, {"std", number_or_null(floor->std_m)},
          {"median", floor->median_m}, {"rmse", floor->rmse_m}, {"max", floor->max_m}};
}

std::optional<ground_truth::FloorStatistics> floor_from_json(const json& floor) {
  if (!floor.is_object()) return std::nullopt;
  ground_truth::FloorStatistics statistics;
  take(floor, "count", statistics.count);
  take(floor, "mean", statistics.mean_m);
  take(floor, "std", statistics.std_m);
  take(floor, "median", statistics.median_m);
  take(floor, "rmse", statistics.rmse_m);
  take(floor, "max", statistics.max_m);
  return statistics;
}

geometry::Vec3 vector_from_json(const json& numbers) {
  return {numbers.at(0).get<double>(), numbers.at(1).get<double>(), numbers.at(2).get<double>()};
}

geometry::PolygonArea polygon_from_json(const json& polygon) {
  std::vector<geometry::Ring> rings;
  for (const json& ring : polygon.at("rings")) {
    rings.emplace_back();
    for (const json& corner : ring) rings.back().emplace_back(corner.at(0).get<double>(), corner.at(1).get<double>());
  }
  return geometry::PolygonArea(std::move(rings));
}

std::optional<tileset::Region> region_from_json(const json& region) {
  if (!region.is_object()) return std::nullopt;
  tileset::Region out{vector_from_json(region.at("center")), vector_from_json(region.at("size")), {}};
  for (const json& polygon : region.value("polygons", json::array()))
    out.parts.push_back({polygon_from_json(polygon), polygon.value("bottom", 0.0), polygon.value("top", 0.0)});
  return out;
}

std::optional<geometry::Geodetic> origin_from_json(const json& frame) {
  if (!frame.is_object() || !frame.contains("origin_lat") || frame["origin_lat"].is_null()) return std::nullopt;
  return geometry::Geodetic{frame.at("origin_lat").get<double>(), frame.at("origin_lon").get<double>(),
                            geometry::EllipsoidalHeight{frame.at("origin_height").get<double>()}};
}

ExtractResult result_from_json(const json& about) {
  ExtractResult result;
  take(about, "source", result.source);
  take(about, "tiles_wanted", result.tiles_wanted);
  take(about, "tiles_loaded", result.tiles_loaded);
  take(about, "tiles_failed", result.tiles_failed);
  take(about, "failures", result.failures);
  take(about, "complete", result.complete);
  take(about, "geometric_error_wanted", result.geometric_error_wanted_m);
  take(about, "geometric_error_max", result.geometric_error_max_m);
  take(about, "triangles", result.triangles);
  take(about, "triangles_loaded", result.triangles_loaded);
  take(about, "points", result.points);
  take(about, "bytes_read", result.bytes_read);
  take(about, "cut_sha256", result.cut_sha256);
  take(about, "voxel_size", result.voxel_m);
  take(about, "voxel_dims", result.voxel_dims);
  take(about, "voxels_occupied", result.voxels_occupied);
  take(about, "surface_points", result.surface_points);
  result.region = region_from_json(about.value("region", json()));
  result.origin = origin_from_json(about.value("frame", json()));
  take(about, "attribution", result.attribution);
  const json terms = about.value("terms", json::object());
  take(terms, "provider", result.terms_provider);
  take(terms, "url", result.terms_url);
  take(about, "terms_accepted", result.terms_accepted);
  take(about, "warnings", result.warnings);
  take(about, "version", result.version);
  const json seconds = about.value("seconds", json::object());
  take(seconds, "load", result.seconds.load_s);
  take(seconds, "truth", result.seconds.truth_s);
  take(seconds, "total", result.seconds.total_s);
  result.quantization_floor = floor_from_json(about.value("quantization_floor", json()));
  return result;
}

}  // namespace

bool TruthRegion::contains_horizontally(const geometry::Vec3& p) const {
  const auto beside = [&](int axis) { return p[axis] < box.min()[axis] || p[axis] > box.max()[axis]; };
  if (beside(0) || beside(1)) return false;
  return polygons.empty() ||
         std::ranges::any_of(polygons, [&](const auto& polygon) { return polygon.contains(p.head<2>()); });
}

geometry::PointCloud crop_to_region(const geometry::PointCloud& cloud, const TruthRegion& region) {
  std::vector<bool> keep(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) keep[i] = region.contains_horizontally(cloud.positions[i]);
  return geometry::filter_points(cloud, keep);
}

TruthRegion ExtractResult::scored_region() const {
  if (!region) throw InputError("extract.json", "does not state the region; make the folder with `tileflight extract`");
  TruthRegion scored{region->box(), {}};
  for (const geometry::Prism& part : region->parts) scored.polygons.push_back(part.base);
  return scored;
}

json to_json(const ExtractResult& result) {
  json about{{"source", result.source},
             {"tiles_wanted", result.tiles_wanted},
             {"tiles_loaded", result.tiles_loaded},
             {"tiles_failed", result.tiles_failed},
             {"failures", result.failures},
             {"complete", result.complete},
             {"geometric_error_wanted", result.geometric_error_wanted_m},
             {"geometric_error_max", number_or_null(result.geometric_error_max_m)},
             {"triangles", result.triangles},
             {"triangles_loaded", result.triangles_loaded},
             {"points", result.points},
             {"bytes_read", result.bytes_read},
             {"cut_sha256", result.cut_sha256},
             {"voxel_size", result.voxel_m},
             {"voxel_dims", result.voxel_dims},
             {"voxels_occupied", result.voxels_occupied},
             {"surface_points", result.surface_points},
             {"frame", frame_json(result.origin)},
             {"attribution", result.attribution},
             {"terms", {{"provider", result.terms_provider}, {"url", result.terms_url}}},
             {"terms_accepted", result.terms_accepted},
             {"warnings", result.warnings},
             {"version", result.version},
             {"quantization_floor", floor_json(result.quantization_floor)},
             {"seconds",
              {{"load", result.seconds.load_s}, {"truth", result.seconds.truth_s}, {"total", result.seconds.total_s}}}};
  if (result.region) about["region"] = region_json(*result.region);
  return about;
}

void write_extract_json(const ExtractResult& result, const std::filesystem::path& folder) {
  base::write_file(extract_file(folder), to_json(result).dump(2) + "\n");
}

ExtractResult read_extract_json(const std::filesystem::path& folder) {
  const std::filesystem::path file = extract_file(folder);
  const json about = json::parse(base::read_text(file), nullptr, false);
  if (!about.is_object())
    throw InputError(file.string(), "not a JSON object; make the folder with `tileflight extract`");
  try {
    return result_from_json(about);
  } catch (const json::exception& error) {
    throw InputError(file.string(), std::string("is not as `tileflight extract` writes it: ") + error.what());
  }
}

json region_json(const tileset::Region& region) {
  const auto corner = [](const geometry::Vec3& v) { return json{v.x(), v.y(), v.z()}; };
  json out = {{"center", corner(region.center)}, {"size", corner(region.size)}};
  for (const geometry::Prism& part : region.parts) {
    json rings = json::array();
    for (const geometry::Ring& ring : part.base.rings()) {
      rings.push_back(json::array());
      for (const Eigen::Vector2d& point : ring) rings.back().push_back({point.x(), point.y()});
    }
    out["polygons"].push_back({{"rings", rings}, {"bottom", part.bottom_m}, {"top", part.top_m}});
  }
  return out;
}

json frame_json(const std::optional<geometry::Geodetic>& origin) {
  if (!origin) return {{"origin_lat", nullptr}, {"origin_lon", nullptr}, {"origin_height", nullptr}};
  return {
      {"origin_lat", origin->latitude_deg}, {"origin_lon", origin->longitude_deg}, {"origin_height", origin->height.m}};
}

json frame_json(const std::optional<geometry::LocalFrame>& frame) {
  return frame_json(frame ? std::optional(frame->origin()) : std::nullopt);
}

std::map<std::string, std::string> describe_frame(const std::optional<geometry::Geodetic>& origin) {
  if (!origin) return {{"frame.kind", "tileset"}};
  return {{"frame.kind", "east-north-up"},
          {"frame.origin_lat", base::fixed_text(origin->latitude_deg)},
          {"frame.origin_lon", base::fixed_text(origin->longitude_deg)},
          {"frame.origin_height", base::fixed_text(origin->height.m)}};
}

}  // namespace tileflight::place
