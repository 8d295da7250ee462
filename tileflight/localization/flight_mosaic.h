#pragma once

#include <functional>
#include <vector>

#include "tileflight/imaging/camera.h"
#include "tileflight/localization/ground_image.h"

namespace tileflight::localization {

/// A flight as odometry knows it: in a map's frame and units, which may be any.
struct FlightPictures {
  imaging::Camera camera;
  std::vector<geometry::SE3> T_map_camera;                      ///< of each picture
  std::function<imaging::RgbImage(std::size_t index)> picture;  ///< of T_map_camera's indices; of the camera's size
};

struct MosaicOptions {
  std::size_t most_pictures = 48;  ///< evenly over the flight
  double most_pixels = 3e6;
  double most_incidence_rad =
      1.25;  ///< of a line of sight, from the vertical: beyond it the ground is too foreshortened
};

/// The ground as a flight saw it, from straight above: a height model by the map's points (map frame), on which the
/// pictures are projected, each part from where it is resolved best and not hidden. `R_ground_map` turns the map so
/// that its z points up. The pixel is what the better part of the views resolves. An empty image where no picture shows
/// any point's surroundings. Same bytes for any number of threads.
GroundImage flight_mosaic(const FlightPictures& flight, const std::vector<geometry::Vec3>& points,
                          const geometry::Mat3& R_ground_map, const MosaicOptions& options = {});

}  // namespace tileflight::localization
