#pragma once

// The pose of an image far from the keyframe (photos of a survey), where no motion from one image to the next is small:
// features matched between both (features.h), with the keyframe's inverse distances, give a pose from which the direct
// alignment begins.

#include <optional>
#include <vector>

#include "tileflight/slam/keyframes/features.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/odometry/tracking_state.h"

namespace tileflight::odometry {

/// Returns the settings for images far apart: searches as long as their motion, and points that few images see.
keyframes::OdometryOptions options_for_images_far_apart(keyframes::OdometryOptions options);

/// Holds the pose of an image by matched features.
struct WidePose {
  geometry::SE3 T_target_reference;
  int matches = 0;         ///< that fit it
  double motion_px = 0.0;  ///< median of theirs
};

/// Searches one image in keyframes.
class WideSearch {
 public:
  WideSearch(const keyframes::LensPyramid& lens, const keyframes::Pyramid& target)
      : lens_(lens), features_(keyframes::find_features(target, lens, keyframes::kManyFeatures)) {}

  /// Returns whether the image has enough features to be found.
  bool shows_anything() const;
  /// Returns the pose against a keyframe with the image `picture` and the known inverse distances of `reference`;
  /// nullopt if too few matches fit one. Replaces what supports() asks.
  std::optional<WidePose> find(const keyframes::Pyramid& picture, const tracking::TrackingReference& reference);
  /// Returns whether the matches of the last pose fit another one to a few pixels.
  bool supports(const geometry::SE3& T_target_reference) const;
  /// Median motion of the features that match in the last keyframe searched, pixels; 0: hardly any match.
  double motion_px() const { return motion_px_; }

 private:
  struct Match {
    geometry::Vec3 ray;  ///< in the keyframe
    double rho = 0.0;    ///< along it
    geometry::Vec2 pixel_reference, pixel;
  };
  std::vector<double> errors_px(const geometry::SE3& T_target_reference) const;

  const keyframes::LensPyramid& lens_;
  std::vector<keyframes::Feature> features_;
  std::vector<Match> matches_;
  double motion_px_ = 0.0;
};

}  // namespace tileflight::odometry
