#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/evaluation/localization/path_fusion.h"
#include "tileflight/evaluation/localization/picture_localizer.h"

namespace tileflight::localization {

/// Holds what the odometry knows of an image of a flight.
struct FlightImage {
  std::optional<geometry::SE3> T_map_camera;  ///< nullopt: the odometry lost it
  double sigma_position = 0.0;                ///< relative to the images before it, for each axis, units of the map
  double sigma_rotation_rad = 0.0;            ///< of the rotation, in the same way
};

/// Holds the images of a flight, in order of time.
struct FlightImages {
  std::vector<FlightImage> images;
  /// Reads an image; nullopt if it cannot be decoded. Called from several threads.
  std::function<std::optional<imaging::RgbImage>(std::size_t index)> read;
  bool has_scale = false;  ///< the map is in metres
};

struct FlightLocalizerOptions {
  std::size_t section = 24;    ///< images that are located one after the other; sections are located in parallel
  double view_motion = 0.06;   ///< an image that moved further from the last rendering, as a share of its width, gets
                               ///< a rendering of its own
  double shared_motion = 0.2;  ///< images closer than this see much of the same ground, and share errors
  double lost_sigma_m = 2.0;   ///< position sigma for each axis beyond which an image is lost
};

/// Tells how an image's pose was found.
enum class PoseSource {
  kPlace,     ///< located in the place
  kOdometry,  ///< carried by the odometry between located images
  kLost       ///< by neither, or too uncertain
};

/// Holds an image's pose in the place, and how well it was found.
struct LocatedImage {
  PoseSource source = PoseSource::kLost;
  FusedPose pose;
  double correlation = 0.0;  ///< of rendered and observed grey values; 0: not located
  double share_in_view = 0.0;
  std::vector<registration::PosePart> parts;  ///< LocalizationResult::parts
  bool contradicts = false;  ///< it was located where the other images and the odometry do not allow it
};

struct LocatedFlight {
  std::vector<LocatedImage> images;  ///< one for each of FlightImages::images
  double noise = 1.0;                ///< FusedPath::noise
  std::size_t renderings = 0;
};

/// Locates every image of a flight in the place, and fuses the poses with the odometry's motion. `T_local_map`: where
/// the flight is, as `align` found it; each image is searched near its pose by it, or near that of its neighbours.
/// Independent of the number of threads. Throws InputError if no image was located, or one has another size.
LocatedFlight locate_flight(const PictureLocalizer& localizer, const FlightImages& flight,
                            const geometry::Sim3& T_local_map, const FlightLocalizerOptions& options = {},
                            const Progress& progress = {});

}  // namespace tileflight::localization
