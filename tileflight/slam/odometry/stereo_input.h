#pragma once

// The images of the rig's other cameras, prepared for static stereo and compared with the rig's calibration.

#include <optional>
#include <vector>

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::odometry {

/// Checks whether two cameras' images of one instant agree with how the rig's calibration places the cameras. Corners
/// are followed from one into the other, freely in the image, and their rays are compared with the epipolar planes.
/// Returns the rotation of the other camera that makes the rays of the matches meet best: b' = exp(w) b, sum of squared
/// distances (b' . n) of the rays from their epipolar planes (normals n = a x c, with the other camera's centre in
/// direction -c), robust (Cauchy). nullopt with fewer than 40 corners found in both pictures, or if no rotation fits
/// half of them. `own`: all levels; `other`: level 0.
std::optional<RigFit> check_rig(const keyframes::LensPyramid& lens, const keyframes::Pyramid& own,
                                const keyframes::StereoCamera& camera, const keyframes::PyramidLevel& other);

/// Follows corners of the reference camera's image into another camera's image of the same instant, freely in the
/// image. Returns their unit rays there, in the reference camera's axes by the calibration; nullopt: not found. `own`:
/// all levels; `other`: level 0.
std::vector<std::optional<geometry::Vec3>> find_in_other_camera(const keyframes::LensPyramid& lens,
                                                                const keyframes::Pyramid& own,
                                                                const keyframes::StereoCamera& camera,
                                                                const keyframes::PyramidLevel& other,
                                                                const std::vector<Eigen::Vector2f>& corners);

/// Returns whether an image shows nothing that could be matched: it is black, covered or without any texture. At most
/// one pixel in a thousand differs visibly from its neighbours.
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
