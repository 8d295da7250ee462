#pragma once

// Prepares images for alignment: their pyramids, the area that shows the scene, and rectification to a global shutter.

#include <memory>
#include <optional>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/keyframes/rolling_shutter.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/rig_turn.h"
#include "tileflight/slam/odometry/stereo_input.h"
#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::odometry {

/// The camera as the photometric stages use it. Its lens changes during a flight: the valid region is found on the
/// first image that is not dark, and the Mapper refines the intrinsics.
class Preprocessor {
 public:
  /// `mask`: see OdometryInput::mask. Throws InputError for other cameras that cannot be used.
  Preprocessor(const imaging::Calibration& calibration, std::optional<imaging::PhotometricCalibration> photometric,
               imaging::GrayImage mask, const keyframes::OdometryOptions& options,
               std::vector<OtherCamera> other_cameras = {});

  const imaging::Camera& camera() const { return calibration_.camera; }
  keyframes::LensPyramid& lens() { return lens_; }
  const keyframes::LensPyramid& lens() const { return lens_; }
  /// Readout time of all rows, seconds; 0: global shutter, negative: played backwards.
  double readout_s() const { return calibration_.line_delay_s * calibration_.camera.height(); }

  /// Excludes pixels that do not show the scene from the lens's rays. Does nothing once the region is known. Throws
  /// InputError if the mask differs in size from the image.
  void find_valid_region(const imaging::RgbImage& image);

  std::shared_ptr<const keyframes::Pyramid> make_pyramid(const InputFrame& frame);
  /// The frame's pictures by the rig's other cameras, for a keyframe.
  std::vector<keyframes::StereoPicture> stereo_pictures(const InputFrame& frame) {
    return stereo_.pictures(frame, photometric_.has_value());
  }
  /// Returns where the rig's other cameras see corners of the reference camera's image, by camera.
  std::vector<OtherView> other_views(const InputFrame& frame, const keyframes::Pyramid& own,
                                     const std::vector<Eigen::Vector2f>& corners);
  const StereoInput& stereo() const { return stereo_; }
  /// Pyramid of the image rectified to a global shutter.
  std::shared_ptr<const keyframes::Pyramid> rectify(const keyframes::Pyramid& pyramid,
                                                    const keyframes::RowRectifier& rectifier);
  /// Rectifier of an image with the motion `twist` over its readout and the pose `T_target_reference`, with the
  /// inverse distances of `reference`.
  keyframes::RowRectifier make_rectifier(const geometry::Vec6& twist, const tracking::ReferenceLevel& reference,
                                         const geometry::SE3& T_target_reference) const;

  /// Returns whether photometric calibration and exposure time give the image's brightness.
  bool is_brightness_known(const InputFrame& frame) const;
  keyframes::AffineBrightness brightness_prior(const InputFrame& frame) const;

 private:
  int levels() const { return static_cast<int>(lens_.lenses.size()); }

  imaging::Calibration calibration_;
  std::optional<imaging::PhotometricCalibration> photometric_;
  imaging::GrayImage mask_;
  keyframes::LensPyramid lens_;
  keyframes::PyramidPool pyramids_;
  StereoInput stereo_;
  bool valid_region_found_ = false;  ///< on an image that is not dark
};

}  // namespace tileflight::odometry
