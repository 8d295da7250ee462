#pragma once

// Joint adjustment of a few pictures' poses and the corners' inverse distances by reprojection error (Huber), for the
// start.

#include <optional>
#include <vector>

#include "tileflight/odometry/lens.h"
#include "tileflight/odometry/two_view.h"

namespace tileflight::odometry {

/// A corner of the first picture and where later pictures show it.
struct CornerTrack {
  geometry::Vec3 ray;                                 ///< unit, first picture
  std::vector<std::optional<geometry::Vec2>> pixels;  ///< one for each later picture; nullopt: not seen
};

struct StartBundle {
  std::vector<geometry::SE3> T_camera_first;  ///< of each later picture
  std::vector<double> rho;                    ///< inverse distance of each track in the first picture
  double cost = 0.0;                          ///< mean of the Huber costs, square pixels
  double median_residual_px = 0.0;
  double behind_share = 0.0;  ///< tracks with a negative inverse distance
};

/// Pose of one later picture from tracks with known inverse distances, by robust Gauss-Newton from `start`.
geometry::SE3 resect(const Lens& lens, const std::vector<CornerTrack>& tracks, const std::vector<double>& rho,
                     std::size_t picture, const geometry::SE3& start);

/// From a relative pose of the last picture: triangulates, resects the pictures between, then Levenberg-Marquardt over
/// everything with the points eliminated. The result's scale: median inverse distance 1.
StartBundle adjust_start(const Lens& lens, const std::vector<CornerTrack>& tracks, std::size_t pictures,
                         const geometry::SE3& T_last_first, int iterations);

}  // namespace tileflight::odometry
