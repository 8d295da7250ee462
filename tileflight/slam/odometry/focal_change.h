#pragma once

// Finds changes of the focal length in flight: a zoom, or stabilization that crops and scales. Direct alignment takes a
// zoom for a motion along the view. Here corners are followed over segments of the flight, and a bundle adjustment of
// each segment is made twice, with one focal length and with one for each image (initialization/bundle_adjustment.h).
// The distances of the corners also show how a rig's other cameras are turned (rig_turn.h).

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/slam/initialization/bundle_adjustment.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/rig_turn.h"

namespace tileflight::odometry {

/// The segment as it is in the flight's own order, for images that were tracked from the last, `last`, to the first.
FocalSegment reversed(const FocalSegment& segment, std::int64_t last);

class FocalChangeRecord {
 public:
  /// Takes up an image with its pose. Returns whether a segment begins with it. `lens` and `rays`: of the full image.
  bool follow(std::int64_t frame, double time_s, const std::shared_ptr<const keyframes::Pyramid>& pyramid,
              const geometry::SE3& T_camera_map, const keyframes::Lens& lens, const keyframes::RayTable& rays);

  /// Returns the corners of the segment's first image.
  std::vector<Eigen::Vector2f> first_corners() const;
  /// Takes where the rig's other cameras see first_corners(); a view without rays: nowhere.
  void set_other_views(std::vector<OtherView> views) { views_ = std::move(views); }
  /// Returns the fits of all segments, the one under way among them, by other camera.
  std::vector<std::vector<RigTurnFit>> rig_turns() const;

  /// Returns the segments that have ended, in the order in which the images came.
  const std::vector<FocalSegment>& segments() const { return segments_; }

 private:
  struct Image {
    std::int64_t frame = 0;
    double time_s = 0.0;
    geometry::SE3 T_camera_map;
  };
  struct Corner {
    geometry::Vec3 ray;
    std::vector<std::optional<Eigen::Vector2f>> pixels;  ///< by image of the segment; nullopt from where it was lost
  };

  void begin(const Image& image, const std::shared_ptr<const keyframes::Pyramid>& pyramid, const keyframes::Lens& lens,
             const keyframes::RayTable& rays);
  std::vector<std::optional<Eigen::Vector2f>> find_corners_in(const keyframes::Pyramid& pyramid) const;
  void end();
  void fit_turns(const std::vector<std::size_t>& corners, const std::vector<double>& rho, double motion_m);

  keyframes::Lens lens_;  ///< when the segment began
  std::shared_ptr<const keyframes::Pyramid> previous_;
  std::vector<Image> images_;  ///< of the segment
  std::vector<Corner> corners_;
  std::vector<OtherView> views_;  ///< of the segment's first image, by other camera
  std::vector<FocalSegment> segments_;
  std::vector<std::vector<RigTurnFit>> rig_turns_;
};

}  // namespace tileflight::odometry
