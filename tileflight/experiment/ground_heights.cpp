#include "tileflight/experiment/ground_heights.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include "tileflight/experiment/open_place.h"
#include "tileflight/geometry/column.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/scene/scene.h"

namespace tileflight::experiment {
namespace {

using geometry::Box3;
using geometry::Geodetic;
using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using nlohmann::json;

/// Tiles within this of the line are read: more than rounding of earth-centred coordinates and of bounding volumes.
constexpr double kAround_m = 0.01;
/// No surface is farther above or below.
constexpr double kTallest_m = 20e3;

std::pair<double, double> two_numbers(const std::string& text, const std::string& option, const char* form) {
  char* end = nullptr;
  const double first = std::strtod(text.c_str(), &end);
  const bool has_comma = end != text.c_str() && *end == ',';
  const char* rest = has_comma ? end + 1 : end;
  const double second = has_comma ? std::strtod(rest, &end) : 0.0;
  if (!has_comma || end == rest || *end != '\0' || !std::isfinite(first) || !std::isfinite(second))
    throw InputError(option + " " + text, std::string("give ") + form + ", two numbers with a comma between them");
  return {first, second};
}

/// The frame whose vertical the line is, about the point.
struct Column {
  SE3 T_column_tileset;
  Vec2 at = Vec2::Zero();  ///< in that frame
};

class Columns {
 public:
  explicit Columns(OpenPlace& place) : place_(place), frame_(place.placement().local_frame) {}

  Column column_of(const GroundQuery& query) const {
    const SE3& T_local_tileset = place_.placement().T_local_tileset;
    if (query.local) return {T_local_tileset, *query.local};
    if (!frame_) {
      throw InputError(place_.name(),
                       "is not georeferenced: ask by --at-local X,Y, or say where its frame's zero is with --origin "
                       "LAT,LON,HEIGHT");
    }
    // The line is the ellipsoid's normal there.
    const geometry::LocalFrame there({query.geodetic->latitude_deg, query.geodetic->longitude_deg, {0.0}});
    return {there.T_local_ecef() * frame_->T_ecef_local() * T_local_tileset, Vec2::Zero()};
  }

  json describe(const GroundQuery& query, const Column& column, const std::vector<double>& heights) const {
    json found{{"asked", query.text()}, {"lat", nullptr}, {"lon", nullptr}};
    json surfaces = json::array();
    for (const double height : heights) surfaces.push_back(surface(column, height));
    const Vec3 place = local_of(column, heights.empty() ? 0.0 : heights.front());
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
  Vec3 local_of(const Column& column, double height) const {
    const Vec3 in_column(column.at.x(), column.at.y(), height);
    return place_.placement().T_local_tileset * (column.T_column_tileset.inverse() * in_column);
  }

  json surface(const Column& column, double height) const {
    const Vec3 local = local_of(column, height);
    json out{{"local_z", local.z()}, {"height", nullptr}, {"height_above_sea_level", nullptr}};
    if (!frame_) return out;
    const Geodetic place = frame_->geodetic_from_local(local);
    out["height"] = place.height.m;
    try {
      out["height_above_sea_level"] = geometry::orthometric_from_ellipsoidal(place).m;
    } catch (const InputError&) {
      // Without the geoid's grid there is none to tell.
    }
    return out;
  }

  OpenPlace& place_;
  const std::optional<geometry::LocalFrame>& frame_;
};

/// Meshes of the finest tiles that the line goes through, in the column's frame.
std::vector<double> heights_in(OpenPlace& place, const Column& column, json& totals, const Progress& progress) {
  const Vec3 middle(column.at.x(), column.at.y(), 0.0);
  const tiles::Region region{middle, Vec3(2 * kAround_m, 2 * kAround_m, 2 * kTallest_m)};
  const tiles::TileCut cut = place.cut(tiles::wanted_region(region, column.T_column_tileset, 0.0));
  const auto part = place.read(cut, false, std::numeric_limits<std::uintmax_t>::max(), progress);
  if (!part->missing.empty())
    throw InputError(part->missing.front().failure, "it may hold the surface that is asked for");
  totals["tiles"] = totals["tiles"].get<std::int64_t>() + part->tiles;
  totals["bytes_read"] = totals["bytes_read"].get<std::uintmax_t>() + part->file_bytes;
  geometry::TriangleMesh mesh = scene::merged(part->meshes);
  const SE3 T_column_local = column.T_column_tileset * place.placement().T_local_tileset.inverse();
  for (Vec3& vertex : mesh.vertices) vertex = T_column_local * vertex;
  return geometry::heights_over(mesh, column.at.x(), column.at.y());
}

std::string with_heights(const json& surface) {
  char text[160];
  const double local_z = surface["local_z"];
  if (surface["height"].is_null()) {
    std::snprintf(text, sizeof text, "local z %.3f m", local_z);
  } else if (surface["height_above_sea_level"].is_null()) {
    std::snprintf(text, sizeof text, "%.3f m above the ellipsoid, local z %.3f m", surface["height"].get<double>(),
                  local_z);
  } else {
    std::snprintf(text, sizeof text, "%.3f m above the ellipsoid, %.3f m above sea level, local z %.3f m",
                  surface["height"].get<double>(), surface["height_above_sea_level"].get<double>(), local_z);
  }
  return text;
}

}  // namespace

std::string GroundQuery::text() const {
  char text[80];
  if (geodetic) {
    std::snprintf(text, sizeof text, "%.8g,%.9g", geodetic->latitude_deg, geodetic->longitude_deg);
  } else {
    std::snprintf(text, sizeof text, "%.8g,%.8g", local->x(), local->y());
  }
  return text;
}

GroundQuery geodetic_query(const std::string& text, const std::string& option) {
  const auto [lat, lon] = two_numbers(text, option, "LAT,LON in degrees");
  if (std::abs(lat) > 90 || std::abs(lon) > 360)
    throw InputError(option + " " + text,
                     "is no place: latitude is from -90 to 90 degrees, longitude from -180 to 180");
  return {.geodetic = Geodetic{lat, lon, {0.0}}, .local = std::nullopt};
}

GroundQuery local_query(const std::string& text, const std::string& option) {
  const auto [x, y] = two_numbers(text, option, "X,Y in metres of the local frame");
  return {.geodetic = std::nullopt, .local = Vec2(x, y)};
}

json ground_heights(const GroundHeightsSettings& settings, const std::vector<GroundQuery>& points,
                    const Progress& progress) {
  tiles::LoadOptions load = settings.load;
  load.whole_however_large = true;
  OpenPlace place(settings.source, load, tiles::Use::kExtract);
  const Columns columns(place);
  json result{{"points", json::array()}, {"tiles", 0}, {"bytes_read", 0}};
  for (const GroundQuery& point : points) {
    const Column column = columns.column_of(point);
    result["points"].push_back(columns.describe(point, column, heights_in(place, column, result, progress)));
  }
  const auto& frame = place.placement().local_frame;
  result["frame"] = {{"origin_lat", nullptr}, {"origin_lon", nullptr}, {"origin_height", nullptr}};
  if (frame) {
    result["frame"] = {{"origin_lat", frame->origin().latitude_deg},
                       {"origin_lon", frame->origin().longitude_deg},
                       {"origin_height", frame->origin().height.m}};
  }
  result["attribution"] = place.attribution();
  result["warnings"] = place.warnings();
  return result;
}

std::string ground_heights_text(const json& found) {
  std::string text;
  for (const json& point : found["points"]) {
    text += point["asked"].get<std::string>() + ": ";
    const json& surfaces = point["surfaces"];
    if (surfaces.empty()) {
      text += "no surface\n";
      continue;
    }
    text += with_heights(surfaces.front());
    if (surfaces.size() > 1) {
      text += "; lowest of " + std::to_string(surfaces.size()) + " surfaces: " + with_heights(surfaces.back());
    }
    text += "\n";
  }
  for (const auto& warning : found["warnings"]) text += "note: " + warning.get<std::string>() + "\n";
  return text;
}

}  // namespace tileflight::experiment
