#include "tileflight/tiles/tileset/region_file.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_content/json_reader.h"

namespace tileflight::tileset {
namespace {

using Eigen::AlignedBox2d;
using Eigen::Vector2d;
using geometry::Ring;
using nlohmann::json;

/// A hand-drawn area has a few thousand corners; larger files are rejected.
constexpr std::uintmax_t kLargestFileBytes = 64 << 20;
constexpr int kDeepestNesting = 16;

Vector2d position_of(const json& position) {
  if (!position.is_array() || position.size() < 2 || !position[0].is_number() || !position[1].is_number()) {
    throw std::runtime_error("a position is not longitude, latitude");
  }
  const Vector2d out(position[0].get<double>(), position[1].get<double>());
  if (!(std::abs(out.x()) <= 180.0 && std::abs(out.y()) <= 90.0)) {
    throw std::runtime_error("a position is not longitude, latitude in degrees");
  }
  return out;
}

/// Whether the longitudes of a ring go once around the earth.
bool surrounds_pole(const json& positions) {
  double turned_deg = 0.0;
  for (std::size_t i = 1; i < positions.size(); ++i) {
    turned_deg += std::remainder(position_of(positions[i]).x() - position_of(positions[i - 1]).x(), 360.0);
  }
  return std::abs(turned_deg) > 180.0;
}

/// RFC 7946, section 3.1.6: four positions or more, the last equal to the first.
Ring ring_of(const json& positions) {
  if (!positions.is_array() || positions.size() < 4) throw std::runtime_error("a ring has fewer than four positions");
  Ring ring;
  for (const json& position : positions) {
    ring.push_back(position_of(position));
    if (ring.size() > 1 && std::abs(ring.back().x() - ring[ring.size() - 2].x()) > 180) {
      const bool at_pole = std::any_of(positions.begin(), positions.end(),
                                       [](const json& p) { return std::abs(position_of(p).y()) > 89.9; });
      throw std::runtime_error(at_pole || surrounds_pole(positions)
                                   ? "a polygon surrounds a pole, where longitudes meet: give --center and --size"
                                   : "a polygon crosses the antimeridian: split it there (RFC 7946, section 3.1.9)");
    }
  }
  if (ring.front() != ring.back()) throw std::runtime_error("a ring is not closed: its last position is not its first");
  ring.pop_back();
  return ring;
}

void add_polygon(const json& rings, GeographicArea& area) {
  if (!rings.is_array()) throw std::runtime_error("coordinates are not nested lists of positions");
  for (const json& ring : rings) area.rings.push_back(ring_of(ring));
}

/// Adds the polygons of a geometry, with the heights of its Feature.
void add_geometry(const json& object, const GeographicArea& heights, int depth, std::vector<GeographicArea>& areas) {
  if (!object.is_object() || depth > kDeepestNesting) throw std::runtime_error("not a GeoJSON object");
  const std::string type = object.value("type", "");
  if (type == "Polygon") {
    areas.push_back(heights);
    add_polygon(object.at("coordinates"), areas.back());
  } else if (type == "MultiPolygon") {
    for (const json& polygon : object.at("coordinates")) {
      areas.push_back(heights);
      add_polygon(polygon, areas.back());
    }
  } else if (type == "GeometryCollection") {
    for (const json& member : object.at("geometries")) add_geometry(member, heights, depth + 1, areas);
  }
}

void add_object(const json& object, int depth, std::vector<GeographicArea>& areas) {
  if (!object.is_object() || depth > kDeepestNesting) throw std::runtime_error("not a GeoJSON object");
  const std::string type = object.value("type", "");
  if (type == "FeatureCollection") {
    for (const json& member : object.at("features")) add_object(member, depth + 1, areas);
    return;
  }
  if (type != "Feature") return add_geometry(object, {}, depth, areas);
  if (!object.contains("geometry") || object["geometry"].is_null()) return;
  GeographicArea heights;
  const json properties = object.value("properties", json::object());
  const auto height = [&](const char* name) -> std::optional<double> {
    const bool there = properties.is_object() && properties.contains(name) && !properties[name].is_null();
    return there ? std::optional(properties[name].get<double>()) : std::nullopt;
  };
  heights.min_height_m = height("min_height");
  heights.max_height_m = height("max_height");
  if (heights.min_height_m && heights.max_height_m && !(*heights.min_height_m < *heights.max_height_m)) {
    throw std::runtime_error("min_height is not below max_height");
  }
  add_geometry(object["geometry"], heights, depth + 1, areas);
}

AlignedBox2d extent_of(const std::vector<GeographicArea>& areas) {
  AlignedBox2d out;
  for (const GeographicArea& area : areas) {
    for (const Ring& ring : area.rings) {
      for (const Vector2d& position : ring) out.extend(position);
    }
  }
  return out;
}

/// Joins areas on both sides of the antimeridian by continuing western longitudes beyond 180 degrees.
void join_at_antimeridian(std::vector<GeographicArea>& areas) {
  if (!(extent_of(areas).sizes().x() > 180)) return;
  std::vector<GeographicArea> turned = areas;
  for (GeographicArea& area : turned) {
    const bool is_west = extent_of({area}).center().x() < 0;
    for (Ring& ring : area.rings) {
      for (Vector2d& position : ring) position.x() += is_west ? 360 : 0;
    }
  }
  if (extent_of(turned).sizes().x() <= 180) areas = std::move(turned);
}

/// The minimum and maximum height, if every area has both.
std::optional<std::pair<double, double>> heights_of(const std::vector<GeographicArea>& areas) {
  std::pair out{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const GeographicArea& area : areas) {
    if (!area.min_height_m || !area.max_height_m) return std::nullopt;
    out = {std::min(out.first, *area.min_height_m), std::max(out.second, *area.max_height_m)};
  }
  return out;
}

}  // namespace

std::vector<GeographicArea> read_geojson_areas(const std::filesystem::path& file) {
  std::vector<GeographicArea> areas;
  try {
    add_object(tile_content::parse_json(base::read_text(file, kLargestFileBytes), file.string()), 0, areas);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& fault) {
    throw InputError(file.string(), std::string("not usable GeoJSON: ") + fault.what());
  }
  if (extent_of(areas).isEmpty()) throw InputError(file.string(), "has no Polygon or MultiPolygon");
  return areas;
}

void set_region_from_geojson(const std::vector<std::filesystem::path>& files, LoadOptions& load) {
  for (const std::filesystem::path& file : files) {
    const std::vector<GeographicArea> areas = read_geojson_areas(file);
    load.areas.insert(load.areas.end(), areas.begin(), areas.end());
  }
  if (load.areas.empty()) return;
  join_at_antimeridian(load.areas);
  const AlignedBox2d extent = extent_of(load.areas);
  const auto heights = heights_of(load.areas);
  const Vector2d middle = extent.center();
  geometry::Geodetic center{middle.y(), middle.x(),
                            geometry::EllipsoidalHeight{heights ? (heights->first + heights->second) / 2 : 0.0}};
  // The widest east-west side of a box in longitude and latitude is the one nearest the equator, so all corners are
  // used.
  const geometry::LocalFrame local(center);
  AlignedBox2d box;
  for (const auto corner :
       {AlignedBox2d::BottomLeft, AlignedBox2d::BottomRight, AlignedBox2d::TopLeft, AlignedBox2d::TopRight}) {
    const Vector2d lon_lat = extent.corner(corner);
    box.extend(local.local_from_geodetic({lon_lat.y(), lon_lat.x(), center.height}).head<2>());
  }
  const Vector2d reach = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs());
  if (!heights) center.height.m = std::numeric_limits<double>::quiet_NaN();  // the tileset's own
  load.center = center;
  load.size = geometry::Vec3(2 * reach.x(), 2 * reach.y(), heights ? heights->second - heights->first : 0.0);
}

}  // namespace tileflight::tileset
