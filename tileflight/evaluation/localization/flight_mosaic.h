#pragma once

#include <functional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/evaluation/localization/ground_image.h"

namespace tileflight::localization {

/// Height field from scattered points: the median height per grid cell; a cell with too few points takes the median of
/// cells twice as large, and so on.
class HeightModel {
 public:
  /// Covers the rectangle from `low` to `high`; points outside are ignored. The cell size follows the density of the
  /// points.
  HeightModel(const std::vector<geometry::Vec3>& points, const geometry::Vec2& low, const geometry::Vec2& high);

  /// Height by bilinear interpolation; outside the rectangle, the value at its border.
  double at(const geometry::Vec2& position) const;
  /// Whether there are points within a few grid cells.
  bool is_supported(const geometry::Vec2& position) const;
  double cell() const { return cell_; }

 private:
  geometry::Vec2 low_;
  double cell_ = 1.0;
  imaging::FloatImage heights_;  ///< heights at the cell centres; rows along y
  imaging::GrayImage supported_;
};

/// Images and poses of a flight as estimated by odometry, in an arbitrary map frame and unit.
struct FlightPictures {
  imaging::Camera camera;
  std::vector<geometry::SE3> T_map_camera;  ///< of each image
  /// Image for an index of T_map_camera, of the camera's size; nullopt if it cannot be decoded.
  std::function<std::optional<imaging::RgbImage>(std::size_t index)> picture;
};

struct MosaicOptions {
  std::size_t max_pictures = 48;  ///< maximum number of images, spread evenly over the flight
  double max_pixels = 3e6;
  double max_incidence_rad =
      1.25;  ///< largest angle of a line of sight from the vertical; beyond it the ground is too foreshortened
};

/// Builds an orthographic mosaic of the ground from a flight's images. The images are projected onto a height model of
/// the map's points (map frame), each part from the unoccluded view with the best resolution. `R_ground_map` rotates
/// the map so that its z axis points up. The pixel size is what the better views resolve. Returns an empty image if no
/// image shows the surroundings of any point. Independent of the number of threads.
GroundImage build_flight_mosaic(const FlightPictures& flight, const std::vector<geometry::Vec3>& points,
                                const geometry::Mat3& R_ground_map, const MosaicOptions& options = {});

}  // namespace tileflight::localization
