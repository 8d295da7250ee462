#pragma once

// The back end: owns the sliding window, traces immature points, makes keyframes, and archives points and keyframes
// that leave the window.

#include <memory>
#include <vector>

#include "tileflight/core/imaging/image.h"
#include "tileflight/slam/mapping/activation.h"
#include "tileflight/slam/mapping/inertial_window.h"
#include "tileflight/slam/mapping/keyframe_policy.h"
#include "tileflight/slam/mapping/map.h"
#include "tileflight/slam/mapping/marginalization.h"
#include "tileflight/slam/mapping/step_uncertainty.h"
#include "tileflight/slam/mapping/systematic_residuals.h"
#include "tileflight/slam/mapping/window_optimizer.h"

namespace tileflight::mapping {

/// A tracked image to be made a keyframe.
struct KeyframeCandidate {
  std::int64_t frame_index = 0;
  double time_s = 0.0;
  std::shared_ptr<const keyframes::Pyramid> pyramid;
  const imaging::RgbImage* image = nullptr;  ///< for point colours; only read during the call
  geometry::SE3 T_camera_map;
  keyframes::AffineBrightness brightness;
  keyframes::AffineBrightness brightness_prior;
  Eigen::Vector2d brightness_information = Eigen::Vector2d::Zero();
  std::vector<keyframes::StereoPicture> stereo;  ///< by stereo camera, its brightness that of the prior; empty: none
  std::optional<inertial::Preintegration> readings = {};  ///< since the newest keyframe; without them a window that is
                                                          ///< coupled to an inertial unit is so no more
  std::vector<tracking::ReferencePoint> known = {};  ///< pixels with known inverse distances, by which those of the
                                                     ///< keyframe's points are bounded; empty: they may be anywhere
};

/// Counts how the keyframes' stereo pictures of one camera matched.
struct StereoRecord {
  int keyframes = 0;                     ///< with a picture
  int unmatched = 0;                     ///< of those: the picture shows something else, and was not used
  std::int64_t searched = 0, found = 0;  ///< points, as StereoMatches
};

/// A keyframe of the trajectory; its pose is final once it has left the window.
struct KeyframeRecord {
  int id = 0;
  std::int64_t frame_index = 0;
  double time_s = 0.0;
  geometry::SE3 T_map_camera;
};

class Mapper {
 public:
  /// `lens` must outlive the Mapper; it is updated when intrinsics are estimated, which excludes stereo cameras.
  Mapper(keyframes::LensPyramid& lens, const keyframes::OdometryOptions& options,
         std::vector<keyframes::StereoCamera> stereo_cameras = {});
  /// A copy that goes its own way, with its own lens: a copy of the other's. It is not coupled to an inertial unit.
  Mapper(const Mapper& other, keyframes::LensPyramid& lens);
  Mapper(const Mapper&) = delete;
  Mapper& operator=(const Mapper&) = delete;

  /// Adds the first keyframes, with poses and already traced immature points; activates points and optimises them
  /// jointly.
  WindowResult initialize(std::vector<keyframes::Keyframe> keyframes);
  /// Starts a map from one instant, metric by its stereo pictures: the first keyframe, with points that these have
  /// determined. Returns false, and leaves no trace, if they determine too few (start_from_stereo()).
  bool start(const KeyframeCandidate& source);
  /// Makes the map that of the reference camera alone. Call it before initialize().
  void use_no_stereo() { window_.stereo_cameras.clear(); }
  /// Makes the oldest keyframe the newest, so that keyframes may be added in the opposite order of time. Call it after
  /// initialize() or start(), before anything else.
  void reverse_order() { reverse_keyframes(window_); }
  /// Makes a keyframe with new immature points; it is not added to the window.
  keyframes::Keyframe make_keyframe(const KeyframeCandidate& source);

  /// Traces the immature points of the whole window in an image that is not a keyframe.
  void trace(const keyframes::Pyramid& picture, const geometry::SE3& T_camera_map,
             const keyframes::AffineBrightness& light);
  /// Adds a keyframe: the steps of DSO, section 3, in order.
  WindowResult add_keyframe(const KeyframeCandidate& source);

  /// Couples the window to an inertial unit from the newest keyframe on; what the readings before it said is `start`.
  void couple(const InertialStart& start, const InertialCalibration& calibration);
  void uncouple() { inertial_.reset(); }
  /// The unit in the window; null: not coupled.
  const InertialWindow* inertial() const { return inertial_ ? &*inertial_ : nullptr; }

  const keyframes::Window& window() const { return window_; }
  /// Change of focal lengths and principal point from the given ones; zero if they are not estimated.
  keyframes::IntrinsicsDelta intrinsics_delta() const { return window_.intrinsics.value(); }
  /// Information of the given intrinsics, as the window has it.
  Eigen::Matrix4d given_intrinsics_information() const;
  /// Active points of the window projected into keyframe `slot`.
  std::vector<tracking::ReferencePoint> reference_points(int slot) const;

  /// All keyframes so far with their latest poses, in order of id.
  std::vector<KeyframeRecord> keyframes() const;
  /// All points so far: those that left the window and those in it.
  std::vector<MapPoint> points() const;
  std::size_t active_points() const;
  /// Returns the step of each keyframe so far (by id) from the previous one, with its uncertainty at the time it was
  /// added; zero for the first.
  const std::vector<StepUncertainty>& step_uncertainties() const { return step_uncertainties_; }
  /// Returns the matches in each stereo camera's pictures, over all keyframes so far.
  const std::vector<StereoRecord>& stereo_records() const { return stereo_records_; }
  /// Returns the systematic part of the good residuals of all keyframes so far.
  const SystematicResiduals& systematic_residuals() const { return systematic_residuals_; }

 private:
  void trace_stereo_pictures(const KeyframeCandidate& source, keyframes::Keyframe& keyframe);
  void update_lens();
  void retire_keyframes();
  void observe_in_newest();
  void update_noise(const WindowResult& result);
  void take_readings(const KeyframeCandidate& source);
  void relinearize_newest();
  void add_step(int slot);
  void update_steps();
  /// Map point of an active point.
  MapPoint window_point(const keyframes::ActivePoint& point, int host) const;
  /// Archives the candidates of a leaving keyframe that were never activated.
  void archive_dense_points(int host);

  keyframes::LensPyramid& lens_;
  keyframes::IntrinsicsDelta applied_delta_ = keyframes::IntrinsicsDelta::Zero();  ///< the change currently applied
                                                                                   ///< to lens_
  const keyframes::OdometryOptions& options_;
  keyframes::Window window_;
  std::optional<InertialWindow> inertial_;
  ActivationSpacing spacing_;
  int selection_block_px_ = 0;  ///< block size of the last keyframe (pixel_selector.h)
  int next_id_ = 0;
  double residual_variance_ = 25.0;
  std::vector<StepUncertainty> step_uncertainties_;
  SystematicResiduals systematic_residuals_;
  std::vector<MapPoint> retired_points_;
  std::vector<KeyframeRecord> retired_keyframes_;
  std::vector<StereoRecord> stereo_records_;
};

}  // namespace tileflight::mapping
