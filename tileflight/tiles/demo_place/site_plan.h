#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::demo_place {

using geometry::Vec2;
using geometry::Vec3;

/// Half the side of the square site. The site frame is in metres: origin at the centre of the field at its height, x
/// across the field, y along it, z up.
inline constexpr double kSiteHalf_m = 200.0;

/// Axis-aligned rectangle of the plan, metres.
struct Rect {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  Vec2 center() const { return {(x0 + x1) / 2, (y0 + y1) / 2}; }
  /// Returns the signed distance in metres, negative inside (outside, the larger of the two axes' distances; exact
  /// beside the edges).
  double distance(double x, double y) const { return std::max(std::max(x0 - x, x - x1), std::max(y0 - y, y - y1)); }
};

/// A yard. The football field (NCAA) has 100 yards between the goal lines and two end zones of 10, and is 160 feet
/// wide.
inline constexpr double kYard_m = 0.9144;
inline constexpr double kGoalLine_m = 50 * kYard_m;
inline constexpr double kEndLine_m = 60 * kYard_m;
inline constexpr double kSideline_m = 24.384;
inline constexpr Rect kTurfArea{-29, -63, 29, 63};
inline constexpr Rect kFieldArea{-32, -67, 32, 67};  ///< turf and the hard apron around it

/// A stand with rows that rise away from the field. Its long side is along y.
struct Grandstand {
  Rect footprint;
  double toward_field = 1.0;  ///< +1: the field lies at larger x (west stand); -1: at smaller x
  int rows = 0;
  double front_height_m = 1.5;

  static constexpr double kRowDepth_m = 0.85;
  static constexpr double kRowRise_m = 0.42;
  double top_m() const { return front_height_m + rows * kRowRise_m; }
};

enum class BuildingStyle { kBrickHall, kConcreteDeck, kGlassOffice, kConcession, kPressBox, kFieldHouse, kPlaster };

struct Building {
  Rect footprint;       ///< whole metres, so that terrain cells end at its walls
  double height_m = 0;  ///< height above its pad
  BuildingStyle style = BuildingStyle::kBrickHall;
};

struct Road {
  std::vector<Vec2> line;  ///< dense enough to look smooth
  double half_width_m = 3.5;
  bool street = true;  ///< with markings, kerbs and sidewalks; else a footpath
};

struct CarPark {
  Rect area;
  std::uint32_t seed = 0;
};

enum class TreeKind { kBroadleaf, kConifer, kBush };

struct Tree {
  Vec2 position;
  double height_m = 8;
  double radius_m = 3;
  TreeKind kind = TreeKind::kBroadleaf;
  std::uint32_t seed = 0;
};

/// The layout of the site. Generated once from a seed; terrain, paint and structures all follow it.
struct SitePlan {
  std::vector<Grandstand> stands;
  std::vector<Building> buildings;
  std::vector<Rect> plazas;  ///< paved with concrete
  std::vector<CarPark> car_parks;
  std::vector<Road> roads;
  std::vector<Vec2> lamps;  ///< street lamps
  std::vector<Vec2> masts;  ///< floodlights
  std::vector<Tree> trees;
  std::uint32_t seed = 0;

  /// Returns whether a stand or a building covers the point. There is no terrain there.
  bool is_built(double x, double y) const;
  /// Returns the distance to the nearest object that trees must keep away from (built or paved), metres.
  double clearance_m(double x, double y) const;
};

/// Makes the plan of a seed.
SitePlan make_site_plan(std::uint32_t seed);

/// The nearest point on a polyline: its distance, and its arc length along the line.
struct LineProjection {
  double distance_m = 0, along_m = 0;
};
/// Finds the point on a polyline that is nearest to `p`.
LineProjection project_onto_line(const std::vector<Vec2>& line, const Vec2& p);

/// The ground: a flat field in a bowl whose rims carry the stands, hills outside, level pads under buildings
/// and car parks, bumps of centimetres on grass. Heights are in metres above the field.
class Terrain {
 public:
  explicit Terrain(const SitePlan& plan);

  double height_m(double x, double y) const;
  /// Returns the unit normal, by finite differences over half a metre.
  Vec3 normal(double x, double y) const;
  Vec3 point(double x, double y) const { return {x, y, height_m(x, y)}; }

 private:
  struct Pad {
    Rect area;
    double height_m = 0.0;
    double margin_m = 6.0;
  };

  double natural_height_m(double x, double y) const;
  double unevenness_m(double x, double y) const;

  std::vector<Pad> pads_;
  std::uint32_t seed_;
};

}  // namespace tileflight::demo_place
