#include "tileflight/world/place/ground_heights.h"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/world/place/extract_result.h"
#include "tileflight/world/place/place_reader.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::place {
namespace {

using geometry::Box3;
using geometry::Geodetic;
using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using nlohmann::json;

/// Tiles within this distance of the line are read: more than the rounding of earth-centred coordinates and bounding
/// volumes.
constexpr double kLineRadius_m = 0.01;
/// Maximum distance of surfaces above or below.
constexpr double kMaxHeight_m = 20e3;

std::pair<double, double> two_numbers(const std::string& text, const std::string& option, const char* form) {
  char* end = nullptr;
  const double first = std::strtod(text.c_str(), &end);
  const bool has_comma = end != text.c_str() && *end == ',';
  const char* rest = has_comma ? end + 1 : end;
  const double second = has_comma ? std::strtod(rest, &end) : 0.0;
  if (!has_comma || end == rest || *end != '\0' || !std::isfinite(first) || !std::isfinite(second))
    throw InputError(option + " " + text, std::string("give ") + form + ", two numbers separated by a comma");
  return {first, second};
}

/// The vertical line through a point, and a frame whose z axis is along it.
struct Column {
  SE3 T_column_tileset;
  Vec2 position = Vec2::Zero();  ///< in that frame
};

class ColumnSampler {
 public:
  explicit ColumnSampler(PlaceReader& place) : place_(place), frame_(place.placement().local_frame) {}

  Column make_column(const GroundQuery& query) const {
    const SE3& T_local_tileset = place_.placement().T_local_tileset;
    if (query.local) return {T_local_tileset, *query.local};
    if (!frame_) {
      throw InputError(place_.name(),
                       "is not georeferenced: use --at-local X,Y, or give the origin of its frame with --origin "
                       "LAT,LON,HEIGHT");
    }
    // The line is the ellipsoid's normal at the point.
    const geometry::LocalFrame there({query.geodetic->latitude_deg, query.geodetic->longitude_deg, {0.0}});
    return {there.T_local_ecef() * frame_->T_ecef_local() * T_local_tileset, Vec2::Zero()};
  }

  json describe(const GroundQuery& query, const Column& column, const std::vector<double>& heights) const {
    json found{{"asked", query.text()}, {"lat", nullptr}, {"lon", nullptr}};
    json surfaces = json::array();
    for (const double height : heights) surfaces.push_back(surface(column, height));
    const Vec3 place = to_local(column, heights.empty() ? 0.0 : heights.front());
    found["local"] = {query.local ? query.local->x() : place.x(), query.local ? query.local->y() : place.y()};
    if (frame_) {
      const Geodetic geodetic = query.geodetic ? *query.geodetic : frame_->geodetic_from_local(place);
      found["lat"] = geodetic.latitude_deg;
      found["lon"] = geodetic.longitude_deg;
    }
    found["highest"] = surfaces.empty() ? json() : surfaces.front();
    found["lowest"] = surfaces.empty() ? json() : surfaces.back();
    found["surfaces"] = std::move(surfaces);
    return found;
  }

 private:
  Vec3 to_local(const Column& column, double height) const {
    const Vec3 in_column(column.position.x(), column.position.y(), height);
    return place_.placement().T_local_tileset * (column.T_column_tileset.inverse() * in_column);
  }

  json surface(const Column& column, double height) const {
    const Vec3 local = to_local(column, height);
    json out{{"local_z", local.z()}, {"height", nullptr}, {"height_above_sea_level", nullptr}};
    if (!frame_) return out;
    const Geodetic place = frame_->geodetic_from_local(local);
    out["height"] = place.height.m;
    try {
      out["height_above_sea_level"] = geometry::orthometric_from_ellipsoidal(place).m;
    } catch (const InputError&) {
      // Without the geoid grid the height is unknown.
    }
    return out;
  }

  PlaceReader& place_;
  const std::optional<geometry::LocalFrame>& frame_;
};

/// Heights of the surfaces on the line, from the meshes of the finest tiles that it crosses.
/// Tiles that are missing are added to `missing` if they are allowed to be.
std::vector<double> sample_heights(PlaceReader& place, const Column& column, bool allow_incomplete, json& totals,
                                   std::vector<std::string>& missing, const Progress& progress) {
  const Vec3 middle(column.position.x(), column.position.y(), 0.0);
  const tileset::Region region{middle, Vec3(2 * kLineRadius_m, 2 * kLineRadius_m, 2 * kMaxHeight_m)};
  const tileset::TileCut cut = place.select_cut(tileset::region_criterion(region, column.T_column_tileset, 0.0));
  const auto part = place.read(cut, false, std::numeric_limits<std::uintmax_t>::max(), progress);
  if (!part->missing.empty() && !allow_incomplete)
    throw InputError(part->missing.front().failure,
                     "it may contain the requested surface (--allow-incomplete continues without this tile)");
  for (const MissingTile& tile : part->missing) missing.push_back(tile.failure);
  totals["tiles"] = totals["tiles"].get<std::int64_t>() + part->tiles;
  totals["bytes_read"] = totals["bytes_read"].get<std::uintmax_t>() + part->file_bytes;
  geometry::TriangleMesh mesh = scene::merge_meshes(part->meshes);
  const SE3 T_column_local = column.T_column_tileset * place.placement().T_local_tileset.inverse();
  for (Vec3& vertex : mesh.vertices) vertex = T_column_local * vertex;
  return geometry::surface_heights_at(mesh, column.position.x(), column.position.y());
}

std::string format_surface(const json& surface) {
  const double local_z = surface["local_z"];
  if (surface["height"].is_null()) {
    return base::formatted("local z %.3f m", local_z);
  }
  const double height_m = surface["height"];
  if (surface["height_above_sea_level"].is_null()) {
    return base::formatted("%.3f m above the ellipsoid, local z %.3f m", height_m, local_z);
  }
  return base::formatted("%.3f m above the ellipsoid, %.3f m above sea level, local z %.3f m", height_m,
                         surface["height_above_sea_level"].get<double>(), local_z);
}

}  // namespace

std::string GroundQuery::text() const {
  return geodetic ? base::formatted("%.8g,%.9g", geodetic->latitude_deg, geodetic->longitude_deg)
                  : base::formatted("%.8g,%.8g", local->x(), local->y());
}

GroundQuery parse_geodetic_query(const std::string& text, const std::string& option) {
  const auto [lat, lon] = two_numbers(text, option, "LAT,LON in degrees");
  if (std::abs(lat) > 90 || std::abs(lon) > 360)
    throw InputError(option + " " + text,
                     "is not a valid position: latitude must be from -90 to 90 degrees, longitude from -180 to 180");
  return {.geodetic = Geodetic{lat, lon, {0.0}}, .local = std::nullopt};
}

GroundQuery parse_local_query(const std::string& text, const std::string& option) {
  const auto [x, y] = two_numbers(text, option, "X,Y in metres of the local frame");
  return {.geodetic = std::nullopt, .local = Vec2(x, y)};
}

json ground_heights(const GroundHeightsSettings& settings, const std::vector<GroundQuery>& points,
                    const Progress& progress) {
  tileset::LoadOptions load = settings.load;
  load.allow_large_area = true;
  PlaceReader place(settings.source, load, settings.use);
  const ColumnSampler columns(place);
  json result{{"points", json::array()}, {"tiles", 0}, {"bytes_read", 0}};
  std::vector<std::string> missing;
  for (const GroundQuery& point : points) {
    const Column column = columns.make_column(point);
    std::vector<std::string> missing_here;
    json found = columns.describe(point, column,
                                  sample_heights(place, column, load.allow_incomplete, result, missing_here, progress));
    found["tiles_missing"] = missing_here.size();
    result["points"].push_back(std::move(found));
    base::add_distinct(missing_here, missing);
  }
  result["frame"] = frame_json(place.placement().local_frame);
  result["attribution"] = place.attribution();
  std::vector<std::string> warnings = place.warnings();
  for (const std::string& failure : missing) warnings.push_back("missing or broken, left out: " + failure);
  result["warnings"] = std::move(warnings);
  return result;
}

std::string ground_heights_text(const json& found) {
  std::string text;
  for (const json& point : found["points"]) {
    text += point["asked"].get<std::string>() + ": ";
    const json& surfaces = point["surfaces"];
    if (surfaces.empty()) {
      text += point["tiles_missing"] > 0 ? "no surface in the tiles that could be read\n" : "no surface\n";
      continue;
    }
    text += format_surface(surfaces.front());
    if (surfaces.size() > 1) {
      text += "; lowest of " + std::to_string(surfaces.size()) + " surfaces: " + format_surface(surfaces.back());
    }
    if (point["tiles_missing"] > 0) text += "; there may be others: tiles are missing here";
    text += "\n";
  }
  for (const auto& warning : found["warnings"]) text += "note: " + warning.get<std::string>() + "\n";
  return text;
}

}  // namespace tileflight::place
