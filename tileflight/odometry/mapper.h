#pragma once

// The back end: owns the window, follows immature points, makes keyframes, and keeps what leaves.

#include <memory>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/odometry/activation.h"
#include "tileflight/odometry/keyframe_policy.h"
#include "tileflight/odometry/map.h"
#include "tileflight/odometry/residual_pattern.h"
#include "tileflight/odometry/step_uncertainty.h"
#include "tileflight/odometry/window_optimizer.h"

namespace tileflight::odometry {

/// A picture that may become a keyframe.
struct KeyframeSource {
  std::int64_t frame_index = 0;
  double time_s = 0.0;
  std::shared_ptr<const Pyramid> pyramid;
  const imaging::RgbImage* image = nullptr;  ///< for colours; only read during the call
  SE3 T_camera_map;
  AffineLight light;
  AffineLight light_prior;
  Eigen::Vector2d light_information = Eigen::Vector2d::Zero();
};

/// A keyframe for the trajectory; the pose is final once it left the window.
struct KeyframeRecord {
  int id = 0;
  std::int64_t frame_index = 0;
  double time_s = 0.0;
  SE3 T_map_camera;
};

class Mapper {
 public:
  /// Where the lens is estimated, `lens` is moved with the estimate.
  Mapper(LensPyramid& lens, const OdometryOptions& options) : lens_(lens), options_(options) {}

  /// First keyframes, with poses and immature points that were followed already; activates and optimises them together.
  WindowResult begin(std::vector<Keyframe> keyframes);
  /// A keyframe with new immature points, outside the window yet.
  Keyframe make_keyframe(const KeyframeSource& source);

  /// Follows the immature points of the whole window into a picture that is no keyframe.
  void trace(const Pyramid& picture, const SE3& T_camera_map, const AffineLight& light);
  /// Adds a keyframe: section 3 of the paper in order.
  WindowResult add_keyframe(const KeyframeSource& source);

  const Window& window() const { return window_; }
  /// How focal lengths and principal point differ from the given ones; zero where they are not estimated.
  LensDelta lens_delta() const { return window_.lens.value(); }
  const Keyframe& newest() const { return window_.keyframes.back(); }
  /// The window's points as `slot` sees them.
  std::vector<ReferencePoint> points_seen_by(int slot) const;

  /// All keyframes so far with their last poses, in order of id.
  std::vector<KeyframeRecord> keyframes() const;
  /// All points so far: those that left and the window's.
  std::vector<MapPoint> points() const;
  std::size_t active_points() const;
  /// How well each keyframe so far (by id) was known relative to the one before when it came; zero for the first.
  const std::vector<StepUncertainty>& steps() const { return steps_; }
  /// What the good residuals of all keyframes so far have in common.
  const ResidualPattern& pattern() const { return pattern_; }

 private:
  void follow_lens();
  void retire();
  void observe_in_newest();
  void update_noise(const WindowResult& result);
  /// A point of the window for the map.
  MapPoint window_point(const ActivePoint& point, int host) const;
  /// What a keyframe that leaves has beside its active points.
  void keep_further_points(int host);

  LensPyramid& lens_;
  LensDelta followed_ = LensDelta::Zero();  ///< that lens_ has
  const OdometryOptions& options_;
  Window window_;
  ActivationSpacing spacing_;
  int selection_block_px_ = 0;  ///< of the last keyframe (pixel_selector.h)
  int next_id_ = 0;
  double residual_variance_ = 25.0;
  std::vector<StepUncertainty> steps_;
  ResidualPattern pattern_;
  std::vector<MapPoint> left_;
  std::vector<KeyframeRecord> archived_;
};

}  // namespace tileflight::odometry
