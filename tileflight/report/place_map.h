#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/imaging/image.h"
#include "tileflight/report/top_view.h"

namespace tileflight::report {

/// The ground from straight above, pixel by pixel, north up.
struct GroundPicture {
  GroundExtent extent;
  imaging::RgbImage colors;
  imaging::FloatImage heights_m;  ///< of the local frame; NaN where there is no surface
};

/// A polygon of the map.
struct MapOutline {
  enum class Kind { kProposedRegion, kMissingTile };
  Kind kind = Kind::kProposedRegion;
  std::vector<geometry::Vec2> corners;  ///< east, north
};

/// What one picture of a flight sees of the ground.
struct MapView {
  std::string name;                       ///< "first"
  geometry::Vec3 position;                ///< of the camera
  std::vector<geometry::Vec2> footprint;  ///< its outline, east, north; empty: it sees none
};

/// A flight over the map.
struct MapFlight {
  std::vector<geometry::Vec3> positions;  ///< of the camera at each frame
  std::vector<geometry::Vec2>
      headings;                       ///< where it looks, east and north, of at most unit length; zero: straight down
  std::vector<std::size_t> troubled;  ///< frames that are inside or go through a surface
  std::vector<MapView> views;
};

/// A map of a place: its picture beside its heights, each with a grid in metres of the local frame, and where the place
/// is on the earth, one in degrees. Where there is no surface the paper is hatched.
struct PlaceMap {
  std::string title;
  std::vector<std::string> notes;  ///< lines below the title
  std::string attribution;
  GroundPicture ground;
  std::optional<geometry::LocalFrame> frame;
  std::vector<MapOutline> outlines;
  std::optional<MapFlight> flight;
};

imaging::RgbImage drawn(const PlaceMap& map);

/// The map's colour of a height, as a share of the range that is shown, 0 to 1.
imaging::Rgb8 height_color(double share);

/// Share of the light from the north-west that each pixel's slope gives back, flat ground 1; NaN where there is none.
imaging::FloatImage hill_shade(const imaging::FloatImage& heights_m, double pixel_m);

/// Where the parallels and meridians of round degrees cross the side of an extent: the way along it in metres (east of
/// its west end, or north of its south end) and the degrees. `meridians`: along the north side; else parallels along
/// the east side.
struct DegreeTick {
  double along_m = 0.0;
  double degrees = 0.0;
  double step = 1.0;  ///< between neighbours, degrees
};
std::vector<DegreeTick> degree_ticks(const GroundExtent& extent, const geometry::LocalFrame& frame, bool meridians,
                                     int wanted);

}  // namespace tileflight::report
