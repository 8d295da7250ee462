#pragma once

// The pictures of the rig's other cameras, prepared for static stereo.

#include <vector>

#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::odometry {

/// Whether a picture shows nothing that could be matched: black, covered or without any texture. At most one pixel in a
/// thousand differs visibly from its neighbours.
bool is_blind(const imaging::RgbImage& picture);

class StereoInput {
 public:
  /// Throws InputError for more than keyframes::kMaxStereoCameras cameras, for one without an image size, for one
  /// whose place is that of the reference camera, and for a rolling shutter.
  explicit StereoInput(std::vector<OtherCamera> cameras);

  bool empty() const { return cameras_.empty(); }
  std::vector<keyframes::StereoCamera> stereo_cameras() const;
  const std::vector<OtherCamera>& cameras() const { return cameras_; }

  /// Throws InputError if the frame has more pictures than there are cameras, or one of another size than its
  /// calibration's.
  void require_usable(const InputFrame& frame) const;
  /// A keyframe's stereo pictures; without a pyramid where there is none or one that shows nothing.
  /// `has_photometric`: whether the reference camera has a photometric calibration.
  std::vector<keyframes::StereoPicture> pictures(const InputFrame& frame, bool has_photometric);

 private:
  std::vector<OtherCamera> cameras_;
  keyframes::PyramidPool pyramids_;
};

}  // namespace tileflight::odometry
