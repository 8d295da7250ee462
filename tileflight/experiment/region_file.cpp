#include "tileflight/experiment/region_file.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::experiment {
namespace {

using nlohmann::json;

/// An area drawn by hand has a few thousand corners; a larger file is not one.
constexpr std::uintmax_t kLargestFileBytes = 64 << 20;
constexpr int kDeepestNesting = 16;

/// Longitude and latitude, degrees, of everything that has an area; heights where properties name them.
struct Extent {
  Eigen::AlignedBox2d lon_lat;
  Eigen::AlignedBox<double, 1> height;
};

void extend_by_positions(const json& coordinates, int depth, Extent& extent) {
  if (!coordinates.is_array() || depth > kDeepestNesting)
    throw std::runtime_error("coordinates are not nested lists of positions");
  if (coordinates.empty()) return;
  if (!coordinates[0].is_number()) {
    for (const json& part : coordinates) extend_by_positions(part, depth + 1, extent);
    return;
  }
  if (coordinates.size() < 2) throw std::runtime_error("a position has fewer than two numbers");
  const Eigen::Vector2d position(coordinates[0].get<double>(), coordinates[1].get<double>());
  if (!(std::abs(position.x()) <= 180.0 && std::abs(position.y()) <= 90.0)) {
    throw std::runtime_error("a position is not longitude, latitude in degrees");
  }
  extent.lon_lat.extend(position);
}

void extend_by_object(const json& object, int depth, Extent& extent) {
  if (!object.is_object() || depth > kDeepestNesting) throw std::runtime_error("not a GeoJSON object");
  const std::string type = object.value("type", "");
  for (const char* list : {"features", "geometries"}) {
    if (!object.contains(list)) continue;
    for (const json& member : object[list]) extend_by_object(member, depth + 1, extent);
  }
  if (type == "Feature" && object.contains("geometry") && !object["geometry"].is_null()) {
    extend_by_object(object["geometry"], depth + 1, extent);
    const json properties = object.value("properties", json::object());
    for (const char* name : {"min_height", "max_height"}) {
      if (properties.is_object() && properties.contains(name)) {
        extent.height.extend(Eigen::Matrix<double, 1, 1>(properties[name].get<double>()));
      }
    }
  }
  if (type == "Polygon" || type == "MultiPolygon") extend_by_positions(object.at("coordinates"), 0, extent);
}

Extent read_extent(const std::filesystem::path& file) {
  Extent extent;
  try {
    extend_by_object(json::parse(geometry::read_text(file, kLargestFileBytes)), 0, extent);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& fault) {
    throw InputError(file.string(), std::string("not usable GeoJSON: ") + fault.what());
  }
  if (extent.lon_lat.isEmpty()) throw InputError(file.string(), "has no Polygon or MultiPolygon");
  return extent;
}

}  // namespace

void set_region_from_geojson(const std::filesystem::path& file, tiles::LoadOptions& load) {
  const Extent extent = read_extent(file);
  const bool has_height = !extent.height.isEmpty() && extent.height.sizes()[0] > 0;
  const Eigen::Vector2d middle = extent.lon_lat.center();
  geometry::Geodetic center{middle.y(), middle.x(),
                            geometry::EllipsoidalHeight{has_height ? extent.height.center()[0] : 0.0}};
  // The widest east-west side of a box in longitude and latitude is the one nearest the equator: take all corners.
  const geometry::LocalFrame local(center);
  Eigen::AlignedBox2d box;
  for (const auto corner : {Eigen::AlignedBox2d::BottomLeft, Eigen::AlignedBox2d::BottomRight,
                            Eigen::AlignedBox2d::TopLeft, Eigen::AlignedBox2d::TopRight}) {
    const Eigen::Vector2d lon_lat = extent.lon_lat.corner(corner);
    box.extend(local.local_from_geodetic({lon_lat.y(), lon_lat.x(), center.height}).head<2>());
  }
  const Eigen::Vector2d reach = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs());
  if (!has_height) center.height.m = std::numeric_limits<double>::quiet_NaN();  // the tileset's own
  load.center = center;
  load.size = geometry::Vec3(2 * reach.x(), 2 * reach.y(), has_height ? extent.height.sizes()[0] : 0.0);
}

}  // namespace tileflight::experiment
