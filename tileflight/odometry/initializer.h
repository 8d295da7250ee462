#pragma once

// The start: corners are followed from a first picture until there is parallax; relative poses of both kinds (essential
// matrix, homography) are refined over all pictures of the window, and the joint residual chooses. While a second
// hypothesis fits nearly as well (the mirror solution of a plane), the window grows.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/odometry/klt.h"
#include "tileflight/odometry/options.h"
#include "tileflight/odometry/start_bundle.h"

namespace tileflight::odometry {

/// The pictures of a start with their poses. Pictures are counted from the first one ever given to the initializer.
struct Start {
  std::size_t first = 0;                      ///< the reference picture
  std::vector<geometry::SE3> T_camera_first;  ///< of first, first + 1, ...; scale: median inverse distance 1
  std::vector<double> parallax_rad;           ///< of each, to the first
  std::vector<Eigen::Vector2f> pixels;        ///< corners in the first picture
  std::vector<float> rho;                     ///< their inverse distances
  double median_residual_px = 0.0;
  double cost_ratio = 0.0;  ///< best hypothesis over the second; 0: there was one only
};

class Initializer {
 public:
  Initializer(const LensPyramid& lens, const StartOptions& options) : lens_(lens), options_(options) {}

  /// The next picture; a start once there is one. Where the poses of the first and the last picture of the window are
  /// known, no other motion is tried.
  std::optional<Start> add(std::shared_ptr<const Pyramid> pyramid,
                           const std::optional<geometry::SE3>& T_world_camera = {});

  /// Pictures before this one are of no more use.
  std::size_t first() const { return first_; }
  double parallax_rad() const { return parallax_.empty() ? 0.0 : parallax_.back(); }
  double widest_parallax_rad() const { return widest_parallax_; }
  /// Why there is no start yet.
  std::string reason() const;

 private:
  struct Corner {
    Eigen::Vector2f first;
    geometry::Vec3 ray;
    std::vector<std::optional<Eigen::Vector2f>> pixels;  ///< in first + 1, first + 2, ...
  };

  void restart(std::shared_ptr<const Pyramid> pyramid);
  std::vector<geometry::SE3> motions(std::size_t picture) const;
  int follow(const Pyramid& pyramid);
  std::vector<RayPair> pairs_to(std::size_t picture) const;
  std::vector<std::size_t> bundle_pictures() const;
  std::vector<CornerTrack> tracks_in(const std::vector<std::size_t>& pictures,
                                     std::vector<std::size_t>& corner_of_track) const;
  std::optional<Start> try_start();
  Start complete(const StartBundle& bundle, const std::vector<std::size_t>& pictures,
                 const std::vector<std::size_t>& corner_of_track) const;

  const LensPyramid& lens_;
  StartOptions options_;
  std::shared_ptr<const Pyramid> previous_;
  std::vector<Corner> corners_;
  std::vector<double> parallax_;  ///< of first, first + 1, ...
  std::optional<geometry::SE3> T_world_first_, T_world_last_;
  std::size_t count_ = 0;  ///< pictures given
  std::size_t first_ = 0;
  double last_try_parallax_ = 0.0;
  double widest_parallax_ = 0.0;
  double last_fit_px_ = 0.0;
};

}  // namespace tileflight::odometry
