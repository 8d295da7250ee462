#include "tileflight/slam/odometry/preprocessor.h"

#include <cmath>

#include "tileflight/slam/keyframes/valid_region.h"

namespace tileflight::odometry {

Preprocessor::Preprocessor(const imaging::Calibration& calibration,
                           std::optional<imaging::PhotometricCalibration> photometric, imaging::GrayImage mask,
                           const keyframes::OdometryOptions& options, std::vector<OtherCamera> other_cameras)
    : calibration_(calibration),
      photometric_(std::move(photometric)),
      mask_(std::move(mask)),
      lens_(keyframes::build_lens_pyramid(
          calibration.camera,
          keyframes::pyramid_levels(calibration.camera.width(), calibration.camera.height(), options))),
      stereo_(std::move(other_cameras)) {}

void Preprocessor::find_valid_region(const imaging::RgbImage& image) {
  if (valid_region_found_) return;
  keyframes::mask_rays(lens_, keyframes::find_valid_region(image, mask_));
  valid_region_found_ = !keyframes::is_dark(image);
}

std::shared_ptr<const keyframes::Pyramid> Preprocessor::make_pyramid(const InputFrame& frame) {
  return pyramids_.make(frame.image, photometric_ ? &*photometric_ : nullptr, levels());
}

std::shared_ptr<const keyframes::Pyramid> Preprocessor::rectify(const keyframes::Pyramid& pyramid,
                                                                const keyframes::RowRectifier& rectifier) {
  return pyramids_.make([&](imaging::FloatImage memory) { return rectifier(pyramid.levels[0], std::move(memory)); },
                        levels());
}

keyframes::RowRectifier Preprocessor::make_rectifier(const geometry::Vec6& twist,
                                                     const tracking::ReferenceLevel& reference,
                                                     const geometry::SE3& T_target_reference) const {
  return {lens_.lenses[0], camera().width(), camera().height(), twist,
          keyframes::transform_depth_samples(lens_.lenses[0], T_target_reference, reference.ray, reference.rho,
                                             reference.size())};
}

bool Preprocessor::is_brightness_known(const InputFrame& frame) const { return photometric_ && frame.exposure_ms > 0; }

keyframes::AffineBrightness Preprocessor::brightness_prior(const InputFrame& frame) const {
  return {is_brightness_known(frame) ? std::log(frame.exposure_ms) : 0.0, 0.0};
}

std::vector<OtherView> Preprocessor::other_views(const InputFrame& frame, const keyframes::Pyramid& own,
                                                 const std::vector<Eigen::Vector2f>& corners) {
  const std::vector<keyframes::StereoPicture> pictures = stereo_pictures(frame);
  const std::vector<keyframes::StereoCamera> cameras = stereo_.stereo_cameras();
  std::vector<OtherView> views(cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const geometry::SE3& T = cameras[c].T_stereo_reference;
    views[c].centre = T.rotation.conjugate() * T.translation;
    if (c < pictures.size() && pictures[c].pyramid)
      views[c].rays = find_in_other_camera(lens_, own, cameras[c], pictures[c].pyramid->levels[0], corners);
  }
  return views;
}

}  // namespace tileflight::odometry
