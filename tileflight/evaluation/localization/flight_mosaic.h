#pragma once

#include <functional>
#include <vector>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/evaluation/localization/ground_image.h"

namespace tileflight::localization {

/// Images and poses of a flight as estimated by odometry, in an arbitrary map frame and unit.
struct FlightPictures {
  imaging::Camera camera;
  std::vector<geometry::SE3> T_map_camera;                      ///< of each image
  std::function<imaging::RgbImage(std::size_t index)> picture;  ///< image for an index of T_map_camera; has the
                                                                ///< camera's size
};

struct MosaicOptions {
  std::size_t max_pictures = 48;  ///< maximum number of images, spread evenly over the flight
  double max_pixels = 3e6;
  double max_incidence_rad =
      1.25;  ///< largest angle of a line of sight from the vertical; beyond it the ground is too foreshortened
};

/// Orthographic mosaic of the ground from a flight's images: the images are projected onto a height model of the map's
/// points (map frame), each part from the unoccluded view with the best resolution. `R_ground_map` rotates the map so
/// that its z axis points up. The pixel size is what the better views resolve. Returns an empty image if no image shows
/// the surroundings of any point. Independent of the number of threads.
GroundImage build_flight_mosaic(const FlightPictures& flight, const std::vector<geometry::Vec3>& points,
                                const geometry::Mat3& R_ground_map, const MosaicOptions& options = {});

}  // namespace tileflight::localization
