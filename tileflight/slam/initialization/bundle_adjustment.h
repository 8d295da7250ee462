#pragma once

// Bundle adjustment for initialization: poses of a few images and inverse distances of the corners, by reprojection
// error (Huber).

#include <optional>
#include <vector>

#include "tileflight/slam/initialization/two_view.h"
#include "tileflight/slam/keyframes/lens.h"

namespace tileflight::initialization {

/// A corner of the first image and its pixels in later images.
struct CornerTrack {
  geometry::Vec3 ray;                                 ///< unit, in the first image's camera
  std::vector<std::optional<geometry::Vec2>> pixels;  ///< one for each later image; nullopt: not tracked
};

struct InitializationBundle {
  std::vector<geometry::SE3> T_camera_first;  ///< of each later image
  std::vector<double> rho;                    ///< inverse distance of each track from the first camera
  double cost = 0.0;                          ///< mean Huber cost, square pixels
  double median_residual_px = 0.0;
  double behind_share = 0.0;             ///< share of tracks with a negative inverse distance
  std::vector<double> log_focal_change;  ///< of each later image; empty: the focal length does not change
};

/// Pose T_camera_first of one later image from tracks with known inverse distances, by robust Gauss-Newton from
/// `start`.
geometry::SE3 resect(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                     const std::vector<double>& rho, std::size_t picture, const geometry::SE3& start);

/// Starts from the relative pose of the last image: triangulates, resects the images in between, then runs
/// Levenberg-Marquardt over all poses and points with the points eliminated (Schur complement). Scale of the result:
/// median inverse distance 1.
InitializationBundle bundle_adjust(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                                   std::size_t pictures, const geometry::SE3& T_last_first, int iterations);

/// Change of the focal length since the first image, of each later image, by the tracks alone.
struct FocalChangeFit {
  std::vector<double> log_change;  ///< natural logarithm of the focal length over that of the first image
  std::vector<double> sigma;       ///< its standard deviation, if the errors of all pixels are independent
  double median_residual_px = 0.0;
};

/// Refines `bundle` with one more unknown for each later image, its focal length. A zoom and a motion along the view
/// differ by the parallax only: where the tracks show none, sigma is large. nullopt if the equations are singular.
std::optional<FocalChangeFit> fit_focal_change(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                                               InitializationBundle bundle, int iterations);

}  // namespace tileflight::initialization
