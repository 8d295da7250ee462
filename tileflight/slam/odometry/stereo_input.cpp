#include "tileflight/slam/odometry/stereo_input.h"

#include <cmath>
#include <cstdlib>
#include <utility>

#include "tileflight/core/base/input_error.h"

namespace tileflight::odometry {
namespace {

std::string camera_text(const OtherCamera& camera) {
  return camera.name.empty() ? "another camera of the rig" : "camera " + camera.name;
}

void require_stereo_camera(const OtherCamera& camera) {
  const imaging::Calibration& calibration = camera.calibration;
  if (calibration.camera.width() <= 0 || calibration.camera.height() <= 0)
    throw InputError(camera_text(camera), "its calibration has no image size; give the width and height of the images");
  if (calibration.line_delay_s != 0.0)
    throw InputError(camera_text(camera),
                     "has a rolling shutter (line_delay), which static stereo does not correct; use one camera alone");
  const geometry::Vec3& t = camera.T_other_reference.translation;
  if (!t.allFinite() || !camera.T_other_reference.rotation.coeffs().allFinite())
    throw InputError(camera_text(camera), "its pose on the rig is not finite");
  if (t.norm() < 1e-4)
    throw InputError(
        camera_text(camera),
        "is where the reference camera is (less than 0.1 mm away), so that it shows no distances; give the "
        "poses of the rig's cameras");
}

keyframes::StereoPicture make_picture(bool known, double log_exposure_ratio) {
  keyframes::StereoPicture picture;
  picture.brightness_prior.a = picture.brightness_linear.a = log_exposure_ratio;
  // As those of a keyframe's own brightness (tracking_state.cpp): nearly known, or free.
  picture.brightness_information = known ? Eigen::Vector2d(1e10, 1e6) : Eigen::Vector2d(1e3, 1.0);
  return picture;
}

}  // namespace

bool is_blind(const imaging::RgbImage& picture) {
  constexpr int kStride = 4, kVisible = 8;  // grey values, between neighbours; more than a camera's noise in the dark
  constexpr double kLeastShare = 1e-3;
  const auto grey = [&](int x, int y) {
    const imaging::Rgb8& p = picture(x, y);
    return (p[0] + 2 * p[1] + p[2]) / 4;
  };
  int seen = 0, visible = 0;
  for (int y = 2; y + 2 < picture.height; y += kStride) {
    for (int x = 2; x + 2 < picture.width; x += kStride, ++seen)
      visible +=
          std::abs(grey(x + 2, y) - grey(x - 2, y)) > kVisible || std::abs(grey(x, y + 2) - grey(x, y - 2)) > kVisible;
  }
  return visible <= kLeastShare * seen;
}

StereoInput::StereoInput(std::vector<OtherCamera> cameras) : cameras_(std::move(cameras)) {
  if (cameras_.size() > keyframes::kMaxStereoCameras)
    throw InputError("odometry", std::to_string(cameras_.size()) +
                                     " cameras are given besides the reference camera; at most " +
                                     std::to_string(keyframes::kMaxStereoCameras) + " can be used");
  for (const OtherCamera& camera : cameras_) require_stereo_camera(camera);
}

std::vector<keyframes::StereoCamera> StereoInput::stereo_cameras() const {
  std::vector<keyframes::StereoCamera> cameras;
  for (const OtherCamera& camera : cameras_)
    cameras.push_back({keyframes::Lens(camera.calibration.camera), camera.T_other_reference});
  return cameras;
}

void StereoInput::require_usable(const InputFrame& frame) const {
  const std::string where = "frame " + std::to_string(frame.index);
  if (frame.others.size() > cameras_.size())
    throw InputError(where, "has pictures of " + std::to_string(frame.others.size()) + " other cameras, the rig has " +
                                std::to_string(cameras_.size()));
  for (std::size_t c = 0; c < frame.others.size(); ++c) {
    const imaging::RgbImage& image = frame.others[c].image;
    const imaging::Camera& camera = cameras_[c].calibration.camera;
    if (image.empty() || (image.width == camera.width() && image.height == camera.height())) continue;
    throw InputError(where, camera_text(cameras_[c]) + ": its picture is " + std::to_string(image.width) + "x" +
                                std::to_string(image.height) + ", its calibration is for " +
                                std::to_string(camera.width()) + "x" + std::to_string(camera.height()));
  }
}

std::vector<keyframes::StereoPicture> StereoInput::pictures(const InputFrame& frame, bool has_photometric) {
  std::vector<keyframes::StereoPicture> pictures;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const bool taken = c < frame.others.size() && !frame.others[c].image.empty() && !is_blind(frame.others[c].image);
    const auto& photometric = cameras_[c].photometric;
    const bool known =
        taken && has_photometric && photometric && frame.exposure_ms > 0.0 && frame.others[c].exposure_ms > 0.0;
    pictures.push_back(make_picture(known, known ? std::log(frame.others[c].exposure_ms / frame.exposure_ms) : 0.0));
    if (taken)
      pictures.back().pyramid = pyramids_.make(frame.others[c].image, photometric ? &*photometric : nullptr, 1);
  }
  return pictures;
}

}  // namespace tileflight::odometry
